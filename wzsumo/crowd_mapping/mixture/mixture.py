"""Mixture: a Gaussian mixture in the plane with full covariances, and its information criteria."""

from dataclasses import dataclass

import numpy as np

from wzsumo.crowd_mapping.mixture.expectation_maximisation import Fit, to_world_axes
from wzsumo.crowd_mapping.mixture.point_blocks import PointBlocks
from wzsumo.frames import FloatArray


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

    def sample(self, n: int, *, seed: int) -> FloatArray:
        """Points (n, 2) drawn from the mixture, in random order."""
        random = np.random.default_rng(seed)
        component = random.choice(self.n_components, size=n, p=self.weights)
        factors = np.linalg.cholesky(self.covariances)
        return np.asarray(self.means[component] + np.einsum("nij,nj->ni", factors[component], random.standard_normal((n, 2))))


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
