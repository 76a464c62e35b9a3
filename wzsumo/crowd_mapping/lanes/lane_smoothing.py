"""Where each vehicle drove: smoothed probabilities of its lane along the road, and the likelihood of its fixes.

A trace's offset at station t in state z is

    y_t = level_t + w position_z + u_t + e_t,   u: Gauss-Markov with sd sigma,   e_t ~ N(0, r_t)

An interacting-multiple-model filter (Blom and Bar-Shalom 1988) runs over the states: each state carries one normal distribution
of u, mixed by moments where states meet. It runs once for each lane in which the trace may have begun, since an error that
lasts may be a lane's width: mixed, the likelier of the two would be all that is left. The smoother multiplies it by the same
filters of the chain read backwards, one for each last lane, divided by the prior (two-filter formula). The density of a fix is
raised to the power eta, since fixes near each other share one wander.
"""

from dataclasses import dataclass

import numba
import numpy as np

from wzsumo.crowd_mapping.lanes.lane_chain import LaneChain
from wzsumo.crowd_mapping.lanes.observations import Observations
from wzsumo.crowd_mapping.lanes.receivers import Receivers
from wzsumo.frames import BoolArray, FloatArray, IntArray

OUTLIER_SHARE = 0.02  # of single fixes, anywhere on
OUTLIER_WIDTH_M = 15.0  # this width
# Off the lanes a vehicle keeps its direction but for 0.04 (a ramp of 1:25), or jumps anywhere
OFF_LANE_SLOPE, JUMP_SHARE = 0.04, 0.2
LEFT_OUT = 30.0  # nats that a state is behind by its weights, from which on the two filters are not joined
FORGOTTEN = 10.0  # nats behind the likeliest, from which on a lane in which a trace begins or ends is left out


@numba.njit(cache=True, nogil=True)
def _off_lane_density(y: FloatArray, eta: FloatArray, r: FloatArray, spacing: float, density: FloatArray) -> None:
    """Fill `density` (stations,): that of each fix, tempered, off the lanes, given the fix before it."""
    last = -1
    for t in range(len(y)):
        if eta[t] > 0:
            plain = 1 / OUTLIER_WIDTH_M
            if last >= 0:
                sd2 = r[t] + r[last] + (OFF_LANE_SLOPE * spacing * (t - last)) ** 2
                step = np.exp(-0.5 * (y[t] - y[last]) ** 2 / sd2) / np.sqrt(2 * np.pi * sd2)
                plain = JUMP_SHARE * plain + (1 - JUMP_SHARE) * step
            density[t] = plain ** eta[t]
            last = t


