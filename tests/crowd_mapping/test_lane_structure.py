from typing import Any

import numpy as np
import pandas as pd
import pytest
from crowd_mapping.zone_traces import Zone, drive, noisy, zone_layout

from wzsumo.crowd_mapping.lane_structure import LaneStructuredMap, LaneStructureSpec, lane_structured_map
from wzsumo.grid import UNKNOWN, blank_grid, cells_inside

ZONES: dict[str, dict[str, Any]] = {
    "straight": {},
    "bend": {"bend": True},
    "two open lanes": {"lanes": 3, "closed": (2,)},
    "closed on the right": {"closed": (0,)},
    "no shift": {"shift_ft": 0.0},
}


def scored(zone: Zone, traces: pd.DataFrame) -> tuple[LaneStructuredMap, float, float]:
    """(map, precision, recall) on the zone's stretch, cells of 0.8 m."""
    road = zone.layout.road
    low_x, low_y, high_x, high_y = zone.drivable.bounds
    template = blank_grid((low_x - 5, low_y - 5, high_x + 5, high_y + 5), resolution=0.8, p_occupied=UNKNOWN)
    made = lane_structured_map(traces, spec=LaneStructureSpec(), grid=template)
    stretch = cells_inside(template, road.strip(zone.start - 80, zone.end, -12.0, road.left_edge + 8))
    truth, free = cells_inside(template, zone.drivable) & stretch, made.grid.free & stretch
    return made, float((truth & free).sum() / free.sum()), float((truth & free).sum() / truth.sum())


@pytest.mark.parametrize("name", ZONES)
def test_map_of_clean_traces_holds_most_of_the_drivable_area_and_little_else(name: str) -> None:
    layout = zone_layout(**ZONES[name])
    zone = drive(layout, 12, seed=3)
    made, precision, recall = scored(zone, zone.traces)
    assert made.model.levels.n_lanes == len(layout.road.lane_widths) - 1
    assert made.model.closed_side == ("right" if name == "closed on the right" else "left")
    assert precision > 0.95
    assert recall > 0.85


@pytest.mark.parametrize(("error_m", "n", "interval_s"), [(1.0, 40, 1.0), (2.0, 100, 3.0)])
def test_error_of_the_traces_is_estimated_and_does_not_blur_the_map(error_m: float, n: int, interval_s: float) -> None:
    zone = drive(zone_layout(), n, seed=5)
    made, precision, recall = scored(zone, noisy(zone, error_m, seed=5, interval_s=interval_s))
    # The bias holds 80 % of the variance and the drift most of the rest over a passage; drivers differ by 0.2 m besides.
    assert made.model.levels.spread == pytest.approx(np.hypot(error_m, 0.2), rel=0.25)
    assert precision > 0.93
    assert recall > 0.8


def test_report_names_what_was_left_out_and_why() -> None:
    zone = drive(zone_layout(), 6, seed=1)
    track = zone.traces[zone.traces["vehicle_id"] == "v0"]
    aside = track.assign(vehicle_id="aside", y_m=track["y_m"] + 50)
    parked = track.assign(vehicle_id="parked", x_m=track["x_m"].iloc[100], y_m=track["y_m"].iloc[100])
    contrary = track.assign(vehicle_id="contrary", x_m=track["x_m"].to_numpy()[::-1], y_m=track["y_m"].to_numpy()[::-1])
    single = track.iloc[[50]].assign(vehicle_id="single")
    made, precision, _ = scored(zone, pd.concat([zone.traces, aside, parked, contrary, single]))
    dropped = made.report["dropped"]
    assert isinstance(dropped, list)
    reasons = {row["vehicle_id"]: row["reason"] for row in dropped}
    assert set(reasons) == {"aside", "parked", "contrary", "single"}
    assert reasons["aside"] in {"lies 49 m beside the others", "lies 50 m beside the others", "lies 51 m beside the others"}
    assert "against the others" in reasons["contrary"]
    assert precision > 0.9


def test_same_traces_give_the_same_bytes() -> None:
    zone = drive(zone_layout(), 5, seed=3)
    first, second = (scored(zone, zone.traces)[0].grid.p_occupied.tobytes() for _ in range(2))
    assert first == second
