"""Which lanes are open and which are closed: hypotheses of a closure, weighed by levels, lane changes and where they happened.

A hypothesis says how many lanes there are and which of them, the leftmost ones or some between open ones, are closed from one
station to another, both unknown. A trace's lanes relative to its first are known, its first lane and its level's error are
not. Closures on the right are the same in the mirror.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from wzsumo.crowd_mapping.lane_expectation import expected_lanes
from wzsumo.crowd_mapping.lane_patterns import LanePattern, likely_patterns
from wzsumo.frames import FloatArray

IntArray = npt.NDArray[np.int64]
# Changes of lane: at discretion about one in 2 km; out of a closing lane one for certain, some 150 m ahead of its end.
DISCRETION_M, MERGE_AHEAD_M = 2000.0, 150.0
STATION_COST = 1.0  # -log chance of a station beside the lanes
MISTAKEN = (0.002, 0.02)  # least and most chance that a trace is nowhere near the lanes that it seems to drive in
CORE_M, CORE_SPREAD = 500.0, 0.6  # median length of the closed stretch and the standard deviation of its logarithm
PLACES = 18  # tried for either end of the closure
FIRST_SPREAD_M = 0.5
LESS_SD, MOST_DOUBT, MORE_SCALE = 0.2, 6.0, 0.3  # of the logarithm of the spread between traces against the usual one
SPREADS_M = np.geomspace(0.08, 6.0, 120)  # tried
SHARE_COUNTS = (3.0, 0.5)  # prior counts of vehicles in each open and each closing lane: open lanes are used about alike
LEAST_USERS = 0.6  # traces in the outermost lanes: a lane that nobody drove in is none
MOST_TRACES = 100  # by which hypotheses are weighed
HOPELESS = 12.0  # behind the best start in log evidence
STARTS, ITERATIONS, SETTLED = 3, 25, 1e-2


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What the traces say: levels (n,) [m] of their first lanes, lanes (n, stations) from the first, weights (n,)."""

    levels: FloatArray
    lanes: IntArray
    weights: FloatArray
    spacing: float  # of the stations [m]
    width: tuple[float, float]  # of the lanes, prior mean and sd [m]
    usual_spread: float  # between traces [m], as far as their drift tells it


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneHypothesis:
    """A fitted hypothesis: lane k's centre at right + k width above the course.

    `first` (n, lanes) are the chances of each trace's first lane; `closes` and `opens` are indices of stations, the second
    one beyond the last where the closed lanes do not open again.
    """

    pattern: LanePattern
    right: float
    width: float
    covariance: FloatArray  # (2, 2) [m^2] of right and width
    spread: float
    closes: int
    opens: int
    first: FloatArray
    log_evidence: float


def likely_hypotheses(evidence: Evidence, *, n_open: int | None, least_closed: int) -> list[LaneHypothesis]:
    """Hypotheses, the likeliest first, that differ in their lanes or by half a lane in level; `n_open` where that is known."""
    few = _thinned(evidence)
    tries = []
    for pattern in likely_patterns(n_open, least_closed=least_closed):
        costs = _Costs(few, pattern)
        quick = [_em(few, costs, right=right, iterations=2) for right in _starts(few, pattern.n_lanes)]
        tries += [(fit, costs) for fit in sorted(quick, key=_by_evidence)[:STARTS]]
    enough = max(fit.log_evidence for fit, _ in tries) - HOPELESS
    fits = [_em(few, costs, right=fit.right, iterations=ITERATIONS) for fit, costs in tries if fit.log_evidence > enough]
    kept: list[LaneHypothesis] = []
    for fit in sorted(fits, key=_by_evidence):
        if not any(_same(fit, other) for other in kept):
            kept.append(fit)
    return kept


def _same(fit: LaneHypothesis, other: LaneHypothesis) -> bool:
    return fit.pattern == other.pattern and abs(fit.right - other.right) < fit.width / 2


