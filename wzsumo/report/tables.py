"""Rows of a report's tables from the figures of result.json, and figures as text."""

import math
from collections.abc import Mapping
from typing import Any

DASH = "-"
GOALS = ("own_lane", "open_lane")
# How a plan without a path ended, by its status.
_NO_PATH_IN_WORDS = {
    "LIMIT_REACHED": "planner gave up at its limit",
    "START_OCCUPIED": "start is not free",
    "GOAL_OCCUPIED": "goal is not free",
}
# Key of result.json["traffic"], name of the quantity, unit, decimals.
_ROWS = (
    ("n_vehicles", "Vehicles due to enter the road", "", 0),
    ("n_arrived", "Vehicles that arrived at its end", "", 0),
    ("n_waiting", "Vehicles still waiting to enter at the end of the run", "", 0),
    ("locked_s", "Traffic locked: a vehicle stood and never drove on from", "s", 0),
    ("locked_station_m", "Station where that vehicle stood", "m", 0),
    ("throughput_vph", "Throughput past the activity area, after the warm-up (up to a lock)", "veh/h", 0),
    ("peak_flow_vph", "Highest flow of 15 minutes past the activity area, before a queue stood", "veh/h", 0),
    ("hcm_queue_discharge_vph", "Queue discharge of the zone by the HCM, 7th edition", "veh/h", 0),
    ("queue_discharge_vph", "Queue discharge in this run, once a queue has stood for 8 minutes", "veh/h", 0),
    ("breakdown_s", "A queue began to stand at", "s", 0),
    ("max_queue_length_m", "Farthest that a queue reached back from the last merging taper", "m", 0),
    ("mean_queue_length_m", "Mean length of the queue over time, after the warm-up", "m", 0),
    ("mean_travel_time_s", "Mean travel time", "s", 1),
    ("mean_delay_s", "Mean delay, departure delay included", "s", 1),
    ("p95_delay_s", "95th percentile of the delay", "s", 1),
    ("mean_departure_delay_s", "Mean departure delay", "s", 1),
    ("speed_sd_taper_mps", "Greatest standard deviation of speeds, 200 m ahead of the zone to its end", "m/s", 1),
    ("n_merges", "Vehicles that merged out of a closing lane", "", 0),
    ("n_hard_braking", "Vehicles that braked hard (2.67 m/s2 over a second)", "", 0),
    ("hard_brakes_per_1000_vkm", "Hard braking", "per 1000 veh km", 0),
    ("n_overlapping", "Vehicles whose outlines overlapped", "", 0),
    ("n_ttc_conflicts", "Vehicles with a time to collision below 1.5 s", "", 0),
    ("n_drac_conflicts", "Vehicles that would have needed more than 3.35 m/s2 to avoid a crash", "", 0),
    ("n_pet_conflicts", "Vehicles with a post-encroachment time below 1 s", "", 0),
    ("co2_g_per_vkm", "Carbon dioxide (SUMO's default emission classes)", "g per veh km", 0),
    ("nox_g_per_vkm", "Nitrogen oxides (ibid.)", "g per veh km", 3),
    ("fuel_g_per_vkm", "Fuel (ibid.)", "g per veh km", 0),
)


# Key of result.json["network"][...], name of the quantity, unit, decimals.
_NETWORK_ROWS = (
    ("n_vehicles", "Vehicles due to depart", "", 0),
    ("n_arrived", "Vehicles that arrived", "", 0),
    ("n_waiting", "Vehicles still waiting to depart at the end", "", 0),
    ("delay_h", "Delay of all vehicles together, departure delay included", "veh h", 2),
    ("mean_delay_s", "Mean delay by vehicle, departure delay included", "s", 1),
    ("mean_departure_delay_s", "Mean departure delay", "s", 1),
    ("mean_travel_time_s", "Mean travel time of those that arrived", "s", 1),
    ("driven_vkm", "Distance driven", "veh km", 0),
    ("co2_kg", "Carbon dioxide (SUMO's default emission classes)", "kg", 0),
    ("nox_kg", "Nitrogen oxides (ibid.)", "kg", 3),
    ("corridor_delay_h", "Delay on the road of the zone", "veh h", 2),
    ("corridor_vkm", "Distance driven on the road of the zone", "veh km", 0),
    ("corridor_co2_kg", "Carbon dioxide on the road of the zone", "kg", 0),
)


