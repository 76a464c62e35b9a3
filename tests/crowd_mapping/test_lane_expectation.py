import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import norm

from wzsumo.crowd_mapping.lane_expectation import expected_lanes


@pytest.mark.parametrize("seed", range(5))
def test_expectation_equals_the_sums_written_out(seed):
    random = np.random.default_rng(seed)
    n, pairs, lanes = random.integers(1, 12), random.integers(1, 9), random.integers(1, 5)
    levels, weights = random.normal(3, 4, n), random.uniform(0.1, 1, n)
    log_fit, log_prior = random.normal(0, 2, (n, pairs, lanes)), random.normal(0, 1, pairs)
    shares = random.dirichlet(np.ones(lanes))
    first, pair_chance, log_evidence = expected_lanes(
        levels, weights, np.exp(log_fit), log_prior, right=0.5, width=3.6, spread=0.7, shares=shares
    )
    joint = norm.logpdf(levels[:, None], 0.5 + 3.6 * np.arange(lanes), 0.7) + np.log(2 * np.pi) / 2 + np.log(shares)
    each = joint[:, None, :] + log_fit
    of_pair = log_prior + weights @ logsumexp(each, axis=2)
    chance = np.exp(of_pair - logsumexp(of_pair))
    np.testing.assert_allclose(pair_chance, chance, rtol=1e-9)
    np.testing.assert_allclose(first, np.einsum("ipk,p->ik", np.exp(each - logsumexp(each, axis=2, keepdims=True)), chance))
    assert log_evidence == pytest.approx(logsumexp(of_pair))
