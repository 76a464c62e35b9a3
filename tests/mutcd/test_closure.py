"""What a zone closes, counted from its open side. Three lanes of 12 ft, left shoulder 12 ft, right shoulder 10 ft."""

import numpy as np
import pytest
from builders import paper_road, paper_work_zone, two_lane_road

from wzsumo.errors import SpecError
from wzsumo.mutcd.closure import Closure, closure_of
from wzsumo.road import Profile, Road

UNSHIFTED = {"shift_ft": 0, "shifted_lane_width_ft": None}


def closure(road: Road | None = None, /, **changes: object) -> Closure:
    return closure_of(paper_work_zone(**{"closed_shoulder": None, **UNSHIFTED} | changes), road or paper_road())


def feet(*lengths_m: float) -> list[float]:
    return [round(length / 0.3048, 6) for length in lengths_m]


@pytest.mark.parametrize(
    ("changes", "side", "first", "count", "interior"),
    [
        ({"closed_lanes": (2,)}, "left", 2, 1, False),
        ({"closed_lanes": (0,)}, "right", 2, 1, False),
        ({"closed_lanes": (0, 1)}, "right", 1, 2, False),
        ({"closed_lanes": (2, 1)}, "left", 1, 2, False),
        ({"closed_lanes": (1, 2), "shift_ft": 1}, "left", 1, 2, False),
        ({"closed_lanes": (0, 1), "shift_ft": 1}, "right", 1, 2, False),
        ({"closed_lanes": (1,)}, "left", 1, 1, True),
        ({"closed_lanes": (1,), "closed_shoulder": "right"}, "right", 1, 1, True),
        ({"closed_lanes": (), "closed_shoulder": "left"}, "left", 3, 0, False),
        ({"closed_lanes": (), "closed_shoulder": "right"}, "right", 3, 0, False),
    ],
)
def test_closed_lanes_are_numbered_from_the_open_side(
    changes: dict[str, object], side: str, first: int, count: int, interior: bool
) -> None:
    found = closure(**changes)
    assert (found.side, found.first, found.count, found.is_interior) == (side, first, count, interior)
    assert (found.n_lanes, found.n_open) == (3, 3 - count)


def test_lane_of_the_road_is_counted_from_the_right() -> None:
    left, right = closure(closed_lanes=(2,)), closure(closed_lanes=(0,))
    assert [left.road_lane(number) for number in range(3)] == [0, 1, 2]
    assert [right.road_lane(number) for number in range(3)] == [2, 1, 0]


def test_lines_are_counted_from_the_open_side_and_the_outer_one_is_the_edge_of_the_shoulder() -> None:
    left, right = closure(closed_lanes=(2,)), closure(closed_lanes=(0,))
    assert feet(*left.lines) == feet(*right.lines) == [0, 12, 24, 36]
    assert feet(left.travelled, left.outer, left.open_shoulder) == [36, 48, 10]
    assert feet(right.travelled, right.outer, right.open_shoulder) == [36, 46, 12]


def test_lines_of_lanes_of_unequal_width_follow_the_side() -> None:
    points = np.array([[0.0, 0.0], [100.0, 0.0]])
    road = Road(reference_line=points, lane_widths=(3.0, 3.5, 4.0), left_shoulder=1.0, right_shoulder=2.0)
    assert Closure(road=road, side="left", first=2, count=1).lines == (0.0, 3.0, 6.5, 10.5)
    assert Closure(road=road, side="right", first=2, count=1).lines == (0.0, 4.0, 7.5, 10.5)


@pytest.mark.parametrize("opposing", [1, 2])
def test_closed_side_ends_at_the_line_to_opposing_lanes(opposing: int) -> None:
    road = paper_road(lane_count=2, opposing_lane_count=opposing)
    beside_opposing = closure(road, closed_lanes=(1,))
    assert beside_opposing.n_lanes == 2
    assert feet(*beside_opposing.lines) == [0, 12, 24]
    assert feet(beside_opposing.outer) == [24]
    assert feet(closure(road, closed_lanes=(0,)).open_shoulder) == [0]