def fit_again(hypothesis: LaneHypothesis, evidence: Evidence) -> LaneHypothesis:
    """The hypothesis, with the closure where it was, fitted to other evidence; its own evidence stays."""
    costs = _Costs(evidence, hypothesis.pattern, pair=(hypothesis.closes, hypothesis.opens))
    fit = _em(evidence, costs, right=hypothesis.right, iterations=ITERATIONS)
    return replace(fit, log_evidence=hypothesis.log_evidence)


def _by_evidence(fit: LaneHypothesis) -> float:
    return -fit.log_evidence


def _starts(evidence: Evidence, n_lanes: int) -> FloatArray:
    """Levels [m] of the rightmost lane from which a fit may start."""
    quantiles = np.quantile(evidence.levels, [0.1, 0.5, 0.9])
    return np.unique(np.round([q - evidence.width[0] * lane for q in quantiles for lane in range(n_lanes)], 1))


def _thinned(evidence: Evidence) -> Evidence:
    n = len(evidence.levels)
    if n <= MOST_TRACES:
        return evidence
    some = np.unique(np.linspace(0, n - 1, MOST_TRACES).astype(int))
    return replace(evidence, levels=evidence.levels[some], lanes=evidence.lanes[some], weights=evidence.weights[some])


class _Costs:
    """How well each trace's lanes suit each first lane and each pair of places where the closure begins and ends."""

    def __init__(self, evidence: Evidence, pattern: LanePattern, *, pair: tuple[int, int] | None = None) -> None:
        n_stations = evidence.lanes.shape[1]
        self.pattern = pattern
        lanes = evidence.lanes[:, None, :] + np.arange(pattern.n_lanes)[:, None]  # (n, first lane, stations)
        beside = ((lanes < 0) | (lanes >= pattern.n_lanes)).sum(axis=2)
        # Beyond the outermost closed lane is as far from the open ones as in it.
        beyond = np.isin(lanes, pattern.closed) | ((lanes >= pattern.n_lanes) & (not pattern.is_interior))
        self.pairs = np.array([pair or (0, 0)])
        self.log_prior = np.zeros(1)
        if pattern.closed and pair is None:
            places = np.unique(np.linspace(1, n_stations, PLACES).astype(int))
            closes, opens = (side.ravel() for side in np.meshgrid(places[:-1], places, indexing="ij"))
            longer = opens > closes
            self.pairs = np.column_stack([closes, opens])[longer]
            length = (self.pairs[:, 1] - self.pairs[:, 0]) * evidence.spacing
            prior = np.exp(-0.5 * (np.log(length / CORE_M) / CORE_SPREAD) ** 2)
            self.log_prior = np.log(prior / prior.sum())
        driven = np.concatenate([np.zeros((*beyond.shape[:2], 1)), np.cumsum(beyond, axis=2)], axis=2)
        inside = driven[:, :, self.pairs[:, 1]] - driven[:, :, self.pairs[:, 0]]
        most_cost = -np.log(np.clip(ndtr(-evidence.width[0] / 2 / evidence.usual_spread), *MISTAKEN))
        cost = np.minimum(STATION_COST * (inside + beside[:, :, None]), most_cost)
        cost += np.log(2.0) * self._changes_between_two(lanes)
        if pattern.closed:
            # The last change out of a closed lane ahead of its end was no change at discretion.
            index = np.arange(n_stations)
            last = np.maximum.accumulate(np.where(beyond, index, -10_000), axis=2)[:, :, self.pairs[:, 0] - 1]
            ahead = (self.pairs[:, 0] - last) * evidence.spacing
            gain = np.log(DISCRETION_M / MERGE_AHEAD_M) - ahead / MERGE_AHEAD_M
            cost -= np.maximum(gain, 0.0)
        self.fit = np.ascontiguousarray(np.exp(-cost).transpose(0, 2, 1))  # (n, pairs, first lane)
        self.ever = np.stack([(lanes == k).any(axis=2) for k in range(pattern.n_lanes)], axis=2).astype(float)

    def _changes_between_two(self, lanes: IntArray) -> FloatArray:
        """Changes of lane (n, first lane, pairs) out of lanes that have another on either side: drivers chose between two."""
        here, closed = lanes[:, :, :-1], self.pattern.closed
        between = (np.diff(lanes, axis=2) != 0) & (here > 0) & (here < self.pattern.n_lanes - 1)
        if not self.pattern.is_interior:
            # Out of closing lanes the way is towards the open ones.
            between &= ~(np.isin(here, closed) & (np.diff(lanes, axis=2) < 0))
        count = between.sum(axis=2)[:, :, None]
        if not closed:
            return np.asarray(count)
        # Beside the closure there is one way only.
        spared = between & ((here == closed[0] - 1) | (here == closed[-1] + 1))
        until = np.concatenate([np.zeros((*here.shape[:2], 1)), np.cumsum(spared, axis=2)], axis=2)
        ends = np.minimum(self.pairs, here.shape[2])
        return np.asarray(count - (until[:, :, ends[:, 1]] - until[:, :, ends[:, 0]]))


