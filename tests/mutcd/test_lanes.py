"""The lines of the lanes that stay open, in feet, at stations counted in feet from the start of an area of the zone."""

import numpy as np
import pytest
from builders import by_turns_layout, interior_layout, paper_layout, paper_road, paper_work_zone

from wzsumo.mutcd.layout import lay_out
from wzsumo.work_zone import OpenLane, WorkZoneLayout

PAPER, INTERIOR, BY_TURNS = paper_layout(), interior_layout(), by_turns_layout()


def station(layout: WorkZoneLayout, area: str, share: float) -> float:
    """Station [m] that share of the way along an area."""
    return layout.area(area).start + share * layout.area(area).length


def lines_ft(lane: OpenLane, s: float) -> tuple[float, float]:
    return round(float(lane.right(s)) / 0.3048, 6), round(float(lane.left(s)) / 0.3048, 6)


def lanes_at(layout: WorkZoneLayout, s: float) -> dict[int, tuple[float, float]]:
    return {lane.index: lines_ft(lane, s) for lane in layout.lanes if lane.start <= s < lane.end}


@pytest.mark.parametrize(
    ("area", "share", "expected"),
    [
        ("shoulder taper", 0.5, {0: (0, 12), 1: (12, 24), 2: (24, 36)}),
        ("merging taper", 0.25, {0: (0, 12), 1: (12, 24), 2: (24, 33)}),
        ("tangent", 0.5, {0: (0, 12), 1: (12, 24)}),
        ("shifting taper", 0.5, {0: (-5, 6.5), 1: (6.5, 18)}),
        ("activity area", 0.5, {0: (-10, 1), 1: (1, 12)}),
        ("shift back", 0.5, {0: (-5, 6.5), 1: (6.5, 18)}),
        ("downstream taper", 0.5, {0: (0, 12), 1: (12, 24)}),
    ],
)
def test_lanes_of_the_paper_zone_share_what_is_left_between_the_lines(
    area: str, share: float, expected: dict[int, tuple[float, float]]
) -> None:
    assert lanes_at(PAPER, station(PAPER, area, share)) == expected


def test_closed_lane_ends_with_its_taper_and_begins_anew_where_the_zone_ends() -> None:
    closing, reopened = [lane for lane in PAPER.lanes if lane.index == 2]
    assert (closing.start, closing.end) == pytest.approx((0, PAPER.area("merging taper").end))
    assert (reopened.start, reopened.end) == pytest.approx((PAPER.end, PAPER.road.length))
    assert lines_ft(reopened, reopened.start) == (24, 36)


def test_two_closing_lanes_end_one_after_the_other_from_the_outside() -> None:
    layout = paper_layout(closed_lanes=(1, 2), start_ft=100, shift_ft=0, shifted_lane_width_ft=None)
    ends = {lane.index: lane.end for lane in layout.lanes if lane.start == 0}
    assert ends == {
        0: layout.road.length,
        1: pytest.approx(layout.area("merging taper 2").end),
        2: pytest.approx(layout.area("merging taper").end),
    }
    assert lanes_at(layout, station(layout, "merging taper 2", 0.5)) == {0: (0, 12), 1: (12, 18)}


def test_lane_beside_an_interior_closure_moves_out_to_the_place_of_the_closed_outer_lane() -> None:
    assert lanes_at(INTERIOR, station(INTERIOR, "merging taper", 0.5)) == {0: (0, 12), 1: (12, 24), 2: (24, 30)}
    assert lanes_at(INTERIOR, station(INTERIOR, "shifting taper", 0.5)) == {0: (0, 12), 1: (18, 30)}
    assert lanes_at(INTERIOR, station(INTERIOR, "buffer", 0.5)) == {0: (0, 12), 1: (24, 36)}
    after = [lines_ft(lane, INTERIOR.end + 1) for lane in INTERIOR.lanes if lane.start <= INTERIOR.end + 1 < lane.end]
    assert after == [(0, 12), (24, 36), (12, 24)]  # the lane that moved out stays there, the closed one begins anew


