"""Drivers as parameters of SUMO's vehicle types, and the drivers that were fitted to the HCM's queue discharge.

A fit holds only for the step length and the lateral resolution that it was made with: a step of 0.1 s instead of 0.5 s changes
the queue discharge by 9 %, the sublane model by 37 % (SUMO 1.28). Fitted drivers therefore name both.
"""

from dataclasses import dataclass
from typing import Literal

from pydantic import Field

from wzsumo.capacity import TRUCK_EQUIVALENT_PC, SiteSpec, zone_queue_discharge_pcphpl
from wzsumo.spec import Spec


class DriverSpec(Spec):
    """Parameters of SUMO's Krauss and SL2015 models. What is not here keeps SUMO's default."""

    name: str = "own"
    tau_s: float = Field(1.0, gt=0, le=10)  # time gap that a driver keeps; SUMO's default
    accel_mps2: float = Field(2.6, gt=0, le=10)  # SUMO's default for passenger cars
    truck_tau_s: float = Field(1.0, gt=0, le=10)
    truck_accel_mps2: float = Field(1.0, gt=0, le=10)  # a loaded truck
    sigma: float = Field(0.5, ge=0, le=1)  # dawdling; SUMO's default
    lc_assertive: float = Field(1.0, gt=0, le=10)  # a driver accepts gaps smaller by this factor; SUMO's default
    # SUMO's default: drivers look twice as far ahead for changes to the left as to the right; 1: as far.
    lc_lookahead_left: float = Field(2.0, gt=0, le=10)
    calibrated_step_length_s: float | None = None  # None: not calibrated, goes with any step length
    calibrated_lateral_resolution_m: float | None = None


UNCALIBRATED = DriverSpec(name="uncalibrated")
# Stands for the drivers that `hcm_drivers` fits to the queue discharge of the scenario's zone.
BY_THE_HCM = DriverSpec(name="hcm", calibrated_step_length_s=0.1, calibrated_lateral_resolution_m=0.45)


@dataclass(frozen=True, kw_only=True)
class _HeadwayFit:
    """How the mean headway of a discharging queue is made up: the driver's own time gap, and `car_extra_s` on top of it.

    The extra [s] covers the vehicle's length and standing gap at the speed of the bottleneck, acceleration and dawdling. Low
    accelerations make the capacity drop: with them a queue discharges less, while the flow before breakdown stays the same.
    Fitted by hand; docs/results/traffic_calibration.md says on which runs, and how well it holds.
    """

    car_extra_s: float
    accel_mps2: float
    truck_accel_mps2: float = 0.7


_TWO_INTO_ONE = _HeadwayFit(car_extra_s=0.88, accel_mps2=0.9)
_MORE_INTO_ONE = _HeadwayFit(car_extra_s=1.03, accel_mps2=0.65)
_INTO_MORE = _HeadwayFit(car_extra_s=1.14, accel_mps2=0.5, truck_accel_mps2=0.5)
_TRUCK_EXTRA_S = 1.22  # as car_extra_s, for trucks; fitted in one class, 2-to-1 urban, ibid.


def hcm_drivers(discharge_pcphpl: float, *, total_lanes: int, open_lanes: int, name: str = BY_THE_HCM.name) -> DriverSpec:
    """Drivers with whom a queue discharges `discharge_pcphpl` [pc/h/lane] past a closure."""
    into_one = _TWO_INTO_ONE if total_lanes == 2 else _MORE_INTO_ONE
    fit = into_one if open_lanes == 1 else _INTO_MORE
    headway_s = 3600 / discharge_pcphpl
    fitted = {
        "name": name, "tau_s": round(headway_s - fit.car_extra_s, 3), "accel_mps2": fit.accel_mps2,
        "truck_tau_s": round(TRUCK_EQUIVALENT_PC * headway_s - _TRUCK_EXTRA_S, 3), "truck_accel_mps2": fit.truck_accel_mps2,
        "lc_assertive": 1.3, "lc_lookahead_left": 1.0,
    }  # fmt: skip
    return BY_THE_HCM.model_copy(update=fitted)


def _preset(total: int, open_lanes: int, area: Literal["urban", "rural"]) -> DriverSpec:
    """Drivers for a class of zones: so many of `total` lanes open, in an urban or rural area."""
    rate = zone_queue_discharge_pcphpl(total_lanes=total, open_lanes=open_lanes, site=SiteSpec(area=area))
    return hcm_drivers(rate, total_lanes=total, open_lanes=open_lanes, name=f"hcm_{total}_to_{open_lanes}_{area}")


_AREAS: tuple[Literal["urban", "rural"], ...] = ("urban", "rural")
_HCM_PRESETS = [_preset(total, open_, area) for total, open_ in ((2, 1), (3, 2), (3, 1)) for area in _AREAS]
DRIVER_PRESETS = {drivers.name: drivers for drivers in (UNCALIBRATED, BY_THE_HCM, *_HCM_PRESETS)}
