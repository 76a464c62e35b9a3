"""Mixture: a plane Gaussian mixture with full covariances, and its fit to points by expectation-maximisation.

Definitions, regularisation and stopping rule are those of scikit-learn's GaussianMixture: from the same start both reach
the same mixture.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wzsumo.crowd_mapping.course.lane_changes import relative_lanes
from wzsumo.crowd_mapping.mixture.expectation_maximisation import (
    Components,
    Fit,
    log_densities,
    run_em,
    strongest,
    to_block_axes,
    to_world_axes,
)
from wzsumo.crowd_mapping.mixture.point_blocks import PointBlocks, block_points
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray

REG_COVAR_M2 = 1e-6  # added to both variances: scikit-learn's reg_covar; a spread of 1 mm
TOLERANCE = 1e-3  # of the mean log-likelihood of a point in one iteration: scikit-learn's tol
MAX_ITERATIONS = 100  # scikit-learn's max_iter
KMEANS_ITERATIONS = 20  # enough for a start: EM moves the means on
DENSITY_LEVEL_SAMPLES = 20_000  # the level's share is then known to sqrt(.05 * .95 / 20000) = 0.15 % at 95 %


@dataclass(frozen=True, kw_only=True, eq=False)
class Mixture:
    """Weights (k,), means (k, 2) [m] and covariances (k, 2, 2) [m^2] of a Gaussian mixture in the frame of its points.

    `log_likelihood` is the sum over the `n_points` points of the fit.
    """

    weights: FloatArray
    means: FloatArray
    covariances: FloatArray
    log_likelihood: float
    n_points: int
    converged: bool

    @property
    def n_components(self) -> int:
        """Number of components k."""
        return len(self.weights)

    @property
    def n_parameters(self) -> int:
        """Free parameters: 2 k of the means, 3 k of the covariances, k - 1 of the weights."""
        return 6 * self.n_components - 1

    @property
    def aic(self) -> float:
        """Akaike's criterion for the points of the fit; lower is better."""
        return 2 * self.n_parameters - 2 * self.log_likelihood

    @property
    def bic(self) -> float:
        """Bayesian (Schwarz) criterion for the points of the fit; lower is better."""
        return self.n_parameters * float(np.log(self.n_points)) - 2 * self.log_likelihood

    def log_density(self, points: npt.ArrayLike) -> FloatArray:
        """Log densities (n,) [log 1/m^2] at points (n, 2)."""
        # About the mixture's own middle the numbers stay small even in national grids of some 1e6 m.
        middle = self.weights @ self.means
        x, y = np.ascontiguousarray((np.asarray(points, dtype=float).reshape(-1, 2) - middle).T)
        return log_densities(x, y, Components(self.weights, self.means - middle, self.covariances))

    def sample(self, n: int, *, seed: int) -> FloatArray:
        """Points (n, 2) drawn from the mixture, in random order."""
        random = np.random.default_rng(seed)
        component = random.choice(self.n_components, size=n, p=self.weights)
        factors = np.linalg.cholesky(self.covariances)
        return np.asarray(self.means[component] + np.einsum("nij,nj->ni", factors[component], random.standard_normal((n, 2))))

    def density_level(self, share: float, *, seed: int) -> float:
        """Log density above which `share` of the probability lies: the border of the highest-density region.

        Source: Hyndman 1996, "Computing and graphing highest density regions", the quantile of the density of a sample.
        """
        if not 0 < share < 1:
            raise TraceError(f"share={share} of the probability must lie between 0 and 1")
        return float(np.quantile(self.log_density(self.sample(DENSITY_LEVEL_SAMPLES, seed=seed)), 1 - share))


def fit_mixture(
    points: npt.ArrayLike,
    *,
    n_components: int,
    seed: int,
    start: Mixture | FloatArray | None = None,
    n_init: int = 1,
    tol: float = TOLERANCE,
    max_iterations: int = MAX_ITERATIONS,
    reg_covar_m2: float = REG_COVAR_M2,
) -> Mixture:
    """The mixture of `n_components` fitted to points (n, 2) [m]: the most likely of `n_init` runs from k-means++ starts.

    With `start`, a mixture or responsibilities (n, k), there is one run, from there, and the seed is not used.
    Raises TraceError where the points are not (n, 2), not finite or fewer than the components.
    """
    xy = check_points(points, n_components=n_components)
    blocks = block_points(xy)
    random = np.random.default_rng(seed)
    if start is None:
        starts = [_kmeans_start(blocks, n_components, random=random, reg_covar=reg_covar_m2) for _ in range(n_init)]
    else:
        starts = [_given_start(start, blocks, n_components=n_components, reg_covar=reg_covar_m2)]
    fits = [run_em(blocks, s, reg_covar=reg_covar_m2, tol=tol, max_iterations=max_iterations) for s in starts]
    return mixture_of(blocks, max(fits, key=lambda fit: fit.log_likelihood))


