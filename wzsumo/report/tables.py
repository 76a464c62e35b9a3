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


def metres(length: float | None, *, decimals: int = 3) -> str:
    """A length, to the millimetre if not said otherwise, a dash where there is none.

    >>> metres(1.2968)
    '1.297 m'
    """
    return DASH if length is None or math.isnan(length) else f"{length:.{decimals}f} m"


def plain_number(value: float | None, unit: str, *, decimals: int = 0) -> str:
    """A figure with its unit, a dash where there is none.

    >>> plain_number(1370.77, "veh/h")
    '1371 veh/h'
    """
    return DASH if value is None else f"{value:.{decimals}f} {unit}".rstrip()


def network_rows(network: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str, str, str]]:
    """(quantity, with the zone, without it, change) of every figure of a network; none on a road of the scenario's own."""
    if not network:
        return []
    sides = [network[name] for name in ("with_zone", "without_zone", "change")]
    return [
        (name, *(plain_number(side.get(key), unit, decimals=decimals) for side in sides))  # type: ignore[misc]  # three sides
        for key, name, unit, decimals in _NETWORK_ROWS
    ]


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
            "behind": f"{conduct['braking_asked_behind_mps2']:.1f} m/s²",
            "jerk": f"{conduct['max_jerk_1s_mps3']:.1f} m/s³",
            "over_line": percent(conduct["over_line_share"], decimals=1),
            "off_middle": f"{conduct['mean_off_middle_m']:.2f} ± {conduct['sd_off_middle_m']:.2f} m",
            "changes": f"{conduct['n_lane_changes']} ({conduct['n_needed_changes']})",
            "time_gap": DASH if ahead is None else f"{ahead:.1f} s",
        })  # fmt: skip
    return rows


def goals_of(methods: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The goals that any method of a run has, in the order of GOALS."""
    return [goal for goal in GOALS if any(goal in (method.get("goals") or {}) for method in methods.values())]


def goal_rows(methods: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row per method with figures of its goals: its name, and for each goal of the run what the path to it does."""
    rows = []
    for name, method in methods.items():
        goals = method.get("goals") or {}
        if goals:
            rows.append({"name": name, "goals": [_goal_cells(goals.get(goal) or {}) for goal in goals_of(methods)]})
    return rows


def _goal_cells(figures: Mapping[str, Any]) -> dict[str, str]:
    struck = figures.get("n_devices_struck")
    return {
        "outcome": outcome_in_words(figures, "planned_outcome"),
        "closed": percent(figures.get("closed_area_share"), decimals=1),
        "struck": DASH if struck is None else str(struck),
    }


def method_row(name: str, method: Mapping[str, Any], *, driven_m: float | None) -> dict[str, str]:
    """The row of a method: quality of its map, the path planned on it, and the drive of `driven_m` [m], None: not driven."""
    plan_ms, driven = method.get("plan_ms"), method.get("driven") or {}
    closed = percent(driven.get("closed_area_share"), decimals=1)
    return quality_and_clearances(method, decimals=2) | {
        "name": name,
        "outcome": outcome_in_words(method),
        "reason": str(method.get("reason") or ""),
        "n_traces": DASH if method.get("n_traces") is None else str(method["n_traces"]),
        "n_fragments": DASH if method.get("n_fragments") is None else str(method["n_fragments"]),
        "plan_ms": DASH if plan_ms is None else f"{plan_ms:.0f} ms",
        "closed": closed if closed == DASH or driven_m is None else f"{closed} of {driven_m:.0f} m",
    }


def quality_and_clearances(method: Mapping[str, Any], *, decimals: int) -> dict[str, str]:
    """Precision, recall and IoU of a method's map, and clearances and closed share of its planned and its driven path."""
    row = {key: percent(method.get(key), decimals=decimals - 1) for key in ("precision", "recall", "iou")}
    for stage in ("planned", "driven"):
        figures = method.get(stage) or {}
        devices, edge = (metres(figures.get(f"min_clearance_{what}_m"), decimals=decimals) for what in ("devices", "road_edge"))
        row |= {
            f"{stage}_devices": devices,
            f"{stage}_edge": edge,
            f"{stage}_closed": percent(figures.get("closed_area_share")),
        }
    return row