@numba.njit(cache=True, nogil=True)
def _filter(  # noqa: C901 - one pass over stations and states: a call in it costs more than reading it
    y: FloatArray, eta: FloatArray, r: FloatArray, off_lane: FloatArray, allowed: FloatArray, level: FloatArray, width: float,
    position: FloatArray, burst: BoolArray, first: IntArray, source: IntArray, probability: FloatArray, start: FloatArray,
    rho: float, sigma2: float, predicted: bool, weight: FloatArray, mean: FloatArray, variance: FloatArray, scale: FloatArray,
) -> float:  # fmt: skip
    """The log likelihood. Fills weight, mean, variance (stations, states) of the predictions, or of the filtered states.

    `scale` (stations,) is the log of the factor by which the weights of a station have to be multiplied.
    """
    n_stations, n_states = weight.shape
    w = start.copy()
    m = np.zeros(n_states)
    v = np.full(n_states, sigma2)
    w2, m2, v2 = np.empty(n_states), np.empty(n_states), np.empty(n_states)
    log_likelihood = 0.0
    floor = OUTLIER_SHARE / OUTLIER_WIDTH_M
    noise = sigma2 * (1 - rho * rho)
    for t in range(n_stations):
        if t > 0:
            for j in range(n_states):
                total, average, square = 0.0, 0.0, 0.0
                for e in range(first[j], first[j + 1]):
                    i = source[e]
                    part = w[i] * probability[e]
                    total += part
                    average += part * m[i]
                    square += part * (v[i] + m[i] * m[i])
                if total > 0:
                    average /= total
                    spread = max(square / total - average * average, 0.0)
                else:
                    average, spread = 0.0, sigma2
                w2[j] = total
                m2[j] = rho * average
                v2[j] = rho * rho * spread + noise
            for j in range(n_states):
                w[j], m[j], v[j] = w2[j], m2[j], v2[j]
        if predicted:
            scale[t] = log_likelihood
            for j in range(n_states):
                weight[t, j], mean[t, j], variance[t, j] = w[j], m[j], v[j]
        for j in range(n_states):
            w[j] *= allowed[t, j]
        if eta[t] > 0:
            widened = r[t] / eta[t]
            power = (2 * np.pi * r[t]) ** (-0.5 * eta[t]) * np.sqrt(2 * np.pi * widened)
            total = 0.0
            for j in range(n_states):
                if burst[j]:
                    w[j] *= off_lane[t]
                else:
                    residual = y[t] - level[t] - width * position[j] - m[j]
                    s = v[j] + widened
                    density = (1 - OUTLIER_SHARE) * power * np.exp(-0.5 * residual * residual / s) / np.sqrt(2 * np.pi * s)
                    share = density / (density + floor)
                    gain = v[j] / s
                    shift = gain * residual
                    inner = v[j] * (1 - gain)
                    m[j] += share * shift
                    v[j] = share * inner + (1 - share) * v[j] + share * (1 - share) * shift * shift
                    w[j] *= density + floor
                total += w[j]
            log_likelihood += np.log(max(total, 1e-300))
            for j in range(n_states):
                w[j] /= max(total, 1e-300)
        if not predicted:
            scale[t] = log_likelihood
            for j in range(n_states):
                weight[t, j], mean[t, j], variance[t, j] = w[j], m[j], v[j]
    return log_likelihood


@numba.njit(cache=True, nogil=True)
def _join(  # noqa: C901 - sums over first lanes, last lanes and states
    w: FloatArray, m: FloatArray, v: FloatArray, scale: FloatArray, bw: FloatArray, bm: FloatArray, bv: FloatArray,
    back_scale: FloatArray, stationary: FloatArray, sigma2: float, share: float, state_share: FloatArray,
) -> None:  # fmt: skip
    """Add to `state_share` (stations, states) the product of both filters, over all first and last lanes, times `share`."""
    n_lanes, n_stations, n_states = w.shape  # "lanes" are the first and last ones
    joint = np.empty((n_lanes, n_lanes, n_states))
    log_stationary = np.log(stationary)
    log_w, log_bw = np.empty((n_lanes, n_states)), np.empty((n_lanes, n_states))
    for t in range(n_stations):
        b = n_stations - 1 - t
        for o in range(n_lanes):
            for j in range(n_states):
                log_w[o, j] = scale[o, t] + np.log(w[o, t, j]) if w[o, t, j] > 0 else -np.inf
                log_bw[o, j] = back_scale[o, b] + np.log(bw[o, b, j]) - log_stationary[j] if bw[o, b, j] > 0 else -np.inf
        most = -np.inf
        for o in range(n_lanes):
            for f in range(n_lanes):
                for j in range(n_states):
                    joint[o, f, j] = log_w[o, j] + log_bw[f, j]
                    most = max(most, joint[o, f, j])
        for o in range(n_lanes):
            for f in range(n_lanes):
                for j in range(n_states):
                    if joint[o, f, j] < most - LEFT_OUT:
                        joint[o, f, j] = -np.inf
                        continue
                    pf, pb = v[o, t, j], min(bv[f, b, j], 0.9999 * sigma2)
                    mf, mb = m[o, t, j], bm[f, b, j]
                    # With q = 1/pf + 1/pb - 1/sigma2 and both sides times pf pb: one division instead of five.
                    q = pf + pb - pf * pb / sigma2
                    gap = mf * mf * (1 - pb / sigma2) + mb * mb * (1 - pf / sigma2) - 2 * mf * mb
                    joint[o, f, j] -= 0.5 * (np.log(q / sigma2) + gap / q)
        top = joint.max()
        total = 0.0
        for o in range(n_lanes):
            for f in range(n_lanes):
                for j in range(n_states):
                    joint[o, f, j] = np.exp(joint[o, f, j] - top) if joint[o, f, j] > top - 40 else 0.0
                    total += joint[o, f, j]
        for o in range(n_lanes):
            for f in range(n_lanes):
                for j in range(n_states):
                    state_share[t, j] += share * joint[o, f, j] / total


