"""LiveMap: changes are found and named, none is found where there is none, and it stays as small as it began."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from live.streams_of_traces import CLOSED_M, keeps_lane, merges_at, reading, two_lane_map

from wzsumo.frames import FloatArray
from wzsumo.lane_map import MappedBranch
from wzsumo.live.alarms import Alarm, Kind
from wzsumo.live.live_map import LiveMap, live_map, with_trace
from wzsumo.live.stream.state_file import state_bytes

Driver = Callable[[int], Callable[[FloatArray], FloatArray]]


def driven(live: LiveMap, numbers: range, driver: Driver) -> tuple[LiveMap, list[Alarm]]:
    alarms = []
    for number in numbers:
        step = with_trace(live, reading(live.ground, number, lane=driver(number)))
        live = step.live
        alarms += [step.alarm] if step.alarm else []
    return live, alarms


@pytest.fixture(scope="module")
def settled() -> LiveMap:
    """A live map that 120 traces went through, in the world that it shows."""
    live, alarms = driven(live_map(two_lane_map()), range(120), merges_at)
    assert alarms == []
    return live


def moved(number: int, *, by_m: float, start: float, end: float) -> Callable[[FloatArray], FloatArray]:
    own = merges_at(number)
    return lambda s: own(s) + by_m / 3.6 * ((s > start) & (s < end))


def test_an_unchanged_zone_raises_no_alarm(settled: LiveMap) -> None:
    _, alarms = driven(settled, range(120, 300), merges_at)
    assert alarms == []


@pytest.mark.parametrize("by_m", [1.0, -1.0])
def test_lanes_that_moved_are_named_with_size_and_place(settled: LiveMap, by_m: float) -> None:
    live, alarms = driven(settled, range(120, 140), lambda n: moved(n, by_m=by_m, start=700, end=1200))
    assert len(alarms) == 1
    change = alarms[0].change
    assert change.kind is Kind.SHIFTED
    assert change.lane is None
    assert alarms[0].trace <= 120 + 8
    assert change.size_m == pytest.approx(by_m, abs=0.25)
    assert change.start_m == pytest.approx(700, abs=50)
    assert change.end_m == pytest.approx(1200, abs=50)
    drawn = live.ground.lanes.lanes[0].middle
    stations = live.ground.lanes.stations
    assert np.median(drawn[(stations > 760) & (stations < 1140)]) == pytest.approx(1.8 + by_m, abs=0.15)
    assert np.abs(drawn[(stations < 640) | (stations > 1260)] - 1.8).max() < 0.05


def leaving(live: LiveMap, first: int, *, apart_s: float, driver: Driver) -> tuple[LiveMap, list[Alarm]]:
    """After six traces that come `apart_s` after each other, and drive as `driver` says."""
    alarms = []
    for number in range(first, first + 6):
        start_s = 40.0 * first + apart_s * (number - first)
        step = with_trace(live, reading(live.ground, number, lane=driver(number), start_s=start_s))
        live = step.live
        alarms += [step.alarm] if step.alarm else []
    return live, alarms


def test_a_platoon_that_steps_aside_as_a_whole_is_no_change_but_as_many_vehicles_apart_are_one(settled: LiveMap) -> None:
    def aside(number: int) -> Callable[[FloatArray], FloatArray]:
        return moved(number, by_m=1.2, start=700, end=1200)

    _, together = leaving(settled, 120, apart_s=1.5, driver=aside)
    assert together == []
    _, apart = leaving(settled, 120, apart_s=40.0, driver=aside)
    assert apart[0].change.kind is Kind.SHIFTED


def test_a_platoon_that_leaves_its_lane_is_no_change_but_as_many_vehicles_apart_are_one() -> None:
    live, _ = driven(live_map(two_lane_map(closed=False)), range(100), keeps_lane)

    def leaves(number: int) -> Callable[[FloatArray], FloatArray]:
        return merges_at(2 * number, by_m=800.0)

    _, together = leaving(live, 100, apart_s=1.5, driver=leaves)
    assert together == []
    drawn, apart = leaving(live, 100, apart_s=8.0, driver=leaves)
    assert apart[0].change.kind is Kind.LANE_CLOSED
    # Closed is drawn from where the drivers left on, though it likely begins half a gap between them later.
    driven_up_to = drawn.ground.cells[max(trace.in_lane[1].nonzero()[0].max() for trace in drawn.recent[-6:])]
    first = drawn.ground.lanes.stations[drawn.ground.lanes.lanes[1].p_open_middle < 0.5].min()
    assert apart[0].change.start_m is not None
    assert driven_up_to - 50.0 < first < apart[0].change.start_m


def test_a_lane_that_is_closed_is_named_and_drawn_closed() -> None:
    live, alarms = driven(live_map(two_lane_map(closed=False)), range(100), keeps_lane)
    assert alarms == []
    live, alarms = driven(live, range(100, 130), lambda n: merges_at(n, by_m=800.0))
    assert alarms[0].change.kind is Kind.LANE_CLOSED
    assert alarms[0].change.lane == 1
    assert alarms[0].trace <= 100 + 24
    assert alarms[0].change.start_m == pytest.approx(750, abs=120)
    stations = live.ground.lanes.stations
    assert (live.ground.lanes.lanes[1].p_open_middle[(stations > 900) & (stations < 1300)] < 0.2).all()
    assert (live.ground.lanes.lanes[0].p_open_middle > 0.9).all()


def test_a_lane_that_all_leave_long_before_it_closes_is_named() -> None:
    """Vehicles merge 450 to 950 m ahead of the closure, as after a sign: none is in the lane over its last 400 m."""

    def early(number: int) -> Callable[[FloatArray], FloatArray]:
        at = 1300.0 - 450.0 - 500.0 * np.random.default_rng([3, number]).random()
        return np.zeros_like if number % 2 else lambda station: 1.0 - np.clip((station - at) / 80.0, 0.0, 1.0)

    live, alarms = driven(live_map(two_lane_map(closed=False)), range(100), keeps_lane)
    assert alarms == []
    live, alarms = driven(live, range(100, 150), early)
    assert alarms[0].change.kind is Kind.LANE_CLOSED
    assert alarms[0].change.lane == 1
    assert (live.ground.lanes.lanes[1].p_open_middle[-10:] < 0.2).all()


def test_a_lane_that_is_driven_again_is_named_and_drawn_open(settled: LiveMap) -> None:
    live, alarms = driven(settled, range(120, 140), keeps_lane)
    assert alarms[0].change.kind is Kind.LANE_OPEN
    assert alarms[0].change.lane == 1
    assert alarms[0].trace <= 120 + 12
    stations = live.ground.lanes.stations
    inside = (stations > CLOSED_M[0] + 40) & (stations < CLOSED_M[1] - 40)
    assert (live.ground.lanes.lanes[1].p_open_middle[inside] > 0.8).all()


def test_a_lane_that_is_driven_again_is_named_though_the_map_has_it_closed_in_two_stretches() -> None:
    lanes = two_lane_map()
    gap = (lanes.stations > 400) & (lanes.stations < 580)
    p_open = lanes.lanes[1].p_open.copy()
    p_open[(lanes.stations >= 200) & (lanes.stations <= 400)] = 0.03
    assert (p_open[gap] > 0.9).all()
    live = live_map(replace(lanes, lanes=(lanes.lanes[0], replace(lanes.lanes[1], p_open=p_open))))
    alarms = []
    for number in range(125):
        lane = keeps_lane(number) if number >= 100 else np.zeros_like
        step = with_trace(live, reading(live.ground, number, lane=lane, error_m=1.0))
        live = step.live
        alarms += [step.alarm] if step.alarm else []
    assert [alarm.change.kind for alarm in alarms[:1]] == [Kind.LANE_OPEN]
    assert alarms[0].trace > 100


def test_a_zone_that_is_gone_before_the_first_trace_is_no_habit_and_no_error_of_receivers() -> None:
    """The map is of yesterday; today half of 40 vehicles keep the lane that it has closed, from the first trace on."""
    live, alarms = driven(live_map(two_lane_map()), range(40), keeps_lane)
    assert [alarm.change.kind for alarm in alarms] == [Kind.LANE_OPEN]
    assert live.error_m < 1.0  # that of the receivers is 0.5 m, and nobody errs by a lane


def test_a_closed_road_is_named_after_four_vehicles(settled: LiveMap) -> None:
    live = settled
    for number in range(120, 124):
        found = reading(live.ground, number, lane=merges_at(number))
        last = 28 - number % 2
        shorter = {"found": found.found & (np.arange(60) <= last), "seen": found.seen & (np.arange(60) <= last), "last": last}
        step = with_trace(live, type(found)(**(vars(found) | shorter)))
        live = step.live
        if step.alarm:
            break
    assert step.alarm is not None
    assert step.alarm.change.kind is Kind.ROAD_CLOSED
    assert step.alarm.change.start_m == pytest.approx(700, abs=60)


def test_an_exit_that_nobody_takes_any_more_is_named_after_twelve_missed_ones() -> None:
    along = np.arange(0.0, 250.0, 10.0)
    lanes = two_lane_map()
    line = lanes.axis.to_xy(300.0 + along, 1.8 - 0.08 * along)
    branch = MappedBranch(line=line, width=np.full(len(along), 3.2), p_open=0.95, n_traces=10)
    live = live_map(replace(lanes, branches=(branch,)))

    def takes_exit(number: int) -> Callable[[FloatArray], FloatArray]:
        if number % 4:
            return merges_at(number)
        return lambda s: -np.clip(s - 300.0, 0.0, 250.0) * 0.08 / 3.6

    live, alarms = driven(live, range(160), takes_exit)
    assert alarms == []
    live, alarms = driven(live, range(160, 240), merges_at)
    assert alarms[0].change.kind is Kind.EXIT_CLOSED
    assert alarms[0].trace - 160 <= 12 * 4
    assert live.ground.lanes.branches[0].p_open < 0.2


def test_a_long_gap_between_traces_is_told_as_silence_and_changes_no_lane(settled: LiveMap) -> None:
    late = reading(settled.ground, 120, lane=merges_at(120), start_s=40.0 * 119 + 40.0 * 30)
    step = with_trace(settled, late)
    assert step.alarm is not None
    assert step.alarm.change.kind is Kind.SILENCE
    assert step.live.version == settled.version


def test_a_live_map_is_as_large_after_300_traces_as_after_120(settled: LiveMap) -> None:
    live, _ = driven(settled, range(120, 300), merges_at)
    assert len(live.recent) == len(settled.recent)
    assert len(state_bytes(live, {})) < 1.2 * len(state_bytes(settled, {}))


def test_ground_without_witnesses_is_worth_half_after_a_half_life(settled: LiveMap) -> None:
    day = 24 * 3600.0
    late = reading(settled.ground, 121, lane=np.zeros_like, start_s=settled.now_s + day)
    aged = with_trace(settled, late).live.lanes_now(half_life_s=day)
    now = settled.lanes_now(half_life_s=day)
    assert aged.lanes[0].p_open_middle[30] == pytest.approx(0.97, abs=0.01)  # driven just now
    before, after = now.lanes[1].p_open_middle[10], aged.lanes[1].p_open_middle[10]
    assert after - 0.5 == pytest.approx((before - 0.5) / 2, abs=0.02)
