from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import log_softmax, logsumexp, softmax
from scipy.stats import norm

from wzsumo.crowd_mapping.hypotheses.lane_em import (
    FittedMixture,
    LaneMixture,
    LaneObservations,
    MixturePrior,
    fit_lane_mixture,
    lane_covariance,
)
from wzsumo.frames import FloatArray

SPREADS_M = np.geomspace(0.08, 6.0, 120)  # that are tried
PRIOR = MixturePrior(width=(3.6, 0.12), usual_spread=1.5, pseudocounts=np.array([3.0, 3.0, 0.5]))


def observations(random: np.random.Generator, *, lanes: int) -> LaneObservations:
    n, pairs = random.integers(2, 12), random.integers(1, 9)
    return LaneObservations(
        levels=random.normal(3, 4, n), weights=random.uniform(0.1, 1, n),
        likelihood=np.exp(random.normal(0, 2, (n, pairs, lanes))), log_prior=random.normal(0, 1, pairs),
    )  # fmt: skip


def expected(seen: LaneObservations, at: LaneMixture) -> tuple[FloatArray, FloatArray, float]:
    """Probabilities of first lanes and of the closure's ends, and the log evidence: all sums written out."""
    lane = np.arange(len(at.shares))
    joint = norm.logpdf(seen.levels[:, None], at.right + at.width * lane, at.spread) + np.log(2 * np.pi) / 2 + np.log(at.shares)
    each = joint[:, None, :] + np.log(seen.likelihood)
    of_pair = seen.log_prior + seen.weights @ logsumexp(each, axis=2)
    chance = np.exp(of_pair - logsumexp(of_pair))
    first = np.einsum("ipk,p->ik", np.exp(each - logsumexp(each, axis=2, keepdims=True)), chance)
    return first, chance, float(logsumexp(of_pair))


def log_prior_of_spread(spread: FloatArray, *, usual: float) -> FloatArray:
    """Narrower spreads cost as a normal distribution of a fifth, 6 at most; wider ones as a Cauchy distribution of 0.3."""
    away = np.log(spread / usual)
    return np.where(away < 0, np.maximum(-0.5 * (away / 0.2) ** 2, -6.0), -np.log(1 + (away / 0.3) ** 2))


def regressed(
    seen: LaneObservations, first: FloatArray, at: LaneMixture, prior: MixturePrior
) -> tuple[LaneMixture, FloatArray]:
    """The mixture that suits first lanes best: weighted least squares with the width's prior as one more row."""
    lane = np.arange(first.shape[1])
    r = first * seen.weights[:, None]
    rows = np.vstack([np.column_stack([np.ones(r.size), np.tile(lane, len(r))]) / at.spread, [0, 1 / prior.width[1]]])
    values = np.append(np.repeat(seen.levels, len(lane)) / at.spread, prior.width[0] / prior.width[1])
    root = np.sqrt(np.append(r.ravel(), 1.0))
    right, width = np.linalg.lstsq(rows * root[:, None], values * root, rcond=None)[0]
    square = (r * (seen.levels[:, None] - right - width * lane) ** 2).sum()
    n = max(seen.weights.sum() - 1, 0.5)
    log_posterior = log_prior_of_spread(SPREADS_M, usual=prior.usual_spread) + n * (
        norm.logpdf(np.sqrt(square / n), scale=SPREADS_M)
    )
    counts = r.sum(axis=0) + prior.pseudocounts
    spread = float(SPREADS_M[np.argmax(log_posterior)])
    return LaneMixture(right=right, width=width, spread=spread, shares=counts / counts.sum()), (rows.T * root**2) @ rows


