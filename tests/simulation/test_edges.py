"""The edges of SUMO's network and the lanes on them, without SUMO."""

import numpy as np
import pytest
from builders import by_turns_layout, interior_layout, paper_layout, paper_road, paper_work_zone

from wzsumo.mutcd.layout import lay_out
from wzsumo.simulation.edges import edge_at, edges_of, opposing_edges_of

PAPER, INTERIOR, BY_TURNS = paper_layout(), interior_layout(), by_turns_layout()
LANE = 12 * 0.3048


def test_edges_are_named_by_the_areas_that_they_begin_and_end_in() -> None:
    assert [edge.id for edge in edges_of(PAPER)] == [
        "00_approach_to_shoulder_taper", "01_merging_taper", "02_merging_taper", "03_merging_taper_to_tangent",
        "04_shifting_taper_to_shift_back", "05_downstream_taper", "06_departure",
    ]  # fmt: skip


def test_lanes_of_the_paper_zone_close_leave_a_remnant_and_open_again() -> None:
    lanes = [([lane.of.index for lane in edge.through_lanes if lane.of], len(edge.lanes)) for edge in edges_of(PAPER)]
    three, remnant, two = ([0, 1, 2], 3), ([0, 1], 3), ([0, 1], 2)
    assert lanes == [three, three, remnant, two, two, two, three]
    assert [lane.allows for lane in edges_of(PAPER)[2].lanes] == ["all", "all", "cars"]


@pytest.mark.parametrize(("closed", "shoulder"), [((2,), "left"), ((0,), "right")])
def test_remnant_lies_beside_the_open_lanes_on_the_side_that_closes(closed: tuple[int, ...], shoulder: str) -> None:
    layout = paper_layout(closed_lanes=closed, closed_shoulder=shoulder, shift_ft=0, shifted_lane_width_ft=None)
    edge = edges_of(layout)[2]
    (number,) = [number for number, lane in enumerate(edge.lanes) if lane.allows == "cars"]
    assert number == (2 if shoulder == "left" else 0)
    assert edge.lanes[number].lines(edge.start)[0 if shoulder == "left" else 1] == pytest.approx(
        edge.lanes[1].lines(edge.start)[1 if shoulder == "left" else 0], abs=0.03
    )


def test_gore_lies_between_the_lanes_from_its_tip_to_where_it_closes() -> None:
    for edge in edges_of(INTERIOR):
        gores = [lane for lane in edge.lanes if lane.allows == "none"]
        inside = INTERIOR.area("shifting taper").start - 0.01 <= edge.start < INTERIOR.end - 0.01
        assert len(gores) == int(inside), edge.id
        if inside:
            right, gore, left = edge.lanes
            s = (edge.start + edge.end) / 2
            assert gore.width == pytest.approx(0.1)
            assert right.lines(s)[1] < gore.lines(s)[0] < gore.lines(s)[1] < left.lines(s)[0]


def test_closing_lane_hugs_the_lane_that_goes_on() -> None:
    edge = edges_of(PAPER)[1]
    for s in np.linspace(edge.start + 17.5, edge.end - 17.5, 5):
        assert edge.lanes[2].lines(s) == pytest.approx((2 * LANE, 2 * LANE + 8 * 0.3048 - 0.1))
        assert edge.lanes[1].lines(s) == pytest.approx((LANE, 2 * LANE))


def test_place_is_in_the_lane_whose_middle_is_nearest() -> None:
    edge = edges_of(INTERIOR)[-2]  # with a gore
    station = (edge.start + edge.end) / 2
    for number in (0, 2):
        assert edge.lane_at(station, float(edge.lanes[number].middle(station)) + 0.5) == number
    assert edge.lane_at(station, -20.0) == 0
    assert edge.lane_at(station, 40.0) == 2


def test_station_on_an_edges_end_is_on_the_next_and_one_beyond_the_road_on_the_last() -> None:
    edges = edges_of(PAPER)
    assert edge_at(edges, edges[0].end) is edges[1]
    assert edge_at(edges, edges[0].end - 1e-6) is edges[0]
    assert edge_at(edges, 1e5) is edges[-1]


def test_opposing_edges_end_at_the_stop_lines_and_are_listed_as_they_are_driven() -> None:
    turns = BY_TURNS.taking_turns
    assert turns is not None
    edges = opposing_edges_of(BY_TURNS)
    assert [(edge.id, edge.start, edge.end) for edge in edges] == [
        ("opposing_0", turns.end, BY_TURNS.road.length),
        ("opposing_1", turns.start, turns.end),
        ("opposing_2", 0.0, turns.start),
    ]
    assert all(edge.opposing and [lane.of.index for lane in edge.lanes if lane.of] == [1] for edge in edges)


def test_opposing_lanes_are_in_the_order_from_the_right_of_their_drivers() -> None:
    layout = lay_out(
        paper_work_zone(closed_lanes=(), shift_ft=0, shifted_lane_width_ft=None),
        paper_road(opposing_lane_count=2, left_shoulder_ft=0),
    )
    (edge,) = opposing_edges_of(layout)
    assert [lane.of.index for lane in edge.lanes if lane.of] == [4, 3]
    assert (edge.start, edge.end) == (0.0, layout.road.length)
    assert opposing_edges_of(PAPER) == ()
