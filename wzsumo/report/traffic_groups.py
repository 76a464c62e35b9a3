"""Figures of a run's traffic in four groups, each beside a reference: the HCM, a rule of a highway agency, a typical value."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from wzsumo.capacity import QUEUE_DISCHARGE_DROP
from wzsumo.report.tables import DASH, metres, plain_number
from wzsumo.units import METRES_PER_MILE


@dataclass(frozen=True, kw_only=True)
class Limit:
    """The most that a rule of a highway agency allows, in the unit of its figure, and the rule in words."""

    most: float
    words: str


DELAY_LIMIT = Limit(most=720.0, words="at most 12 min (Massachusetts' rule)")  # FHWA, Work Zone Best Practices, A4-1
QUEUE_LIMIT = Limit(  # FHWA Work Zone Fact Sheet 8, Figure 1: shorter queues may stand for any time, some up to 1.5 miles
    most=0.75 * METRES_PER_MILE, words=f"at most {0.75 * METRES_PER_MILE:.0f} m (Ohio's rule: 0.75 mile)"
)
EPA_CO2_G_PER_KM = 400 / METRES_PER_MILE * 1000  # 400 g per mile: EPA-420-F-23-014, typical passenger vehicle
EPA_CO2_G_PER_GALLON = 8887.0  # ibid., petrol
PETROL_G_PER_GALLON = 3.785 * 745  # 0.745 kg/l, middle of EN 228
EURO_4_NOX_G_PER_KM = 0.08  # Directive 98/69/EC, petrol cars


@dataclass(frozen=True, kw_only=True)
class Row:
    """A figure of the traffic, in words."""

    name: str
    value: str
    reference: str = ""


@dataclass(frozen=True, kw_only=True)
class _Quantity:
    """A key of result.json["traffic"]: name, unit, decimals, what it is held against, and what its absence means."""

    key: str
    name: str
    unit: str = ""
    decimals: int = 0
    reference: str = ""
    absent: str = DASH


_GROUPS: dict[str, tuple[_Quantity, ...]] = {
    "Flow": (
        _Quantity(key="n_vehicles", name="Vehicles due to enter the road"),
        _Quantity(key="n_arrived", name="of them at the road's end"),
        _Quantity(key="n_waiting", name="of them still waiting to enter", reference="0: the road takes all that come"),
        _Quantity(
            key="throughput_vph", name="Flow past the activity area, after the warm-up", unit="veh/h", reference="{demand}",
        ),
        _Quantity(
            key="peak_flow_vph", name="Highest flow of 15 minutes before a queue stood", unit="veh/h", reference="{capacity}",
            absent="the run counts fewer than 15 min",
        ),
        _Quantity(
            key="queue_discharge_vph", name="Flow out of a queue that has stood for 8 minutes", unit="veh/h",
            reference="{discharge}", absent="no queue stood so long",
        ),
        _Quantity(key="n_merges", name="Vehicles that merged out of a closing lane"),
        _Quantity(key="locked_s", name="A vehicle stood for good from", unit="s", reference="never", absent="none did"),
        _Quantity(key="locked_station_m", name="where it stood", unit="m"),
    ),
    "Delay and queue": (
        _Quantity(
            key="mean_delay_s", name="Mean delay, the wait to enter included", unit="s", decimals=1,
            reference="at most 12 min in Massachusetts, 20 min in Oregon and Wyoming (FHWA, Work Zone Best Practices A4-1)",
        ),
        _Quantity(key="p95_delay_s", name="Delay that one vehicle in 20 exceeds", unit="s", decimals=1, reference="as above"),
        _Quantity(key="mean_departure_delay_s", name="Mean wait to enter", unit="s", decimals=1),
        _Quantity(key="mean_travel_time_s", name="Mean travel time from end to end of the road", unit="s", decimals=1),
        _Quantity(key="breakdown_s", name="A queue began to stand at", unit="s", absent="none did"),
        _Quantity(
            key="max_queue_length_m", name="Farthest that a queue reached back from the last merging taper", unit="m",
            reference="up to 1207 m (0.75 mile) for any time, never beyond 2414 m (1.5 miles) in Ohio (FHWA, Work Zone "
            "Fact Sheet 8)",
        ),
        _Quantity(key="mean_queue_length_m", name="Mean length of the queue over time, after the warm-up", unit="m"),
    ),
    "Safety": (
        _Quantity(key="n_overlapping", name="Vehicles whose outlines overlapped", reference="0"),
        _Quantity(
            key="n_ttc_conflicts", name="Vehicles with a time to collision below 1.5 s",
            reference="0; the threshold is FHWA SSAM's (Gettman et al. 2008)",
        ),
        _Quantity(
            key="n_drac_conflicts", name="Vehicles that would have needed more than 3.35 m/s² to avoid a crash",
            reference="0; above it a conflict is severe (Archer 2005)",
        ),
        _Quantity(
            key="n_pet_conflicts", name="Vehicles with a post-encroachment time below 1 s",
            reference="0 of those that cross or merge; close followers count, too",
        ),
        _Quantity(key="n_hard_braking", name="Vehicles that braked hard (2.67 m/s² over a second)"),
        _Quantity(
            key="hard_brakes_per_1000_vkm", name="Hard braking", unit="per 1000 veh km",
            reference="one crash came with 147 reported events in 23 work zones (Desai et al. 2021)",
        ),
        _Quantity(
            key="speed_sd_taper_mps", unit="m/s", decimals=1,
            name="Greatest standard deviation of speeds, 200 m ahead of the zone to its end",
            reference="2.2 m/s (5 mph) in free flow (Box and Oppenlander 1976, Manual of Traffic Engineering Studies)",
        ),
    ),
    "Emissions": (
        _Quantity(
            key="co2_g_per_vkm", name="Carbon dioxide", unit="g per veh km",
            reference=f"{EPA_CO2_G_PER_KM:.0f}, a typical US passenger vehicle (EPA-420-F-23-014)",
        ),
        _Quantity(
            key="nox_g_per_vkm", name="Nitrogen oxides", unit="g per veh km", decimals=3,
            reference=f"{EURO_4_NOX_G_PER_KM:g}, limit of Euro 4 for petrol cars, the class of SUMO's cars; trucks emit more",
        ),
        _Quantity(
            key="fuel_g_per_vkm", name="Fuel", unit="g per veh km",
            reference=f"{EPA_CO2_G_PER_KM / EPA_CO2_G_PER_GALLON * PETROL_G_PER_GALLON:.0f}, the same EPA vehicle on petrol",
        ),
    ),
}  # fmt: skip


def traffic_groups(
    traffic: Mapping[str, Any], *, fleet: Mapping[str, Any] | None = None, demand_vph: float | None = None
) -> dict[str, list[Row]]:
    """The rows of each group. `fleet`: figures of the vehicles' tracks. `demand_vph`: the flow that the scenario asks for."""
    references = _references(traffic, demand_vph)
    groups = {
        title: [_row(each, traffic[each.key], references) for each in group if _is_told(each, traffic)]
        for title, group in _GROUPS.items()
    }
    for title, row in _fleet_rows(fleet or {}):
        groups[title].append(row)
    return {title: rows for title, rows in groups.items() if rows}


