"""Closures: whether each lane is closed somewhere, from where to where, and which strips of it are open along the road."""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.crowd_mapping.lanes.closure_evidence import (
    DOWNSTREAM_TAPER_M,
    FIRST_SEEMING_FACTOR,
    SHORTEST_CLOSURE_M,
    TAPER_LENGTHS,
    USABLE_TAPER_SHARE,
    interval_evidence,
    interval_prior,
)
from wzsumo.crowd_mapping.lanes.fit import LaneFit, crowd_of, fit_lanes
from wzsumo.crowd_mapping.lanes.lane_chain import LANE_CHANGES_PER_M
from wzsumo.crowd_mapping.lanes.observations import Observations
from wzsumo.crowd_mapping.lanes.witnesses import lanes_driven
from wzsumo.frames import BoolArray, FloatArray

P_CLOSED_ANNOUNCED, P_CLOSED = 0.5, 0.05  # of a lane somewhere along the road, where a zone is announced and where none is
P_CLOSED_AS_SAID, P_CLOSED_NOT_SAID = 0.8, 0.1  # where the announcement says which lanes are closed
SEEMING_SHARE = 0.001  # of traces that seem to drive in a closed lane: stray vehicles, jumps of positions. Chosen by us
# The same of a vehicle that stands or creeps there while nearly all others drive by: a work vehicle
SEEMING_SHARE_OF_SLOW, SLOW_FACTOR = 0.5, 3.0
QUEUED_SHARE = 0.25  # of traces that are slow at a place: more of them stand in a queue. Chosen by us
MIN_SLOW_S = 20.0  # that such a vehicle loses; a fix that is a second or two late loses no more. Chosen by us
# A closure is doubted where this many traces, and at most this share of them, seem to drive in it
MIN_DOUBTFUL_USERS, MAX_DOUBTFUL_SHARE = 0.5, 0.35
DOUBT_TURNS, DOUBT_ROUNDS = 4, 1  # of a fit with the lane closed and of where it is closed; of the fit within each turn
MIN_DOUBTFUL_SIGMA_M = 0.8  # of the receivers of those users: better ones do not err by a lane. Chosen by us
ENOUGH_GOOD = 10  # traces of good receivers, from which on these alone say where a lane has further closures. Chosen by us
LEAST_USER = 0.01  # chance of a trace to be in the closed lane, from which on it is fitted again
LEAST_LOG_ODDS = -15.0  # of a closure that is worth a further fit


@dataclass(frozen=True, kw_only=True, eq=False)
class Closure:
    """One closure of a lane: `p_closed`, and given that it is closed the probabilities of `interval`.

    These (lengths, stations, stations) are of the length of its taper, one of TAPER_LENGTHS, and of [e, b].
    """

    p_closed: float
    interval: FloatArray


@dataclass(frozen=True, kw_only=True)
class ClosurePrior:
    """What is known beforehand: the announcement, the manual's taper length [m], shoulders (right, left) [lane widths]."""

    announced: AnnouncedZone | None = None
    taper_m: float = 0.0
    shoulders: tuple[float, float] = (0.0, 0.0)

    def log_odds(self, lane: int) -> float:
        """Of a lane that is closed somewhere."""
        p = P_CLOSED if self.announced is None else P_CLOSED_ANNOUNCED
        if self.announced is not None and self.announced.closed_lanes is not None:
            p = P_CLOSED_AS_SAID if lane in self.announced.closed_lanes else P_CLOSED_NOT_SAID
        return float(np.log(p / (1 - p)))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sight:
    """A fit to its observations, with the ground `driven` (traces, stations, lanes) and where vehicles are `slow`."""

    fit: LaneFit
    observations: Observations
    driven: FloatArray
    slow: BoolArray


def _sight(fit: LaneFit, observations: Observations, slow: BoolArray) -> _Sight:
    return _Sight(fit=fit, observations=observations, driven=lanes_driven(fit, observations), slow=slow)


