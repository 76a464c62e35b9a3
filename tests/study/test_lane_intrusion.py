import numpy as np
import pytest
from builders import paper_layout

from wzsumo.ego import EgoState
from wzsumo.simulation.edges import edges_of
from wzsumo.simulation.traffic import Traffic
from wzsumo.study.lane_intrusion import Seen, seen_by_others
from wzsumo.vehicle import VehicleGeometry

LAYOUT = paper_layout()
EDGES = edges_of(LAYOUT)
CAR = VehicleGeometry()  # 1.86 m wide
NOBODY = Traffic(ids=(), poses=np.empty((0, 3)), speeds=np.empty(0), lengths=np.empty(0), widths=np.empty(0))
LANE = 12 * 0.3048


def seen(y, *, heading=0.0, traffic=NOBODY) -> Seen:
    state = EgoState(x=100.0, y=y, heading=heading, speed=10.0)
    return seen_by_others(state, CAR, traffic, road=LAYOUT.road, edges=EDGES)


def seen_at(y, traffic=NOBODY):
    return seen(y, traffic=traffic).intrusions


def test_ego_in_the_middle_of_its_lane_reaches_into_no_other():
    assert seen_at(1.5 * LANE) == ()


@pytest.mark.parametrize("over_m", [0.1, 0.4])
def test_part_over_the_line_to_the_right_is_seen_there_with_its_clearance(over_m):
    (part,) = seen_at(LANE + CAR.width_m / 2 - over_m)
    assert part.lane == 0
    assert part.width == pytest.approx(over_m + 0.3)
    assert part.front[:2] == pytest.approx([100.0 + CAR.axle_to_bumper_m, LANE - (over_m + 0.3) / 2])


@pytest.mark.parametrize(("y", "lane"), [(LANE + CAR.width_m / 2 - 0.6, 0), (2 * LANE - CAR.width_m / 2 + 0.6, 2)])
def test_ego_more_than_half_a_metre_in_a_lane_takes_all_of_it(y, lane):
    (part,) = seen_at(y)
    assert part.lane == lane
    assert part.width == pytest.approx(LANE)
    assert part.front[1] == pytest.approx((lane + 0.5) * LANE)


def test_part_over_the_line_to_the_left_is_seen_there():
    (part,) = seen_at(2 * LANE - CAR.width_m / 2 + 0.4)
    assert part.lane == 2
    assert part.front[1] == pytest.approx(2 * LANE + (0.4 + 0.3) / 2)


@pytest.mark.parametrize("beside_line_m", [0.0, 1e-9, -0.04])
def test_ego_on_the_line_is_seen_in_both_lanes(beside_line_m):
    assert [part.lane for part in seen_at(LANE + beside_line_m)] == [0, 1]


@pytest.mark.parametrize(
    ("ahead_m", "lane", "shown"), [(0, 0, False), (4.5, 0, False), (5.5, 0, True), (-5.5, 0, True), (0, 2, True)]
)
def test_ego_is_not_shown_in_a_lane_while_somebody_there_is_beside_it(ahead_m, lane, shown):
    x = 100.0 + CAR.axle_to_centre_m + ahead_m
    other = Traffic(
        ids=("other",), poses=np.array([[x, (lane + 0.5) * LANE, 0.0]]), speeds=np.array([10.0]),
        lengths=np.array([4.8]), widths=np.array([1.85]),
    )  # fmt: skip
    assert bool(seen_at(LANE + 0.5, other)) == shown


def test_turned_ego_reaches_over_with_its_corner():
    y = 1.5 * LANE
    assert seen_at(y) == ()
    turned = seen(y, heading=np.deg2rad(20)).intrusions
    # Front left corner: 3.72 sin 20 + 0.93 cos 20 = 2.15 m to the left of the axle, the line is 1.83 m off.
    assert [part.lane for part in turned] == [2]
    assert turned[0].width == pytest.approx(2.146 - LANE / 2 + 0.3, abs=0.002)


def test_ego_along_its_lane_is_seen_as_wide_as_it_is_with_its_clearance():
    assert seen(LANE / 2).width == pytest.approx(CAR.width_m + 2 * 0.3)


@pytest.mark.parametrize("turned", [0.12, -0.12])
def test_turned_ego_is_seen_wide_enough_for_its_rear_corner(turned):
    # From the middle of the front to the rear corner: L sin + w/2 cos across the lane.
    across = CAR.length_m * np.sin(0.12) + CAR.width_m / 2 * np.cos(0.12)
    assert seen(LANE / 2, heading=turned).width == pytest.approx(2 * (across + 0.3))
