from dataclasses import replace

import numpy as np
import pytest
from behaviour.outlooks import CAR, LANE, LAYOUT, MIDDLE, NOBODY, RIGHT, one_vehicle, outlook, vehicle_at
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.behaviour.ego_outlook import EgoOutlook
from wzsumo.behaviour.giving_way import yield_point_ahead
from wzsumo.traffic import Traffic


def yield_point(ego: EgoOutlook, traffic: Traffic) -> float | None:
    return yield_point_ahead(ego, traffic, layout=LAYOUT)


def yields(ego: EgoOutlook, traffic: Traffic) -> bool:
    return yield_point(ego, traffic) is not None


def test_ego_yields_to_a_vehicle_that_would_be_alongside_where_it_drifts_to() -> None:
    # In the next lane 20 m behind at 20 m/s: alongside after 2 s, when the ego has drifted 2 m towards it.
    ahead_m = yield_point(outlook(slope=0.1), one_vehicle(-20, MIDDLE, speed=20))
    # 3.66 m apart, half widths of 0.93 and 0.925 m and 0.5 m of margin leave 1.30 m; its front corner swings out by
    # 2.32 m x sin 5.7 degrees = 0.23 m: reached after 1.07 m of drift, less 0.14 m that the centre is ahead.
    assert ahead_m == pytest.approx(9.4, abs=0.2)


def test_ego_that_will_slow_down_before_it_drifts_yields_to_the_vehicle_that_then_comes_alongside() -> None:
    # 20 m behind at its own speed of 20 m/s. Braking with 2 m/s2 it comes 60 m far in 3.7 s, the other 74 m.
    steady = outlook(slope=0.02, speed=20.0, desired_speed=20.0)
    slowing = replace(steady, desired_speeds=np.full_like(steady.desired_speeds, 8.0))
    assert yield_point(steady, one_vehicle(-20, MIDDLE, speed=20.0)) is None
    assert yield_point(slowing, one_vehicle(-20, MIDDLE, speed=20.0)) == pytest.approx(60.0, abs=5.0)


def test_ego_does_not_yield_to_a_vehicle_that_passes_beside_its_straight_path() -> None:
    assert not yields(outlook(), one_vehicle(-20, MIDDLE, speed=20))


def test_ego_does_not_yield_to_the_driver_who_follows_in_its_own_lane() -> None:
    assert not yields(outlook(slope=0.1), one_vehicle(-20, RIGHT, speed=20))


def test_ego_does_not_yield_to_a_driver_who_is_past_when_it_comes_over() -> None:
    assert not yields(outlook(slope=0.1), one_vehicle(12, MIDDLE, speed=30))


@pytest.mark.parametrize(("behind_m", "yielded_to"), [(41, True), (49, False)])
def test_ego_yields_to_the_driver_behind_who_could_not_brake_and_to_no_other(behind_m: int, yielded_to: bool) -> None:
    # The ego comes over after 1.2 to 1.4 s. Closing at 10 m/s the other is 13 m nearer by then and needs
    # 2 + 10 + 100 / 8 = 24.5 m besides half the lengths of both, 4.7 m: 42 m behind is the border.
    assert yields(outlook(slope=0.08), one_vehicle(-behind_m, MIDDLE, speed=20)) == yielded_to


@pytest.mark.parametrize(("behind_m", "yielded_to"), [(28, True), (37, False)])
def test_ego_that_cannot_stop_any_more_goes_on_before_a_driver_who_can_still_brake(behind_m: int, yielded_to: bool) -> None:
    # It comes over in 9.4 m and would take 100 / 8 = 12.5 m to stop. After 0.9 to 1.1 s the other is 10 m nearer and needs
    # 0.5 + 10 + 100 / 18 = 16.1 m besides half the lengths of both, 4.7 m: 31 m behind is the border.
    assert yields(outlook(slope=0.1), one_vehicle(-behind_m, MIDDLE, speed=20)) == yielded_to


def test_standing_ego_looks_at_where_it_would_be_after_moving_off() -> None:
    # From standstill the lane is reached after sqrt(2 * 11.4 / 1.4) = 4.0 s; the other, 70 m behind at 18 m/s, is there then.
    assert yields(outlook(slope=0.1, speed=0.0), one_vehicle(-70, MIDDLE, speed=18))