def test_own_lane_crosses_to_the_opposing_one_from_100_ft_ahead_of_the_taper_to_its_end() -> None:
    turns = BY_TURNS.taking_turns
    assert turns is not None
    taper, last = BY_TURNS.area("one-lane two-way taper"), BY_TURNS.area("downstream taper")
    assert taper.start - turns.start == pytest.approx(100 * 0.3048)
    assert turns.end - last.end == pytest.approx(100 * 0.3048)
    own, opposing = BY_TURNS.lanes
    assert [lines_ft(own, s) for s in (turns.start, (turns.start + taper.end) / 2, taper.end)] == [(0, 12), (6, 18), (12, 24)]
    assert [lines_ft(own, s) for s in (last.start, (last.start + turns.end) / 2, turns.end)] == [(12, 24), (6, 18), (0, 12)]
    assert (own.index, own.opposing, own.start, own.end) == (0, False, 0, BY_TURNS.road.length)
    assert (opposing.index, opposing.opposing, lines_ft(opposing, 0.0)) == (1, True, (12, 24))
    assert (opposing.start, opposing.end) == (0, BY_TURNS.road.length)


def test_lane_on_the_open_side_of_a_closure_on_the_right_is_the_left_one() -> None:
    layout = paper_layout(closed_lanes=(0,), closed_shoulder="right", shift_ft=0, shifted_lane_width_ft=None)
    assert lanes_at(layout, station(layout, "merging taper", 0.25)) == {0: (3, 12), 1: (12, 24), 2: (24, 36)}
    assert lanes_at(layout, station(layout, "activity area", 0.5)) == {1: (12, 24), 2: (24, 36)}


def test_opposing_lanes_keep_their_lines_beside_any_zone() -> None:
    layout = lay_out(
        paper_work_zone(closed_lanes=(0,), closed_shoulder="right", shift_ft=0, shifted_lane_width_ft=None),
        paper_road(lane_count=2, opposing_lane_count=2),
    )
    opposing = [lane for lane in layout.lanes if lane.opposing]
    assert [lane.index for lane in opposing] == [2, 3]
    assert [lines_ft(lane, layout.start) for lane in opposing] == [(24, 36), (36, 48)]
    assert {(lane.start, lane.end) for lane in opposing} == {(0.0, layout.road.length)}


def test_gore_opens_from_its_tip_and_closes_in_the_downstream_taper() -> None:
    outer, gore = INTERIOR.closed_strips
    assert (outer.interior, gore.interior) == (False, True)
    assert (gore.start, gore.end) == pytest.approx((INTERIOR.area("shifting taper").start, INTERIOR.end))
    assert (outer.start, outer.end) == pytest.approx((INTERIOR.start, INTERIOR.area("shifting taper").end))

    def right_and_left_ft(area: str, share: float) -> list[float]:
        s = station(INTERIOR, area, share)
        return [round(float(line(s)) / 0.3048, 6) for line in (gore.right, gore.left)]

    assert right_and_left_ft("shifting taper", 0.5) == [12, 18]
    assert right_and_left_ft("activity area", 0.5) == [12, 24]
    assert right_and_left_ft("downstream taper", 0.5) == [12, 18]


def test_drivable_area_ends_at_the_line_of_devices_or_the_edge_line_whichever_is_nearer() -> None:
    s = np.array([0.0, station(PAPER, "shoulder taper", 0.5), *(station(PAPER, "merging taper", q) for q in (0.0, 0.5, 1.0))])
    assert PAPER.drivable_left(s) / 0.3048 == pytest.approx([36, 36, 36, 30, 24])
    downstream = [station(PAPER, "downstream taper", q) for q in (0.0, 0.5, 1.0)]
    assert PAPER.drivable_left(downstream) / 0.3048 == pytest.approx([24, 30, 36])
    assert PAPER.drivable_right(s) / 0.3048 == pytest.approx([0, 0, 0, 0, 0])
