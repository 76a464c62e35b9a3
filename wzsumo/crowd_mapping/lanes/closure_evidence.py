"""Evidence and prior of the interval [e, b] of stations over which a lane is closed.

The log of the odds of closed on [e, b] against open is

    log LR(e, b) =   sum_i v_i log[ (1 - m_i) (1 + l_i (f / lambda - 1)) (1 + n_i (f / lambda - 1)) + m_i rho_i ]
                   + (1 + u) log(1 + E_in / (E_0 + E_out))

m_i is the chance that trace i drove in the lane between e and b, rho_i the chance that it seems to, though the lane is
closed; l_i that it left the lane within MERGE_LENGTH_M ahead of e, n_i that it entered within as much after b. Drivers do so
with the density f = 1 / MERGE_LENGTH_M at a closure, and with the rate lambda of lane changes elsewhere. E [m] is driven beside
the lane by vehicles that do not enter it, u counts entries ahead of e and beyond the reach of b, so the last term is the ratio
of two gamma-Poisson predictions: all drivers share one unknown rate of entering, and evidence from mere absence grows with the
logarithm of the number of traces. v_i in [0, 1] is how well trace i tells lanes apart.
"""

import numba
import numpy as np

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.frames import BoolArray, FloatArray

# Ahead of a closure and behind it, in which drivers leave and enter the lane. Learned from our generator
MERGE_LENGTH_M = 400.0
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
    changes_per_m: float,
    left_to: FloatArray | None = None,
) -> FloatArray:
    """Log LR (stations, stations) of closed on [e, b] against open, -inf where b < e.

    `in_lane` (traces, stations) is the chance of being in the lane, `visibility` (traces,) v, `seeming` (traces, stations) rho.
    With `left_to` (traces, stations), the chance of being in lanes that vehicles leave this one to, only such changes count for
    a closure, and neither who enters nor that nobody drives there.
    """
    to = in_lane if left_to is None else left_to
    return np.asarray(
        _interval_evidence(
            in_lane, reached, visibility, seeming, spacing, changes_per_m, MERGE_LENGTH_M, np.log(FIRST_SEEMING_FACTOR),
            to, left_to is None,
        )
    )  # fmt: skip


@numba.njit(cache=True, nogil=True)
def _interval_evidence(  # noqa: C901 - sums over traces for each pair of stations, with its arrays at hand
    in_lane: FloatArray, reached: BoolArray, visibility: FloatArray, seeming: FloatArray, spacing: float, rate: float,
    merge_length: float, first_user: float, left_to: FloatArray, counts: bool,
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
    ratio = 1.0 / merge_length / rate
    first = 1.0 / rate
    left, entered = np.zeros((n, m)), np.zeros((n, m))  # within `merge_length` ahead of a station, and after it
    for i in range(n):
        for t in range(m - 1):
            if reached[i, t] and reached[i, t + 1]:
                step = in_lane[i, t + 1] - in_lane[i, t]
                gone = min(max(-step, 0.0), max(left_to[i, t + 1] - left_to[i, t], 0.0)) if not counts else max(-step, 0.0)
                for at in range(t + 1, min(t + 1 + reach, m)):
                    left[i, at] += gone
                for at in range(max(t - reach, 0), t + 1):
                    entered[i, at] += max(step, 0.0)
    for e in range(m):
        result[e, e:] = 0.0
        users = np.zeros(m)
        for i in range(n):
            if visibility[i] < 0.01:
                continue
            bonus = 1 + min(left[i, e], 1.0) * max(ratio - 1, 0.0)
            most, rho = 0.0, 0.0
            for b in range(e, m):
                if reached[i, b] and in_lane[i, b] > most:
                    most = in_lane[i, b]
                if seeming[i, b] > rho and in_lane[i, b] > 0.5:
                    rho = seeming[i, b]
                users[b] += visibility[i] * most
                again = 1 + min(entered[i, b], 1.0) * max(ratio - 1, 0.0) if counts else 1.0
                result[e, b] += visibility[i] * np.log((1 - most) * bonus * again + most * max(rho, least) + 1e-12)
        for b in range(e, m):
            e_in = beside[b + 1] - beside[e]
            e_out = beside[m] - e_in
            u = entries[e] + entries[m] - entries[min(b + 1 + reach, m)]
            absence = (1 + u) * np.log(1 + e_in / (first + e_out)) if counts else 0.0
            result[e, b] += absence + first_user * min(users[b], 1.0)
    return result


def interval_prior(
    s: FloatArray, lane: int, n_lanes: int, *, announced: AnnouncedZone | None, taper_m: float, shoulder: float
) -> FloatArray:
    """Prior probabilities (stations, stations) of [e, b], which sum to 1."""
    m, spacing = len(s), s[1] - s[0]
    anywhere = np.full(m, 1 / m)
    start, end = anywhere.copy(), anywhere.copy()
    if announced is not None:
        start = (1 - P_ANNOUNCEMENT_RIGHT) * anywhere
        for offset, weight in _usable_ends(lane, n_lanes, taper_m=taper_m, shoulder=shoulder):
            sd = np.hypot(np.hypot(announced.start_sd_m, DEVICE_PLACING_SD_M), spacing / 3)
            start = start + P_ANNOUNCEMENT_RIGHT * weight * _normal(s, announced.start_m + offset, sd)
        end = (1 - P_ANNOUNCEMENT_RIGHT) * anywhere + P_ANNOUNCEMENT_RIGHT * _normal(
            s, announced.end_m - DOWNSTREAM_TAPER_M, np.hypot(announced.end_sd_m, spacing / 3)
        )
    prior = np.triu(np.outer(start, end), k=min(max(1, round(SHORTEST_CLOSURE_M / spacing)), m - 1))
    return prior / max(prior.sum(), 1e-300)


def _usable_ends(lane: int, n_lanes: int, *, taper_m: float, shoulder: float) -> list[tuple[float, float]]:
    """(distance [m] from the first device to where the lane can no longer be driven, probability)."""
    before = min(lane, n_lanes - 1 - lane)  # lanes that close before this one, at most
    orders = [(0, 1.0)] if before == 0 else [(0, 0.5), (before, 0.5)]
    return [
        (has_shoulder * shoulder / 3 * taper_m + count * (1 + tangent) * taper_m + USABLE_TAPER_SHARE * share * taper_m,
         weight * p_shoulder * p_tangent * p_share)
        for count, weight in orders
        for has_shoulder, p_shoulder in ((1, P_SHOULDER_TAPER), (0, 1 - P_SHOULDER_TAPER))
        for tangent, p_tangent in (((0.0, 1.0),) if count == 0 else TANGENTS)
        for share, p_share in TAPER_LENGTHS
    ]  # fmt: skip


def _normal(s: FloatArray, mean: float, sd: float) -> FloatArray:
    density = np.exp(-0.5 * ((s - mean) / sd) ** 2)
    return np.asarray(density / max(density.sum(), 1e-12)) if density.sum() > 1e-12 else np.zeros_like(density)