def fit_closures(fit: LaneFit, observations: Observations, prior: ClosurePrior) -> tuple[LaneFit, list[list[Closure]]]:
    """The closures of each lane, and the fit that knows of them: one, the announced where one is, and those likely beside it.

    Where some traces seem to drive in a lane that others avoid, the traces are fitted again with that lane closed: they may be
    of receivers that err by a lane.
    """
    sight = _sight(fit, observations, slow_stretches(observations))
    first = []
    for lane in range(fit.setting.n_lanes):
        interval, log_ratio = _evidence(lane, sight, prior)
        log_odds = prior.log_odds(lane) + log_ratio
        good, _ = _evidence(lane, sight, prior, witness=_good_receivers(sight.fit))
        if log_odds > LEAST_LOG_ODDS and _users_may_err(lane, good, sight):
            closed, doubted, doubted_log_odds = _doubted(lane, good, sight, prior)
            log_odds = max(log_odds, doubted_log_odds)
            if log_odds > 0:
                sight, interval = closed, doubted
        first.append(_closure(interval, log_odds))
    return sight.fit, [_with_others(lane, closure, sight) for lane, closure in enumerate(first)]


def _with_others(lane: int, closure: Closure, sight: _Sight) -> list[Closure]:
    """A closure, and others of its lane, each where the others are not."""
    others = _beside(lane, closure, slice(0, len(sight.observations.stations)), sight)
    interval = closure.interval.copy()
    for other in others:
        first, last = _likeliest(other.interval)
        interval[:, : last + 1, first:] = 0.0  # e <= last and b >= first: both overlap
    return [Closure(p_closed=closure.p_closed, interval=interval / max(interval.sum(), 1e-300)), *others]


def _closure(interval: FloatArray, log_odds: float) -> Closure:
    return Closure(p_closed=float(1 / (1 + np.exp(-np.clip(log_odds, -50, 50)))), interval=interval)


def _beside(lane: int, closure: Closure, within: slice, sight: _Sight) -> list[Closure]:
    """Closures that are likelier than not, nothing being announced, ahead of one that is and behind it, `within` stations.

    Between two closures vehicles drove in the lane. Good receivers alone are asked where there are enough of them: those that
    err by a lane seem to drive in lanes that nobody drives.
    """
    if closure.p_closed <= 0.5:
        return []
    unannounced, found = ClosurePrior(), []
    e, b = _likeliest(closure.interval)
    good = _good_receivers(sight.fit)
    used = np.flatnonzero(good @ sight.driven[:, :, lane] >= 1)  # else it is one closure, and longer
    ahead, behind = used[(used >= within.start) & (used < e)], used[(used > b) & (used < within.stop)]
    parts = [slice(within.start, int(ahead.max()))] if len(ahead) else []
    parts += [slice(int(behind.min()) + 1, within.stop)] if len(behind) else []
    for part in parts:
        if (part.stop - part.start) * sight.observations.spacing > SHORTEST_CLOSURE_M:
            interval, log_ratio = _evidence(lane, sight, unannounced, witness=good, part=part)
            other = _closure(interval, unannounced.log_odds(lane) + log_ratio)
            if other.p_closed > 0.5:
                found += [other, *_beside(lane, other, part, sight)]
    return found


def _good_receivers(fit: LaneFit) -> FloatArray:
    """1 for traces (traces,) of receivers that do not err by a lane, else 0; 1 for all where these are too few."""
    good = fit.sigma < MIN_DOUBTFUL_SIGMA_M
    return np.where(good, 1.0, 0.0) if good.sum() >= ENOUGH_GOOD else np.ones(len(good))


def log_closing(fit: LaneFit, observations: Observations) -> float:
    """Log of how much likelier traces are where each lane may be closed somewhere, nothing being announced.

    A chain of lanes prices each vehicle that leaves a closed lane as a lane change of its own. What it knows already does not
    count again: how seldom a lane is entered. Nor do changes to lanes farther out, as on the way to an exit.
    """
    sight = _sight(fit, observations, slow_stretches(observations))
    inside = [_lanes_inside(lane, fit.setting.n_lanes) for lane in range(fit.setting.n_lanes)]
    ratios = np.array(
        [
            _evidence(lane, sight, ClosurePrior(), left_to=sight.driven[:, :, others].sum(axis=2))[1]
            for lane, others in enumerate(inside)
        ]
    )
    return float(np.logaddexp(np.log(1 - P_CLOSED), np.log(P_CLOSED) + ratios).sum())


