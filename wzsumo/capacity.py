"""Capacity of a freeway work zone by the work-zone model of the Highway Capacity Manual, 7th edition (HCM 7), Chapter 10.

The model is a regression on US freeway work zones (NCHRP Project 03-107). It counts passenger cars (pc):
`heavy_vehicle_factor` turns them into vehicles.
"""

from dataclasses import dataclass
from typing import Literal

from pydantic import Field

from wzsumo.errors import SpecError
from wzsumo.spec import Spec

QUEUE_DISCHARGE_DROP = 0.134  # from capacity before breakdown to queue discharge, mean of NCHRP 03-107; HCM 7, Eq. 10-9
MAX_LCSI = 2.0  # severer closures than 2-to-1 count as 2-to-1; HCM 7, text to Eq. 10-7
MAX_SPEED_RATIO = 1.2  # of the normal to the work zone's speed limit; HCM 7, text to Eq. 10-10
TRUCK_EQUIVALENT_PC = 2.0  # passenger cars per truck, E_T on level terrain; HCM 7, Chapter 12
FREEWAY_FFS_MPH = (55.0, 75.0)  # free-flow speeds of the manual's basic freeway segments; HCM 7, Chapter 12


class SiteSpec(Spec):
    """What the capacity model needs to know about the zone's site: area, light, barrier, speeds, ramps."""

    area: Literal["urban", "rural"] = "urban"  # f_AT of HCM 7, Eq. 10-8
    light: Literal["day", "night"] = "day"  # f_DN, ibid.
    barrier: Literal["soft", "hard"] | None = None  # soft: cones, drums; hard: concrete; None: as the zone's devices are
    lateral_distance_ft: float = Field(
        0.0, ge=0, le=12
    )  # from the lane line to the devices, which stand on the line here; range: HCM 7
    normal_speed_limit_mph: float | None = Field(None, gt=0)  # without the zone; None: as posted in the zone
    free_flow_speed_mph: float | None = Field(None, gt=0)  # without the zone; None: normal limit + 5 mph, HCM 7, Chapter 12
    total_ramp_density_per_mile: float = Field(0.0, ge=0, le=6)  # within 3 miles to either side; at most 6: HCM 7, Ch. 12


@dataclass(frozen=True, kw_only=True)
class ZoneCapacity:
    """Capacity and speed of a zone by the HCM. pc: passenger cars; per lane unless the name says all lanes."""

    total_lanes: int
    open_lanes: int
    lane_closure_severity_index: float
    queue_discharge_pcphpl: float  # flow while a queue waits upstream, 15-minute mean
    capacity_pcphpl: float  # flow before breakdown, 15-minute mean
    free_flow_speed_mph: float  # in the zone
    capacity_adjustment_factor: float  # share of the same freeway's capacity without a zone
    speed_adjustment_factor: float  # share of its free-flow speed without a zone
    heavy_vehicle_factor: float  # vehicles per passenger car
    queue_discharge_all_lanes_vph: float
    capacity_all_lanes_vph: float


def zone_capacity(
    *, total_lanes: int, open_lanes: int, posted_speed_mph: float, truck_share: float, site: SiteSpec
) -> ZoneCapacity:
    """Capacity of a zone on a freeway with `total_lanes` per direction. Raises SpecError where the model does not hold.

    Source: HCM 7, Eq. 10-7 to 10-12 (zone) and 12-6 (capacity without one).
    """
    discharge = zone_queue_discharge_pcphpl(total_lanes=total_lanes, open_lanes=open_lanes, site=site)
    ffs = _normal_free_flow_speed_mph(posted_speed_mph, site)
    normal_capacity = min(2200 + 10 * (ffs - 50), 2400.0)
    severity = lane_closure_severity_index(total_lanes=total_lanes, open_lanes=open_lanes)
    # Neither the zone's capacity nor its free-flow speed may exceed what the road has without it (ibid.).
    capacity = min(discharge / (1 - QUEUE_DISCHARGE_DROP), normal_capacity)
    zone_ffs = min(_zone_free_flow_speed_mph(posted_speed_mph, severity=severity, site=site), ffs)
    factor = 1 / (1 + truck_share * (TRUCK_EQUIVALENT_PC - 1))
    return ZoneCapacity(
        total_lanes=total_lanes,
        open_lanes=open_lanes,
        lane_closure_severity_index=severity,
        queue_discharge_pcphpl=discharge,
        capacity_pcphpl=capacity,
        free_flow_speed_mph=zone_ffs,
        capacity_adjustment_factor=capacity / normal_capacity,
        speed_adjustment_factor=zone_ffs / ffs,
        heavy_vehicle_factor=factor,
        queue_discharge_all_lanes_vph=discharge * factor * open_lanes,
        capacity_all_lanes_vph=capacity * factor * open_lanes,
    )


