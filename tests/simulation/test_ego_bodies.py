import numpy as np
import pytest
from builders import paper_layout

from wzsumo.ego import EgoState
from wzsumo.simulation.edges import edges_of
from wzsumo.simulation.ego_bodies import bodies_in_lanes
from wzsumo.simulation.session import LaneBody
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry

LAYOUT = paper_layout()
EDGES = edges_of(LAYOUT)
CAR = VehicleGeometry()  # 1.86 m wide
NO_TRAFFIC = Traffic(
    ids=(), poses=np.empty((0, 3)), speeds=np.empty(0), accelerations=np.empty(0), lengths=np.empty(0), widths=np.empty(0)
)
LANE = 12 * 0.3048
WITHIN = 0.15  # from a lane's lines to the body in it
MARGIN = 0.1  # from the outer lines of a road's lanes to those of SUMO's


def bodies(y: float, *, heading: float = 0.0, traffic: Traffic = NO_TRAFFIC, x: float = 100.0) -> tuple[LaneBody, ...]:
    state = EgoState(x=x, y=y, heading=heading, speed=10.0)
    return bodies_in_lanes(state, CAR, traffic, road=LAYOUT.road, edges=EDGES)


def lanes_of(found: tuple[LaneBody, ...]) -> list[int]:
    return [body.lane for body in found]


def test_ego_in_the_middle_of_its_lane_has_one_body_as_wide_as_the_ego_with_its_clearance() -> None:
    (body,) = bodies(1.5 * LANE)
    assert (body.lane, body.edge, body.lane_on_edge) == (1, EDGES[0].id, 1)
    assert body.front == pytest.approx([100.0 + CAR.axle_to_bumper_m, 1.5 * LANE, 0.0])
    assert body.width == pytest.approx(CAR.width_m + 2 * 0.5)


@pytest.mark.parametrize("over_m", [0.1, 0.4])
def test_ego_over_the_line_to_the_right_has_a_body_there_with_its_clearance(over_m: float) -> None:
    own, body = bodies(LANE + CAR.width_m / 2 - over_m)
    assert (own.lane, body.lane) == (1, 0)
    width = max(over_m + 0.5 - WITHIN, 0.1)
    assert body.width == pytest.approx(width)
    assert body.front[:2] == pytest.approx([100.0 + CAR.axle_to_bumper_m, LANE - WITHIN - width / 2])


def test_ego_over_the_line_to_the_left_has_a_body_there() -> None:
    own, body = bodies(2 * LANE - CAR.width_m / 2 + 0.4)
    assert (own.lane, body.lane) == (1, 2)
    assert body.front[1] == pytest.approx(2 * LANE + (WITHIN + 0.4 + 0.5) / 2)


def test_ego_whose_clearance_alone_reaches_over_the_line_has_a_body_there_too() -> None:
    own, body = bodies(LANE + CAR.width_m / 2 + 0.1)
    assert (own.lane, body.lane) == (1, 0)
    assert body.width == pytest.approx(0.5 - 0.1 - WITHIN)


@pytest.mark.parametrize(("y", "lane"), [(LANE + CAR.width_m / 2 - 0.6, 0), (2 * LANE - CAR.width_m / 2 + 0.6, 2)])
def test_ego_more_than_half_a_metre_in_a_lane_that_leaves_room_to_pass_takes_all_of_it(y: float, lane: int) -> None:
    body = bodies(y)[1]
    assert body.lane == lane
    assert body.width == pytest.approx(LANE - MARGIN - 2 * WITHIN)
    assert body.front[1] == pytest.approx((lane + 0.5) * LANE + (1 - lane) * MARGIN / 2)


@pytest.mark.parametrize("beside_line_m", [0.0, 1e-9, -0.04])
def test_ego_on_the_line_takes_both_lanes(beside_line_m: float) -> None:
    found = bodies(LANE + beside_line_m)
    assert sorted(lanes_of(found)) == [0, 1]
    widths = {body.lane: body.width for body in found}
    assert widths == pytest.approx({0: LANE - MARGIN - 2 * WITHIN, 1: LANE - 2 * WITHIN})


def test_ego_on_the_shoulder_has_its_body_at_the_edge_of_the_lane_next_to_it() -> None:
    (body,) = bodies(-1.6)
    assert body.lane == 0
    assert body.width == pytest.approx(0.1)
    assert body.front[1] == pytest.approx(MARGIN + WITHIN + 0.05)


@pytest.mark.parametrize("y", np.linspace(-1.5, 3 * LANE + 1.5, 41))
@pytest.mark.parametrize("turned", [0.0, 0.3, -0.1])
@pytest.mark.parametrize("x", [100.0, 1200.0])  # in the approach, and in the merging taper
def test_every_body_lies_within_its_lane_and_the_first_in_the_one_nearest_to_the_front(
    y: float, turned: float, x: float
) -> None:
    found = bodies(y, heading=turned, x=x)
    for body in found:
        edge = next(edge for edge in EDGES if edge.id == body.edge)
        lane = edge.lanes[body.lane_on_edge]
        assert lane.of is not None
        assert lane.of.index == body.lane
        right, left = lane.lines(body.front[0])
        assert right + WITHIN - 0.01 < body.front[1] - body.width / 2 < body.front[1] + body.width / 2 < left - WITHIN + 0.01
    middle = {lane.of.index: float(lane.middle(found[0].front[0])) for lane in edge.lanes if lane.of}
    front_y = y + CAR.axle_to_bumper_m * np.sin(turned)
    assert found[0].lane == min(middle, key=lambda lane: abs(middle[lane] - front_y))