def _em(evidence: Evidence, costs: _Costs, *, right: float, iterations: int) -> LaneHypothesis:
    levels, weights, prior = evidence.levels, evidence.weights, evidence.width
    n_lanes, n = costs.pattern.n_lanes, float(weights.sum())
    lane = np.arange(n_lanes)
    counts = np.where(np.isin(lane, costs.pattern.closed), *SHARE_COUNTS[::-1])
    width, spread, shares = prior[0], FIRST_SPREAD_M, np.full(n_lanes, 1 / n_lanes)
    posterior = -np.inf
    for _ in range(iterations):
        first, pair_chance, log_evidence = expected_lanes(
            levels, weights, costs.fit, costs.log_prior, right=right, width=width, spread=spread, shares=shares
        )
        before, posterior = posterior, log_evidence + float(counts @ np.log(shares * n_lanes))
        posterior += float(_log_prior(np.array(spread), evidence.usual_spread)) - 0.5 * ((width - prior[0]) / prior[1]) ** 2
        r = first * weights[:, None]
        shares = (r.sum(axis=0) + counts) / (n + counts.sum())
        normal = np.array([[r.sum(), (r @ lane).sum()], [(r @ lane).sum(), (r @ lane**2).sum()]]) / spread**2
        normal[1, 1] += 1 / prior[1] ** 2
        side = np.array([(r * levels[:, None]).sum(), (r * levels[:, None] * lane).sum()]) / spread**2
        side[1] += prior[0] / prior[1] ** 2
        right, width = np.linalg.solve(normal, side)
        square = float((r * (levels[:, None] - right - width * lane) ** 2).sum())
        spread = _spread_of(square, max(n - 1, 0.5), usual=evidence.usual_spread)
        if posterior - before < SETTLED:
            break
    closes, opens = costs.pairs[int(np.argmax(pair_chance))]
    # Free parameters by Schwarz' criterion; the width's prior and the closure's places are integrated already.
    penalty = 0.5 * n_lanes * np.log(max(n, 2.0))
    users = np.einsum("nf,n,nfk->k", first, weights, costs.ever)
    unused = users.min() < LEAST_USERS * min(1.0, n)
    return LaneHypothesis(
        pattern=costs.pattern, right=float(right), width=float(width), covariance=np.asarray(np.linalg.inv(normal)),
        spread=spread, closes=int(closes), opens=int(opens), first=first,
        log_evidence=-np.inf if unused and iterations > 2 else posterior - penalty + costs.pattern.log_prior,
    )  # fmt: skip


def _spread_of(square: float, n: float, *, usual: float) -> float:
    """The spread [m] whose posterior, of n squares that add up to `square` and the prior, is highest."""
    log_posterior = _log_prior(SPREADS_M, usual) - n * np.log(SPREADS_M) - square / (2 * SPREADS_M**2)
    return float(SPREADS_M[np.argmax(log_posterior)])


def _log_prior(spread: FloatArray, usual: float) -> FloatArray:
    """Log prior of the spread [m]: near the usual one it pulls, far away it lets go.

    Traces that differ by less than their drift lets expect are doubted sooner than others: many narrow lanes fit any levels.
    """
    away = np.log(spread / usual)
    return np.asarray(
        np.where(away < 0, -np.minimum(0.5 * (away / LESS_SD) ** 2, MOST_DOUBT), -np.log1p((away / MORE_SCALE) ** 2))
    )
