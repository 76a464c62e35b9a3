"""Closures: from where to where each lane is closed, as a posterior over intervals.

A lane is closed from the station e, past which no vehicle fits between the devices and the open lanes, to the station b at which it
opens again. The log of the odds of closed on [e, b] against open is a sum of three kinds of evidence:

    log LR(e, b) =   sum_i v_i log[ (1 - m_i) (1 + sum_s left_i(s) (f / lambda - 1)) + m_i rho_i ]
                   + (1 + u) log(1 + E_in / (E_0 + E_out))

m_i: the chance that trace i drove in the lane between e and b; rho_i: that of a vehicle to be there though the lane is closed (a
work vehicle, a stray one, a jump of its positions). left_i(s): that it left the lane at s, within the last `merge_length_m` ahead of
e, where drivers leave with density f, and elsewhere with the rate lambda of lane changes. E: metres driven beside the lane by
vehicles that did not enter, u: entries seen elsewhere; both on a road whose drivers enter at an unknown rate (a gamma distribution).
"""

from dataclasses import dataclass, replace

import numba
import numpy as np

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.crowd_mapping.lanes.fit import LaneFit, fit_lanes
from wzsumo.crowd_mapping.lanes.lane_chain import LANE_CHANGES_PER_M
from wzsumo.crowd_mapping.lanes.observations import Observations
from wzsumo.crowd_mapping.lanes.receivers import shares_after
from wzsumo.frames import FloatArray

ODD_SHARE = 0.05  # of a first vehicle in a closed lane; and of each further one
WORK_VEHICLE_ODD_SHARE = 0.5  # of a vehicle that stands or creeps there while others drive by
WORK_VEHICLE_SLOWNESS = 3.0  # times the crowd's time per metre
MERGE_LENGTH_M = 400.0  # ahead of a closure, in which drivers leave the lane: field studies put most merges there
P_CLOSED_ANNOUNCED, P_CLOSED = 0.5, 0.05
P_ANNOUNCEMENT_RIGHT = 0.8
USABLE_TAPER_SHARE = 0.69  # of a taper: until 1.13 m of a 3.66 m lane remain with half a vehicle and the wander beside
DOWNSTREAM_TAPER_M = 30.0  # MUTCD 11th ed., Table 6B-3: 50 to 100 ft a lane
TAPER_LENGTHS = ((0.5, 0.15), (0.75, 0.15), (1.0, 0.5), (1.5, 0.12), (2.0, 0.08))  # in manual lengths, with probabilities
TAPER_PLACING_SD_M = 8.0
MIN_DOUBTFUL_USERS, MAX_DOUBTFUL_SHARE = 0.5, 0.35  # of traces that seem to drive where others do not
LEAST_LOG_ODDS = -15.0
DOUBT_ROUNDS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class Closure:
    """What is known of one lane: `p_closed`, and given that it is closed the joint probabilities (starts, ends) of (e, b)."""

    p_closed: float
    interval: FloatArray  # (stations, stations), sums to 1; [e, b]


@dataclass(frozen=True, kw_only=True)
class ClosurePrior:
    """What is known beforehand: the announcement, the manual's taper length [m], shoulders (right, left) [lane widths]."""

    announced: AnnouncedZone | None
    taper_m: float
    shoulders: tuple[float, float]

    def log_odds(self, lane: int) -> float:
        """Of a lane that is closed somewhere."""
        p = P_CLOSED if self.announced is None else P_CLOSED_ANNOUNCED
        if self.announced is not None and self.announced.closed_lanes is not None:
            p = 0.8 if lane in self.announced.closed_lanes else 0.1
        return float(np.log(p / (1 - p)))


def fit_closures(fit: LaneFit, observations: Observations, prior: ClosurePrior) -> tuple[LaneFit, list[Closure]]:
    """The closures of all lanes, and the fit that knows of them.

    Where some traces seem to drive in a lane that others avoid, the traces are fitted again with that lane closed: they may be of
    receivers that err by a lane.
    """
    closures = []
    for lane in range(fit.setting.n_lanes):
        evidence, closed_somewhere = _evidence(lane, fit, observations, prior)
        log_odds = prior.log_odds(lane) + closed_somewhere
        e, b = np.unravel_index(int(evidence.argmax()), evidence.shape)
        seen = observations.eta[:, e : b + 1].max(axis=1) > 0
        users = np.where(seen, fit.in_lane[:, e : b + 1, lane].max(axis=1), 0.0)
        if MIN_DOUBTFUL_USERS < users.sum() < MAX_DOUBTFUL_SHARE * seen.sum() and log_odds > LEAST_LOG_ODDS - 3 * users.sum():
            setting = replace(fit.setting, closed=(*fit.setting.closed, (lane, int(e), int(b))))
            closed = fit_lanes(
                observations, setting, course=fit.course.offset, receivers=fit.receivers, shares=shares_after(fit.class_share),
                rounds=DOUBT_ROUNDS,
            )  # fmt: skip
            ratio = (1 - ODD_SHARE) * np.exp(np.clip(closed.log_likelihood - fit.log_likelihood, -50, 5))
            gain = np.log(ratio + ODD_SHARE)
            without_users = _evidence(lane, closed, observations, prior, witness=ratio / (ratio + ODD_SHARE))
            doubted = prior.log_odds(lane) + float(gain.sum()) + without_users[1]
            if doubted > log_odds:
                log_odds, evidence = doubted, without_users[0]
            if log_odds > 0:
                fit = closed
        closures.append(Closure(p_closed=float(1 / (1 + np.exp(-np.clip(log_odds, -50, 50)))), interval=evidence))
    return fit, closures


