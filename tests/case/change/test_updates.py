"""What a live map tells the ego of a lane that closes."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from live.streams_of_traces import fixes, keeps_lane, merges_at, reading, two_lane_map

from wzsumo.case.change.updates import Update, doubtful_stretches, updates_of
from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap
from wzsumo.live.alarms import Kind
from wzsumo.live.live_map import LiveMap, live_map, with_trace
from wzsumo.live.stream.arrivals import Arrival

Driver = Callable[[int], Callable[[FloatArray], FloatArray]]
MAP = two_lane_map(closed=False)


def arrivals(numbers: range, driver: Driver) -> list[Arrival]:
    found = []
    for number in numbers:
        station, offset, time = fixes(number, lane=driver(number))
        found.append(Arrival(key=str(number), points=MAP.axis.to_xy(station, offset), times=time, length=4.6))
    return found


@pytest.fixture(scope="module")
def settled() -> LiveMap:
    live = live_map(MAP)
    for number in range(120):
        step = with_trace(live, reading(live.ground, number, lane=keeps_lane(number)))
        assert step.alarm is None
        live = step.live
    return live


@pytest.fixture(scope="module")
def updates(settled: LiveMap) -> tuple[Update, ...]:
    return updates_of(settled, arrivals(range(120, 180), lambda n: merges_at(n, by_m=800.0)), doubtful_share=0.5)


def closed_m(lanes: LaneMap) -> float:
    return float(20.0 * (lanes.lanes[1].p_open_middle < 0.5).sum())


def test_first_update_is_the_map_as_it_was(settled: LiveMap, updates: tuple[Update, ...]) -> None:
    first = updates[0]
    assert first.lanes is settled.ground.lanes
    assert (first.redrawn, first.alarm, first.n_traces) == (False, None, 0)
    assert first.time_s == -np.inf


def test_lane_is_doubtful_before_it_is_drawn_closed_and_then_closed(updates: tuple[Update, ...]) -> None:
    alarmed = next(number for number, update in enumerate(updates) if update.alarm)
    update = updates[alarmed]
    assert update.alarm is not None
    assert update.alarm.change.kind is Kind.LANE_CLOSED
    assert update.redrawn
    assert update.n_traces <= 24
    assert closed_m(update.lanes) > 300.0
    doubted = [one for one in updates[:alarmed] if one.doubtful]
    assert doubted
    assert all(closed_m(one.lanes) == 0 for one in updates[:alarmed])
    low, high = doubted[-1].doubtful[0][0], doubted[-1].doubtful[-1][1]
    assert low < 800.0 < high + 400.0


def test_stretch_that_was_drawn_anew_is_doubtful_until_it_is_learned(updates: tuple[Update, ...]) -> None:
    alarmed = next(number for number, update in enumerate(updates) if update.alarm)
    drawn = updates[alarmed]
    inside = [(low, high) for low, high in drawn.doubtful if low < 900.0 < high]
    assert inside
    last = updates[-1]
    assert last.n_traces - drawn.n_traces >= 10
    assert not any(low < 900.0 < high for low, high in last.doubtful)


def test_updates_come_in_order_and_each_says_something_new(updates: tuple[Update, ...]) -> None:
    times = [update.time_s for update in updates]
    assert times == sorted(times)
    for before, after in pairwise(updates):
        assert after.redrawn or after.doubtful != before.doubtful


def test_unchanged_map_is_nowhere_doubtful_if_all_evidence_is_asked_for(settled: LiveMap) -> None:
    assert doubtful_stretches(settled, doubtful_share=1.0) == ()
    everywhere = doubtful_stretches(settled, doubtful_share=1e-9)
    assert np.ptp(everywhere) > 0
