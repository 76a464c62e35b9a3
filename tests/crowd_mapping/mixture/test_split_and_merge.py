import itertools

import numpy as np
import pytest
from crowd_mapping.mixture.road_points import em_twin, strips
from scipy.stats import multivariate_normal

from wzsumo.crowd_mapping.mixture.expectation_maximisation import Components
from wzsumo.crowd_mapping.mixture.point_blocks import block_points
from wzsumo.crowd_mapping.mixture.split_and_merge import merges, single_component, splits
from wzsumo.frames import FloatArray

CLOUD = np.random.default_rng(0).standard_normal((300, 2))


def log_likelihood(points: FloatArray, components: Components) -> float:
    densities = [w * multivariate_normal(m, c).pdf(points) for w, m, c in zip(*components, strict=True)]
    return float(np.log(np.sum(densities, axis=0)).sum())


def test_single_component_has_the_moments_of_the_points() -> None:
    blocks = block_points(CLOUD * (5.0, 1.0))
    one = single_component(blocks, reg_covar=0.01)
    xy = np.column_stack([blocks.x, blocks.y])
    np.testing.assert_allclose(one.means, [xy.mean(axis=0)], atol=1e-12)
    np.testing.assert_allclose(one.covariances, [np.cov(xy.T, ddof=0) + 0.01 * np.eye(2)], atol=1e-12)


def test_splits_are_the_halves_along_either_axis_after_four_iterations_the_likelier_first() -> None:
    blocks = block_points(strips(400, seed=1))
    xy = np.column_stack([blocks.x, blocks.y])
    mean, covariance = xy.mean(axis=0), np.cov(xy.T, ddof=0) + 1e-6 * np.eye(2)
    vectors = np.linalg.eigh(covariance)[1]
    expected = []
    for axis in vectors.T:
        # The mean of a half normal distribution lies sqrt(2 / pi) = 0.79788 standard deviations from its middle.
        step = 0.7978845608 * np.sqrt(axis @ covariance @ axis) * axis
        half = covariance - np.outer(step, step)
        pair = Components(np.full(2, 0.5), np.array([mean - step, mean + step]), np.array([half, half]))
        for _ in range(4):
            pair = em_twin(xy, pair)
        expected.append(pair)
    expected.sort(key=lambda pair: -log_likelihood(xy, pair))
    ours = splits(single_component(blocks, reg_covar=1e-6), blocks, count=5, reg_covar=1e-6)
    assert len(ours) == 2
    for got, want in zip(ours, expected, strict=True):
        for part, twin in zip(got, want, strict=True):
            np.testing.assert_allclose(part, twin, rtol=1e-6, atol=1e-6)


def test_component_of_two_clouds_is_split_before_a_cloud_of_many_points() -> None:
    pair = np.vstack([CLOUD[:50] + np.array([100, 0]), CLOUD[50:100] + np.array([120, 0])])
    points = np.vstack([CLOUD, CLOUD[:, ::-1], pair])
    blocks = block_points(points)
    clouds = (points[:600], pair)
    means = np.array([(part.mean(axis=0) - blocks.centre) @ blocks.axes for part in clouds])
    covariances = np.array([blocks.axes.T @ np.cov(part.T) @ blocks.axes for part in clouds])
    first = splits(Components(np.array([6 / 7, 1 / 7]), means, covariances), blocks, count=1, reg_covar=1e-6)[0]
    # The broad cloud stays; the halves share the weight of the pair of clouds.
    assert first.weights == pytest.approx([6 / 7, 1 / 14, 1 / 14], rel=0.01)
    world = first.means @ blocks.axes.T + blocks.centre
    assert sorted(world[1:, 0]) == pytest.approx([100, 120], abs=1)


@pytest.mark.parametrize(("n_far", "n_splits"), [(1, 2), (2, 4)])
def test_component_of_one_point_is_not_split_and_one_of_two_points_is(n_far: int, n_splits: int) -> None:
    points = np.vstack([CLOUD, np.array([(500.0, 0.0), (503.0, 1.0)])[:n_far]])
    blocks = block_points(points)
    means = np.array([(point - blocks.centre) @ blocks.axes for point in ((0.0, 0.0), (501.0, 0.0))])
    components = Components(np.array([0.9, 0.1]), means, np.tile(4 * np.eye(2), (2, 1, 1)))
    assert len(splits(components, blocks, count=9, reg_covar=1e-6)) == n_splits


def test_merges_keep_the_moments_of_the_mixture_and_come_in_the_order_of_runnalls_bound() -> None:
    random = np.random.default_rng(3)
    shapes = random.standard_normal((5, 2, 2))
    mixture = Components(random.dirichlet(np.ones(5)), 4 * random.standard_normal((5, 2)), shapes @ shapes.swapaxes(1, 2))
    bounds = []
    for i, j in itertools.combinations(range(5), 2):
        pair = Components(*(part[[i, j]] for part in mixture))
        _, covariance = moments(pair)
        of_each = [w * np.log(np.linalg.det(c)) for w, _, c in zip(*pair, strict=True)]
        bounds.append((pair.weights.sum() * np.log(np.linalg.det(covariance)) - sum(of_each), i, j))
    bounds.sort()
    ours = merges(mixture, count=4)
    assert len(ours) == 4
    for merged, (_, i, j) in zip(ours, bounds[:4], strict=True):
        kept = [number for number in range(5) if number not in {i, j}]
        np.testing.assert_allclose(merged.means[:3], mixture.means[kept])
        assert merged.weights[3] == pytest.approx(mixture.weights[[i, j]].sum())
        for got, want in zip(moments(merged), moments(mixture), strict=True):
            np.testing.assert_allclose(got, want, atol=1e-9)


def moments(components: Components) -> tuple[FloatArray, FloatArray]:
    """Mean (2,) and covariance (2, 2) of a mixture, its weights scaled to 1."""
    weights = components.weights / components.weights.sum()
    mean = weights @ components.means
    away = components.means - mean
    return mean, np.tensordot(weights, components.covariances, 1) + (weights[:, None] * away).T @ away