@pytest.mark.parametrize(
    ("ahead_m", "lane", "shown"), [(0, 0, False), (4.5, 0, False), (5.5, 0, True), (-5.5, 0, True), (0, 2, True)]
)
def test_ego_has_no_body_in_another_lane_while_a_vehicle_there_is_beside_it(ahead_m: float, lane: int, shown: bool) -> None:
    x = 100.0 + CAR.axle_to_centre_m + ahead_m
    other = Traffic(
        ids=("other",), poses=np.array([[x, (lane + 0.5) * LANE, 0.0]]), speeds=np.array([10.0]),
        accelerations=np.zeros(1), lengths=np.array([4.8]), widths=np.array([1.85]),
    )  # fmt: skip
    assert (0 in lanes_of(bodies(LANE + 0.5, traffic=other))) == shown


def test_turned_ego_reaches_over_with_its_corner() -> None:
    assert lanes_of(bodies(1.5 * LANE)) == [1]
    _, body = bodies(1.5 * LANE, heading=np.deg2rad(20))
    # Front left corner: 3.72 sin 20 + 0.93 cos 20 = 2.146 m to the left of the axle, the line is 1.829 m off.
    assert body.lane == 2
    assert body.width == pytest.approx(2.146 - LANE / 2 + 0.5 - WITHIN, abs=0.002)


@pytest.mark.parametrize("turned", [0.04, -0.04])
def test_body_of_a_turned_ego_is_as_wide_as_its_corners_reach(turned: float) -> None:
    (body,) = bodies(LANE / 2 - 1.3 * np.sin(turned), heading=turned)
    # Front to rear corners across the lane: L sin + w cos.
    across = CAR.length_m * np.sin(abs(turned)) + CAR.width_m * np.cos(turned)
    assert body.width == pytest.approx(across + 2 * 0.5)


@pytest.mark.parametrize(("reach_m", "lanes"), [(0.019, [1]), (0.021, [1, 0])])
def test_ego_that_reaches_less_than_2_cm_into_another_lane_with_its_clearance_has_no_body_there(
    reach_m: float, lanes: list[int]
) -> None:
    assert lanes_of(bodies(LANE + CAR.width_m / 2 + 0.5 - reach_m)) == lanes


@pytest.mark.parametrize(("over_m", "width_m"), [(0.49, 0.49 + 0.5 - WITHIN), (0.51, LANE - MARGIN - 2 * WITHIN)])
def test_ego_takes_all_of_a_lane_once_it_reaches_more_than_half_a_metre_into_it(over_m: float, width_m: float) -> None:
    _, body = bodies(LANE + CAR.width_m / 2 - over_m)
    assert body.width == pytest.approx(width_m)


@pytest.mark.parametrize(
    ("free_m", "width_m"),
    [(1.49, LANE - 1.49 - WITHIN), (1.51, LANE - 2 * WITHIN)],
    ids=["too narrow to pass", "wide enough to pass"],
)
def test_ego_takes_all_of_its_lane_where_it_leaves_more_than_one_and_a_half_metres_free(free_m: float, width_m: float) -> None:
    # Its clearance of 0.5 m on the right ends that far from the lane's right line.
    body = bodies(LANE + free_m + 0.5 + CAR.width_m / 2)[0]
    assert body.lane == 1
    assert body.width == pytest.approx(width_m)


def test_ego_is_on_the_edge_where_its_front_bumper_is() -> None:
    first, second = EDGES[:2]
    rear_to_front = CAR.axle_to_bumper_m
    for front, edge in ((second.start - 0.01, first), (second.start + 0.01, second)):
        assert {body.edge for body in bodies(LANE, x=front - rear_to_front)} == {edge.id}
    assert bodies(LANE, x=LAYOUT.road.length + 5)[0].edge == EDGES[-1].id


def test_body_heads_as_the_ego_does() -> None:
    assert bodies(1.5 * LANE, heading=0.05)[0].front[2] == 0.05


def test_vehicle_whose_middle_is_in_another_lane_takes_no_body_from_this_one() -> None:
    for y, lanes in ((0.99 * LANE, [1]), (1.01 * LANE, [1, 0])):
        other = Traffic(
            ids=("other",), poses=np.array([[100.0, y, 0.0]]), speeds=np.array([10.0]), accelerations=np.zeros(1),
            lengths=np.array([4.8]), widths=np.array([1.85]),
        )  # fmt: skip
        assert lanes_of(bodies(LANE + 0.5, traffic=other)) == lanes