def _lanes_inside(lane: int, n_lanes: int) -> list[int]:
    """The neighbours of a lane that are no farther from the middle of the road than it is."""
    centre = (n_lanes - 1) / 2
    return [k for k in (lane - 1, lane + 1) if 0 <= k < n_lanes and abs(k - centre) <= max(abs(lane - centre), 1.0)]


def _users_may_err(lane: int, interval: FloatArray, sight: _Sight) -> bool:
    """Whether some traces seem to drive in a likely closure, few of those that pass, and of receivers that err by a lane."""
    e, b = _likeliest(interval)
    seen = sight.observations.reached[:, e : b + 1].any(axis=1)
    users = np.where(seen, sight.driven[:, e : b + 1, lane].max(axis=1), 0.0)
    sigma = float((users * sight.fit.sigma).sum() / max(users.sum(), 1e-9))
    return sigma > MIN_DOUBTFUL_SIGMA_M and MIN_DOUBTFUL_USERS < users.sum() < MAX_DOUBTFUL_SHARE * seen.sum()


def _doubted(lane: int, interval: FloatArray, sight: _Sight, prior: ClosurePrior) -> tuple[_Sight, FloatArray, float]:
    """(fit, posterior of taper and [e, b], log odds of closed) with the lane held to be closed, first at the likeliest [e, b].

    Fit and interval are found in turns: a trace that is held to drive in the lane hides the rest of a closure.
    """
    fit, observations = sight.fit, sight.observations
    closed, tried = fit, []
    users = np.zeros(len(observations.ids), dtype=bool)
    for _ in range(DOUBT_TURNS):
        at = _likeliest(interval)
        users |= sight.driven[:, at[0] : at[1] + 1, lane].max(axis=1) > LEAST_USER
        setting = replace(fit.setting, closed=(*fit.setting.closed, (lane, *at)))
        closed = fit_lanes(
            observations,
            setting,
            course=closed.course.offset,
            receivers=fit.receivers,
            rounds=DOUBT_ROUNDS,
            crowd=crowd_of(closed, observations),
            others=(closed, users),
        )
        ratio = (1 - SEEMING_SHARE) * np.exp(np.clip(closed.log_likelihood - fit.log_likelihood, -50, 0))
        follows = ratio / (ratio + SEEMING_SHARE)
        seen_closed = _sight(closed, observations, sight.slow)
        interval, log_ratio = _evidence(lane, seen_closed, prior, witness=follows)
        first = np.log(FIRST_SEEMING_FACTOR) * min(float((1 - follows).sum()), 1.0)
        log_odds = prior.log_odds(lane) + float(np.log(ratio + SEEMING_SHARE).sum()) + first + log_ratio
        tried.append((seen_closed, interval, log_odds))
        if _likeliest(interval) == at:
            break
    return max(tried, key=lambda one: one[2])


def _likeliest(interval: FloatArray) -> tuple[int, int]:
    of_any_length = interval.sum(axis=0)
    e, b = np.unravel_index(int(of_any_length.argmax()), of_any_length.shape)
    return int(e), int(b)


