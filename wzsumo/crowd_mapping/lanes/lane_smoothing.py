"""Where each vehicle drove: smoothed probabilities of its lane along the road, and the likelihood of its fixes.

A trace's offset at station t in state z is

    y_t = level_t + w position_z + u_t + e_t,   u: Gauss-Markov with sd sigma,   e_t ~ N(0, r_t)

An interacting-multiple-model filter (Blom and Bar-Shalom 1988) runs over the states: each state carries one normal distribution
of u, mixed by moments where states meet. The smoother multiplies it by the same filter of the chain read backwards, divided by
the prior (two-filter formula). The density of a fix is raised to the power eta, since fixes near each other share one wander.
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
    rho: float, sigma2: float, predicted: bool, weight: FloatArray, mean: FloatArray, variance: FloatArray,
) -> float:  # fmt: skip
    """The log likelihood. Fills weight, mean, variance (stations, states) of the predictions, or of the filtered states."""
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
                total = 0.0
                average = 0.0
                for e in range(first[j], first[j + 1]):
                    part = w[source[e]] * probability[e]
                    total += part
                    average += part * m[source[e]]
                average = average / total if total > 0 else 0.0
                spread = 0.0
                for e in range(first[j], first[j + 1]):
                    i = source[e]
                    spread += w[i] * probability[e] * (v[i] + (m[i] - average) ** 2)
                spread = spread / total if total > 0 else sigma2
                w2[j] = total
                m2[j] = rho * average
                v2[j] = rho * rho * spread + noise
            for j in range(n_states):
                w[j], m[j], v[j] = w2[j], m2[j], v2[j]
        if predicted:
            for j in range(n_states):
                weight[t, j], mean[t, j], variance[t, j] = w[j], m[j], v[j]
        for j in range(n_states):
            w[j] *= allowed[t, j]
        if eta[t] > 0:
            widened = r[t] / eta[t]
            scale = (2 * np.pi * r[t]) ** (-0.5 * eta[t]) * np.sqrt(2 * np.pi * widened)
            total = 0.0
            for j in range(n_states):
                if burst[j]:
                    w[j] *= off_lane[t]
                else:
                    residual = y[t] - level[t] - width * position[j] - m[j]
                    s = v[j] + widened
                    density = (1 - OUTLIER_SHARE) * scale * np.exp(-0.5 * residual * residual / s) / np.sqrt(2 * np.pi * s)
                    share = density / (density + floor)
                    gain = v[j] / s
                    shift = gain * residual
                    inner = v[j] * (1 - gain)
                    m[j] += share * shift
                    v[j] = share * inner + (1 - share) * v[j] + share * (1 - share) * shift * shift
                    w[j] *= density + floor
                total += w[j]
            log_likelihood += np.log(total)
            for j in range(n_states):
                w[j] /= total
        if not predicted:
            for j in range(n_states):
                weight[t, j], mean[t, j], variance[t, j] = w[j], m[j], v[j]
    return log_likelihood


@numba.njit(cache=True, nogil=True)
def _smooth(  # noqa: C901 - filters forwards and backwards, and joins them
    y: FloatArray, eta: FloatArray, r: FloatArray, spacing: float, allowed: FloatArray, level: FloatArray, width: float,
    position: FloatArray, burst: BoolArray, first: IntArray, source: IntArray, probability: FloatArray, back_first: IntArray,
    back_source: IntArray, back_probability: FloatArray, stationary: FloatArray, start: FloatArray, rho: FloatArray,
    sigma: FloatArray, log_shares: FloatArray, least_share: float, state_share: FloatArray, class_share: FloatArray,
    log_likelihood: FloatArray,
) -> None:  # fmt: skip
    """See `smooth_traces`."""
    n_traces, n_stations = y.shape
    n_states, n_classes = len(position), len(sigma)
    w, m, v = np.empty((n_stations, n_states)), np.empty((n_stations, n_states)), np.empty((n_stations, n_states))
    bw, bm, bv = np.empty((n_stations, n_states)), np.empty((n_stations, n_states)), np.empty((n_stations, n_states))
    back_y, back_eta, back_r = np.empty(n_stations), np.empty(n_stations), np.empty(n_stations)
    back_level, back_allowed = level[::-1].copy(), allowed[::-1].copy()
    off_lane, back_off_lane = np.empty(n_stations), np.empty(n_stations)
    joint = np.empty(n_states)
    for i in range(n_traces):
        low, high = n_stations, 0  # only the stations that the trace reaches
        for t in range(n_stations):
            if eta[i, t] > 0:
                low, high = min(low, t), max(high, t + 1)
        state_share[i] = 0.0
        if low >= high:
            log_likelihood[i] = 0.0
            class_share[i] = np.exp(log_shares)
            continue
        _off_lane_density(y[i, low:high], eta[i, low:high], r[i, low:high], spacing, off_lane[low:high])
        best = -np.inf
        for c in range(n_classes):
            class_share[i, c] = -np.inf
            if log_shares[c] > -30:
                class_share[i, c] = log_shares[c] + _filter(
                    y[i, low:high], eta[i, low:high], r[i, low:high], off_lane[low:high], allowed[low:high], level[low:high],
                    width, position, burst, first, source, probability, start, rho[i, c], sigma[c] ** 2, False, w[low:high],
                    m[low:high], v[low:high],
                )  # fmt: skip
            best = max(best, class_share[i, c])
        total = 0.0
        for c in range(n_classes):
            class_share[i, c] = np.exp(class_share[i, c] - best)
            total += class_share[i, c]
        log_likelihood[i] = best + np.log(total)
        kept = 0.0
        for c in range(n_classes):
            class_share[i, c] /= total
            if class_share[i, c] >= least_share:
                kept += class_share[i, c]
        size = high - low
        for t in range(size):
            back_y[t], back_eta[t], back_r[t] = y[i, high - 1 - t], eta[i, high - 1 - t], r[i, high - 1 - t]
        _off_lane_density(back_y[:size], back_eta[:size], back_r[:size], spacing, back_off_lane[:size])
        for c in range(n_classes):
            if class_share[i, c] < least_share:
                continue
            sigma2 = sigma[c] ** 2
            _filter(
                y[i, low:high], eta[i, low:high], r[i, low:high], off_lane[low:high], allowed[low:high], level[low:high], width,
                position, burst, first, source, probability, start, rho[i, c], sigma2, False, w[low:high], m[low:high],
                v[low:high],
            )  # fmt: skip
            _filter(
                back_y[:size], back_eta[:size], back_r[:size], back_off_lane[:size],
                back_allowed[n_stations - high : n_stations - low],
                back_level[n_stations - high : n_stations - low], width, position,
                burst, back_first, back_source, back_probability, stationary, rho[i, c], sigma2, True, bw[:size], bm[:size],
                bv[:size],
            )  # fmt: skip
            for t in range(low, high):
                b = high - 1 - t
                best = -np.inf
                for j in range(n_states):
                    pf, pb = v[t, j], min(bv[b, j], 0.9999 * sigma2)
                    precision = 1 / pf + 1 / pb - 1 / sigma2
                    h = m[t, j] / pf + bm[b, j] / pb
                    value = (
                        np.log(max(w[t, j], 1e-300)) + np.log(max(bw[b, j], 1e-300)) - np.log(stationary[j])
                        - 0.5 * np.log(pf * pb * precision) - 0.5 * (m[t, j] ** 2 / pf + bm[b, j] ** 2 / pb)
                        + 0.5 * h * h / precision
                    )  # fmt: skip
                    joint[j] = value
                    best = max(best, value)
                total = 0.0
                for j in range(n_states):
                    joint[j] = np.exp(joint[j] - best)
                    total += joint[j]
                share = class_share[i, c] / kept
                for j in range(n_states):
                    state_share[i, t, j] += share * joint[j] / total


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
) -> Smoothed:
    """The smoothed states of all traces.

    `level` (stations,) [m] is the offset of lane 0, `width` [m] that between lanes, `allowed` (stations, states) a factor of
    each state's probability, `start` (states,) and `class_shares` (classes,) the prior shares. A class that explains a trace
    with a share below `least_share` is left out of the smoothing.
    """
    n, m = observations.offset.shape
    smoothed = Smoothed(
        state_share=np.zeros((n, m, len(chain.position))),
        class_share=np.zeros((n, len(receivers.sigma))),
        log_likelihood=np.zeros(n),
    )
    _smooth(
        observations.offset, observations.eta, observations.variance, observations.spacing, allowed, level, width,
        chain.position, chain.burst, chain.first, chain.source, chain.probability, chain.back_first, chain.back_source,
        chain.back_probability, chain.stationary, start, receivers.rho, receivers.sigma, np.log(class_shares), least_share,
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