def _is_told(quantity: _Quantity, traffic: Mapping[str, Any]) -> bool:
    """Whether a run has the figure; where a vehicle stood is told only if one did."""
    return quantity.key in traffic and not (quantity.key == "locked_station_m" and traffic[quantity.key] is None)


def _row(quantity: _Quantity, value: float | None, references: Mapping[str, str]) -> Row:
    told = quantity.absent if value is None else plain_number(value, quantity.unit, decimals=quantity.decimals)
    return Row(name=quantity.name, value=told, reference=quantity.reference.format(**references))


def _references(traffic: Mapping[str, Any], demand_vph: float | None) -> dict[str, str]:
    discharge = traffic.get("hcm_queue_discharge_vph")
    found = dict.fromkeys(("demand", "capacity", "discharge"), "")
    if demand_vph is not None:
        found["demand"] = f"{demand_vph:.0f} asked for in the scenario"
    if discharge is None:
        return found
    capacity = discharge / (1 - QUEUE_DISCHARGE_DROP)
    return found | {
        "capacity": f"{capacity:.0f}, capacity before breakdown (HCM 7, Eq. 10-9)",
        "discharge": f"{discharge:.0f}, queue discharge of this zone (HCM 7, Eq. 10-8)",
    }


def _fleet_rows(fleet: Mapping[str, Any]) -> list[tuple[str, Row]]:
    if not fleet:
        return []
    merge = fleet.get("merge_position_m") or {}
    shares = {"q10": "10 %", "q50": "half", "q90": "90 %"}
    told = [f"{shares.get(name, name)} by {_place(value)}" for name, value in merge.items() if value is not None]
    passed, closed = (str(fleet.get(key, DASH)) for key in ("n_passed", "n_in_closed_area"))
    scatter = metres(fleet.get("lateral_sd_m"), decimals=2)
    return [
        ("Flow", Row(name="Vehicles that passed the whole zone", value=passed)),
        ("Flow", Row(name="Vehicles had merged, from the start of the merging taper", value="; ".join(told) or DASH)),
        ("Safety", Row(name="Vehicles in the closed area", value=closed, reference="0")),
        ("Safety", Row(name="Lateral scatter between vehicles (standard deviation)", value=scatter)),
    ]


def _place(metres_on: float) -> str:
    return f"{abs(metres_on):.0f} m {'before' if metres_on < 0 else 'after'}"
