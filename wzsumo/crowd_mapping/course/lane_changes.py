"""Lane changes within traces: the likeliest sequence of lanes, relative to the first, beside an offset that may drift.

The departure y_j of a trace from the common course at station j is modelled as

    y_j = w_j h_j + a_j + T_j g + v_j,    a_j = a_{j-1} + u_j

with lane h_j of width w_j, an offset a_j that drifts (u_j), the part T_j g that the trace's GNSS bias g adds on a bend
(`gnss_bias`) and white noise v_j. The trace's own error is unknown but slow and a lane change is quick, which tells them apart.
A Viterbi search over lanes, in which every survivor carries a Kalman filter of (a, g) ("per-survivor processing", Raheli,
Polydoros and Tzou 1995), minimises the sum over stations of  min(z_j^2, OUTLIER_SQUARE) / 2 + log(S_j / var v) / 2, with
innovations z_j normalised by their variances S_j, plus CHANGE_COST for every lane change. A trace may begin during a change.
"""

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray, IntArray

MAX_LANES_MOVED = 3  # to either side of the first lane; chosen by us
# Lengths of a change that are tried, in stations 10 m apart: from 10 m (a simulator's jump) to 120 m.
CHANGE_LENGTHS_STATIONS = np.array([1, 4, 8, 12])
CHANGE_COST = 8.0  # -log of the chance that a change ends at a station: about one in 3000, one in 30 km; chosen by us
OUTLIER_SQUARE = 16.0  # normalised square of an innovation, 4 sd, beyond which it counts as an outlier; chosen by us
# A survivor is a row: cost; the filter's offset and bias along and across; their covariance's upper triangle by rows.
_SURVIVOR = 10


def relative_lanes(
    departures: FloatArray,
    widths: FloatArray,
    *,
    drift_variance: float,
    white_variance: float,
    bias_effect: FloatArray | None,
    bias_variance: float,
) -> tuple[FloatArray, float]:
    """Lanes (traces, stations) from each trace's first, positive to the left, fractions during a change; and the cost of all.

    Of a trace that begins during a change the first lane is the nearer one.

    `departures` (traces, stations) [m] are lateral offsets from the common course, NaN where unknown; `widths` (stations,) [m]
    those of the lanes. `drift_variance` [m^2] is that of the drift from one station to the next, `white_variance` [m^2] that of
    the noise at a station. `bias_effect` (stations, 2) is what a metre of GNSS bias adds on a bend, None on a straight road;
    `bias_variance` [m^2] is that of the biases.
    """
    bias_effect = np.zeros((departures.shape[1], 2)) if bias_effect is None else bias_effect
    variances = (drift_variance, white_variance, bias_variance)
    lanes, cost = _search_all(departures, widths, bias_effect, variances, CHANGE_COST, CHANGE_LENGTHS_STATIONS)
    return np.asarray(lanes), float(cost)


@njit(cache=True)
def _search_all(
    departures: FloatArray,
    widths: FloatArray,
    bias_effect: FloatArray,
    variances: tuple[float, float, float],
    change_cost: float,
    lengths: IntArray,
) -> tuple[FloatArray, float]:
    lanes = np.zeros(departures.shape)
    total = 0.0
    for i in range(len(departures)):
        total += _search(departures[i], widths, bias_effect, variances, change_cost, lengths, lanes[i])
    return lanes, total


@njit(cache=True)
def _search(
    v: FloatArray, widths: FloatArray, bias_effect: FloatArray, variances: tuple[float, float, float], change_cost: float,
    lengths: IntArray, out: FloatArray,
) -> float:  # fmt: skip
    """Cost of the best sequence of lanes for one trace; the lanes themselves go into `out`."""
    n, span = len(v), 2 * MAX_LANES_MOVED + 1
    first = 0
    while first < n and np.isnan(v[first]):
        first += 1
    if first == n:
        return 0.0
    # The survivor at each station and lane, and how it got there.
    state = np.full((n, span, _SURVIVOR), np.inf)
    origin = np.ones((n, span, 2), dtype=np.int64)  # lane before, stations ago
    _, white_variance, bias_variance = variances
    _begin(state[first, MAX_LANES_MOVED], v[first], bias_effect[first], white_variance, bias_variance)
    scratch = np.empty(_SURVIVOR)
    for j in range(first + 1, n):
        for k in range(span):
            if np.isfinite(state[j - 1, k, 0]):
                state[j, k] = state[j - 1, k]
                _step(state[j, k], v[j] - widths[j] * (k - MAX_LANES_MOVED), bias_effect[j, 0], bias_effect[j, 1], variances)
                origin[j, k, 0] = k
            for source in (k - 1, k + 1):
                if 0 <= source < span:
                    _change(
                        v, widths, bias_effect, variances, change_cost, lengths, first, j, k, source, state, origin, scratch
                    )
    last = np.argmin(state[n - 1, :, 0])
    _trace_back(first, last, origin, out)
    return state[n - 1, last, 0]


