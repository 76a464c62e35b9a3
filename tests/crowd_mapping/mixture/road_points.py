"""Points like those of road traces, any start for a mixture of them, and one iteration of EM as textbooks write it."""

import numpy as np
from scipy.stats import multivariate_normal

from wzsumo.crowd_mapping.mixture.expectation_maximisation import Components
from wzsumo.frames import FloatArray


def strips(n: int, *, seed: int) -> FloatArray:
    """Points like those of road traces: two long narrow strips that join."""
    random = np.random.default_rng(seed)
    s = random.uniform(0, 300, n)
    lane = np.where(random.random(n) < 0.5, 3.6 * np.clip((150 - s) / 80, 0, 1), 0.0)
    return np.column_stack([s, lane + 0.25 * random.standard_normal(n)])


def start_for(points: FloatArray, k: int) -> Components:
    """Any start: means at points, one broad covariance."""
    means = points[np.random.default_rng(k).choice(len(points), k, replace=False)]
    return Components(np.full(k, 1 / k), means, np.tile(np.cov(points.T) / k, (k, 1, 1)))


def em_twin(points: FloatArray, start: Components) -> Components:
    """One iteration, written as in any textbook."""
    density = np.column_stack([w * multivariate_normal(m, c).pdf(points) for w, m, c in zip(*start, strict=True)])
    share = density / density.sum(axis=1, keepdims=True)
    counts = share.sum(axis=0)
    means = share.T @ points / counts[:, None]
    covariances = [
        (share[:, j, None] * (points - m)).T @ (points - m) / counts[j] + 1e-6 * np.eye(2) for j, m in enumerate(means)
    ]
    return Components(counts / len(points), means, np.array(covariances))
