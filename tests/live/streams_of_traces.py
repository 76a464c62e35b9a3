"""Readings of made-up traces on a straight road of two lanes, whose left one is closed from 600 m to 1000 m."""

from collections.abc import Callable
from typing import Any

import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap, MappedLane
from wzsumo.live.ground import Ground
from wzsumo.live.trace.reading import Reading, read_trace
from wzsumo.road import Road

LENGTH_M, WIDTH_M = 1500.0, 3.6
CLOSED_M = (600.0, 1000.0)


def two_lane_map(*, closed: bool = True, sd_m: float = 0.08, first_s: float = 0.0) -> LaneMap:
    """The map of that road; stations every 20 m."""
    axis = Road(
        reference_line=np.array([[0.0, WIDTH_M], [LENGTH_M, WIDTH_M]]), lane_widths=(WIDTH_M, WIDTH_M), left_shoulder=3.0,
        right_shoulder=3.0,
    )  # fmt: skip
    stations = np.arange(0.0, LENGTH_M + 1, 20.0)
    sd = np.full(len(stations), sd_m)
    lanes = []
    for number in range(2):
        shut = closed and number == 1
        inside = shut & (stations >= CLOSED_M[0]) & (stations <= CLOSED_M[1])
        lanes.append(
            MappedLane(
                right=np.full(len(stations), number * WIDTH_M),
                left=np.full(len(stations), (number + 1) * WIDTH_M),
                right_sd=sd,
                left_sd=sd,
                p_open=np.repeat(np.where(inside, 0.03, 0.97)[:, None], 8, axis=1),
                n_traces=50,
            )
        )
    return LaneMap(
        axis=axis, stations=stations, lanes=tuple(lanes), n_traces=50, first_time_s=first_s, last_time_s=first_s
    )  # fmt: skip


def fixes(
    number: int, *, lane: Callable[[FloatArray], FloatArray], error_m: float = 0.5, seed: int = 1, start_s: float | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Stations, offsets, times of trace `number`: 25 m/s, each second; `lane` gives its place in lanes at stations."""
    random = np.random.default_rng([seed, number])
    time = np.arange(random.uniform(0, 1), LENGTH_M / 25.0, 1.0)
    station = 25.0 * time
    bias, slow = 0.9 * error_m * random.standard_normal(), 0.02 * error_m * random.standard_normal(len(time)).cumsum()
    offset = (lane(station) + 0.5) * WIDTH_M + bias + slow + np.hypot(0.2, 0.2 * error_m) * random.standard_normal(len(time))
    begin = 40.0 * number if start_s is None else start_s
    return station, offset, begin + time


def merges_at(number: int, *, by_m: float = CLOSED_M[0], seed: int = 1) -> Callable[[FloatArray], FloatArray]:
    """The lane of a driver: every other one begins in the left lane and leaves it over the 400 m ahead of `by_m`."""
    random = np.random.default_rng([seed, number, 7])
    at, length = by_m - 100.0 - 300.0 * random.random(), random.uniform(60, 100)
    if number % 2:
        return np.zeros_like
    return lambda station: 1.0 - np.clip((station - at) / length, 0.0, 1.0)


def keeps_lane(number: int) -> Callable[[FloatArray], FloatArray]:
    """A lane that is kept all along: the left one, or the right one."""
    return lambda station: np.full_like(station, float(number % 2 == 0))


def reading(ground: Ground, number: int, *, lane: Callable[[FloatArray], FloatArray], **how: Any) -> Reading:
    """What the ground makes of trace `number`."""
    found = read_trace(ground, *fixes(number, lane=lane, **how))
    assert found is not None
    return found