@pytest.mark.parametrize("seed", range(5))
def test_expectation_equals_the_sums_written_out(seed: int) -> None:
    random = np.random.default_rng(seed)
    lanes = int(random.integers(1, 5))
    seen = observations(random, lanes=lanes)
    start = LaneMixture(right=0.5, width=3.6, spread=float(SPREADS_M[60]), shares=random.dirichlet(np.ones(lanes)))
    # A prior that says nothing: width and spread are the usual ones, and no vehicles are counted beforehand.
    prior = MixturePrior(width=(3.6, 0.12), usual_spread=start.spread, pseudocounts=np.zeros(lanes))
    fitted = fit_lane_mixture(seen, start=start, prior=prior, rounds=1)
    first, chance, log_evidence = expected(seen, start)
    np.testing.assert_allclose(fitted.pair_chance, chance, rtol=1e-9)
    np.testing.assert_allclose(fitted.first, first)
    assert fitted.log_posterior == pytest.approx(log_evidence)


def test_posterior_counts_what_the_width_and_the_shares_depart_from_their_priors() -> None:
    seen = observations(np.random.default_rng(1), lanes=3)
    shares = np.array([0.5, 0.3, 0.2])
    start = LaneMixture(right=0.5, width=3.3, spread=float(SPREADS_M[60]), shares=shares)
    prior = replace(PRIOR, usual_spread=start.spread)
    fitted = fit_lane_mixture(seen, start=start, prior=prior, rounds=1)
    of_prior = -0.5 * (0.3 / 0.12) ** 2 + 3 * np.log(1.5) + 3 * np.log(0.9) + 0.5 * np.log(0.6)
    assert fitted.log_posterior == pytest.approx(expected(seen, start)[2] + of_prior)


@pytest.mark.parametrize(("seed", "rounds"), [(0, 1), (1, 2), (2, 4)])
def test_rounds_equal_expectations_and_regressions_in_turn(seed: int, rounds: int) -> None:
    seen = observations(np.random.default_rng(seed), lanes=3)
    prior = replace(PRIOR, usual_spread=0.5)
    at = start = LaneMixture(right=0.2, width=3.6, spread=0.5, shares=np.full(3, 1 / 3))
    for _ in range(rounds):
        at, precision = regressed(seen, expected(seen, at)[0], at, prior)
    fitted = fit_lane_mixture(seen, start=start, prior=prior, rounds=rounds)
    for ours, theirs in zip(vars(fitted.mixture).values(), vars(at).values(), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9)
    np.testing.assert_allclose(fitted.precision, precision, rtol=1e-9)


# The spread of two traces says little beside its prior; that of forty moves it by half and doubles it.
@pytest.mark.parametrize(("n", "scatter_m", "usual_m"), [(2, 0.3, 1.2), (40, 0.3, 0.6), (40, 0.3, 0.15), (4, 0.02, 1.0)])
def test_spread_is_the_best_of_a_grid_under_a_prior_that_lets_go_far_from_the_usual_one(
    n: int, scatter_m: float, usual_m: float
) -> None:
    levels = scatter_m * np.where(np.arange(n) % 2, 1.0, -1.0)
    seen = LaneObservations(levels=levels, weights=np.ones(n), likelihood=np.ones((n, 1, 1)), log_prior=np.zeros(1))
    start = LaneMixture(right=0.0, width=3.6, spread=usual_m, shares=np.ones(1))
    prior = MixturePrior(width=(3.6, 0.12), usual_spread=usual_m, pseudocounts=np.array([3.0]))
    log_posterior = log_prior_of_spread(SPREADS_M, usual=usual_m) - (n - 1) * np.log(SPREADS_M)
    log_posterior -= n * scatter_m**2 / (2 * SPREADS_M**2)
    fitted = fit_lane_mixture(seen, start=start, prior=prior, rounds=1)
    assert fitted.mixture.spread == pytest.approx(SPREADS_M[np.argmax(log_posterior)])


def test_more_rounds_do_not_lower_the_posterior() -> None:
    seen = observations(np.random.default_rng(7), lanes=2)
    prior = MixturePrior(width=(3.6, 0.12), usual_spread=0.5, pseudocounts=np.array([3.0, 0.5]))
    start = LaneMixture(right=0.0, width=3.6, spread=0.5, shares=np.full(2, 0.5))
    posterior = [fit_lane_mixture(seen, start=start, prior=prior, rounds=n).log_posterior for n in range(1, 12)]
    # The spread is the best of a grid, for the mixture just found: it may cost a little.
    assert (np.diff(posterior) > -0.05).all()


