import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal
from sklearn.exceptions import ConvergenceWarning
from sklearn.mixture import GaussianMixture

from wzsumo.crowd_mapping.mixture.expectation_maximisation import Components, run_em
from wzsumo.crowd_mapping.mixture.mixture import Mixture, fit_mixture
from wzsumo.crowd_mapping.mixture.point_blocks import block_points
from wzsumo.errors import TraceError


def strips(n, *, seed):
    """Points like those of road traces: two long narrow strips that join."""
    random = np.random.default_rng(seed)
    s = random.uniform(0, 300, n)
    lane = np.where(random.random(n) < 0.5, 3.6 * np.clip((150 - s) / 80, 0, 1), 0.0)
    return np.column_stack([s, lane + 0.25 * random.standard_normal(n)])


def start_for(points, k):
    """Any start: means at points, one broad covariance."""
    rng = np.random.default_rng(k)
    means = points[rng.choice(len(points), k, replace=False)]
    covariances = np.tile(np.cov(points.T) / k, (k, 1, 1))
    return Mixture(
        weights=np.full(k, 1 / k),
        means=means,
        covariances=covariances,
        log_likelihood=0.0,
        n_points=len(points),
        converged=False,
    )


def sklearn_fit(points, start, **options):
    model = GaussianMixture(
        start.n_components,
        weights_init=start.weights,
        means_init=start.means,
        precisions_init=np.linalg.inv(start.covariances),
        init_params="random_from_data",
        random_state=0,
        **options,
    )
    return model.fit(points)


def em_twin(points, weights, means, covariances, reg_covar):
    """One iteration, written as in any textbook: (weights, means, covariances)."""
    density = np.column_stack(
        [w * multivariate_normal(m, c).pdf(points) for w, m, c in zip(weights, means, covariances, strict=True)]
    )
    share = density / density.sum(axis=1, keepdims=True)
    counts = share.sum(axis=0)
    new_means = share.T @ points / counts[:, None]
    new_covariances = [
        (share[:, j, None] * (points - m)).T @ (points - m) / counts[j] + reg_covar * np.eye(2) for j, m in enumerate(new_means)
    ]
    return counts / len(points), new_means, np.array(new_covariances)


@pytest.mark.parametrize("k", [1, 4, 12])
@pytest.mark.parametrize("seed", [0, 1])
def test_fit_from_same_start_equals_scikit_learn(k: int, seed: int) -> None:
    points = strips(3000, seed=seed)
    start = start_for(points, k)
    expected = sklearn_fit(points, start, max_iter=500)
    ours = fit_mixture(points, n_components=k, seed=0, start=start, max_iterations=500)
    assert ours.converged
    np.testing.assert_allclose(ours.means, expected.means_, atol=1e-8, rtol=0)
    np.testing.assert_allclose(ours.covariances, expected.covariances_, atol=1e-7, rtol=1e-7)
    np.testing.assert_allclose(ours.weights, expected.weights_, atol=1e-10)
    assert ours.aic == pytest.approx(expected.aic(points), rel=1e-10)
    assert ours.bic == pytest.approx(expected.bic(points), rel=1e-10)
    np.testing.assert_allclose(ours.log_density(points), expected.score_samples(points), atol=1e-7)


def test_fit_stopped_at_max_iterations_says_so_and_equals_scikit_learn() -> None:
    points = strips(2000, seed=3)
    start = start_for(points, 6)
    with pytest.warns(ConvergenceWarning):
        expected = sklearn_fit(points, start, max_iter=7, tol=0.0)
    ours = fit_mixture(points, n_components=6, seed=0, start=start, max_iterations=7, tol=0.0)
    assert not ours.converged
    np.testing.assert_allclose(ours.means, expected.means_, atol=1e-8, rtol=0)


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), k=st.integers(1, 6), n=st.integers(20, 400), turn=st.floats(0, np.pi))
def test_one_em_pass_equals_textbook_twin(seed: int, k: int, n: int, turn: float) -> None:
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    points = strips(n, seed=seed) @ axes
    start = start_for(points, k)
    ours = fit_mixture(points, n_components=k, seed=0, start=start, max_iterations=1)
    weights, means, covariances = em_twin(points, start.weights, start.means, start.covariances, 1e-6)
    np.testing.assert_allclose(ours.weights, weights, atol=1e-9)
    np.testing.assert_allclose(ours.means, means, atol=1e-6)
    np.testing.assert_allclose(ours.covariances, covariances, atol=1e-5, rtol=1e-7)


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
    here = fit_mixture(points, n_components=5, seed=4)
    there = fit_mixture(points + far, n_components=5, seed=4)
    np.testing.assert_allclose(there.means - far, here.means, atol=1e-5)
    assert there.bic == pytest.approx(here.bic, abs=1e-3)
    np.testing.assert_allclose(there.log_density(points + far), here.log_density(points), atol=1e-4)


