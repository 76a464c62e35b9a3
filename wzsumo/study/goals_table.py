"""The table of a report that holds every map against two goals: the ego's own lane and a lane that stays open."""

from collections.abc import Mapping
from typing import Any

GOALS = ("own_lane", "open_lane")


def goal_rows(methods: Mapping[str, Mapping[str, Any]]) -> list[dict[str, str]]:
    """One row a method that has figures of its goals: name, quality of its map, and of each goal what the path does."""
    rows = []
    for name, method in methods.items():
        goals = method.get("goals") or {}
        if not goals:
            continue
        row = {"name": name} | {key: _percent(method.get(key)) for key in ("precision", "recall", "iou")}
        for goal in GOALS:
            figures = goals.get(goal) or {}
            row |= {
                f"{goal}_outcome": str(figures.get("planned_outcome") or "-").replace("_", " ").lower(),
                f"{goal}_closed": _percent(figures.get("closed_area_share")),
                f"{goal}_struck": "-" if figures.get("n_devices_struck") is None else str(figures["n_devices_struck"]),
            }
        rows.append(row)
    return rows


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"
