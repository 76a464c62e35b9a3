"""LaneHypothesis: a fitted pattern of lanes with its closure, and the hypotheses that are likeliest for some traces.

A hypothesis says how many lanes there are and which of them are closed from one station to another. Its log evidence is

    log posterior of the mixture (`lane_em`) - n_lanes / 2 log(n traces) + log p(pattern)

where the second term is Schwarz' criterion for the free parameters (the level and n_lanes - 1 shares; the width has a prior,
and the closure's ends are summed over). A hypothesis with a lane that hardly any trace used is discarded: its log evidence is
minus infinity.
"""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.hypotheses.change_likelihood import ChangeLikelihood, LaneEvidence, change_likelihood
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior, known_closure
from wzsumo.crowd_mapping.hypotheses.lane_em import (
    LaneMixture,
    LaneObservations,
    MixturePrior,
    fit_lane_mixture,
    lane_covariance,
)
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern, candidate_patterns
from wzsumo.frames import FloatArray

MIN_TRACES_PER_LANE = 0.6  # expected number of traces, each by its weight, that were ever in a lane; chosen by us
MAX_COMPARED_TRACES = 100  # by which hypotheses are compared, evenly taken where there are more
# All starts of a pattern are fitted for SCREENING_ROUNDS. The KEPT_STARTS best of them are then fitted on, except those whose
# log evidence lies more than MAX_EVIDENCE_GAP below the best of all patterns. All chosen by us.
SCREENING_ROUNDS, KEPT_STARTS, MAX_EVIDENCE_GAP = 4, 3, 12.0
EM_ROUNDS = 25  # at most; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneHypothesis:
    """A fitted hypothesis: the middle of lane k at right + k width [m] above the course.

    `closed_from` and `open_from` are the indices of the first closed station and of the first that is open again; the second is
    the number of stations where the closed lanes do not open again. `first` (n, lanes) are the probabilities of each trace's
    first lane, `covariance` (2, 2) [m^2] is that of right and width, `spread` [m] the standard deviation of the traces' levels
    about their lanes.
    """

    pattern: LanePattern
    right: float
    width: float
    covariance: FloatArray
    spread: float
    closed_from: int
    open_from: int
    first: FloatArray
    log_evidence: float


def likely_hypotheses(
    evidence: LaneEvidence, closure_prior: ClosurePrior, *, n_open: int | None, min_closed: int
) -> list[LaneHypothesis]:
    """The hypotheses, the likeliest first, that differ in their pattern or by half a lane width in level.

    `n_open` is the number of open lanes where that is known; for `min_closed` see `candidate_patterns`.
    """
    compared = _thinned(evidence)
    tries = []
    for pattern in candidate_patterns(n_open, min_closed=min_closed):
        changes = change_likelihood(compared, pattern, closures=closure_prior.candidates(pattern))
        screened = [
            _fit(compared, changes, right=right, rounds=SCREENING_ROUNDS) for right in _starts(compared, pattern.n_lanes)
        ]
        tries += [(fit, changes) for fit in sorted(screened, key=_by_evidence)[:KEPT_STARTS]]
    enough = max(fit.log_evidence for fit, _ in tries) - MAX_EVIDENCE_GAP
    fits = [_fit(compared, changes, right=fit.right, rounds=EM_ROUNDS) for fit, changes in tries if fit.log_evidence > enough]
    kept: list[LaneHypothesis] = []
    for fit in sorted(fits, key=_by_evidence):
        if not any(_same(fit, other) for other in kept):
            kept.append(fit)
    return kept


def refit_hypothesis(hypothesis: LaneHypothesis, evidence: LaneEvidence) -> LaneHypothesis:
    """The hypothesis fitted to other evidence, with its closure and its log evidence as they are."""
    closure = known_closure(hypothesis.closed_from, hypothesis.open_from)
    changes = change_likelihood(evidence, hypothesis.pattern, closures=closure)
    fit = _fit(evidence, changes, right=hypothesis.right, rounds=EM_ROUNDS)
    return replace(fit, log_evidence=hypothesis.log_evidence)


def _thinned(evidence: LaneEvidence) -> LaneEvidence:
    n = len(evidence.levels)
    if n <= MAX_COMPARED_TRACES:
        return evidence
    some = np.unique(np.linspace(0, n - 1, MAX_COMPARED_TRACES).astype(int))
    return replace(evidence, levels=evidence.levels[some], lanes=evidence.lanes[some], weights=evidence.weights[some])


def _starts(evidence: LaneEvidence, n_lanes: int) -> FloatArray:
    """Levels [m] of the rightmost lane from which fits start: some quantile of the levels lies in some lane."""
    quantiles = np.quantile(evidence.levels, [0.1, 0.5, 0.9])
    return np.unique(np.round([q - evidence.width[0] * lane for q in quantiles for lane in range(n_lanes)], 1))


def _fit(evidence: LaneEvidence, changes: ChangeLikelihood, *, right: float, rounds: int) -> LaneHypothesis:
    """The hypothesis of a pattern from a start; the screening rounds do not ask for traces in each lane yet."""
    n_lanes, n, usual = changes.pattern.n_lanes, float(evidence.weights.sum()), evidence.usual_spread
    seen = LaneObservations(
        levels=evidence.levels,
        weights=evidence.weights,
        likelihood=changes.likelihood,
        log_prior=changes.closures.log_prior,
    )
    start = LaneMixture(right=right, width=evidence.width[0], spread=usual, shares=np.full(n_lanes, 1 / n_lanes))
    prior = MixturePrior(width=evidence.width, usual_spread=usual, pseudocounts=changes.pattern.pseudocounts)
    fitted = fit_lane_mixture(seen, start=start, prior=prior, rounds=rounds)
    closed_from, open_from = changes.closures.ends[int(np.argmax(fitted.pair_chance))]
    schwarz = 0.5 * n_lanes * np.log(max(n, 2.0))
    traces_per_lane = np.einsum("nf,n,nfk->k", fitted.first, evidence.weights, changes.visited)
    unused = traces_per_lane.min() < MIN_TRACES_PER_LANE * min(1.0, n) and rounds > SCREENING_ROUNDS
    return LaneHypothesis(
        pattern=changes.pattern, right=fitted.mixture.right, width=fitted.mixture.width,
        covariance=lane_covariance(fitted, seen, prior), spread=fitted.mixture.spread, closed_from=int(closed_from),
        open_from=int(open_from), first=fitted.first,
        log_evidence=-np.inf if unused else fitted.log_posterior - schwarz + changes.pattern.log_prior,
    )  # fmt: skip


def _by_evidence(fit: LaneHypothesis) -> float:
    return -fit.log_evidence


def _same(fit: LaneHypothesis, other: LaneHypothesis) -> bool:
    return fit.pattern == other.pattern and abs(fit.right - other.right) < fit.width / 2