def test_traces_of_weight_0_change_nothing() -> None:
    seen = observations(np.random.default_rng(3), lanes=2)
    prior = MixturePrior(width=(3.6, 0.12), usual_spread=0.5, pseudocounts=np.array([3.0, 0.5]))
    start = LaneMixture(right=0.0, width=3.6, spread=0.5, shares=np.full(2, 0.5))
    silent = replace(seen, weights=np.append(seen.weights[:-1], 0.0))
    fewer = replace(seen, levels=seen.levels[:-1], weights=seen.weights[:-1], likelihood=seen.likelihood[:-1])
    ours, theirs = (fit_lane_mixture(one, start=start, prior=prior, rounds=6) for one in (silent, fewer))
    assert ours.mixture.right == pytest.approx(theirs.mixture.right, rel=1e-12)
    np.testing.assert_allclose(ours.pair_chance, theirs.pair_chance, rtol=1e-12)


def levels_in_three_lanes(n: int, *, spread: float) -> LaneObservations:
    random = np.random.default_rng(2)
    levels = 1.0 + 3.6 * random.integers(3, size=n) + spread * random.standard_normal(n)
    return LaneObservations(levels=levels, weights=np.ones(n), likelihood=np.ones((n, 1, 3)), log_prior=np.zeros(1))


def fitted_to(seen: LaneObservations) -> FittedMixture:
    start = LaneMixture(right=1.0, width=3.6, spread=1.5, shares=np.full(3, 1 / 3))
    return fit_lane_mixture(seen, start=start, prior=PRIOR, rounds=400)


def log_posterior_at(parameters: FloatArray, seen: LaneObservations, spread: float) -> float:
    """Of right, width and the logits of the first two shares; the spread is given."""
    right, width, *logits = parameters
    shares = np.append(logits, 0.0)
    mixture = LaneMixture(right=right, width=width, spread=spread, shares=softmax(shares))
    of_width = -0.5 * ((width - PRIOR.width[0]) / PRIOR.width[1]) ** 2
    return float(expected(seen, mixture)[2] + of_width + PRIOR.pseudocounts @ log_softmax(shares))


def second_derivatives(function: Callable[[FloatArray], float], at: FloatArray, step: float = 1e-3) -> FloatArray:
    axes = step * np.eye(len(at))
    return np.array(
        [
            [function(at + a + b) - function(at + a - b) - function(at - a + b) + function(at - a - b) for b in axes]
            for a in axes
        ]
    ) / (4 * step**2)  # fmt: skip


@pytest.mark.parametrize("spread", [0.3, 1.8])
def test_covariance_is_that_of_the_posteriors_second_derivatives(spread: float) -> None:
    seen = levels_in_three_lanes(80, spread=spread)
    fit = fitted_to(seen)
    shares = np.log(fit.mixture.shares)
    at = np.array([fit.mixture.right, fit.mixture.width, *(shares[:2] - shares[2])])
    hessian = second_derivatives(lambda x: log_posterior_at(x, seen, fit.mixture.spread), at)
    np.testing.assert_allclose(lane_covariance(fit, seen, PRIOR), np.linalg.inv(-hessian)[:2, :2], rtol=0.05)


def test_lanes_that_are_told_apart_are_known_as_if_their_traces_said_so() -> None:
    seen = levels_in_three_lanes(80, spread=0.3)
    fit = fitted_to(seen)
    np.testing.assert_allclose(lane_covariance(fit, seen, PRIOR), np.linalg.inv(fit.precision), rtol=1e-3)


def test_lanes_that_overlap_are_known_less_well() -> None:
    seen = levels_in_three_lanes(80, spread=1.8)
    fit = fitted_to(seen)
    assert lane_covariance(fit, seen, PRIOR)[0, 0] > 1.5 * np.linalg.inv(fit.precision)[0, 0]
