import numpy as np
import pytest

from wzsumo.frames import FloatArray
from wzsumo.planning.lane_route import LaneLine, lane_cost, route_offsets

STATIONS = np.linspace(0.0, 1000.0, 201)
OFFSETS = np.arange(-3.0, 12.0, 0.1)
FREE = np.zeros((len(STATIONS), len(OFFSETS)), dtype=bool)
RIGHT, LEFT = 1.8, 5.4


def straight(offset: float, first: float = 0.0, last: float = 1000.0, *, weight: float = 1.0) -> LaneLine:
    return LaneLine(stations=np.array([first, last]), offsets=np.full(2, offset), weight=weight)


def route(*lines: LaneLine, ends: tuple[float, float], speed: float = 25.0, blocked: np.ndarray = FREE) -> FloatArray:
    return route_offsets(STATIONS, lines, ends=ends, offsets=OFFSETS, speed_mps=speed, blocked=blocked)


def test_route_keeps_its_lane() -> None:
    np.testing.assert_allclose(route(straight(RIGHT), straight(LEFT), ends=(LEFT, LEFT)), LEFT, atol=1e-9)


def test_route_changes_lanes_once_over_the_length_of_a_comfortable_change() -> None:
    offsets = route(straight(RIGHT), straight(LEFT), ends=(RIGHT, LEFT))
    assert (np.diff(offsets) >= -1e-9).all()
    between = STATIONS[(offsets > RIGHT + 0.2) & (offsets < LEFT - 0.2)]
    # 4.6 s at 25 m/s are 115 m; the middles of lanes cost less than 1 a metre, so a little less or more is cheapest.
    assert 70 < np.ptp(between) < 160


@pytest.mark.parametrize("speed", [10.0, 20.0, 30.0])
def test_change_takes_4_6_seconds_at_any_speed(speed: float) -> None:
    offsets = route(straight(RIGHT), straight(LEFT), ends=(RIGHT, LEFT), speed=speed)
    twentieth = (LEFT - RIGHT) / 20
    first, last = np.interp([RIGHT + twentieth, LEFT - twentieth], offsets, STATIONS)
    assert last - first == pytest.approx(4.6 * speed, rel=0.2)


def test_route_leaves_a_lane_that_ends_and_returns_where_it_begins_again() -> None:
    lines = (straight(RIGHT), straight(LEFT, 0.0, 400.0), straight(LEFT, 700.0, 1000.0))
    closed = FREE.copy()
    closed[np.ix_((STATIONS > 400) & (STATIONS < 700), OFFSETS > 3.6)] = True
    offsets = route(*lines, ends=(LEFT, LEFT), blocked=closed)
    inside = (STATIONS > 440) & (STATIONS < 660)
    np.testing.assert_allclose(offsets[inside], RIGHT, atol=0.5)
    assert offsets[0] == offsets[-1] == pytest.approx(LEFT)


def test_route_follows_a_shift_of_the_road_and_stays_in_its_lane() -> None:
    s = np.array([0.0, 400.0, 500.0, 1000.0])
    shift = np.array([0.0, 0.0, -3.6, -3.6])
    right, left = LaneLine(stations=s, offsets=RIGHT + shift), LaneLine(stations=s, offsets=LEFT + shift)
    offsets = route(right, left, ends=(LEFT, LEFT - 3.6))
    np.testing.assert_allclose(offsets, np.interp(STATIONS, s, LEFT + shift), atol=0.3)


def test_vehicles_that_changed_lanes_are_no_lane_to_follow() -> None:
    changers = LaneLine(stations=np.array([300.0, 420.0]), offsets=np.array([LEFT, RIGHT]), weight=0.1)
    np.testing.assert_allclose(route(straight(RIGHT), straight(LEFT), changers, ends=(LEFT, LEFT)), LEFT, atol=0.11)


def test_lane_of_few_and_of_many_is_followed_in_the_middle_of_its_lines() -> None:
    few = (straight(LEFT - 0.2, weight=0.2), straight(LEFT + 0.2, weight=0.2))
    np.testing.assert_allclose(route(straight(RIGHT, weight=5.0), *few, ends=(LEFT, LEFT)), LEFT, atol=0.11)
    outermost = (straight(LEFT, weight=1.0), straight(LEFT - 0.9, weight=0.1))  # one fellow near the line to the next lane
    np.testing.assert_allclose(route(straight(RIGHT), *outermost, ends=(LEFT, LEFT)), LEFT, atol=0.11)


def test_ground_that_the_map_has_not_free_is_gone_around() -> None:
    blocked = FREE.copy()
    blocked[np.ix_((STATIONS > 450) & (STATIONS < 550), OFFSETS > 3.6)] = True
    offsets = route(straight(RIGHT), straight(LEFT), ends=(LEFT, LEFT), blocked=blocked)
    assert (offsets[(STATIONS > 450) & (STATIONS < 550)] <= 3.6).all()


@pytest.mark.parametrize("speed", [10.0, 25.0])
@pytest.mark.parametrize(("blocked_m", "lane"), [(15.0, LEFT), (40.0, RIGHT)])
def test_lane_is_kept_past_15_m_that_are_not_free_and_left_for_40_m_at_any_speed(
    blocked_m: float, lane: float, speed: float
) -> None:
    blocked = FREE.copy()  # a wall across the left lane, 0.93 m being half a vehicle
    blocked[np.ix_((STATIONS >= 500) & (500 + blocked_m > STATIONS), OFFSETS > 3.6 - 0.93)] = True
    offsets = route(straight(RIGHT), straight(LEFT), ends=(LEFT, LEFT), blocked=blocked, speed=speed)
    assert np.interp(500 + blocked_m / 2, STATIONS, offsets) == pytest.approx(lane, abs=1.0)


def test_cost_is_0_in_the_middles_of_lanes_and_1_between_and_beside_them() -> None:
    lines = np.array([[RIGHT], [LEFT]])
    cost = lane_cost(OFFSETS, lines, weights=np.array([1.0, 0.2]))[0]
    at = {offset: cost[np.argmin(np.abs(OFFSETS - offset))] for offset in (RIGHT, LEFT, 3.6, -1.0)}
    assert (at[RIGHT], at[LEFT]) == (pytest.approx(0, abs=1e-6), pytest.approx(0, abs=1e-6))
    assert min(at[3.6], at[-1.0]) > 0.95


def test_part_of_a_line_ends_where_it_is_cut() -> None:
    line = LaneLine(stations=np.array([0.0, 100.0, 200.0]), offsets=np.array([0.0, 1.0, 3.0]), weight=0.3)
    part = line.between(50.0, 150.0)
    assert part is not None
    assert part.stations.tolist() == [50.0, 100.0, 150.0]
    assert part.offsets.tolist() == [0.5, 1.0, 2.0]
    assert part.weight == 0.3
    assert line.between(200.0, 300.0) is None
    assert np.isnan(line.at(np.array([-1.0, 201.0]))).all()
