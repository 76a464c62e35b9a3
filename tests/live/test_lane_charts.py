"""The lane charts, fed with ways of which all is known, and what is drawn of a closed lane."""

import numpy as np
import pytest
from live.streams_of_traces import two_lane_map

from wzsumo.live.charts.findings import Family, Finding
from wzsumo.live.charts.lane_charts import LaneCharts, add_use, first_lane_charts
from wzsumo.live.ground import Ground, ground_of
from wzsumo.live.redraw import with_lane_change
from wzsumo.live.trace.decoding import Ways
from wzsumo.live.trace.lane_use import use_of_lanes
from wzsumo.live.trace.recent import RecentTrace


def with_drivers(charts: LaneCharts, ground: Ground, left_at: list[int], *, first: int) -> LaneCharts:
    """The charts after vehicles that drive in the left lane and leave it at the cells `left_at`, a minute apart."""
    for number, cell in enumerate(left_at, start=first):
        places = np.where(np.arange(len(ground.cells)) <= cell, 3, 0).astype(np.int16)
        use = use_of_lanes(ground, Ways(places=places[None], weights=np.ones(1)))
        charts = add_use(charts, use, ground, kind=0, slow=False, now_s=60.0 * number, number=number)
    return charts


def test_a_start_that_moves_is_noticed_though_drivers_leave_from_the_road_s_beginning_on() -> None:
    """Drivers leave evenly over the 600 m ahead of the closure, and then over the 300 m ahead of one that begins earlier.

    So each leaves the lane where some did before. What tells is that none leaves later: of places twice as likely as before
    each driver says ln 2 at most.
    """
    ground, random = ground_of(two_lane_map()), np.random.default_rng(4)
    charts = with_drivers(first_lane_charts(ground), ground, list(random.integers(0, 24, 400)), first=1)
    assert charts.ends[0, 1].max() < 8.0
    charts = with_drivers(charts, ground, list(random.integers(0, 12, 40)), first=401)
    assert charts.ends[0, 1].argmax() == 0  # 300 m earlier
    assert 0.5 * 40 * np.log(2) < charts.ends[0, 1, 0] < 40 * np.log(2) + 4.0


def test_one_who_leaves_a_lane_that_hardly_any_leave_says_as_much_as_any_trace_may() -> None:
    ground = ground_of(two_lane_map(closed=False))
    stay = [len(ground.cells)] * 300
    charts = with_drivers(first_lane_charts(ground), ground, stay, first=1)
    charts = with_drivers(charts, ground, [20, 21, 22, 23], first=301)
    assert charts.closing[0, 1, 30] == pytest.approx(4 * np.log(0.97 / 0.02), rel=0.02)


def test_a_lane_is_drawn_closed_as_far_as_nobody_drives_though_two_receivers_are_a_lane_off() -> None:
    ground = ground_of(two_lane_map(closed=False))
    m = len(ground.cells)
    traces = []
    for number in range(30):
        last = m - 4 if number in (7, 19) else 18 if number % 3 == 0 else -1  # behind it the trace drives in the right lane
        left = (np.arange(m) <= last).astype(float)
        traces.append(
            RecentTrace(
                number=number, start_s=0.0, end_s=1.0, residual=np.zeros(m), in_lane=np.array([1 - left, left]),
                noise=0.1, walk=0.01,
            )
        )  # fmt: skip
    found = Finding(family=Family.CLOSING, evidence=15.0, at=(0, 1, 24), since=0)
    drawn, change = with_lane_change(ground, found, tuple(traces))
    assert change.start_m is not None
    assert change.start_m == pytest.approx(ground.cells[19], abs=50.0)
    assert (drawn.lanes[1].p_open_middle[drawn.stations > 500.0] < 0.2).all()