def mixture_of(blocks: PointBlocks, fit: Fit) -> Mixture:
    """The Mixture, in the world's axes, of a fit to `blocks`."""
    weights, means, covariances = to_world_axes(blocks, fit.components)
    return Mixture(
        weights=weights,
        means=means,
        covariances=covariances,
        log_likelihood=fit.log_likelihood,
        n_points=len(blocks.x),
        converged=fit.converged,
    )


def compile_kernels() -> None:
    """Compile or load all kernels of crowd mapping, so that the first real call does not wait."""
    points = np.random.default_rng(0).normal(size=(100, 2))
    fit_mixture(points, n_components=2, seed=0).log_density(points)
    relative_lanes(np.zeros((1, 2)), np.ones(2), drift_variance=1.0, white_variance=1.0)


def check_points(points: npt.ArrayLike, *, n_components: int) -> FloatArray:
    """Points (n, 2) as an array of floats; TraceError where they are not (n, 2), not finite or too few."""
    xy = np.asarray(points, dtype=float)
    if xy.ndim != 2 or xy.shape[1] != 2:
        raise TraceError(f"points of shape {xy.shape} must be (n, 2): x and y of every fix")
    bad = np.flatnonzero(~np.isfinite(xy).all(axis=1))
    if bad.size:
        raise TraceError(f"point {bad[0]} is {tuple(xy[bad[0]].tolist())}; every coordinate must be finite; drop such fixes")
    if not 1 <= n_components <= len(xy):
        raise TraceError(
            f"n_components={n_components} must be 1 to the number of points, {len(xy)}; give more fixes or fewer components"
        )
    return xy


def _given_start(start: Mixture | FloatArray, blocks: PointBlocks, *, n_components: int, reg_covar: float) -> Components:
    if isinstance(start, Mixture):
        if start.n_components != n_components:
            raise TraceError(f"the start has {start.n_components} components, n_components={n_components}; they must agree")
        return to_block_axes(blocks, Components(start.weights, start.means, start.covariances))
    responsibilities = np.asarray(start, dtype=float)
    if responsibilities.shape != (len(blocks.x), n_components):
        raise TraceError(f"responsibilities of shape {responsibilities.shape} must be {(len(blocks.x), n_components)}")
    return _moments(blocks, responsibilities[blocks.order], reg_covar=reg_covar)


def _moments(blocks: PointBlocks, responsibilities: FloatArray, *, reg_covar: float) -> Components:
    xy = np.column_stack([blocks.x, blocks.y])
    counts = responsibilities.sum(axis=0) + 10 * np.finfo(float).eps
    means = responsibilities.T @ xy / counts[:, None]
    covariances = np.empty((len(counts), 2, 2))
    for j, mean in enumerate(means):
        local = xy - mean
        covariances[j] = (responsibilities[:, j, None] * local).T @ local / counts[j] + reg_covar * np.eye(2)
    return Components(counts / counts.sum(), means, covariances)


def _kmeans_start(blocks: PointBlocks, n_components: int, *, random: np.random.Generator, reg_covar: float) -> Components:
    """Moments of a k-means clustering from k-means++ centres (Arthur and Vassilvitskii 2007)."""
    xy = np.column_stack([blocks.x, blocks.y])
    centres = xy[random.integers(len(xy), size=1)]
    nearest = np.sum((xy - centres[0]) ** 2, axis=1)
    for _ in range(n_components - 1):
        total = nearest.sum()
        # All points in the centres already: any point will do, the regularisation keeps the component finite.
        chance = nearest / total if total > 0 else None
        centre = xy[random.choice(len(xy), p=chance)]
        centres = np.vstack([centres, centre])
        nearest = np.minimum(nearest, np.sum((xy - centre) ** 2, axis=1))
    # With equal weights and round components the strongest one is the nearest.
    equal, round_ones = np.full(n_components, 1 / n_components), np.tile(np.eye(2), (n_components, 1, 1))
    label = strongest(blocks.x, blocks.y, Components(equal, centres, round_ones))
    for _ in range(KMEANS_ITERATIONS):
        counts = np.bincount(label, minlength=n_components)
        sums = [np.bincount(label, weights=v, minlength=n_components) for v in (blocks.x, blocks.y)]
        filled = counts > 0
        centres[filled] = np.column_stack(sums)[filled] / counts[filled, None]
        moved = strongest(blocks.x, blocks.y, Components(equal, centres, round_ones))
        if (moved == label).all():
            break
        label = moved
    responsibilities = np.zeros((len(xy), n_components))
    responsibilities[np.arange(len(xy)), label] = 1.0
    return _moments(blocks, responsibilities, reg_covar=reg_covar)
