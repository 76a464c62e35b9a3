import numpy as np
import pytest
from behaviour.outlooks import CAR, LAYOUT, MIDDLE, NOBODY, RIGHT, one_vehicle, outlook

from wzsumo.behaviour.leaders import leader_ahead
from wzsumo.traffic import Traffic


def test_vehicle_ahead_on_the_path_is_the_leader_with_the_gap_between_bumpers() -> None:
    leader = leader_ahead(outlook(), one_vehicle(30.0, RIGHT + 0.5, speed=7, acceleration=-3), layout=LAYOUT)
    assert leader is not None
    assert leader.gap_m == pytest.approx(30 - (4.8 + CAR.length_m) / 2)
    assert (leader.speed_mps, leader.acceleration_mps2) == (7, -3)


def test_vehicle_that_stands_across_the_line_is_in_the_way_of_an_ego_that_passes_its_middle() -> None:
    # Corners of a 4.8 x 1.85 m car turned by 0.2: 0.91 + 0.48 = 1.38 m to the side, and half the ego's 1.86 m.
    beside = RIGHT + 1.38 + 0.93 - 0.1
    assert leader_ahead(outlook(), one_vehicle(30.0, beside, speed=0, heading=-0.2), layout=LAYOUT) is not None
    assert leader_ahead(outlook(), one_vehicle(30.0, beside, speed=0), layout=LAYOUT) is None


def drifting(ahead_m: float, *, side_gap: float, towards: float = 0.5, speed: float = 15.0, from_left: bool = True) -> Traffic:
    """A car in the lane beside an ego in the middle one, `side_gap` off, that nears its path by `towards` m/s."""
    turned = float(np.arcsin(towards / speed))
    reach = 1.85 / 2 * np.cos(turned) + 4.8 / 2 * np.sin(turned) + CAR.width_m / 2
    side = 1 if from_left else -1
    return one_vehicle(ahead_m, MIDDLE + side * (side_gap + reach), speed=speed, heading=-side * turned)


def follows(traffic: Traffic, *, speed: float) -> bool:
    return leader_ahead(outlook(y=MIDDLE, speed=speed), traffic, layout=LAYOUT) is not None


@pytest.mark.parametrize(("side_gap", "followed"), [(1.6, True), (1.8, False)])
def test_driver_at_the_end_of_a_lane_is_followed_if_three_seconds_of_drift_lead_onto_the_path(
    side_gap: float, followed: bool
) -> None:
    # 0.5 m/s x 3 s, and 0.2 m beside the ego count as on its path: 1.7 m is the border.
    assert follows(drifting(20.0, side_gap=side_gap), speed=20.0) == followed


@pytest.mark.parametrize(("side_gap", "followed"), [(0.6, True), (0.8, False)])
def test_driver_whom_the_ego_has_passed_before_the_drift_leads_onto_its_path_is_not_followed(
    side_gap: float, followed: bool
) -> None:
    # Centres 10 m apart: past 14.7 m farther on, at 15 m/s in 0.98 s; 0.49 + 0.2 m is the border.
    assert follows(drifting(10.0, side_gap=side_gap), speed=30.0) == followed


@pytest.mark.parametrize(("speed", "followed"), [(12.0, True), (16.0, False)])
def test_vehicle_that_passes_beside_the_ego_and_is_ahead_in_three_tenths_of_a_second_is_not_followed_yet(
    speed: float, followed: bool
) -> None:
    # Half lengths are 4.72 m together: 1.2 m of it are beside the ego at 10 m/s, 0.6 s or 0.2 s before it is ahead.
    beside = one_vehicle(3.52, MIDDLE + 0.925 + 0.93 + 0.1, speed=speed)
    assert follows(beside, speed=10.0) == followed
    assert follows(one_vehicle(6.0, MIDDLE + 0.925 + 0.93 + 0.1, speed=speed), speed=10.0)


def test_driver_who_drifts_within_a_lane_that_goes_on_is_not_followed() -> None:
    assert follows(drifting(20.0, side_gap=1.0), speed=20.0)
    assert not follows(drifting(20.0, side_gap=1.0, from_left=False), speed=20.0)


def test_driver_who_comes_in_faster_than_the_ego_is_not_followed_before_being_in() -> None:
    assert not follows(drifting(20.0, side_gap=1.0, speed=21.0), speed=20.0)


def test_driver_who_creeps_straight_on_in_a_queue_beside_the_ego_is_not_followed() -> None:
    assert not follows(one_vehicle(20.0, MIDDLE + 0.925 + 0.93 + 0.3, speed=1.0), speed=10.0)


def test_empty_road_leaves_nobody_to_follow() -> None:
    assert leader_ahead(outlook(slope=0.1), NOBODY, layout=LAYOUT) is None
