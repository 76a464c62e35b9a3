import numpy as np
import pytest
from builders import paper_layout

from wzsumo.ego import EgoState
from wzsumo.simulation.edges import edges_of
from wzsumo.simulation.ego_bodies import bodies_in_lanes
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry

LAYOUT = paper_layout()
EDGES = edges_of(LAYOUT)
CAR = VehicleGeometry()  # 1.86 m wide
NOBODY = Traffic(
    ids=(), poses=np.empty((0, 3)), speeds=np.empty(0), accelerations=np.empty(0), lengths=np.empty(0), widths=np.empty(0)
)
LANE = 12 * 0.3048
WITHIN = 0.4  # of a lane's lines is what is shown in it


def seen(y, *, heading=0.0, traffic=NOBODY, x=100.0):
    state = EgoState(x=x, y=y, heading=heading, speed=10.0)
    return bodies_in_lanes(state, CAR, traffic, road=LAYOUT.road, edges=EDGES)


def lanes_of(parts):
    return [part.lane for part in parts]


def test_ego_in_the_middle_of_its_lane_is_shown_there_alone_as_wide_as_it_is_with_its_clearance() -> None:
    (part,) = seen(1.5 * LANE)
    assert (part.lane, part.edge, part.lane_on_edge) == (1, EDGES[0].id, 1)
    assert part.front == pytest.approx([100.0 + CAR.axle_to_bumper_m, 1.5 * LANE, 0.0])
    assert part.width == pytest.approx(CAR.width_m + 2 * 0.3)


@pytest.mark.parametrize("over_m", [0.1, 0.4])
def test_part_over_the_line_to_the_right_is_seen_there_with_its_clearance(over_m: float) -> None:
    own, part = seen(LANE + CAR.width_m / 2 - over_m)
    assert (own.lane, part.lane) == (1, 0)
    width = max(over_m + 0.3 - WITHIN, 0.1)
    assert part.width == pytest.approx(width)
    assert part.front[:2] == pytest.approx([100.0 + CAR.axle_to_bumper_m, LANE - WITHIN - width / 2])


def test_part_over_the_line_to_the_left_is_seen_there() -> None:
    own, part = seen(2 * LANE - CAR.width_m / 2 + 0.4)
    assert (own.lane, part.lane) == (1, 2)
    assert part.front[1] == pytest.approx(2 * LANE + (WITHIN + 0.4 + 0.3) / 2)


def test_ego_whose_clearance_alone_reaches_over_the_line_is_seen_there_too() -> None:
    own, part = seen(LANE + CAR.width_m / 2 + 0.1)
    assert (own.lane, part.lane) == (1, 0)
    assert part.width == pytest.approx(0.1)


@pytest.mark.parametrize(("y", "lane"), [(LANE + CAR.width_m / 2 - 0.6, 0), (2 * LANE - CAR.width_m / 2 + 0.6, 2)])
def test_ego_more_than_half_a_metre_in_a_lane_that_leaves_room_to_pass_takes_all_of_it(y, lane: int) -> None:
    part = seen(y)[1]
    assert part.lane == lane
    assert part.width == pytest.approx(LANE - 2 * WITHIN)
    assert part.front[1] == pytest.approx((lane + 0.5) * LANE)


@pytest.mark.parametrize("beside_line_m", [0.0, 1e-9, -0.04])
def test_ego_on_the_line_takes_both_lanes(beside_line_m: float) -> None:
    parts = seen(LANE + beside_line_m)
    assert sorted(lanes_of(parts)) == [0, 1]
    assert [part.width for part in parts] == pytest.approx([LANE - 2 * WITHIN] * 2)


def test_ego_on_the_shoulder_is_shown_at_the_edge_of_the_lane_next_to_it() -> None:
    (part,) = seen(-1.6)
    assert part.lane == 0
    assert part.width == pytest.approx(0.1)
    assert part.front[1] == pytest.approx(WITHIN + 0.05)


@pytest.mark.parametrize("y", np.linspace(-1.5, 3 * LANE + 1.5, 41))
@pytest.mark.parametrize("turned", [0.0, 0.3, -0.1])
@pytest.mark.parametrize("x", [100.0, 1200.0])  # in the approach, and in the merging taper
def test_every_part_lies_within_its_lane_and_the_first_in_the_one_nearest_to_the_front(y, turned: float, x: float) -> None:
    parts = seen(y, heading=turned, x=x)
    for part in parts:
        edge = next(edge for edge in EDGES if edge.id == part.edge)
        lane = edge.lanes[part.lane_on_edge]
        assert lane.index == part.lane
        right, left = float(lane.right(part.front[0])), float(lane.left(part.front[0]))
        assert right + WITHIN - 0.01 < part.front[1] - part.width / 2 < part.front[1] + part.width / 2 < left - WITHIN + 0.01
    middle = {lane.index: float(lane.right(part.front[0]) + lane.left(part.front[0])) / 2 for lane in edge.through_lanes}
    front_y = y + CAR.axle_to_bumper_m * np.sin(turned)
    assert parts[0].lane == min(middle, key=lambda lane: abs(middle[lane] - front_y))


@pytest.mark.parametrize(
    ("ahead_m", "lane", "shown"), [(0, 0, False), (4.5, 0, False), (5.5, 0, True), (-5.5, 0, True), (0, 2, True)]
)
def test_ego_is_not_shown_in_another_lane_while_somebody_there_is_beside_it(ahead_m: float, lane: int, shown: bool) -> None:
    x = 100.0 + CAR.axle_to_centre_m + ahead_m
    other = Traffic(
        ids=("other",), poses=np.array([[x, (lane + 0.5) * LANE, 0.0]]), speeds=np.array([10.0]),
        accelerations=np.zeros(1), lengths=np.array([4.8]), widths=np.array([1.85]),
    )  # fmt: skip
    assert (0 in lanes_of(seen(LANE + 0.5, traffic=other))) == shown


def test_turned_ego_reaches_over_with_its_corner() -> None:
    assert lanes_of(seen(1.5 * LANE)) == [1]
    _, part = seen(1.5 * LANE, heading=np.deg2rad(20))
    # Front left corner: 3.72 sin 20 + 0.93 cos 20 = 2.146 m to the left of the axle, the line is 1.829 m off.
    assert part.lane == 2
    assert part.width == pytest.approx(2.146 - LANE / 2 + 0.3 - WITHIN, abs=0.002)


@pytest.mark.parametrize("turned", [0.07, -0.07])
def test_turned_ego_is_seen_as_far_as_its_corners_reach(turned: float) -> None:
    (part,) = seen(LANE / 2 - 1.3 * np.sin(turned), heading=turned)
    # Front to rear corners across the lane: L sin + w cos.
    across = CAR.length_m * np.sin(abs(turned)) + CAR.width_m * np.cos(turned)
    assert part.width == pytest.approx(across + 2 * 0.3)
