import numpy as np
import pytest
from behaviour.outlooks import CAR, LANE, LAYOUT, LEFT, MIDDLE, NOBODY, RIGHT, one_vehicle, outlook, together, vehicle_at
from builders import by_turns_layout

from wzsumo.behaviour.ego_outlook import EgoOutlook
from wzsumo.behaviour.speed_plan_spec import SpeedPlanSpec
from wzsumo.behaviour.ways_of_others import WaysOfOthers, ways_of_others
from wzsumo.traffic import Traffic

TIMES = np.arange(0.0, 8.01, 0.25)
BOTH = (4.8 + CAR.length_m) / 2  # half of the two lengths


def ways(ego: EgoOutlook, traffic: Traffic) -> WaysOfOthers:
    return ways_of_others(ego, traffic, layout=LAYOUT, times=TIMES, spec=SpeedPlanSpec())


def test_vehicle_ahead_in_the_lane_is_in_the_way_from_here_on() -> None:
    found = ways(outlook(), one_vehicle(30.0, RIGHT, speed=7.0))
    assert found.enters.tolist() == [0.0]
    np.testing.assert_allclose(found.near[0], 30 - BOTH + 7 * TIMES, atol=0.02)
    np.testing.assert_allclose(found.far[0], 30 + BOTH + 7 * TIMES, atol=0.02)


def test_driver_who_brakes_brakes_on_for_two_seconds_and_does_not_drive_back() -> None:
    found = ways(outlook(), one_vehicle(30.0, RIGHT, speed=10.0, acceleration=-3.0))
    assert found.speeds[0, [4, 8, 32]] == pytest.approx([7.0, 4.0, 4.0])
    assert found.near[0, 8] == pytest.approx(30 - BOTH + 10 * 2 - 3 * 2, abs=0.1)
    stopping = ways(outlook(), one_vehicle(30.0, RIGHT, speed=3.0, acceleration=-3.0))
    assert stopping.speeds[0, 4:].max() == 0
    speeding_up = ways(outlook(), one_vehicle(30.0, RIGHT, speed=10.0, acceleration=2.0))
    assert speeding_up.speeds[0].max() == 10.0


@pytest.mark.parametrize("ahead_m", [-20.0, 0.0, 20.0])
def test_vehicle_beside_a_straight_path_is_not_in_the_way(ahead_m: float) -> None:
    assert len(ways(outlook(), one_vehicle(ahead_m, MIDDLE, speed=10)).enters) == 0


@pytest.mark.parametrize(("ahead_m", "found"), [(240.0, 1), (260.0, 0)])
def test_vehicles_within_250_m_are_minded(ahead_m: float, found: int) -> None:
    assert len(ways(outlook(length_m=400), one_vehicle(ahead_m, RIGHT, speed=5)).enters) == found


def test_driver_who_follows_in_the_lane_is_left_out() -> None:
    assert len(ways(outlook(slope=0.1), one_vehicle(-20, RIGHT, speed=20)).enters) == 0


def test_ego_that_drifts_comes_into_the_way_where_half_a_metre_is_left() -> None:
    found = ways(outlook(slope=0.1), one_vehicle(-20, MIDDLE, speed=20))
    # 3.66 m apart, half widths of 0.93 and 0.925 m and 0.5 m leave 1.30 m; the front corner swings out by 0.23 m: after 1.07 m
    # of drift, less 0.14 m that the centre is ahead: 9.4 m, and the next place that is looked at is 10 m.
    assert found.enters.tolist() == [10.0]
    np.testing.assert_allclose(found.far[0], -20 + BOTH + 20 * TIMES, atol=1.0)


def test_vehicle_that_is_passed_more_closely_already_is_in_the_way_only_where_it_comes_nearer() -> None:
    beside = RIGHT + 0.93 + 0.925 + 0.3  # 0.3 m between the sides
    assert len(ways(outlook(), one_vehicle(5.0, beside, speed=10)).enters) == 0
    assert len(ways(outlook(slope=0.02), one_vehicle(5.0, beside, speed=10)).enters) == 1


@pytest.mark.parametrize(("drifts_m", "found"), [(0.3, 0), (0.45, 0), (0.6, 1), (3.66, 1)])
def test_vehicle_behind_on_the_line_is_in_the_way_only_of_an_ego_that_comes_over(drifts_m: float, found: int) -> None:
    """It comes from behind, half in the next lane, 0.2 m between the sides: an ego that keeps its lane need not let it pass.

    The path drifts over 200 m. For such a vehicle the ego braked at 6 m/s2 and stood in a live lane.
    """
    on_the_line = RIGHT + 0.93 + 0.925 + 0.2
    ego = outlook(slope=drifts_m / 200, length_m=200)
    assert len(ways(ego, one_vehicle(-100.0, on_the_line, speed=22)).enters) == found


