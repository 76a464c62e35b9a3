import numpy as np
import pytest

from wzsumo.crowd_mapping.mixture.mixture import Mixture

TWO = Mixture(
    weights=np.array([0.25, 0.75]),
    means=np.array([[0.0, 0.0], [10.0, 2.0]]),
    covariances=np.array([[[4.0, 1.0], [1.0, 1.0]], [[1.0, 0.0], [0.0, 0.25]]]),
    log_likelihood=-50.0,
    n_points=100,
    converged=True,
)


def test_sample_has_the_moments_of_the_mixture() -> None:
    sample = TWO.sample(200_000, seed=0)
    np.testing.assert_allclose(sample.mean(axis=0), [7.5, 1.5], atol=0.05)
    between = 0.25 * 0.75 * np.outer([10, 2], [10, 2])
    np.testing.assert_allclose(np.cov(sample.T), np.tensordot(TWO.weights, TWO.covariances, 1) + between, rtol=0.02)


def test_same_seed_draws_the_same_sample_and_another_seed_another() -> None:
    first, second, other = (TWO.sample(50, seed=seed) for seed in (1, 1, 2))
    assert first.tobytes() == second.tobytes() != other.tobytes()


def test_criteria_of_two_components_count_eleven_parameters() -> None:
    # 4 of the means, 6 of the covariances, 1 of the weights; log L = -50 on 100 points.
    assert TWO.aic == pytest.approx(2 * 11 + 100)
    assert TWO.bic == pytest.approx(11 * np.log(100) + 100)