@numba.njit(cache=True, nogil=True)
def _smooth(  # noqa: C901 - filters forwards and backwards, and joins them
    y: FloatArray, eta: FloatArray, r: FloatArray, spacing: float, allowed: FloatArray, level: FloatArray, width: float,
    position: FloatArray, burst: BoolArray, first: IntArray, source: IntArray, probability: FloatArray, back_first: IntArray,
    back_source: IntArray, back_probability: FloatArray, stationary: FloatArray, rho: FloatArray,
    sigma: FloatArray, log_shares: FloatArray, tried: BoolArray, least_share: float, begins: FloatArray, ends: FloatArray,
    state_share: FloatArray, class_share: FloatArray, log_likelihood: FloatArray,
) -> None:  # fmt: skip
    """See `smooth_traces`. `begins` and `ends` (parts, states) are the start and the long-run shares, parted by lane."""
    n_traces, n_stations = y.shape
    n_states, n_classes, n_parts = len(position), len(sigma), len(begins)
    shape = (n_parts, n_stations, n_states)
    w, m, v, scale = np.empty(shape), np.empty(shape), np.empty(shape), np.empty((n_parts, n_stations))
    bw, bm, bv, back_scale = np.empty(shape), np.empty(shape), np.empty(shape), np.empty((n_parts, n_stations))
    off_lane, back_off_lane = np.empty(n_stations), np.empty(n_stations)
    by_part, last = np.empty(n_parts), np.empty(n_parts)
    for i in range(n_traces):
        low, high = n_stations, 0  # only the stations that the trace reaches
        for t in range(n_stations):
            if eta[i, t] > 0:
                low, high = min(low, t), max(high, t + 1)
        if low >= high:
            log_likelihood[i] = 0.0
            class_share[i] = np.exp(log_shares[i])
            continue
        size = high - low
        yy, ee, rr, aa, ll = y[i, low:high], eta[i, low:high], r[i, low:high], allowed[low:high], level[low:high]
        _off_lane_density(yy, ee, rr, spacing, off_lane[:size])
        best = -np.inf
        for c in range(n_classes):
            class_share[i, c] = -np.inf
            if log_shares[i, c] > -30 and tried[i, c]:
                for o in range(n_parts):
                    by_part[o] = _filter(
                        yy, ee, rr, off_lane[:size], aa, ll, width, position, burst, first, source, probability, begins[o],
                        rho[i, c], sigma[c] ** 2, False, w[o, :size], m[o, :size], v[o, :size], scale[o, :size],
                    )  # fmt: skip
                most = by_part.max()
                class_share[i, c] = log_shares[i, c] + most + np.log(np.exp(by_part - most).sum())
            best = max(best, class_share[i, c])
        for c in range(n_classes):
            class_share[i, c] = np.exp(class_share[i, c] - best)
        total = class_share[i].sum()
        log_likelihood[i] = best + np.log(total)
        class_share[i] /= total
        if least_share > 1:
            continue
        kept = class_share[i][class_share[i] >= least_share].sum()
        back_y, back_eta, back_r = yy[::-1].copy(), ee[::-1].copy(), rr[::-1].copy()
        back_allowed, back_level = aa[::-1].copy(), ll[::-1].copy()
        _off_lane_density(back_y, back_eta, back_r, spacing, back_off_lane[:size])
        for c in range(n_classes):
            if class_share[i, c] < least_share:
                continue
            for o in range(n_parts):
                by_part[o] = _filter(
                    yy, ee, rr, off_lane[:size], aa, ll, width, position, burst, first, source, probability, begins[o],
                    rho[i, c], sigma[c] ** 2, False, w[o, :size], m[o, :size], v[o, :size], scale[o, :size],
                )  # fmt: skip
            most = by_part.max()
            last[:] = 0.0
            for o in range(n_parts):  # where the trace ends
                for f in range(n_parts):
                    for j in range(n_states):
                        if ends[f, j] > 0:
                            last[f] += np.exp(by_part[o] - most) * w[o, size - 1, j]
                if by_part[o] < most - FORGOTTEN:
                    scale[o, :size] = -np.inf
            for f in range(n_parts):
                if last[f] < np.exp(-FORGOTTEN) * last.sum():
                    back_scale[f, :size], bw[f, :size] = -np.inf, 0.0
                    continue
                _filter(
                    back_y, back_eta, back_r, back_off_lane[:size], back_allowed, back_level, width, position, burst,
                    back_first, back_source, back_probability, ends[f], rho[i, c], sigma[c] ** 2, True, bw[f, :size],
                    bm[f, :size], bv[f, :size], back_scale[f, :size],
                )  # fmt: skip
            _join(
                w[:, :size], m[:, :size], v[:, :size], scale[:, :size], bw[:, :size], bm[:, :size], bv[:, :size],
                back_scale[:, :size], stationary, sigma[c] ** 2, class_share[i, c] / kept, state_share[i, low:high],
            )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Smoothed:
    """Shares of states (traces, stations, states) and of receiver classes (traces, classes); log likelihoods (traces,)."""

    state_share: FloatArray
    class_share: FloatArray
    log_likelihood: FloatArray


