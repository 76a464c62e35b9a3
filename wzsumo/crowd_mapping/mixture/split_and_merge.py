"""Starts for the fit of a mixture with one component more, or one less, than a fitted one.

A split replaces one component by two halves of it, a merge two components by one of their moments. Both are ranked: splits by
the likelihood that they gain, merges by a bound on the divergence that they cost.
"""

import numpy as np

from wzsumo.crowd_mapping.mixture.expectation_maximisation import Components, most_responsible, run_em
from wzsumo.crowd_mapping.mixture.point_blocks import PointBlocks
from wzsumo.frames import FloatArray

SPLIT_ITERATIONS = 4  # EM iterations of the two halves on the points of their component; chosen by us, enough to rank splits
MIN_POINTS_TO_SPLIT = 2


def single_component(blocks: PointBlocks, *, reg_covar: float) -> Components:
    """The mixture of one component: mean and covariance of all points."""
    mean, covariance = _moments(blocks, reg_covar=reg_covar)
    return Components(np.ones(1), mean[None], covariance[None])


def splits(components: Components, blocks: PointBlocks, *, count: int, reg_covar: float) -> list[Components]:
    """At most `count` starts with one component split in two along one of its axes, the largest gain in likelihood first.

    The gain is estimated on the points for which the component is the most responsible one: by how much a mixture of the two
    halves, after a few iterations of EM, is more likely on them than their normal distribution.
    """
    label = most_responsible(blocks.x, blocks.y, components)
    order = np.argsort(label, kind="stable")
    ends = np.searchsorted(label[order], np.arange(len(components.weights) + 1))
    pairs: list[tuple[float, int, Components]] = []
    for j in range(len(components.weights)):
        own = blocks.select(order[ends[j] : ends[j + 1]])
        n = len(own.x)
        if n < MIN_POINTS_TO_SPLIT:
            continue
        mean, covariance = _moments(own, reg_covar=reg_covar)
        # Log-likelihood of n points under the normal distribution of their own moments.
        alone = -n / 2 * (np.log(np.linalg.det(covariance)) + 2 + 2 * np.log(2 * np.pi))
        for pair in _halves(mean, covariance):
            halves = run_em(own, pair, reg_covar=reg_covar, tol=0.0, max_iterations=SPLIT_ITERATIONS)
            pairs.append((halves.log_likelihood - alone, j, halves.components))
    pairs.sort(key=lambda pair: -pair[0])
    return [_with_pair(components, j, pair) for _, j, pair in pairs[:count]]


def merges(components: Components, *, count: int) -> list[Components]:
    """At most `count` starts with two components i, j merged into one of their moments (w, S), the smallest loss first.

    The loss  w log det S - w_i log det S_i - w_j log det S_j  is twice a bound on the Kullback-Leibler divergence from the
    mixture before (Runnalls 2007, IEEE Trans. AES 43(3), eq. 16).
    """
    weights, means, covariances = components
    i, j = np.triu_indices(len(weights), 1)
    total = weights[i] + weights[j]
    share = np.stack([weights[i], weights[j]], axis=1) / total[:, None]
    gap = means[i] - means[j]
    merged = (
        share[:, 0, None, None] * covariances[i]
        + share[:, 1, None, None] * covariances[j]
        + (share[:, 0] * share[:, 1])[:, None, None] * gap[:, :, None] * gap[:, None, :]
    )
    log_det = np.log(np.linalg.det(covariances))
    loss = total * np.log(np.linalg.det(merged)) - weights[i] * log_det[i] - weights[j] * log_det[j]
    starts = []
    for pair in np.argsort(loss, kind="stable")[:count]:
        rest = np.setdiff1d(np.arange(len(weights)), [i[pair], j[pair]])
        mean = share[pair, 0] * means[i[pair]] + share[pair, 1] * means[j[pair]]
        starts.append(
            Components(
                np.append(weights[rest], total[pair]),
                np.vstack([means[rest], mean]),
                np.concatenate([covariances[rest], merged[pair][None]]),
            )
        )
    return starts


def _moments(blocks: PointBlocks, *, reg_covar: float) -> tuple[FloatArray, FloatArray]:
    """Mean (2,) and covariance (2, 2), regularised, of all points."""
    xy = np.stack([blocks.x, blocks.y])
    mean = xy.mean(axis=1)
    local = xy - mean[:, None]
    return mean, local @ local.T / xy.shape[1] + reg_covar * np.eye(2)


def _with_pair(components: Components, j: int, pair: Components) -> Components:
    """The components with component j replaced by a pair, whose weights are shares of its weight."""
    rest = np.arange(len(components.weights)) != j
    scaled = pair._replace(weights=pair.weights * components.weights[j])
    return Components(*(np.concatenate([old[rest], new]) for old, new in zip(components, scaled, strict=True)))


def _halves(mean: FloatArray, covariance: FloatArray) -> list[Components]:
    """For each of the two axes of a component its two halves along it; together they have its mean and covariance."""
    variances, axes = np.linalg.eigh(covariance)
    pairs = []
    for variance, axis in zip(variances, axes.T, strict=True):
        # The mean of one half of a normal distribution lies sqrt(2 / pi) standard deviations from its middle.
        step = np.sqrt(2 / np.pi * variance) * axis
        shrunk = covariance - step[:, None] * step
        pairs.append(Components(np.full(2, 0.5), np.array([mean - step, mean + step]), np.array([shrunk, shrunk])))
    return pairs