def _evidence(
    lane: int,
    sight: _Sight,
    prior: ClosurePrior,
    *,
    witness: FloatArray | float = 1.0,
    left_to: FloatArray | None = None,
    part: slice = slice(None),
) -> tuple[FloatArray, float]:
    """(posterior of taper and [e, b] given that the lane is closed, log of the evidence for closed against open).

    The posterior has the shape (lengths, stations, stations).

    `witness` (traces,) is the weight of each trace; `part` are the stations within which the lane may be closed.
    """
    fit, observations = sight.fit, sight.observations
    evidence = interval_evidence(
        sight.driven[:, part, lane],
        observations.reached[:, part],
        visibility=witness * (1 - fit.stray) / (1 + (2 * fit.sigma / fit.course.width) ** 2),
        seeming=np.where(sight.slow[:, part], SEEMING_SHARE_OF_SLOW, SEEMING_SHARE),
        spacing=observations.spacing,
        changes=_lane_changes(fit, observations),
        driven_m=observations.reached.sum(axis=1) * observations.spacing,
        without_change_m=1 / LANE_CHANGES_PER_M,
        left_to=left_to,
    )
    n_lanes = fit.setting.n_lanes
    chances = interval_prior(
        observations.stations[part], lane, n_lanes, announced=prior.announced, taper_m=prior.taper_m,
        shoulder=prior.shoulders[2 * lane > n_lanes - 1],
    )  # fmt: skip
    log_joint = np.where(chances > 0, evidence + np.log(np.maximum(chances, 1e-300)), -np.inf)
    best = log_joint.max()
    joint = np.exp(log_joint - best)
    interval = np.zeros((len(chances), len(observations.stations), len(observations.stations)))
    interval[:, part, part] = joint / joint.sum()
    return interval, float(best + np.log(joint.sum()))


def _lane_changes(fit: LaneFit, observations: Observations) -> FloatArray:
    """How often (traces,) each vehicle changes lanes."""
    both = (observations.reached[:, 1:] & observations.reached[:, :-1])[:, :, None]
    return np.asarray((np.abs(np.diff(fit.in_lane, axis=1)) * both).sum(axis=(1, 2)) / 2)


def slow_stretches(observations: Observations) -> BoolArray:
    """Where (traces, stations) a vehicle takes SLOW_FACTOR times as long a metre as all but the slowest QUEUED_SHARE.

    In a queue many are slow, a work vehicle is slow alone. Only vehicles that lose MIN_SLOW_S in all count: a fix may be late.
    """
    slowness = np.where(observations.slowness > 0, observations.slowness, np.nan)
    usual = np.full(slowness.shape[1], np.inf)
    some = np.isfinite(slowness).any(axis=0)
    usual[some] = np.nanquantile(slowness[:, some], 1 - QUEUED_SHARE, axis=0)
    slow = observations.slowness > SLOW_FACTOR * usual
    lost_s = np.where(slow, observations.slowness - np.where(some, usual, 0.0), 0.0).sum(axis=1) * observations.spacing
    return slow & (lost_s >= MIN_SLOW_S)[:, None]


def p_open_strips(
    closures: list[Closure], stations: FloatArray, *, outer_left: bool, taper_m: float, strips: int
) -> FloatArray:
    """Probability (stations, strips) that each strip of the lane is open, from its right line to its left one.

    A taper closes the strips from the outer line, the left one where `outer_left`, to the inner one, and ends where half a
    vehicle no longer fits at e; behind b they open again in the opposite order.
    """
    across = (np.arange(strips) + 0.5) / strips
    inner = across if outer_left else 1 - across  # distance from the inner line [lane widths]
    p_open = np.ones((len(stations), strips))
    for closure in closures:
        p_open *= 1 - closure.p_closed * _closed_strips(closure.interval, stations, inner, taper_m=taper_m)
    return np.clip(p_open, 0.0, 1.0)


def _closed_strips(interval: FloatArray, stations: FloatArray, inner: FloatArray, *, taper_m: float) -> FloatArray:
    """Chance (stations, strips) that a strip is closed if the lane is; `inner` (strips,) [lane widths] from the inner line."""
    n = len(stations)
    closed = np.zeros((n, len(inner)))
    for (length, _), of_length in zip(TAPER_LENGTHS, interval, strict=True):
        cumulated = np.zeros((n + 1, n + 1))
        cumulated[1:, 1:] = of_length.cumsum(axis=0).cumsum(axis=1)
        for strip, distance in enumerate(inner):
            # Strip closes at e + ((1 - distance) - USABLE_TAPER_SHARE) L, opens at b + distance times the downstream taper.
            begun = np.searchsorted(stations + (1 - distance - USABLE_TAPER_SHARE) * length * taper_m, stations, side="right")
            ended = np.searchsorted(stations + distance * DOWNSTREAM_TAPER_M, stations, side="right")
            closed[:, strip] += cumulated[begun, n] - cumulated[begun, ended]
    return closed
