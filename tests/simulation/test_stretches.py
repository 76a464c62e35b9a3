"""The stretches of road on which lanes stay the same, without SUMO. Lengths from the zone's numbers in feet."""

from itertools import pairwise

import pytest
from builders import by_turns_layout, interior_layout, paper_layout

from wzsumo.simulation.stretches import passable_end, remnant_end, stretches_of
from wzsumo.work_zone import WorkZoneLayout

PAPER, INTERIOR, BY_TURNS = paper_layout(), interior_layout(), by_turns_layout()


def test_closing_lane_is_passable_to_8_ft_and_its_remnant_goes_on_to_1_m_25() -> None:
    taper = PAPER.area("merging taper")  # 12 ft close over 720 ft
    closing = next(lane for lane in PAPER.lanes if lane.index == 2 and lane.start == 0)
    assert passable_end(closing) == pytest.approx(taper.start + 240 * 0.3048)
    assert remnant_end(closing) == pytest.approx(taper.start + (12 * 0.3048 - 1.25) * 60)


def test_lane_that_goes_on_ends_where_the_road_does() -> None:
    assert passable_end(PAPER.lanes[0]) == remnant_end(PAPER.lanes[0]) == PAPER.road.length


def test_paper_zone_has_seven_stretches_each_with_its_lanes_at_their_narrowest() -> None:
    taper, shift, back = (PAPER.area(name) for name in ("merging taper", "shifting taper", "shift back"))
    ends = [taper.start, taper.start + 240 * 0.3048, taper.start + (12 * 0.3048 - 1.25) * 60, shift.start, back.end]
    stretches = stretches_of(PAPER)
    assert [stretch.end for stretch in stretches] == pytest.approx([*ends, PAPER.end, PAPER.road.length])
    widths_ft = [[12, 12, 12], [12, 12, 8], [12, 12], [12, 12], [11, 11], [12, 12], [12, 12, 12]]
    for stretch, expected in zip(stretches, widths_ft, strict=True):
        assert [width / 0.3048 for width in stretch.widths] == pytest.approx(expected)
    assert [stretch.remnant is not None for stretch in stretches] == [False, False, True, False, False, False, False]


def test_lane_that_narrows_has_its_greatest_width_too() -> None:
    (closing,) = [stretch for stretch in stretches_of(PAPER) if stretch.start == PAPER.area("merging taper").start]
    assert closing.greatest_widths == pytest.approx([12 * 0.3048] * 3)


@pytest.mark.parametrize("layout", [PAPER, INTERIOR, BY_TURNS], ids=["paper", "interior", "by turns"])
def test_stretches_follow_one_another_from_the_roads_start_to_its_end(layout: WorkZoneLayout) -> None:
    stretches = stretches_of(layout)
    assert stretches[0].start == 0
    assert stretches[-1].end == layout.road.length
    assert all(before.end == after.start for before, after in pairwise(stretches))
    assert all(stretch.end - stretch.start > 1 for stretch in stretches)


def test_lanes_are_parted_from_the_nose_to_where_the_zone_ends_and_barred_from_100_m_before() -> None:
    nose = INTERIOR.area("shifting taper").start
    for stretch in stretches_of(INTERIOR):
        if len(stretch.lanes) == 2:
            assert stretch.parted == [nose - 0.01 < stretch.start < INTERIOR.end - 0.01]
            assert stretch.barred == [nose - 100.01 < stretch.start < INTERIOR.end - 0.01]
        else:
            assert not any(stretch.barred)


def test_lane_that_both_directions_share_begins_and_ends_at_the_stop_lines() -> None:
    turns = BY_TURNS.taking_turns
    assert turns is not None
    assert [stretch.end for stretch in stretches_of(BY_TURNS)] == pytest.approx([turns.start, turns.end, BY_TURNS.road.length])