def percent(share: float | None, *, decimals: int = 2) -> str:
    """A share in percent, a dash where there is none.

    >>> percent(0.9008)
    '90.08 %'
    """
    return DASH if share is None or math.isnan(share) else f"{100 * share:.{decimals}f} %"


def metres(length: float | None) -> str:
    """A length to the millimetre, a dash where there is none.

    >>> metres(1.2968)
    '1.297 m'
    """
    return DASH if length is None or math.isnan(length) else f"{length:.3f} m"


def traffic_rows(traffic: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(quantity, value with its unit) of every traffic figure of a run; a dash where nothing could be measured."""
    return [(name, _value(traffic[key], unit, decimals)) for key, name, unit, decimals in _ROWS if key in traffic]


def network_rows(network: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str, str, str]]:
    """(quantity, with the zone, without it, change) of every figure of a network; none on a road of the scenario's own."""
    if not network:
        return []
    sides = [network[name] for name in ("with_zone", "without_zone", "change")]
    return [
        (name, *(_value(side.get(key), unit, decimals) for side in sides))  # type: ignore[misc]  # three sides
        for key, name, unit, decimals in _NETWORK_ROWS
    ]


def _value(value: float | None, unit: str, decimals: int) -> str:
    return DASH if value is None else f"{value:.{decimals}f} {unit}".rstrip()


def outcome_code(figures: Mapping[str, Any], key: str = "outcome") -> str:
    """The outcome under `key`. Where no path was found it is the planner's status, if that says more.

    A planner that stopped at its limit, for example, has not shown that there is no path.
    """
    outcome, status = str(figures.get(key) or DASH), figures.get("plan_status")
    return str(status) if outcome == "NO_PATH" and status in _NO_PATH_IN_WORDS else outcome


def outcome_in_words(figures: Mapping[str, Any], key: str = "outcome") -> str:
    """The outcome of `outcome_code` in words."""
    code = outcome_code(figures, key)
    return _NO_PATH_IN_WORDS.get(code, code.replace("_", " ").lower())


def conduct_rows(methods: Mapping[str, Mapping[str, Any]]) -> list[dict[str, str]]:
    """One row per method that drove: its name, whether the drive was clean, else why not, and how it was driven."""
    rows = []
    for name, method in methods.items():
        conduct = method.get("conduct")
        if not conduct:
            continue
        ahead = conduct.get("min_time_gap_s")
        rows.append({
            "name": name,
            "verdict": "clean" if method.get("clean") else str(method.get("faults")),
            "stops": f"{conduct['n_unprompted_stops']} of {conduct['n_stops']}",
            "braking": f"{conduct['braking_unprompted_mps2']:.1f} m/s²",
            "behind": f"{conduct['braking_behind_mps2']:.1f} m/s²",
            "jerk": f"{conduct['max_jerk_1s_mps3']:.1f} m/s³",
            "over_line": percent(conduct["over_line_share"], decimals=1),
            "off_middle": f"{conduct['mean_off_middle_m']:.2f} ± {conduct['sd_off_middle_m']:.2f} m",
            "changes": f"{conduct['n_lane_changes']} ({conduct['n_needed_changes']})",
            "time_gap": DASH if ahead is None else f"{ahead:.1f} s",
        })  # fmt: skip
    return rows


def goal_rows(methods: Mapping[str, Mapping[str, Any]]) -> list[dict[str, str]]:
    """One row per method with figures of its goals: its name, the quality of its map, and what the path to each goal does."""
    rows = []
    for name, method in methods.items():
        goals = method.get("goals") or {}
        if not goals:
            continue
        row = {"name": name} | {key: percent(method.get(key), decimals=1) for key in ("precision", "recall", "iou")}
        for goal in GOALS:
            figures = goals.get(goal) or {}
            row |= {
                f"{goal}_outcome": outcome_in_words(figures, "planned_outcome"),
                f"{goal}_closed": percent(figures.get("closed_area_share"), decimals=1),
                f"{goal}_struck": DASH if figures.get("n_devices_struck") is None else str(figures["n_devices_struck"]),
            }
        rows.append(row)
    return rows
