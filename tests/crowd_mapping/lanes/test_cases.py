"""Small inputs with a right answer that is known from outside: each has misled a lane map.

`cases/` holds traces, the road before where it is known, and the drivable ground where it is not plain. Those named ngsim are
of real vehicles (NGSIM I-80, 2005, US DOT public data), the others are generated.
"""

import functools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import shapely

from wzsumo.crowd_mapping.cleaning.usable_fixes import UsableTraces
from wzsumo.crowd_mapping.cleaning.usable_traces import usable_traces
from wzsumo.crowd_mapping.lanes.lane_mapping import MappedLanes, map_lanes
from wzsumo.crowd_mapping.lanes.raster import occupancy_grid
from wzsumo.grid import blank_grid, cells_inside
from wzsumo.lane_map import LaneMap
from wzsumo.scenario.road_before import read_map_before
from wzsumo.tables import check_traces

CASES = Path(__file__).parent / "cases"
CELL_M = 0.5
FREE = 0.196  # default free_thresh of ROS map_server


@dataclass(frozen=True, kw_only=True, eq=False)
class Mapped:
    """What was used of a case, and the map."""

    usable: UsableTraces
    made: MappedLanes

    @property
    def lanes(self) -> LaneMap:
        return self.made.lanes

    @property
    def figures(self) -> dict[str, Any]:
        return self.made.figures

    @property
    def said(self) -> str:
        return " ".join(self.figures["warnings"])


@functools.cache
def mapped(name: str, *, joined: bool = False) -> Mapped:
    table = check_traces(pd.read_csv(CASES / name / "traces.csv"), source=name)
    usable = usable_traces(table, source=name)
    before = read_map_before(CASES / name / "road.toml") if joined else None
    return Mapped(usable=usable, made=map_lanes(usable.traces, before=before))


def precision_and_iou(name: str, *, joined: bool) -> tuple[float, float]:
    """Of free cells inside the scored area of a case's truth."""
    features = json.loads((CASES / name / "truth.geojson").read_text())["features"]
    area = {f["properties"]["name"]: shapely.from_geojson(json.dumps(f["geometry"])) for f in features}
    scored = area["scored"]
    grid = occupancy_grid(mapped(name, joined=joined).lanes, blank_grid(scored.bounds, resolution=CELL_M, p_occupied=1.0))
    inside, truth = cells_inside(grid, scored), cells_inside(grid, area["drivable"])
    free = (grid.p_occupied < FREE) & inside
    hit = (free & truth).sum()
    return float(hit / free.sum()), float(hit / ((free | truth) & inside).sum())


def p_open(case: Mapped, lane: int, *, first: float, last: float) -> np.ndarray:
    """Probability that the middle of a lane is open between two stations [m] of the road."""
    s = case.lanes.stations
    return case.lanes.lanes[lane].p_open_middle[(s >= first) & (s <= last)]


def middles_apart(case: Mapped) -> list[float]:
    """Distances [m] between the middles of neighbouring lanes."""
    return [float(np.median(b.middle - a.middle)) for a, b in zip(case.lanes.lanes, case.lanes.lanes[1:], strict=False)]


def assert_speaks_for_its_witnesses(case: Mapped) -> None:
    assert case.figures["fixes_on_free_share"] >= 0.95
    assert case.figures["fixes_on_occupied_share"] <= 0.01


# Lanes of NGSIM's section of I-80 are 12 ft wide; so are those of the generated roads.
ALONE = {"ngsim_i80_n100": 3, "ngsim_i80_two_lanes_n60": 2, "no_change_n100": 2, "one_half_change_n60": 2}


@pytest.mark.parametrize("name", ALONE)
def test_traces_alone_show_the_lanes_that_they_drive_in_however_many_they_are(name: str) -> None:
    case, n = mapped(name), ALONE[name]
    assert case.figures["open_lanes"] == len(case.lanes.lanes) == n
    assert middles_apart(case) == pytest.approx([3.66] * (n - 1), abs=0.35)
    assert_speaks_for_its_witnesses(case)
    length = float(np.ptp(case.lanes.stations))
    for lane in range(n):
        assert sum(b - a for a, b in case.lanes.open_intervals(lane)) > 0.95 * length


