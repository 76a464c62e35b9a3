"""Evidence and prior of the interval [e, b] of stations over which a lane is closed.

The log of the odds of closed on [e, b] against open is

    log LR(e, b) =   sum_i v_i log[ (1 - m_i) + m_i rho_i ]
                   + max(0, log[ Gamma(1 + c - M) (E_0 + E)^M / (Gamma(1 + c) R^M) ])
                   + (1 + u) log(1 + E_in / (E_0 + E_out)) - (d_e + d_b) / (R / 2)

m_i is the chance that trace i drove in the lane between e and b, rho_i the chance that it seems to, though the lane is
closed. M counts those that left the lane within R = MERGE_LENGTH_M ahead of e, and those that entered it within R after b: at a
closure drivers do so anywhere on R, elsewhere with a rate that all lane changes have in common, c of them on E metres. That
rate is unknown, so the second term is the ratio of two gamma-Poisson predictions: of c - M changes and of c. So is the last
but one: E_in and E_out [m] are driven beside the lane by vehicles that do not enter it, u counts entries ahead of e and beyond
the reach of b. All drivers share one rate of entering, so evidence from mere absence grows with the logarithm of the number of
traces. d_e and d_b are the mean distances from e and b at which drivers left and entered the lane: how far ahead a crowd does
so is one unknown, exponential with a mean of R / 2, whatever the number of traces. v_i in [0, 1] is how well trace i tells
lanes apart; c, M, E and u are counted with it.
"""

import math

import numba
import numpy as np

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.frames import BoolArray, FloatArray

# Ahead of a closure, in which drivers leave the lane: from the sign "1/2 mile" on (MUTCD 11th ed., TA-33); and as far behind it
MERGE_LENGTH_M = 805.0
P_ANNOUNCEMENT_RIGHT = 0.8  # that a zone is announced where it is, but for the stated deviation; otherwise it is anywhere
USABLE_TAPER_SHARE = 0.69  # of a taper: there 1.13 m of a 12 ft lane are left, too little for half a car and its wander
DOWNSTREAM_TAPER_M = 30.0  # MUTCD 11th ed., Table 6B-3: 50 to 100 ft a lane
# Lengths of merging tapers in the manual's (Table 6B-3, a minimum), with probabilities. Chosen by us
TAPER_LENGTHS = ((0.5, 0.15), (0.75, 0.15), (1.0, 0.5), (1.5, 0.12), (2.0, 0.08))
P_SHOULDER_TAPER = 0.6  # that a shoulder taper of a third of L stands ahead of the merging taper (TA-33). Chosen by us
TANGENTS = ((0.0, 0.3), (1.0, 0.3), (2.0, 0.4))  # between two merging tapers, in L: the manual's 2 L (TA-37), or less
DEVICE_PLACING_SD_M = 8.0  # devices are set out by pacing. Chosen by us
SHORTEST_CLOSURE_M = 120.0  # between the end of a taper and the next opening. Chosen by us
# How much likelier a first trace is than a further one to seem to be in a closed lane: one witness does not open it
FIRST_SEEMING_FACTOR = 50.0


def interval_evidence(
    in_lane: FloatArray,
    reached: BoolArray,
    *,
    visibility: FloatArray,
    seeming: FloatArray,
    spacing: float,
    changes: FloatArray,
    driven_m: FloatArray,
    without_change_m: float,
    left_to: FloatArray | None = None,
) -> FloatArray:
    """Log LR (stations, stations) of closed on [e, b] against open, -inf where b < e.

    `in_lane` (traces, stations) is the chance of being in the lane, `visibility` (traces,) v, `seeming` (traces, stations) rho,
    `changes` (traces,) the lane changes of each on the `driven_m` (traces,) [m] of all of the road; one in `without_change_m`
    [m] is expected beforehand.
    With `left_to` (traces, stations), the chance of being in lanes that vehicles leave this one to, only such changes count for
    a closure, and neither who enters nor that nobody drives there.
    """
    to = in_lane if left_to is None else left_to
    return np.asarray(
        _interval_evidence(
            in_lane, reached, visibility, seeming, spacing, float(visibility @ changes),
            without_change_m + float(visibility @ driven_m), MERGE_LENGTH_M, np.log(FIRST_SEEMING_FACTOR), to, left_to is None,
        )
    )  # fmt: skip