def smooth_traces(
    observations: Observations,
    chain: LaneChain,
    receivers: Receivers,
    *,
    level: FloatArray,
    width: float,
    allowed: FloatArray,
    start: FloatArray,
    class_shares: FloatArray,
    least_share: float,
    tried: BoolArray | None = None,
    roughly: bool = False,
) -> Smoothed:
    """The smoothed states of all traces.

    `level` (stations,) [m] is the offset of lane 0, `width` [m] that between lanes, `allowed` (stations, states) a factor of
    each state's probability, `start` (states,) and `class_shares` (classes,) the prior shares. A class that explains a trace
    with a share below `least_share` is left out of the smoothing; above 1, nothing is smoothed and likelihoods alone are told.
    `tried` (traces, classes) are the classes that come into question, by default all. `roughly`, the filters run once for all
    lanes in which a trace may have begun: faster, and likelier to forget the less likely one.
    """
    n, m = observations.offset.shape
    smoothed = Smoothed(
        state_share=np.zeros((n, m, len(chain.position))),
        class_share=np.zeros((n, len(receivers.sigma))),
        log_likelihood=np.zeros(n),
    )
    parts = np.zeros((1, len(chain.position)), dtype=int) if roughly else np.rint(chain.position).astype(int)[None, :]
    parts = parts == np.arange(1 if roughly else chain.n_lanes)[:, None]
    _smooth(
        observations.offset, observations.eta, observations.variance, observations.spacing, allowed, level, width,
        chain.position, chain.burst, chain.first, chain.source, chain.probability, chain.back_first, chain.back_source,
        chain.back_probability, chain.stationary, receivers.rho, receivers.sigma, receivers.log_shares(class_shares),
        np.ones(smoothed.class_share.shape, dtype=bool) if tried is None else tried, least_share,
        parts * start, parts * chain.stationary,
        smoothed.state_share, smoothed.class_share, smoothed.log_likelihood,
    )  # fmt: skip
    return smoothed


def lane_shares(state_share: FloatArray, position: FloatArray, burst: BoolArray, n_lanes: int) -> FloatArray:
    """Shares (traces, stations, lanes) of being in each lane; a vehicle between two lanes is in the nearer one."""
    of_lane = np.zeros((*state_share.shape[:2], n_lanes))
    nearest = np.rint(position).astype(int)
    for state, lane in enumerate(nearest):
        if not burst[state]:
            of_lane[:, :, lane] += state_share[:, :, state]
    return of_lane
