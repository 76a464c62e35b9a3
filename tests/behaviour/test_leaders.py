from dataclasses import replace

import numpy as np
import pytest
from behaviour.outlooks import CAR, LAYOUT, MIDDLE, NOBODY, RIGHT, one_vehicle, outlook, together

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


@pytest.mark.parametrize(("speed", "followed"), [(13.5, True), (14.5, False)])
def test_vehicle_that_passes_beside_the_ego_and_is_ahead_in_three_tenths_of_a_second_is_not_followed_yet(
    speed: float, followed: bool
) -> None:
    # Half lengths are 4.72 m together: 1.2 m of it are beside the ego at 10 m/s, 0.34 s or 0.27 s before it is ahead.
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


@pytest.mark.parametrize(
    ("speed", "ahead_m", "followed"),
    [
        (10.0, 62.0, True),  # 6 s at 10 m/s: poses up to 59 m on; centres up to 5 m beyond, 62.6 m before the ego's, count
        (10.0, 63.0, False),
        (0.0, 32.0, True),  # 30 m at least: poses up to 29 m on
        (0.0, 33.0, False),
        (20.0, 122.0, True),
        (20.0, 123.0, False),
    ],
)
def test_leader_is_looked_for_as_far_as_the_ego_drives_in_six_seconds_and_thirty_metres_at_least(
    speed: float, ahead_m: float, followed: bool
) -> None:
    assert follows(one_vehicle(ahead_m, MIDDLE, speed=speed), speed=speed) == followed


@pytest.mark.parametrize(("ahead_m", "followed"), [(-0.5, False), (0.5, True)])
def test_vehicle_beside_the_ego_is_followed_with_no_gap_if_its_front_is_ahead_of_the_egos(
    ahead_m: float, followed: bool
) -> None:
    # Its half length is 2.4 m, the ego's 2.32 m.
    beside = one_vehicle(ahead_m, MIDDLE + 0.925 + 0.93 + 0.1, speed=5.0)
    leader = leader_ahead(outlook(y=MIDDLE), beside, layout=LAYOUT)
    assert (leader is not None) == followed
    assert leader is None or leader.gap_m == 0.0


@pytest.mark.parametrize(("side_gap", "followed"), [(0.15, True), (0.25, False)])
@pytest.mark.parametrize("side", [-1, 1])
def test_vehicle_nearer_than_two_decimetres_to_the_egos_path_is_on_it(side_gap: float, followed: bool, side: int) -> None:
    assert follows(one_vehicle(30.0, MIDDLE + side * (0.925 + 0.93 + side_gap), speed=10.0), speed=10.0) == followed


def test_nearest_of_several_vehicles_on_the_path_is_followed() -> None:
    traffic = together(
        one_vehicle(40.0, MIDDLE, speed=9.0), one_vehicle(25.0, MIDDLE, speed=8.0), one_vehicle(20.0, RIGHT, speed=7.0)
    )
    leader = leader_ahead(outlook(y=MIDDLE), traffic, layout=LAYOUT)
    assert leader is not None
    assert leader.speed_mps == 8.0


def test_vehicle_behind_the_ego_is_not_followed() -> None:
    assert not follows(one_vehicle(-10.0, MIDDLE, speed=12.0), speed=10.0)


def test_ego_at_the_end_of_its_path_follows_nobody() -> None:
    ego = outlook(y=MIDDLE, length_m=2)
    assert leader_ahead(replace(ego, station=1.0), one_vehicle(10.0, MIDDLE, speed=5.0), layout=LAYOUT) is None


def test_ego_past_the_end_of_its_path_follows_nobody() -> None:
    ego = outlook(y=MIDDLE, length_m=2)
    assert leader_ahead(replace(ego, station=2.5), one_vehicle(10.0, MIDDLE, speed=5.0), layout=LAYOUT) is None


def test_leader_is_found_on_the_last_three_poses_of_a_path() -> None:
    leader = leader_ahead(outlook(y=MIDDLE, length_m=3), one_vehicle(5.0, MIDDLE, speed=5.0), layout=LAYOUT)
    assert leader is not None
    assert leader.gap_m == pytest.approx(5.0 - 4.72)


def test_faster_vehicle_right_ahead_of_the_ego_is_followed() -> None:
    assert follows(one_vehicle(5.2, MIDDLE, speed=14.0), speed=10.0)


@pytest.mark.parametrize(("side_gap", "followed"), [(0.15, True), (0.25, False)])
def test_vehicle_parallel_to_a_path_askew_on_the_road_takes_its_width_beside_it(side_gap: float, followed: bool) -> None:
    turned = float(np.arctan(0.2))
    along, beside = 20.0, 0.925 + 0.93 + side_gap
    x = along * np.cos(turned) + beside * np.sin(turned) - 1.4
    y = MIDDLE + along * np.sin(turned) - beside * np.cos(turned)
    found = leader_ahead(outlook(MIDDLE, slope=0.2), one_vehicle(x, y, speed=5.0, heading=turned), layout=LAYOUT)
    assert (found is not None) == followed


def test_driver_who_drifts_away_from_the_path_in_a_lane_that_ends_is_not_followed() -> None:
    assert not follows(drifting(20.0, side_gap=0.5, towards=-0.5), speed=20.0)


def test_truck_that_drifts_in_is_passed_later_than_a_car() -> None:
    # 16 m of it and the ego's 4.64 m are passed at 15 m/s in 1.7 s after the gap of 5 m: 0.85 m of drift and 0.2 m.
    turned = float(np.arcsin(0.5 / 15.0))
    reach = 1.85 / 2 * np.cos(turned) + 8.0 * np.sin(turned) + 0.93
    truck = one_vehicle(5.0 + 8.0 + 2.32, MIDDLE + reach + 0.95, speed=15.0, heading=-turned, length=16.0)
    car = drifting(5.0 + 2.4 + 2.32, side_gap=0.95)
    assert follows(truck, speed=30.0)
    assert not follows(car, speed=30.0)


def test_gap_counts_from_where_the_ego_is_on_its_path() -> None:
    ego = outlook(y=MIDDLE)
    ego = replace(ego, station=20.0, state=replace(ego.state, x=70.0))
    leader = leader_ahead(ego, one_vehicle(50.0, MIDDLE, speed=5.0), layout=LAYOUT)
    assert leader is not None
    assert leader.gap_m == pytest.approx(30.0 - 4.72)