def zone_queue_discharge_pcphpl(*, total_lanes: int, open_lanes: int, site: SiteSpec) -> float:
    """Flow [pc/h/lane] out of a queue at a zone on a freeway with `total_lanes` per direction. Raises SpecError."""
    _check_lanes(total_lanes, open_lanes)
    severity = lane_closure_severity_index(total_lanes=total_lanes, open_lanes=open_lanes)
    return queue_discharge_rate(severity=severity, site=site)


def lane_closure_severity_index(*, total_lanes: int, open_lanes: int) -> float:
    """1 / (open ratio x open lanes), at most 2. Source: HCM 7, Eq. 10-7, Exhibit 10-15.

    >>> lane_closure_severity_index(total_lanes=3, open_lanes=2)
    0.75
    """
    return min(total_lanes / open_lanes**2, MAX_LCSI)


def queue_discharge_rate(*, severity: float, site: SiteSpec) -> float:
    """Flow [pc/h/lane] out of a queue at the zone, for a lane closure severity index. Source: HCM 7, Eq. 10-8."""
    return (
        2093
        - 154 * severity
        - 194 * (site.barrier != "hard")
        - 179 * (site.area == "rural")
        + 9 * site.lateral_distance_ft
        - 59 * (site.light == "night")
    )


def _zone_free_flow_speed_mph(posted_speed_mph: float, *, severity: float, site: SiteSpec) -> float:
    """Source: HCM 7, Eq. 10-10."""
    ratio = min((site.normal_speed_limit_mph or posted_speed_mph) / posted_speed_mph, MAX_SPEED_RATIO)
    return (
        9.95
        + 33.49 * ratio
        + 0.53 * posted_speed_mph
        - 5.60 * severity
        - 3.84 * (site.barrier != "hard")
        - 1.71 * (site.light == "night")
        - 8.7 * site.total_ramp_density_per_mile
    )


def _check_lanes(total_lanes: int, open_lanes: int) -> None:
    if total_lanes < 2:
        raise SpecError(
            f"road.lane_count={total_lanes}: the HCM's work-zone model is of freeways with 2 or more lanes a direction; "
            "one lane that two directions share is timed, not counted by it"
        )
    if not 1 <= open_lanes <= total_lanes:
        raise SpecError(f"{open_lanes} open lanes must be 1 to {total_lanes}, the lanes of the road")


def _normal_free_flow_speed_mph(posted_speed_mph: float, site: SiteSpec) -> float:
    normal = site.normal_speed_limit_mph or posted_speed_mph
    if normal < posted_speed_mph:
        raise SpecError(
            f"site.normal_speed_limit_mph={normal:g} must be at least posted_speed_mph={posted_speed_mph:g} "
            "in the zone; a zone does not raise the limit"
        )
    low, high = FREEWAY_FFS_MPH
    ffs = site.free_flow_speed_mph or min(normal + 5, high)
    if not low <= ffs <= high:
        raise SpecError(
            f"a free-flow speed of {ffs:g} mph without the zone (normal speed limit {normal:g} mph) is not a freeway's, "
            f"{low:g} to {high:g} mph, which alone the HCM's work-zone model covers; give site.normal_speed_limit_mph or "
            "site.free_flow_speed_mph if the road is one"
        )
    return ffs