def test_fit_from_responsibilities_starts_with_their_moments() -> None:
    points = strips(500, seed=2)
    shares = np.random.default_rng(0).dirichlet([1, 1, 1], size=500)
    ours = fit_mixture(points, n_components=3, seed=0, start=shares, max_iterations=0)
    np.testing.assert_allclose(ours.weights, shares.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(ours.means, shares.T @ points / shares.sum(axis=0)[:, None], atol=1e-9)
    for j in range(3):
        expected = np.cov(points.T, aweights=shares[:, j], ddof=0)
        np.testing.assert_allclose(ours.covariances[j], expected + 1e-6 * np.eye(2), atol=1e-7)


def test_more_restarts_are_never_less_likely() -> None:
    points = strips(1000, seed=8)
    one, five = (fit_mixture(points, n_components=6, seed=3, n_init=n) for n in (1, 5))
    assert five.log_likelihood >= one.log_likelihood


def test_same_seed_gives_the_same_bytes() -> None:
    points = strips(1000, seed=8)
    first, second = (fit_mixture(points, n_components=6, seed=3) for _ in range(2))
    assert first.means.tobytes() == second.means.tobytes()
    assert first.sample(50, seed=1).tobytes() == second.sample(50, seed=1).tobytes()


def test_sample_has_the_moments_of_the_mixture() -> None:
    mixture = Mixture(
        weights=np.array([0.25, 0.75]),
        means=np.array([[0.0, 0.0], [10.0, 2.0]]),
        covariances=np.array([[[4.0, 1.0], [1.0, 1.0]], [[1.0, 0.0], [0.0, 0.25]]]),
        log_likelihood=0.0,
        n_points=1,
        converged=True,
    )
    sample = mixture.sample(200_000, seed=0)
    np.testing.assert_allclose(sample.mean(axis=0), [7.5, 1.5], atol=0.05)
    between = 0.25 * 0.75 * np.outer([10, 2], [10, 2])
    np.testing.assert_allclose(np.cov(sample.T), np.tensordot(mixture.weights, mixture.covariances, 1) + between, rtol=0.02)


@pytest.mark.parametrize("share", [0.5, 0.95])
def test_density_level_of_one_normal_equals_closed_form(share: float) -> None:
    # The squared Mahalanobis distance in the plane is exponential with mean 2: the level is the peak times (1 - share).
    one = fit_mixture(strips(500, seed=0), n_components=1, seed=0)
    peak = -np.log(2 * np.pi) - 0.5 * np.log(np.linalg.det(one.covariances[0]))
    assert one.density_level(share, seed=0) == pytest.approx(peak + np.log(1 - share), abs=0.05)


def test_points_all_in_one_place_keep_the_regularisation_as_covariance() -> None:
    ours = fit_mixture(np.full((50, 2), 7.0), n_components=2, seed=0)
    np.testing.assert_allclose(ours.covariances, np.tile(1e-6 * np.eye(2), (2, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(ours.means, 7.0)


@pytest.mark.parametrize(
    ("points", "k", "message"),
    [
        (np.zeros((5, 3)), 1, "must be \\(n, 2\\)"),
        (np.array([[0.0, 1.0], [np.nan, 2.0]]), 1, "point 1 is .*finite"),
        (np.zeros((3, 2)), 4, "n_components=4 must be 1 to the number of points, 3"),
    ],
)
def test_points_that_cannot_be_fitted_are_named(points, k: int, message: str) -> None:
    with pytest.raises(TraceError, match=message):
        fit_mixture(points, n_components=k, seed=0)


def test_start_that_does_not_fit_is_named() -> None:
    points = strips(100, seed=0)
    with pytest.raises(TraceError, match="the start has 3 components"):
        fit_mixture(points, n_components=2, seed=0, start=start_for(points, 3))
    with pytest.raises(TraceError, match="responsibilities of shape"):
        fit_mixture(points, n_components=2, seed=0, start=np.ones((99, 2)))