def _evidence(
    lane: int, fit: LaneFit, observations: Observations, prior: ClosurePrior, *, witness: FloatArray | float = 1.0
) -> tuple[FloatArray, float]:
    """(posterior (starts, ends) given that the lane is closed, log of the evidence for closed against open).

    `witness` (traces,) is the weight of each trace.
    """
    visibility = witness * (1 - fit.stray) / (1 + (2 * fit.sigma / fit.course.width) ** 2)
    evidence = _interval_evidence(
        fit.in_lane[:, :, lane], observations.eta > 0, visibility, _odd_shares(observations, fit), observations.spacing,
        _lane_changes_per_m(fit, observations), MERGE_LENGTH_M,
    )  # fmt: skip
    shoulder = prior.shoulders[2 * lane > fit.setting.n_lanes - 1]
    chances = _interval_prior(
        observations.stations, lane, fit.setting.n_lanes, announced=prior.announced, taper_m=prior.taper_m, shoulder=shoulder
    )
    log_joint = np.where(chances > 0, evidence + np.log(np.maximum(chances, 1e-300)), -np.inf)
    best = log_joint.max()
    joint = np.exp(log_joint - best)
    return joint / joint.sum(), float(best + np.log(joint.sum()))


def _lane_changes_per_m(fit: LaneFit, observations: Observations) -> float:
    """Rate [1/m] at which vehicles change lanes."""
    seen = observations.eta > 0
    both = (seen[:, 1:] & seen[:, :-1])[:, :, None]
    changes = float((np.abs(np.diff(fit.in_lane, axis=1)) * both * (1 - fit.stray)[:, None, None]).sum()) / 2
    return float((1 + changes) / (1 / LANE_CHANGES_PER_M + seen.sum() * observations.spacing))


def _odd_shares(observations: Observations, fit: LaneFit) -> FloatArray:
    """rho (traces, stations): of a vehicle that is there though the lane is closed."""
    slowness = observations.slowness
    with np.errstate(invalid="ignore"):
        usual = np.nanmedian(np.where(slowness > 0, slowness, np.nan), axis=0)
    slow = slowness > WORK_VEHICLE_SLOWNESS * np.nan_to_num(usual, nan=np.inf)[None, :]
    return np.where(slow, WORK_VEHICLE_ODD_SHARE, ODD_SHARE)


@numba.njit(cache=True, nogil=True)
def _interval_evidence(in_lane, seen, visibility, odd, spacing, rate, merge_length):
    """Log LR (stations, stations) of closed on [e, b] against open; -inf where b <= e."""
    n, m = in_lane.shape
    beside, entries = np.zeros(m + 1), np.zeros(m + 1)  # cumulated
    for t in range(m):
        for i in range(n):
            if seen[i, t]:
                beside[t + 1] += visibility[i] * (1 - in_lane[i, t]) * spacing
                if t > 0 and seen[i, t - 1]:
                    entries[t + 1] += visibility[i] * max(in_lane[i, t] - in_lane[i, t - 1], 0.0)
        beside[t + 1] += beside[t]
        entries[t + 1] += entries[t]
    result = np.full((m, m), -np.inf)
    reach = int(round(merge_length / spacing))
    ratio = 1.0 / merge_length / rate
    first = 1.0 / rate
    left, entered = np.zeros((n, m)), np.zeros((n, m))  # within `merge_length` ahead of a station, and after it
    for i in range(n):
        for t in range(m - 1):
            if seen[i, t] and seen[i, t + 1]:
                step = in_lane[i, t + 1] - in_lane[i, t]
                for at in range(t + 1, min(t + 1 + reach, m)):
                    left[i, at] += max(-step, 0.0)
                for at in range(max(t - reach, 0), t + 1):
                    entered[i, at] += max(step, 0.0)
    for e in range(m):
        result[e, e:] = 0.0
        for i in range(n):
            if visibility[i] < 0.01:
                continue
            bonus = 1 + min(left[i, e], 1.0) * max(ratio - 1, 0.0)
            most, rho = 0.0, 0.0
            for b in range(e, m):
                if seen[i, b] and in_lane[i, b] > most:
                    most = in_lane[i, b]
                if odd[i, b] > rho and in_lane[i, b] > 0.5:
                    rho = odd[i, b]
                again = 1 + min(entered[i, b], 1.0) * max(ratio - 1, 0.0)
                result[e, b] += visibility[i] * np.log((1 - most) * bonus * again + most * max(rho, 0.05) + 1e-12)
        for b in range(e, m):
            e_in = beside[b + 1] - beside[e]
            e_out = beside[m] - e_in
            u = entries[e] + entries[m] - entries[b + 1]
            result[e, b] += (1 + u) * np.log(1 + e_in / (first + e_out))
    return result