@njit(cache=True)
def _begin(survivor: FloatArray, value: float, turn: FloatArray, white_variance: float, bias_variance: float) -> None:
    """Start the filter at a trace's first value: the offset is that value less what the bias, still unknown, adds to it."""
    along, across = turn[0], turn[1]
    survivor[0:4] = 0.0
    survivor[1] = value
    covariance = survivor[4:]
    covariance[0] = white_variance + bias_variance * (along * along + across * across)
    covariance[1], covariance[2] = -along * bias_variance, -across * bias_variance
    covariance[3], covariance[4], covariance[5] = bias_variance, 0.0, bias_variance


@njit(cache=True)
def _step(survivor: FloatArray, value: float, along: float, across: float, variances: tuple[float, float, float]) -> None:
    """One Kalman step of a random walk beside two constants; a missing value only lets it drift."""
    drift_variance, white_variance, bias_variance = variances
    survivor[4] += drift_variance
    if np.isnan(value):
        return
    p00, p01, p02 = survivor[4], survivor[5], survivor[6]
    p11, p12, p22 = survivor[7], survivor[8], survivor[9]
    h0 = p00 + along * p01 + across * p02
    h1 = p01 + along * p11 + across * p12
    h2 = p02 + along * p12 + across * p22
    spread = h0 + along * h1 + across * h2 + white_variance
    miss = value - survivor[1] - along * survivor[2] - across * survivor[3]
    square = miss * miss / spread
    # log of a spread relative to the white noise: costs stay comparable whatever the noise is.
    survivor[0] += 0.5 * (min(square, OUTLIER_SQUARE) + np.log(spread / white_variance))
    share = 1.0 / spread
    if square > OUTLIER_SQUARE:
        share *= OUTLIER_SQUARE / square
    survivor[1] += share * h0 * miss
    survivor[4] -= share * h0 * h0
    if bias_variance > 0.0:  # else the bias is 0 and stays so
        survivor[2] += share * h1 * miss
        survivor[3] += share * h2 * miss
        survivor[5] -= share * h0 * h1
        survivor[6] -= share * h0 * h2
        survivor[7] -= share * h1 * h1
        survivor[8] -= share * h1 * h2
        survivor[9] -= share * h2 * h2


@njit(cache=True)
def _change(
    v: FloatArray, widths: FloatArray, bias_effect: FloatArray, variances: tuple[float, float, float], change_cost: float,
    lengths: IntArray, first: int, j: int, k: int, source: int, state: FloatArray, origin: IntArray, scratch: FloatArray,
) -> None:  # fmt: skip
    """Enter the best change from lane `source` that ends in lane k at station j, where it beats the survivor there.

    A change that began before the trace's first value leaves the first lane; its cost and its filter begin at that value.
    """
    _, white_variance, bias_variance = variances
    for length in lengths:
        start = j - length
        ahead = max(first - start, 0)  # stations of the change before the trace's first value
        if (ahead == 0 and not np.isfinite(state[start, source, 0])) or (ahead > 0 and source != MAX_LANES_MOVED):
            continue
        if ahead > 0:
            begun = widths[first] * (_on_the_way(source, k, ahead / length) - MAX_LANES_MOVED)
            _begin(scratch, v[first] - begun, bias_effect[first], white_variance, bias_variance)
        else:
            scratch[:] = state[start, source]
        scratch[0] += change_cost
        for step in range(ahead + 1, length + 1):
            at = start + step
            value = v[at] - widths[at] * (_on_the_way(source, k, step / length) - MAX_LANES_MOVED)
            _step(scratch, value, bias_effect[at, 0], bias_effect[at, 1], variances)
            if scratch[0] >= state[j, k, 0]:
                break
        if scratch[0] < state[j, k, 0]:
            state[j, k] = scratch
            origin[j, k] = (source, length)


@njit(cache=True)
def _on_the_way(source: int, goal: int, t: float) -> float:
    """Place between two lanes at a share t of a change: slow at both ends, as drivers steer."""
    return source + (goal - source) * t * t * (3.0 - 2.0 * t)


@njit(cache=True)
def _trace_back(first: int, k: int, origin: IntArray, out: FloatArray) -> None:
    j = len(out) - 1
    while j > first:
        source, length = origin[j, k]
        for step in range(max(first - j + length, 1), length + 1):
            out[j - length + step] = _on_the_way(source, k, step / length) - MAX_LANES_MOVED
        j -= length
        k = source
    out[first:] -= np.rint(out[first])