def test_both_lanes_of_a_two_lane_road_belong_to_a_closure_by_turns() -> None:
    found = closure(two_lane_road(), posted_speed_mph=45, closed_lanes=(0,), one_lane_two_way="signal")
    assert (found.side, found.first, found.count, found.n_lanes, found.takes_turns) == ("right", 1, 1, 2, True)
    assert feet(*found.lines, found.outer, found.open_shoulder) == [0, 12, 24, 30, 6]


def test_offsets_from_the_open_side_become_offsets_of_the_road() -> None:
    left, right = closure(closed_lanes=(2,)), closure(closed_lanes=(0,))
    e = np.array([0.0, 12.0, 36.0]) * 0.3048
    assert feet(*left.d_of(e)) == [0, 12, 36]
    assert feet(*right.d_of(e)) == [36, 24, 0]


def test_line_near_the_open_side_is_the_right_one_of_a_closure_on_the_left() -> None:
    near, far = (Profile(stations=np.array([0.0]), offsets=np.array([e * 0.3048])) for e in (10.0, 20.0))
    for found, expected in ((closure(closed_lanes=(2,)), [10, 20]), (closure(closed_lanes=(0,)), [16, 26])):
        assert feet(*(float(line(0.0)) for line in found.right_and_left(near, far))) == expected


BY_TURNS = {"posted_speed_mph": 45, "closed_lanes": (0,), "one_lane_two_way": "signal"}


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"closed_lanes": (3,)}, r"closed_lanes=\(3,\) must be lanes of the road, 0\.\.2"),
        ({"closed_lanes": (2, 3)}, r"closed_lanes=\(2, 3\) must be lanes of the road, 0\.\.2"),
        ({"closed_lanes": (-1,)}, r"closed_lanes=\(-1,\) must be lanes of the road, 0\.\.2"),
        ({"closed_lanes": (2, 2)}, "names a lane twice"),
        ({"closed_lanes": (0, 1, 2)}, "at least one of lanes 0..2"),
        ({"closed_lanes": ()}, "nothing is closed"),
        ({"closed_lanes": (0, 2)}, "must lie side by side"),
        ({"closed_lanes": (1,), "shift_ft": 1}, "shift_ft=1: lanes are open on both sides"),
        ({"closed_lanes": (1,), "shifted_lane_width_ft": 11}, "lanes are open on both sides"),
        ({"closed_lanes": (2,), "closed_shoulder": "right"}, 'closed_shoulder="right" must be the shoulder beside'),
        ({"closed_lanes": (0,), "closed_shoulder": "left"}, 'closed_shoulder="left" must be the shoulder beside'),
    ],
)
def test_closure_that_the_lanes_do_not_allow_is_refused_with_the_rule(changes: dict[str, object], rule: str) -> None:
    with pytest.raises(SpecError, match=rule):
        closure(**changes)


@pytest.mark.parametrize(
    "changes", [{"closed_lanes": ()}, {"closed_shoulder": "left"}, {"shift_ft": 1}, {"shifted_lane_width_ft": 11}]
)
def test_closure_by_turns_closes_the_own_lane_without_a_shift(changes: dict[str, object]) -> None:
    with pytest.raises(SpecError, match=r"give closed_lanes = \[0\]"):
        closure(two_lane_road(), **BY_TURNS | changes)


@pytest.mark.parametrize(("own", "opposing"), [(1, 2), (2, 1)])
def test_closure_by_turns_needs_one_lane_in_each_direction(own: int, opposing: int) -> None:
    with pytest.raises(SpecError, match=rf"given: {own} and {opposing}"):
        closure(paper_road(lane_count=own, opposing_lane_count=opposing), **BY_TURNS)