def _interval_prior(
    s: FloatArray, lane: int, n_lanes: int, *, announced: AnnouncedZone | None, taper_m: float, shoulder: float
) -> FloatArray:
    """Prior probabilities (stations, stations) of [e, b], which sum to 1."""
    m, spacing = len(s), s[1] - s[0]
    anywhere = np.full(m, 1 / m)
    start, end = anywhere.copy(), anywhere.copy()
    if announced is not None:
        start = (1 - P_ANNOUNCEMENT_RIGHT) * anywhere
        for offset, weight in _usable_ends(lane, n_lanes, taper_m=taper_m, shoulder=shoulder):
            sd = np.hypot(np.hypot(announced.start_sd_m, TAPER_PLACING_SD_M), spacing / 3)
            start = start + P_ANNOUNCEMENT_RIGHT * weight * _normal(s, announced.start_m + offset, sd)
        end = (1 - P_ANNOUNCEMENT_RIGHT) * anywhere + P_ANNOUNCEMENT_RIGHT * _normal(
            s, announced.end_m - DOWNSTREAM_TAPER_M, np.hypot(announced.end_sd_m, spacing / 3)
        )
    prior = np.triu(np.outer(start, end), k=max(1, int(round(40.0 / spacing))))
    return prior / max(prior.sum(), 1e-300)


def _usable_ends(lane: int, n_lanes: int, *, taper_m: float, shoulder: float) -> list[tuple[float, float]]:
    """(distance [m] from the first device to where the lane can no longer be driven, probability)."""
    before = min(lane, n_lanes - 1 - lane)  # lanes that close before this one, at most
    orders = [(0, 1.0)] if before == 0 else [(0, 0.5), (before, 0.5)]
    return [
        (has_shoulder * shoulder / 3 * taper_m + count * (1 + tangent) * taper_m + USABLE_TAPER_SHARE * share * taper_m,
         weight * p_shoulder * p_tangent * p_share)
        for count, weight in orders
        for has_shoulder, p_shoulder in ((1, 0.6), (0, 0.4))
        for tangent, p_tangent in (((0.0, 1.0),) if count == 0 else ((0.0, 0.3), (1.0, 0.3), (2.0, 0.4)))
        for share, p_share in TAPER_LENGTHS
    ]  # fmt: skip


def _normal(s: FloatArray, mean: float, sd: float) -> FloatArray:
    density = np.exp(-0.5 * ((s - mean) / sd) ** 2)
    return np.asarray(density / max(density.sum(), 1e-12)) if density.sum() > 1e-12 else np.zeros_like(density)


def p_open_strips(closure: Closure, s: FloatArray, *, closing_side: int, taper_m: float, strips: int) -> FloatArray:
    """Probability (stations, strips) that each strip of the lane is open, from its right line to its left one.

    `closing_side` is the side, 1 left or -1 right, that the taper closes first.
    """
    spacing = s[1] - s[0]
    across = (np.arange(strips) + 0.5) / strips
    inner = across if closing_side > 0 else 1 - across  # distance from the line that closes last
    e_share, b_share = closure.interval.sum(axis=1), closure.interval
    closed = np.zeros((len(s), strips))
    joint = b_share
    for share, p_share in TAPER_LENGTHS:
        for j, f in enumerate(inner):
            begins = s + (USABLE_TAPER_SHARE - f) * 0 + ((1 - f) - USABLE_TAPER_SHARE) * share * taper_m
            ends = s + f * DOWNSTREAM_TAPER_M
            # P(begins(e) <= station < ends(b)) = P(begins <= station) - P(begins <= station and ends <= station)
            e_reach = np.searchsorted(begins, s, side="right")
            b_reach = np.searchsorted(ends, s, side="right")
            cumulative = np.zeros((len(s) + 1, len(s) + 1))
            cumulative[1:, 1:] = joint.cumsum(axis=0).cumsum(axis=1)
            p = cumulative[e_reach, len(s)] - cumulative[e_reach, b_reach]
            closed[:, j] += p_share * p
    del e_share, spacing
    return 1 - closure.p_closed * closed
