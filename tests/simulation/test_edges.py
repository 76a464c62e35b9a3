"""The stretches of road that become SUMO's edges, without SUMO. Lengths from the zone's numbers in feet."""

from itertools import pairwise

import numpy as np
import pytest
from builders import by_turns_layout, interior_layout, paper_layout, paper_road, paper_work_zone

from wzsumo.mutcd.layout import lay_out
from wzsumo.road import Profile
from wzsumo.simulation.edges import edges_of, gap_between, opposing_edges_of, passable_end, remnant_end, width_at
from wzsumo.work_zone import OpenLane

PAPER, INTERIOR, BY_TURNS = paper_layout(), interior_layout(), by_turns_layout()


def test_closing_lane_is_passable_to_8_ft_and_its_remnant_goes_on_to_1_m_25() -> None:
    taper = PAPER.area("merging taper")  # 12 ft close over 720 ft
    closing = next(lane for lane in PAPER.lanes if lane.index == 2 and lane.start == 0)
    assert passable_end(closing) == pytest.approx(taper.start + 240 * 0.3048)
    assert width_at(closing, passable_end(closing)) == pytest.approx(8 * 0.3048)
    assert remnant_end(closing) == pytest.approx(taper.start + (12 * 0.3048 - 1.25) * 60)
    assert width_at(closing, remnant_end(closing)) == pytest.approx(1.25)


def test_lane_that_goes_on_ends_where_the_road_does() -> None:
    lane = PAPER.lanes[0]
    assert passable_end(lane) == remnant_end(lane) == PAPER.road.length
    assert width_at(lane, 100.0) == pytest.approx(12 * 0.3048)


def test_edges_of_the_paper_zone_change_the_width_of_a_lane_by_at_most_a_fifth_of_a_metre() -> None:
    edges = edges_of(PAPER)
    # 4 ft, 1.22 m, close in 7 steps; then the remnant, then the rest of the taper. A shift changes 12 ft to 11 ft in 2 steps.
    assert [edge.id.split("_", 1)[1] for edge in edges] == [
        "approach", "shoulder_taper", *["merging_taper"] * 9, "tangent", *["shifting_taper"] * 2, "buffer", "activity_area",
        *["shift_back"] * 2, "downstream_taper", "departure",
    ]  # fmt: skip
    assert [edge.id[:2] for edge in edges] == [f"{number:02d}" for number in range(len(edges))]
    for edge in edges:
        for lane in edge.through_lanes:
            assert abs(width_at(lane, edge.end) - width_at(lane, edge.start)) <= 0.2 + 1e-9


def test_edges_follow_one_another_from_the_roads_start_to_its_end() -> None:
    for layout in (PAPER, INTERIOR, BY_TURNS):
        edges = edges_of(layout)
        assert edges[0].start == 0
        assert edges[-1].end == layout.road.length
        assert all(before.end == after.start for before, after in pairwise(edges))
        assert all(edge.end - edge.start > 1e-3 for edge in edges)


def test_lanes_of_the_paper_zone_close_leave_a_remnant_and_open_again() -> None:
    lanes = [([lane.index for lane in edge.through_lanes], len(edge.lanes)) for edge in edges_of(PAPER)]
    three, remnant, two = ([0, 1, 2], 3), ([0, 1], 3), ([0, 1], 2)
    assert lanes == [three] * 9 + [remnant] + [two] * 9 + [three]
    assert all(edge.gores == () for edge in edges_of(PAPER))


def test_gore_lies_between_the_lanes_from_its_tip_to_where_it_closes() -> None:
    for edge in edges_of(INTERIOR):
        inside = INTERIOR.area("shifting taper").start <= edge.start + 1e-6 < INTERIOR.end - 1e-6
        assert len(edge.gores) == int(inside), edge.id
        if inside:
            right, gore, left = edge.lanes
            assert edge.gores == (gore,)
            assert edge.through_lanes == (right, left)
            assert (gore.index, gore.start, gore.end) == (right.index, edge.start, edge.end)
            assert width_at(gore, edge.end) == pytest.approx(gap_between(right, left, at=(edge.end,)))


def test_gap_between_two_lanes_is_the_greatest_at_the_given_stations() -> None:
    stations = np.array([0.0, 100.0])

    def lane(right: tuple[float, float], left: tuple[float, float]) -> OpenLane:
        lines = [Profile(stations=stations, offsets=np.array(offsets)) for offsets in (right, left)]
        return OpenLane(index=0, start=0.0, end=100.0, right=lines[0], left=lines[1])

    right, left = lane((0.0, 0.0), (3.0, 3.0)), lane((3.0, 7.0), (6.0, 10.0))
    assert gap_between(right, left, at=(0.0, 50.0)) == pytest.approx(2.0)
    assert gap_between(right, left, at=(0.0,)) == 0.0


def test_opposing_edges_end_at_the_stop_lines_and_are_listed_as_they_are_driven() -> None:
    turns = BY_TURNS.taking_turns
    assert turns is not None
    edges = opposing_edges_of(BY_TURNS)
    assert [(edge.id, edge.start, edge.end) for edge in edges] == [
        ("opposing_0", turns.end, BY_TURNS.road.length),
        ("opposing_1", turns.start, turns.end),
        ("opposing_2", 0.0, turns.start),
    ]
    assert all(edge.opposing and [lane.index for lane in edge.through_lanes] == [1] for edge in edges)


def test_opposing_lanes_are_in_the_order_from_the_right_of_their_drivers() -> None:
    layout = lay_out(
        paper_work_zone(closed_lanes=(), shift_ft=0, shifted_lane_width_ft=None),
        paper_road(opposing_lane_count=2, left_shoulder_ft=0),
    )
    (edge,) = opposing_edges_of(layout)
    assert [lane.index for lane in edge.lanes] == [4, 3]
    assert (edge.start, edge.end) == (0.0, layout.road.length)
    assert opposing_edges_of(PAPER) == ()