@numba.njit(cache=True, nogil=True)
def _interval_evidence(  # noqa: C901 - sums over traces for each pair of stations, with its arrays at hand
    in_lane: FloatArray, reached: BoolArray, visibility: FloatArray, seeming: FloatArray, spacing: float, changes: float,
    driven: float, merge_length: float, first_user: float, left_to: FloatArray, counts: bool,
) -> FloatArray:  # fmt: skip
    """See `interval_evidence`."""
    n, m = in_lane.shape
    least = seeming.min()
    beside, entries = np.zeros(m + 1), np.zeros(m + 1)  # cumulated
    for t in range(m):
        for i in range(n):
            if reached[i, t]:
                beside[t + 1] += visibility[i] * (1 - in_lane[i, t]) * spacing
                if t > 0 and reached[i, t - 1]:
                    entries[t + 1] += visibility[i] * max(in_lane[i, t] - in_lane[i, t - 1], 0.0)
        beside[t + 1] += beside[t]
        entries[t + 1] += entries[t]
    result = np.full((m, m), -np.inf)
    reach = round(merge_length / spacing)
    first = driven / (1 + changes)
    left, entered = np.zeros((n, m + 1)), np.zeros((n, m + 1))  # up to a station, cumulated
    for i in range(n):
        for t in range(m - 1):
            step = in_lane[i, t + 1] - in_lane[i, t] if reached[i, t] and reached[i, t + 1] else 0.0
            gone = max(-step, 0.0) if counts else min(max(-step, 0.0), max(left_to[i, t + 1] - left_to[i, t], 0.0))
            left[i, t + 1] = left[i, t] + gone
            entered[i, t + 1] = entered[i, t] + (max(step, 0.0) if counts else 0.0)
        left[i, m], entered[i, m] = left[i, m - 1], entered[i, m - 1]
    ahead = _distance_of_crowd(left, visibility, reach, -1) * spacing * 2 / merge_length
    behind = _distance_of_crowd(entered, visibility, reach, 1) * spacing * 2 / merge_length
    for e in range(m):
        result[e, e:] = 0.0
        users, merges = np.zeros(m), np.zeros(m)
        for i in range(n):
            if visibility[i] < 0.01:
                continue
            leaves = min(left[i, e] - left[i, max(e - reach, 0)], 1.0)
            most, rho = 0.0, 0.0
            for b in range(e, m):
                if reached[i, b] and in_lane[i, b] > most:
                    most = in_lane[i, b]
                if seeming[i, b] > rho and in_lane[i, b] > 0.5:
                    rho = seeming[i, b]
                users[b] += visibility[i] * most
                returns = min(entered[i, min(b + 1 + reach, m)] - entered[i, b], 1.0)
                merges[b] += visibility[i] * (1 - most) * (leaves + returns)
                result[e, b] += visibility[i] * np.log(1 - most + most * max(rho, least) + 1e-12)
        for b in range(e, m):
            merged = min(merges[b], changes)
            fewer = math.lgamma(1 + changes - merged) - math.lgamma(1 + changes) + merged * np.log(driven / merge_length)
            e_in = beside[b + 1] - beside[e]
            e_out = beside[m] - e_in
            u = entries[e] + entries[m] - entries[min(b + 1 + reach, m)]
            absence = (1 + u) * np.log(1 + e_in / (first + e_out)) if counts else 0.0
            result[e, b] += max(fewer, 0.0) + absence + first_user * min(users[b], 1.0) - ahead[e] - behind[b]
    return result


@numba.njit(cache=True, nogil=True)
def _distance_of_crowd(changed: FloatArray, visibility: FloatArray, reach: int, direction: int) -> FloatArray:
    """Mean distance (stations,) [stations] of the changes `changed` (traces, stations + 1), cumulated, from each station.

    Changes within `reach` of it in the `direction` count, 1 or -1. Where less than one change is seen, the distance is that
    share of the mean: what may not have happened tells as much less.
    """
    n, m = changed.shape[0], changed.shape[1] - 1
    weight = np.zeros(m)
    for t in range(m):
        for i in range(n):
            weight[t] += visibility[i] * (changed[i, t + 1] - changed[i, t])
    result = np.zeros(m)
    for at in range(m):
        count, distance = 0.0, 0.0
        for step in range(reach):
            t = at + step if direction > 0 else at - 1 - step
            if 0 <= t < m:
                count += weight[t]
                distance += weight[t] * (step + 0.5)
        result[at] = distance / max(count, 1.0)
    return result


def interval_prior(
    s: FloatArray, lane: int, n_lanes: int, *, announced: AnnouncedZone | None, taper_m: float, shoulder: float
) -> FloatArray:
    """Prior probabilities (lengths, stations, stations) of the taper's length and [e, b], which sum to 1."""
    m, spacing = len(s), s[1] - s[0]
    anywhere = np.full(m, 1 / m)
    start, end = np.array([p_length * anywhere for _, p_length in TAPER_LENGTHS]), anywhere
    if announced is not None:
        start *= 1 - P_ANNOUNCEMENT_RIGHT
        sd = np.hypot(np.hypot(announced.start_sd_m, DEVICE_PLACING_SD_M), spacing / 3)
        for number, (length, p_length) in enumerate(TAPER_LENGTHS):
            for offset, weight in _usable_ends(lane, n_lanes, length=length, taper_m=taper_m, shoulder=shoulder):
                start[number] += P_ANNOUNCEMENT_RIGHT * p_length * weight * _normal(s, announced.start_m + offset, sd)
        end = (1 - P_ANNOUNCEMENT_RIGHT) * anywhere + P_ANNOUNCEMENT_RIGHT * _normal(
            s, announced.end_m - DOWNSTREAM_TAPER_M, np.hypot(announced.end_sd_m, spacing / 3)
        )
    shortest = min(max(1, round(SHORTEST_CLOSURE_M / spacing)), m - 1)
    prior = np.triu(start[:, :, None] * end, k=shortest)
    return np.asarray(prior / max(prior.sum(), 1e-300))


def _usable_ends(lane: int, n_lanes: int, *, length: float, taper_m: float, shoulder: float) -> list[tuple[float, float]]:
    """(distance [m] from the first device to where the lane can no longer be driven, probability) for a taper's `length`."""
    before = min(lane, n_lanes - 1 - lane)  # lanes that close before this one, at most
    orders = [(0, 1.0)] if before == 0 else [(0, 0.5), (before, 0.5)]
    return [
        (has_shoulder * shoulder / 3 * taper_m + count * (1 + tangent) * taper_m + USABLE_TAPER_SHARE * length * taper_m,
         weight * p_shoulder * p_tangent)
        for count, weight in orders
        for has_shoulder, p_shoulder in ((1, P_SHOULDER_TAPER), (0, 1 - P_SHOULDER_TAPER))
        for tangent, p_tangent in (((0.0, 1.0),) if count == 0 else TANGENTS)
    ]  # fmt: skip


def _normal(s: FloatArray, mean: float, sd: float) -> FloatArray:
    density = np.exp(-0.5 * ((s - mean) / sd) ** 2)
    return np.asarray(density / max(density.sum(), 1e-12)) if density.sum() > 1e-12 else np.zeros_like(density)
