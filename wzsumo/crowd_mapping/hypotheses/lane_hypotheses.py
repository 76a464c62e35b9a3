"""Which lanes are open and which are closed: hypotheses of a closure, weighed by levels, lane changes and where they happened.

A hypothesis says how many lanes there are and which of them, the leftmost ones or some between open ones, are closed from one
station to another, both unknown. A trace's lanes relative to its first are known, its first lane and its level's error are
not. Closures on the right are the same in the mirror.
"""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.hypotheses.change_costs import ChangeCosts, Evidence, change_costs
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior, one_closure
from wzsumo.crowd_mapping.hypotheses.lane_em import LaneLikelihood, LanePlaces, LanePrior, covariance_of, fit_lanes
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern, likely_patterns
from wzsumo.frames import FloatArray

SHARE_COUNTS = (3.0, 0.5)  # prior counts of vehicles in each open and each closing lane: open lanes are used about alike
LEAST_USERS = 0.6  # traces in the outermost lanes: a lane that nobody drove in is none
MOST_TRACES = 100  # by which hypotheses are weighed
HOPELESS = 12.0  # behind the best start in log evidence
STARTS, QUICK_ROUNDS, ROUNDS = 3, 4, 25


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


def likely_hypotheses(
    evidence: Evidence, closure: ClosurePrior, *, n_open: int | None, least_closed: int
) -> list[LaneHypothesis]:
    """Hypotheses, the likeliest first, that differ in their lanes or by half a lane in level; `n_open` where that is known."""
    few = _thinned(evidence)
    tries = []
    for pattern in likely_patterns(n_open, least_closed=least_closed):
        costs = change_costs(few, pattern, closures=closure.closures(pattern))
        quick = [_fit(few, costs, right=right, rounds=QUICK_ROUNDS) for right in _starts(few, pattern.n_lanes)]
        tries += [(fit, costs) for fit in sorted(quick, key=_by_evidence)[:STARTS]]
    enough = max(fit.log_evidence for fit, _ in tries) - HOPELESS
    fits = [_fit(few, costs, right=fit.right, rounds=ROUNDS) for fit, costs in tries if fit.log_evidence > enough]
    kept: list[LaneHypothesis] = []
    for fit in sorted(fits, key=_by_evidence):
        if not any(_same(fit, other) for other in kept):
            kept.append(fit)
    return kept


def _same(fit: LaneHypothesis, other: LaneHypothesis) -> bool:
    return fit.pattern == other.pattern and abs(fit.right - other.right) < fit.width / 2


def fit_again(hypothesis: LaneHypothesis, evidence: Evidence) -> LaneHypothesis:
    """The hypothesis, with the closure where it was, fitted to other evidence; its own evidence stays."""
    costs = change_costs(evidence, hypothesis.pattern, closures=one_closure(hypothesis.closes, hypothesis.opens))
    fit = _fit(evidence, costs, right=hypothesis.right, rounds=ROUNDS)
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


def _fit(evidence: Evidence, costs: ChangeCosts, *, right: float, rounds: int) -> LaneHypothesis:
    n_lanes, n, usual = costs.pattern.n_lanes, float(evidence.weights.sum()), evidence.usual_spread
    closed = np.isin(np.arange(n_lanes), costs.pattern.closed)
    seen = LaneLikelihood(levels=evidence.levels, weights=evidence.weights, fit=costs.fit, log_prior=costs.closures.log_chance)
    start = LanePlaces(right=right, width=evidence.width[0], spread=usual, shares=np.full(n_lanes, 1 / n_lanes))
    prior = LanePrior(width=evidence.width, usual_spread=usual, counts=np.where(closed, *SHARE_COUNTS[::-1]))
    fitted = fit_lanes(seen, start=start, prior=prior, rounds=rounds)
    closes, opens = costs.closures.pairs[int(np.argmax(fitted.pair_chance))]
    # Free parameters by Schwarz' criterion; the width's prior and the closure's places are integrated already.
    penalty = 0.5 * n_lanes * np.log(max(n, 2.0))
    users = np.einsum("nf,n,nfk->k", fitted.first, evidence.weights, costs.ever)
    unused = users.min() < LEAST_USERS * min(1.0, n)
    return LaneHypothesis(
        pattern=costs.pattern, right=fitted.places.right, width=fitted.places.width,
        covariance=covariance_of(fitted, seen, prior), spread=fitted.places.spread, closes=int(closes),
        opens=int(opens), first=fitted.first,
        log_evidence=-np.inf if unused and rounds > QUICK_ROUNDS else fitted.log_posterior - penalty + costs.pattern.log_prior,
    )  # fmt: skip
