from dataclasses import replace

import numpy as np
import pytest
import shapely
from behaviour.outlooks import CAR, LANE, LAYOUT, MIDDLE, NOBODY, RIGHT, one_vehicle, outlook, vehicle_at
from hypothesis import assume, given
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


@pytest.mark.parametrize(("behind_m", "yielded_to"), [(43.9, True), (44.6, False)])
def test_ego_yields_to_the_driver_behind_who_could_not_brake_and_to_no_other(behind_m: float, yielded_to: bool) -> None:
    # The ego comes over after 12.6 m; the forecast, with steps of 0.25 s, shows it over after 1.5 s and 14.95 m. Closing at
    # 10 m/s the other needs 2 + 10 + 100 / (2 x 4) = 24.5 m then, besides half of both lengths, 4.72 m: from 44.27 m behind.
    assert yields(outlook(slope=0.08), one_vehicle(-behind_m, MIDDLE, speed=20)) == yielded_to


@pytest.mark.parametrize(("behind_m", "yielded_to"), [(30.6, True), (31.1, False)])
def test_ego_that_cannot_stop_any_more_goes_on_before_a_driver_who_can_still_brake(behind_m: float, yielded_to: bool) -> None:
    # It comes over in 9.4 m and would take 100 / 8 = 12.5 m to stop. After 1 s and 9.95 m the other needs
    # 0.5 + 10 + 100 / (2 x 9) = 16.06 m, besides half the lengths of both, 4.72 m: from 30.83 m behind.
    assert yields(outlook(slope=0.1), one_vehicle(-behind_m, MIDDLE, speed=20)) == yielded_to


@pytest.mark.parametrize(("slope", "yielded_to"), [(0.088, False), (0.085, True)])
def test_ego_that_must_brake_harder_than_4_mps2_to_stop_a_metre_inside_the_others_way_cannot_wait(
    slope: float, yielded_to: bool
) -> None:
    # It comes over in 11.2 m or 11.7 m and takes 12.5 m to stop from 10 m/s. The driver 38 m behind can brake in an emergency.
    assert yields(outlook(slope=slope), one_vehicle(-38, MIDDLE, speed=20)) == yielded_to


@pytest.mark.parametrize(("behind_m", "yielded_to"), [(96.5, True), (98.5, False)])
def test_standing_ego_looks_at_where_it_would_be_after_moving_off(behind_m: float, yielded_to: bool) -> None:
    # With 1.4 m/s2 it comes over in 9.4 m, and is at 5.25 m/s and 9.8 m after 3.75 s. Closing at 12.75 m/s the other needs
    # 2 + 12.75 + 12.75^2 / 8 = 35.1 m, besides 4.72 m: from 97.5 m behind.
    assert yields(outlook(slope=0.1, speed=0.0), one_vehicle(-behind_m, MIDDLE, speed=18)) == yielded_to


@pytest.mark.parametrize(("ahead_m", "yielded_to"), [(13.8, True), (14.5, False)])
def test_ego_comes_over_behind_a_slower_vehicle_two_metres_ahead(ahead_m: float, yielded_to: bool) -> None:
    # After 1.5 s the ego is 14.95 m on, the other 7.5 m; half the lengths are 4.72 m: 14.17 m ahead is the border.
    assert yields(outlook(slope=0.08), one_vehicle(ahead_m, MIDDLE, speed=5)) == yielded_to


@pytest.mark.parametrize(("speed", "yielded_to"), [(0.25, False), (0.35, True)])
def test_vehicle_below_three_tenths_of_a_metre_per_second_counts_as_standing(speed: float, yielded_to: bool) -> None:
    assert yields(outlook(slope=0.1), one_vehicle(9, MIDDLE, speed=speed)) == yielded_to