def test_driver_in_a_lane_that_ends_drifts_on_and_one_in_another_lane_does_not() -> None:
    # 0.5 m/s to the right for the 2 s until the ego is there.
    turned = float(np.arcsin(0.5 / 15))
    side = MIDDLE + 0.93 + 0.925 + 1.0
    drifting = one_vehicle(30.0, side, speed=15.0, heading=-turned)
    assert len(ways(outlook(y=MIDDLE, speed=16.0), drifting).enters) == 1
    straight = one_vehicle(30.0, side, speed=15.0)
    assert len(ways(outlook(y=MIDDLE, speed=16.0), straight).enters) == 0
    from_the_right = one_vehicle(30.0, MIDDLE - 0.93 - 0.925 - 1.0, speed=15.0, heading=turned)
    assert len(ways(outlook(y=MIDDLE, speed=16.0), from_the_right).enters) == 0


@pytest.mark.parametrize(("sideways", "found"), [(0.15, 0), (0.18, 1)])
def test_driver_who_drifts_out_of_an_ending_lane_is_taken_to_do_so_for_three_seconds(sideways: float, found: int) -> None:
    # 1.0 m between the sides, of which 0.5 m must be left: 0.167 m/s for 3 s. The ego is there after 5 s.
    side = MIDDLE + 0.93 + 0.925 + 1.0
    drifting = one_vehicle(80.0, side, speed=15.0, heading=-float(np.arcsin(sideways / 15)))
    assert len(ways(outlook(y=MIDDLE, speed=16.0), drifting).enters) == found


def test_driver_who_changes_lanes_goes_on_to_the_middle_and_one_who_does_not_keeps_its_place() -> None:
    # 1.2 m to the right of its lane's middle: with 1.0 m/s it is there after 1.2 s.
    side, speed = MIDDLE - 1.2, 16.0
    for sideways, found in ((0.0, 1), (1.0, 0), (-1.0, 1)):
        other = one_vehicle(-30.0, side, speed=speed, heading=float(np.arcsin(sideways / speed)))
        assert len(ways(outlook(slope=0.005, length_m=150), other).enters) == found


@pytest.mark.parametrize(("ahead_m", "speed"), [(30.0, 17.0), (-30.0, 15.0), (-30.0, 25.0), (2.0, 15.0)])
def test_driver_who_comes_over_faster_than_the_ego_or_behind_it_minds_the_ego(ahead_m: float, speed: float) -> None:
    turned = float(np.arcsin(0.5 / speed))
    coming = one_vehicle(ahead_m, MIDDLE + 0.93 + 0.925 + 1.0, speed=speed, heading=-turned)
    assert len(ways(outlook(y=MIDDLE, speed=16.0), coming).enters) == 0


@pytest.mark.parametrize("beyond_m", [3.0, 60.0])
def test_driver_from_the_other_side_waits_at_the_stop_line_of_the_shared_lane(beyond_m: float) -> None:
    layout = by_turns_layout()
    assert layout.taking_turns is not None
    line, shared = layout.taking_turns.end, 1.5 * LANE
    ego = outlook(shared, speed=15.0, x=line - 150.0)
    coming = vehicle_at(line + 2.4 + beyond_m, shared, speed=15.0, heading=np.pi)
    found = ways_of_others(ego, coming, layout=layout, times=TIMES, spec=SpeedPlanSpec())
    # Its front stops at the line, which is 150 m from the ego's rear axle: its tail, less half of the ego, is 3.7 m nearer.
    assert found.near[0].min() == pytest.approx(150.0 - CAR.axle_to_centre_m + 2.4 - BOTH, abs=0.05)
    inside = vehicle_at(line - 10.0, shared, speed=15.0, heading=np.pi)  # one that has passed the line drives on
    passing = ways_of_others(ego, inside, layout=layout, times=TIMES, spec=SpeedPlanSpec())
    assert passing.near[0, -1] == pytest.approx(passing.near[0, 0] - 15.0 * 8, abs=0.1)


def test_each_vehicle_has_a_way_of_its_own_and_nobody_has_none() -> None:
    found = ways(
        outlook(),
        together(one_vehicle(30.0, RIGHT, speed=7), one_vehicle(40.0, LEFT, speed=7), one_vehicle(80.0, RIGHT, speed=9)),
    )
    assert found.near[:, 0] == pytest.approx([30 - BOTH, 80 - BOTH], abs=0.02)
    assert ways(outlook(), NOBODY).near.shape == (0, len(TIMES))


def test_vehicle_beyond_the_end_of_the_path_is_in_the_way_all_the_same() -> None:
    found = ways(outlook(length_m=40), one_vehicle(60.0, RIGHT, speed=0.0))
    assert found.near[0, 0] == pytest.approx(60 - BOTH, abs=0.05)


def test_lane_width_of_the_tests_is_that_of_the_paper() -> None:
    assert pytest.approx(3.6576) == LANE