@pytest.mark.parametrize(("stood_at", "yielded_to"), [(9, False), (16, True), (19, True)])
def test_ego_goes_on_before_a_standing_vehicle_and_yields_only_where_it_would_touch(stood_at: int, yielded_to: bool) -> None:
    # It comes over 12 to 15 m on; half lengths are 4.7 m together. From 9 m there are 1.3 m between the bumpers: less than is
    # left to a driver on the move, but they do not touch.
    assert yields(outlook(slope=0.1), one_vehicle(stood_at, MIDDLE, speed=0.0)) == yielded_to


def test_lanes_that_shift_together_bring_nobody_into_anothers_way() -> None:
    shifting = LAYOUT.area("shifting taper")
    drift = -LANE / shifting.length  # of the lanes, by 12 ft to the right
    x = shifting.start + 10
    path = outlook(MIDDLE + 10 * drift, slope=drift, x=x)
    other = vehicle_at(x, RIGHT + 10 * drift, heading=float(np.arctan(drift)), speed=12.0)
    assert not yields(path, other)


def test_empty_road_leaves_nobody_to_yield_to() -> None:
    assert not yields(outlook(slope=0.1), NOBODY)


@pytest.mark.parametrize(("ahead_m", "yielded_to"), [(60, True), (160, False)])
def test_ego_yields_to_oncoming_traffic_where_it_comes_over(ahead_m: int, yielded_to: bool) -> None:
    # It comes over after 1.5 s; closing at 25 m/s the other must be 2 + 25 + 625 / 8 + 4.7 = 110 m ahead then, 37 m more now.
    oncoming = one_vehicle(ahead_m, MIDDLE, speed=15, heading=np.pi)
    assert yields(outlook(slope=0.1), oncoming) == yielded_to


@given(ahead=st.floats(-150, 20), y=st.floats(-2, 11), speed=st.floats(0, 40), ego_speed=st.floats(0, 30))
def test_ego_that_keeps_straight_on_yields_to_nobody(ahead: float, y: float, speed: float, ego_speed: float) -> None:
    assert not yields(outlook(speed=ego_speed), one_vehicle(ahead, y, speed=speed))


def test_yield_point_stays_where_it_is_while_the_ego_slows_down() -> None:
    # Counted in whole time steps of the forecast it would come nearer by up to 2.5 m.
    points = [
        yield_point(outlook(slope=0.1, speed=v, desired_speed=v), one_vehicle(-2, MIDDLE, speed=v + 0.5))
        for v in (10.0, 8.0, 6.0, 5.0)
    ]
    assert points == pytest.approx([points[0]] * 4, abs=0.05)


def test_ego_stops_before_its_front_corner_is_in_the_others_way() -> None:
    path = outlook(slope=0.23)
    ahead_m = yield_point(path, one_vehicle(-3, MIDDLE, speed=11.0))
    assert ahead_m is not None
    x = path.state.x + ahead_m
    corners = CAR.outline(np.array([x, path.state.y + 0.23 * ahead_m, np.arctan(0.23)]))
    assert MIDDLE - 1.85 / 2 - corners[:, 1].max() == pytest.approx(0.5, abs=0.05)


def test_ego_does_not_creep_nearer_than_a_decimetre_to_a_vehicle_that_creeps_beside_it() -> None:
    # Askew by 5.7 degrees it takes 0.93 m x cos + 2.32 m x sin = 1.156 m to its side: 0.15 m are left, 0.1 m must be.
    beside = MIDDLE - 0.925 - 1.156 - 0.15
    path = outlook(y=beside - CAR.axle_to_centre_m * float(np.sin(np.arctan(0.1))), slope=0.1, speed=1.0, desired_speed=1.0)
    assert yield_point(path, one_vehicle(0.0, MIDDLE, speed=1.0)) == pytest.approx(0.5, abs=0.1)


def test_fast_ego_sees_where_it_comes_over_as_long_before_as_it_takes_to_stop_gently() -> None:
    # 1.30 m to the side at 8 : 1000 is 160 m ahead, 6.4 s at 25 m/s; to stop at 2 m/s2 takes 156 m.
    path = outlook(slope=0.008, speed=25.0, desired_speed=25.0)
    assert yield_point(path, one_vehicle(-20, MIDDLE, speed=28)) == pytest.approx(160, abs=5)