@pytest.mark.parametrize("joined", [False, True])
def test_jump_of_one_receiver_in_five_opens_no_closed_lane(joined: bool) -> None:
    """The taper takes 300 to 519 m of the drawing, the lane is closed to 1150 m; the jump is at 780 to 940 m."""
    precision, iou = precision_and_iou("one_jump_n5", joined=joined)
    assert precision >= 0.95
    assert iou >= (0.9 if joined else 0.75)


def test_zone_of_sixty_receivers_that_differ_has_one_open_lane() -> None:
    """Half err by 0.5 m, three tenths by 1.5 m, two tenths by 4 m, more than a lane."""
    precision, iou = precision_and_iou("mixed_receivers_n60", joined=True)
    assert precision >= 0.95
    assert iou >= 0.9
    case = mapped("mixed_receivers_n60", joined=True)
    assert case.figures["open_lanes"] == 1
    assert p_open(case, 0, first=100, last=1450).min() > 0.8


@pytest.mark.parametrize(("name", "users"), [("off_ramp", 2), ("on_ramp", 6)])
def test_ramp_is_a_branch_beside_two_open_lanes(name: str, users: int) -> None:
    case = mapped(name, joined=True)
    assert case.figures["open_lanes"] == 2
    assert len(case.lanes.branches) >= 1
    assert max(branch.n_traces for branch in case.lanes.branches) == users
    precision, iou = precision_and_iou(name, joined=True)
    assert precision >= 0.95
    assert iou >= 0.8


@pytest.mark.parametrize("name", ["off_ramp", "on_ramp"])
def test_traces_alone_beside_a_ramp_show_two_lanes_and_close_none(name: str) -> None:
    case = mapped(name)
    assert case.figures["open_lanes"] == 2
    assert precision_and_iou(name, joined=False)[0] >= 0.93


@pytest.mark.parametrize("joined", [False, True])
def test_zone_that_is_announced_and_not_there_closes_nothing(joined: bool) -> None:
    case = mapped("announced_but_open", joined=joined)
    assert case.figures["open_lanes"] == 2
    assert not any(case.lanes.closed_intervals(lane) for lane in (0, 1))
    precision, iou = precision_and_iou("announced_but_open", joined=joined)
    assert precision >= 0.95
    assert iou >= 0.85


def test_road_that_is_drawn_5_m_off_is_said_with_size_and_side() -> None:
    """The drawing's lanes are 5 m to the left of the traces, as its middle at y = 6.83 m is of theirs at 1.83 m."""
    case = mapped("road_5m_off", joined=True)
    assert case.figures["common_shift_m"] == pytest.approx(-5.0, abs=0.5)
    assert "5.0 m" in case.said or "4." in case.said or "5." in case.said
    assert "to the right of the road" in case.said
    # The map lies where the traces are.
    middle = case.lanes.to_xy(case.lanes.stations, case.lanes.lanes[0].middle)[:, 1]
    assert np.median(middle) == pytest.approx(0.0, abs=0.5)


def test_fixes_that_jump_sideways_for_a_second_are_left_out_and_named() -> None:
    case = mapped("sideways_jumps")
    assert case.figures["open_lanes"] == len(case.lanes.lanes) == 2
    left_out = case.usable.dropped
    assert left_out["n_fixes"].sum() >= 10
    assert left_out["n_fixes"].sum() <= 30
    assert_speaks_for_its_witnesses(case)


def test_slow_vehicles_at_10_hz_show_their_lanes() -> None:
    case = mapped("slow_10hz")
    assert case.figures["open_lanes"] == len(case.lanes.lanes) >= 1
    assert_speaks_for_its_witnesses(case)


def test_of_two_directions_one_is_mapped_and_the_vehicles_of_the_other_are_named() -> None:
    case = mapped("both_directions")
    assert len(case.usable.dropped) == 3
    assert case.usable.dropped["reason"].str.contains("against").all()
    assert case.lanes.n_traces == 3
    assert_speaks_for_its_witnesses(case)
