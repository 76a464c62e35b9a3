"""Lane changes within traces: the likeliest sequence of lanes, relative to the first, beside an offset that may drift.

A trace's own error is unknown but slow, a lane change is quick: a Viterbi search over lanes in which every path carries a
Kalman filter of the offset ("per-survivor processing", Raheli, Polydoros and Tzou 1995) tells them apart at any error.
"""

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray, IntArray

MAX_LANES_MOVED = 3  # to either side of the first lane
CHANGE_STATIONS = np.array([1, 4, 8, 12])  # tried lengths of a change: 10 m (a simulator's jump) to 120 m
CHANGE_COST = 8.0  # -log of the chance of a change at a station: about one in 3000, one in 30 km
_CLIP = 16.0  # normalised square at which a residual counts as an outlier


def relative_lanes(
    departures: FloatArray, widths: FloatArray, *, drift_variance: float, white_variance: float
) -> tuple[FloatArray, float]:
    """Lanes (traces, stations) from each first one, positive to the left, fractional during a change; and the cost of all.

    `departures` (traces, stations) [m] are lateral offsets from the common path, NaN where unknown; `widths` (stations,)
    [m] the lanes' widths; `drift_variance` [m^2] is that of the drift from one station to the next.
    """
    lanes, cost = _search_all(departures, widths, drift_variance, white_variance, CHANGE_COST, CHANGE_STATIONS)
    return np.asarray(lanes), float(cost)


@njit(cache=True)
def _search_all(
    departures: FloatArray,
    widths: FloatArray,
    drift_variance: float,
    white_variance: float,
    change_cost: float,
    lengths: IntArray,
) -> tuple[FloatArray, float]:
    lanes = np.zeros(departures.shape)
    total = 0.0
    for i in range(len(departures)):
        total += _search(departures[i], widths, drift_variance, white_variance, change_cost, lengths, lanes[i])
    return lanes, total


@njit(cache=True)
def _step(
    cost: float, mean: float, variance: float, value: float, drift_variance: float, white_variance: float
) -> tuple[float, float, float]:
    """One Kalman step of a random walk; a missing value only lets it drift."""
    variance += drift_variance
    if np.isnan(value):
        return cost, mean, variance
    spread = variance + white_variance
    miss = value - mean
    square = miss * miss / spread
    # log of a spread relative to the white noise: costs stay comparable whatever the noise is.
    cost += 0.5 * (min(square, _CLIP) + np.log(spread / white_variance))
    gain = variance / spread
    if square > _CLIP:
        gain *= _CLIP / square
    return cost, mean + gain * miss, variance * (1.0 - gain)


@njit(cache=True)
def _search(
    v: FloatArray, widths: FloatArray, drift_variance: float, white_variance: float, change_cost: float, lengths: IntArray,
    out: FloatArray,
) -> float:  # fmt: skip
    """Cost of the best sequence of lanes for one trace; the lanes themselves go into `out`."""
    n, span = len(v), 2 * MAX_LANES_MOVED + 1
    first = 0
    while first < n and np.isnan(v[first]):
        first += 1
    if first == n:
        return 0.0
    # cost, mean and variance of the offset, and how the best path to each station and lane got there.
    state = np.full((n, span, 3), np.inf)
    origin = np.ones((n, span, 2), dtype=np.int64)  # lane before, stations ago
    state[first, MAX_LANES_MOVED] = (0.0, v[first], white_variance)
    for j in range(first + 1, n):
        for k in range(span):
            if np.isfinite(state[j - 1, k, 0]):
                value = v[j] - widths[j] * (k - MAX_LANES_MOVED)
                cost, mean, variance = state[j - 1, k]
                state[j, k] = _step(cost, mean, variance, value, drift_variance, white_variance)
                origin[j, k, 0] = k
            for source in (k - 1, k + 1):
                if 0 <= source < span:
                    _change(v, widths, drift_variance, white_variance, change_cost, lengths, first, j, k, source, state, origin)
    last = np.argmin(state[n - 1, :, 0])
    _trace_back(first, last, origin, out)
    return state[n - 1, last, 0]


@njit(cache=True)
def _change(
    v: FloatArray, widths: FloatArray, drift_variance: float, white_variance: float, change_cost: float, lengths: IntArray,
    first: int, j: int, k: int, source: int, state: FloatArray, origin: IntArray,
) -> None:  # fmt: skip
    """Enter the best change from lane `source` that ends in lane k at station j, where it beats what is there."""
    for length in lengths:
        start = j - length
        if start < first or not np.isfinite(state[start, source, 0]):
            continue
        cost, mean, variance = state[start, source]
        cost += change_cost
        for step in range(1, length + 1):
            value = v[start + step] - widths[start + step] * (_on_the_way(source, k, step / length) - MAX_LANES_MOVED)
            cost, mean, variance = _step(cost, mean, variance, value, drift_variance, white_variance)
            if cost >= state[j, k, 0]:
                break
        if cost < state[j, k, 0]:
            state[j, k] = (cost, mean, variance)
            origin[j, k] = (source, length)


@njit(cache=True)
def _on_the_way(source: int, goal: int, t: float) -> float:
    """Place between two lanes at a share t of a change, as drivers steer: slow at both ends."""
    return source + (goal - source) * t * t * (3.0 - 2.0 * t)


@njit(cache=True)
def _trace_back(first: int, k: int, origin: IntArray, out: FloatArray) -> None:
    j = len(out) - 1
    while j > first:
        source, length = origin[j, k]
        for step in range(1, length + 1):
            out[j - length + step] = _on_the_way(source, k, step / length) - MAX_LANES_MOVED
        j -= length
        k = source
