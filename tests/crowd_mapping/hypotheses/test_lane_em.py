from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import norm

from wzsumo.crowd_mapping.hypotheses.lane_em import (
    SPREADS_M,
    LaneLikelihood,
    LanePlaces,
    LanePrior,
    expected_lanes,
    fit_lanes,
    log_prior_of_spread,
)


def likelihood(random, *, lanes):
    n, pairs = random.integers(2, 12), random.integers(1, 9)
    return LaneLikelihood(
        levels=random.normal(3, 4, n), weights=random.uniform(0.1, 1, n),
        fit=np.exp(random.normal(0, 2, (n, pairs, lanes))), log_prior=random.normal(0, 1, pairs),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_expectation_equals_the_sums_written_out(seed) -> None:
    random = np.random.default_rng(seed)
    lanes = random.integers(1, 5)
    seen = likelihood(random, lanes=lanes)
    shares = random.dirichlet(np.ones(lanes))
    first, pair_chance, log_evidence = expected_lanes(seen, LanePlaces(right=0.5, width=3.6, spread=0.7, shares=shares))
    joint = norm.logpdf(seen.levels[:, None], 0.5 + 3.6 * np.arange(lanes), 0.7) + np.log(2 * np.pi) / 2 + np.log(shares)
    each = joint[:, None, :] + np.log(seen.fit)
    of_pair = seen.log_prior + seen.weights @ logsumexp(each, axis=2)
    chance = np.exp(of_pair - logsumexp(of_pair))
    np.testing.assert_allclose(pair_chance, chance, rtol=1e-9)
    np.testing.assert_allclose(first, np.einsum("ipk,p->ik", np.exp(each - logsumexp(each, axis=2, keepdims=True)), chance))
    assert log_evidence == pytest.approx(logsumexp(of_pair))


def regressed(seen, first, places, prior):
    """Places that suit chances of first lanes best: weighted least squares with the width's prior as one more row."""
    lane = np.arange(first.shape[1])
    r = first * seen.weights[:, None]
    rows = np.vstack([np.column_stack([np.ones(r.size), np.tile(lane, len(r))]) / places.spread, [0, 1 / prior.width[1]]])
    values = np.append(np.repeat(seen.levels, len(lane)) / places.spread, prior.width[0] / prior.width[1])
    root = np.sqrt(np.append(r.ravel(), 1.0))
    right, width = np.linalg.lstsq(rows * root[:, None], values * root, rcond=None)[0]
    square = (r * (seen.levels[:, None] - right - width * lane) ** 2).sum()
    n = max(seen.weights.sum() - 1, 0.5)
    log_posterior = log_prior_of_spread(SPREADS_M, usual=prior.usual_spread) + n * (
        norm.logpdf(np.sqrt(square / n), scale=SPREADS_M)
    )
    counts = r.sum(axis=0) + prior.counts
    return LanePlaces(
        right=right, width=width, spread=SPREADS_M[np.argmax(log_posterior)], shares=counts / counts.sum()
    ), (rows.T * root**2) @ rows  # fmt: skip


@pytest.mark.parametrize(("seed", "rounds"), [(0, 1), (1, 2), (2, 4)])
def test_rounds_equal_expectations_and_regressions_in_turn(seed: int, rounds: int) -> None:
    random = np.random.default_rng(seed)
    seen = likelihood(random, lanes=3)
    prior = LanePrior(width=(3.6, 0.12), usual_spread=0.5, counts=np.array([3.0, 3.0, 0.5]))
    places = start = LanePlaces(right=0.2, width=3.6, spread=0.5, shares=np.full(3, 1 / 3))
    for _ in range(rounds):
        first, _, _ = expected_lanes(seen, places)
        places, precision = regressed(seen, first, places, prior)
    fitted = fit_lanes(seen, start=start, prior=prior, rounds=rounds)
    for ours, theirs in zip(vars(fitted.places).values(), vars(places).values(), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9)
    np.testing.assert_allclose(fitted.precision, precision, rtol=1e-9)


def test_more_rounds_do_not_lower_the_posterior() -> None:
    seen = likelihood(np.random.default_rng(7), lanes=2)
    prior = LanePrior(width=(3.6, 0.12), usual_spread=0.5, counts=np.array([3.0, 0.5]))
    start = LanePlaces(right=0.0, width=3.6, spread=0.5, shares=np.full(2, 0.5))
    posterior = [fit_lanes(seen, start=start, prior=prior, rounds=n).log_posterior for n in range(1, 12)]
    # The spread is the best of a grid, for the places just found: it may cost a little.
    assert (np.diff(posterior) > -0.05).all()


def test_traces_of_weight_0_change_nothing() -> None:
    seen = likelihood(np.random.default_rng(3), lanes=2)
    prior = LanePrior(width=(3.6, 0.12), usual_spread=0.5, counts=np.array([3.0, 0.5]))
    start = LanePlaces(right=0.0, width=3.6, spread=0.5, shares=np.full(2, 0.5))
    silent = replace(seen, weights=np.append(seen.weights[:-1], 0.0))
    fewer = LaneLikelihood(
        levels=seen.levels[:-1], weights=seen.weights[:-1], fit=seen.fit[:-1], log_prior=seen.log_prior
    )  # fmt: skip
    ours, theirs = (fit_lanes(one, start=start, prior=prior, rounds=6) for one in (silent, fewer))
    assert ours.places.right == pytest.approx(theirs.places.right, rel=1e-12)
    np.testing.assert_allclose(ours.pair_chance, theirs.pair_chance, rtol=1e-12)
