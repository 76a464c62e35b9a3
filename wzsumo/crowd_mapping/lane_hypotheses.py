"""Which lanes are open and which are closed: hypotheses of a closure, weighed by levels, lane changes and where they happened.

A hypothesis says how many lanes there are and which of them, the leftmost ones or some between open ones, are closed from one
station to another, both unknown. A trace's lanes relative to its first are known, its first lane and its level's error are
not. Closures on the right are the same in the mirror.
"""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.change_costs import ChangeCosts, Evidence
from wzsumo.crowd_mapping.lane_expectation import expected_lanes
from wzsumo.crowd_mapping.lane_patterns import LanePattern, likely_patterns
from wzsumo.frames import FloatArray

FIRST_SPREAD_M = 0.5
LESS_SD, MOST_DOUBT, MORE_SCALE = 0.2, 6.0, 0.3  # of the logarithm of the spread between traces against the usual one
SPREADS_M = np.geomspace(0.08, 6.0, 120)  # tried
SHARE_COUNTS = (3.0, 0.5)  # prior counts of vehicles in each open and each closing lane: open lanes are used about alike
LEAST_USERS = 0.6  # traces in the outermost lanes: a lane that nobody drove in is none
MOST_TRACES = 100  # by which hypotheses are weighed
HOPELESS = 12.0  # behind the best start in log evidence
STARTS, ITERATIONS, SETTLED = 3, 25, 1e-2


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
        costs = ChangeCosts(few, pattern)
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
    costs = ChangeCosts(evidence, hypothesis.pattern, pair=(hypothesis.closes, hypothesis.opens))
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


def _em(evidence: Evidence, costs: ChangeCosts, *, right: float, iterations: int) -> LaneHypothesis:
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
