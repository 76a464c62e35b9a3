import numpy as np
import pytest
from crowd_mapping.mixture.road_points import em_twin, start_for, strips
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal
from sklearn.exceptions import ConvergenceWarning
from sklearn.mixture import GaussianMixture

from wzsumo.crowd_mapping.mixture.expectation_maximisation import Components, most_responsible, run_em, to_block_axes
from wzsumo.crowd_mapping.mixture.mixture import Mixture, mixture_of
from wzsumo.crowd_mapping.mixture.point_blocks import block_points
from wzsumo.frames import FloatArray


def fit(
    points: FloatArray, start: Components, *, tol: float = 1e-3, max_iterations: int = 100, reg_covar: float = 1e-6
) -> Mixture:
    """The mixture, in the axes of the points, where EM ends from a start in the same axes."""
    blocks = block_points(points)
    ended = run_em(blocks, to_block_axes(blocks, start), reg_covar=reg_covar, tol=tol, max_iterations=max_iterations)
    return mixture_of(blocks, ended)


def sklearn_fit(points: FloatArray, start: Components, *, max_iter: int, tol: float = 1e-3) -> GaussianMixture:
    model = GaussianMixture(
        len(start.weights), weights_init=start.weights, means_init=start.means,
        precisions_init=np.linalg.inv(start.covariances), init_params="random_from_data", random_state=0,
        max_iter=max_iter, tol=tol,
    )  # fmt: skip
    return model.fit(points)


@pytest.mark.parametrize("k", [1, 4, 12])
@pytest.mark.parametrize("seed", [0, 1])
def test_fit_from_same_start_equals_scikit_learn(k: int, seed: int) -> None:
    points = strips(3000, seed=seed)
    start = start_for(points, k)
    expected = sklearn_fit(points, start, max_iter=500)
    ours = fit(points, start, max_iterations=500)
    assert ours.converged
    np.testing.assert_allclose(ours.means, expected.means_, atol=1e-8, rtol=0)
    np.testing.assert_allclose(ours.covariances, expected.covariances_, atol=1e-7, rtol=1e-7)
    np.testing.assert_allclose(ours.weights, expected.weights_, atol=1e-10)
    assert ours.aic == pytest.approx(expected.aic(points), rel=1e-10)
    assert ours.bic == pytest.approx(expected.bic(points), rel=1e-10)
    assert ours.log_likelihood == pytest.approx(expected.score_samples(points).sum(), rel=1e-10)


def test_fit_stopped_at_max_iterations_says_so_and_equals_scikit_learn() -> None:
    points = strips(2000, seed=3)
    start = start_for(points, 6)
    with pytest.warns(ConvergenceWarning):
        expected = sklearn_fit(points, start, max_iter=7, tol=0.0)
    ours = fit(points, start, max_iterations=7, tol=0.0)
    assert not ours.converged
    np.testing.assert_allclose(ours.means, expected.means_, atol=1e-8, rtol=0)


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), k=st.integers(1, 6), n=st.integers(20, 400), turn=st.floats(0, np.pi))
def test_one_iteration_equals_textbook_twin(seed: int, k: int, n: int, turn: float) -> None:
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    points = strips(n, seed=seed) @ axes
    start = start_for(points, k)
    ours, expected = fit(points, start, max_iterations=1), em_twin(points, start)
    np.testing.assert_allclose(ours.weights, expected.weights, atol=1e-9)
    np.testing.assert_allclose(ours.means, expected.means, atol=1e-6)
    np.testing.assert_allclose(ours.covariances, expected.covariances, atol=1e-5, rtol=1e-7)


def test_components_far_from_a_block_change_nothing() -> None:
    # The pruned sums over blocks against the full sums: narrow, far components are the ones left out.
    points = strips(4000, seed=5)
    blocks = block_points(points)
    xy = np.column_stack([blocks.x, blocks.y])
    means = xy[:: len(xy) // 20][:20]
    covariances = np.tile(np.diag([9.0, 0.04]), (len(means), 1, 1))
    weights = np.full(len(means), 1 / len(means))
    log_density = np.array([multivariate_normal(m, c).logpdf(xy) for m, c in zip(means, covariances, strict=True)])
    expected = np.logaddexp.reduce(log_density + np.log(weights)[:, None], axis=0).sum()
    ours = run_em(blocks, Components(weights, means, covariances), reg_covar=1e-6, tol=0.0, max_iterations=0).log_likelihood
    assert ours == pytest.approx(expected, rel=1e-12)


def test_fit_far_from_the_origin_equals_fit_at_the_origin() -> None:
    points, far = strips(2000, seed=1), np.array([500_000.0, 4_400_000.0])
    start = start_for(points, 5)
    here, there = fit(points, start), fit(points + far, start._replace(means=start.means + far))
    np.testing.assert_allclose(there.means - far, here.means, atol=1e-5)
    assert there.bic == pytest.approx(here.bic, abs=1e-3)


def test_component_that_no_point_belongs_to_stays_finite_with_weight_zero() -> None:
    points = strips(200, seed=0)
    far = Components(np.array([0.5, 0.5]), np.array([[150.0, 1.0], [1e6, 0.0]]), np.tile(np.diag([100.0, 1.0]), (2, 1, 1)))
    ours = fit(points, far, max_iterations=3)
    assert all(np.isfinite(part).all() for part in (ours.weights, ours.means, ours.covariances))
    assert ours.weights == pytest.approx([1.0, 0.0], abs=1e-12)
    assert ours.log_likelihood == pytest.approx(fit(points, start_for(points, 1), max_iterations=3).log_likelihood)


def test_most_responsible_component_counts_weight_and_width() -> None:
    # Halfway between two means the heavier of two equals is the likelier one; far out the broader one is.
    x, y = np.array([0.0, 5.0, 5.0 + 1e-9, 40.0, -40.0]), np.zeros(5)
    covariances = np.array([np.eye(2), np.eye(2), 100 * np.eye(2)])
    components = Components(np.array([0.5, 0.4, 0.1]), np.array([[0.0, 0.0], [10.0, 0.0], [5.0, 0.0]]), covariances)
    assert most_responsible(x, y, components).tolist() == [0, 2, 2, 2, 2]
    heavy = components._replace(weights=np.array([0.6, 0.4, 1e-12]))
    assert most_responsible(x, y, heavy).tolist() == [0, 0, 0, 2, 2]