@given(ahead=st.floats(-4, 12), beside=st.floats(2.0, 3.5), slope=st.floats(0.02, 0.3), left=st.booleans())
def test_ego_yields_to_a_standing_vehicle_just_where_their_outlines_would_touch(
    ahead: float, beside: float, slope: float, left: bool
) -> None:
    side = 1 if left else -1
    ego = outlook(MIDDLE, slope=side * slope, speed=2.0, desired_speed=2.0)
    other = one_vehicle(ahead, MIDDLE + side * beside, speed=0.0)
    driven = 0.5 * np.arange(21)  # at 2 m/s, for 5 s in steps of 0.25 s
    along = np.hypot(1.0, slope)
    poses = np.column_stack([50 + driven / along, MIDDLE + side * slope * driven / along, np.full(21, side * np.arctan(slope))])
    body = shapely.box(*(other.poses[0, :2] - (2.4, 0.925)), *(other.poses[0, :2] + (2.4, 0.925)))
    gap = np.atleast_1d(shapely.distance(shapely.polygons(CAR.outline(poses)), body))
    assume(gap[0] > 0.2)
    nearest_side = beside - 0.925 - 0.93 * np.cos(np.arctan(slope)) - 2.32 * np.sin(np.arctan(slope))
    assume(nearest_side - slope * CAR.axle_to_centre_m / along > 0.2)  # it is beside the ego's way at first
    if gap.min() == 0:
        assert yields(ego, other)
    if gap.min() > 0.29:  # 0.2 m along and across
        assert not yields(ego, other)


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


@pytest.mark.parametrize(("ahead_m", "yielded_to"), [(60, True), (146.5, True), (148, False)])
def test_ego_yields_to_oncoming_traffic_where_it_comes_over(ahead_m: float, yielded_to: bool) -> None:
    # After 1.5 s the ego is 14.95 m on, the other 22.5 m nearer. Closing at 25 m/s it needs 2 + 25 + 625 / 8 = 105.1 m then,
    # besides 4.72 m: from 147.3 m ahead.
    oncoming = one_vehicle(ahead_m, MIDDLE, speed=15, heading=np.pi)
    assert yields(outlook(slope=0.08), oncoming) == yielded_to


@pytest.mark.parametrize(("behind_m", "yielded_to"), [(149, True), (152, False)])
def test_ego_minds_vehicles_within_150_m(behind_m: float, yielded_to: bool) -> None:
    # Standing, it comes over after 3.7 s; at 40 m/s the other is there then, and could not brake before.
    assert yields(outlook(slope=0.1, speed=0.0), one_vehicle(-behind_m, MIDDLE, speed=40)) == yielded_to


@pytest.mark.parametrize(
    ("speed", "slope", "yielded_to"),
    [
        (10.0, 0.025, True),  # it comes over after 48 m, 4.8 s
        (10.0, 0.0235, False),  # 52 m, 5.2 s: beyond the 5 s at least
        (25.0, 0.0063, True),  # 203 m, 8.1 s
        (25.0, 0.006, False),  # 213 m, 8.5 s: beyond 25 / (2 x 2) s to where it could stop comfortably, and 2 s
    ],
)
def test_ego_looks_ahead_five_seconds_or_two_more_than_its_comfortable_braking_distance_takes(
    speed: float, slope: float, yielded_to: bool
) -> None:
    ego = outlook(slope=slope, speed=speed, desired_speed=speed, length_m=300)
    assert yields(ego, one_vehicle(-5, MIDDLE, speed=speed + 0.5)) == yielded_to


@pytest.mark.parametrize(("slope", "yielded_to"), [(0.0016, False), (0.003, True)])
def test_ego_that_nears_a_vehicle_beside_it_by_less_than_a_decimetre_does_not_yield(slope: float, yielded_to: bool) -> None:
    # 0.3 m are between them; in 5 s at 10 m/s it drifts by 0.08 m or 0.15 m.
    beside = MIDDLE - 0.925 - 0.93 - 0.3 - (1.4 + 2.32) * slope
    ego = outlook(beside, slope=slope)
    assert yields(ego, one_vehicle(0.0, MIDDLE, speed=10.0)) == yielded_to


@pytest.mark.parametrize("overlap_m", [0.1, 0.4, 1.0])
def test_ego_that_overlaps_a_vehicle_sideways_does_not_yield_to_it_however_it_moves(overlap_m: float) -> None:
    beside = MIDDLE - 0.925 - 0.93 + overlap_m - (1.4 + 2.32) * 0.1
    assert not yields(outlook(beside, slope=0.1), one_vehicle(-12, MIDDLE, speed=20.0))


def test_vehicle_in_the_nearest_lane_keeps_its_place_beside_the_middle_of_that_lane() -> None:
    # 0.3 m to the left of its lane's middle it is 3 m farther on before the ego that comes over by 1 : 10 is in its way.
    middle, aside = (yield_point(outlook(slope=0.1), one_vehicle(-20, MIDDLE + left, speed=20)) for left in (0.0, 0.3))
    assert middle is not None
    assert aside == pytest.approx(middle + 0.3 / 0.1 * np.hypot(1.0, 0.1), abs=0.01)


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
