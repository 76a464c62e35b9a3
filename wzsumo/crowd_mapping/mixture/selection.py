"""MixtureSweep: mixtures of 1 to k_max components fitted to the same points, and the best of them by AIC or BIC.

    AIC = 2 n_parameters - 2 log L,    BIC = n_parameters log n_points - 2 log L

The sweep runs upwards, then downwards. Upwards the fit of K components starts from the fit of K - 1 with one component split
in two; downwards from the fit of K + 1 with two components merged. For each K the sweep tries a few such starts: it runs a few
iterations of EM on a part of the points, and carries only the most likely start to convergence on all points. The better of
the two fits of each K is kept. No random numbers are drawn.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
import pandas as pd

from wzsumo.crowd_mapping.mixture.expectation_maximisation import Components, Fit, run_em
from wzsumo.crowd_mapping.mixture.mixture import Mixture, mixture_of
from wzsumo.crowd_mapping.mixture.point_blocks import PointBlocks, block_points
from wzsumo.crowd_mapping.mixture.split_and_merge import merges, single_component, splits
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray

Criterion = Literal["aic", "bic"]
COMPONENTS_PER_METRE = 30 / 657  # K = 1..30 on the 657 m of the zone of Chen et al. 2022
MAX_COMPONENTS = 200  # enough for 4.4 km; chosen by us, for the time that a sweep takes grows with the square
REG_COVAR_M2 = 1e-6  # added to the variances where the caller names none, a spread of 1 mm: scikit-learn's reg_covar
# EM stops where the mean log-likelihood changes by less in an iteration. From a warm start it then ends closer to the maximum
# than with scikit-learn's 1e-3, after no more iterations (analysis/benchmarks/mixture.py).
TOLERANCE = 2e-4
MAX_ITERATIONS = 100  # scikit-learn's max_iter
# More iterations, points or starts than these four lowered the best BIC by less than 0.1 % for twice the time (ibid.).
TRIAL_ITERATIONS = 8
TRIAL_POINTS = 3000  # on which the starts of one K are compared
SPLIT_POINTS = 2000  # on which the gain of each split is estimated
STARTS_PER_COUNT = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class MixtureSweep:
    """Mixtures of 1, 2, ... components of the same points."""

    mixtures: tuple[Mixture, ...]

    @property
    def table(self) -> pd.DataFrame:
        """One row a mixture: n_components, log_likelihood, aic, bic."""
        columns = ("n_components", "log_likelihood", "aic", "bic")
        return pd.DataFrame({name: [getattr(m, name) for m in self.mixtures] for name in columns})

    def best(self, criterion: Criterion) -> Mixture:
        """The mixture with the lowest AIC or BIC."""
        return min(self.mixtures, key=lambda mixture: getattr(mixture, criterion))


def sweep_mixtures(
    points: npt.ArrayLike,
    *,
    k_max: int | None = None,
    reg_covar_m2: float = REG_COVAR_M2,
    progress: Callable[[int, int], None] | None = None,
) -> MixtureSweep:
    """Mixtures of 1..k_max components of points (n, 2) [m]; k_max in proportion to their extent where it is not given.

    `reg_covar_m2` is added to the variances of every component: none is narrower than its root. `progress` is told (done, all).
    Raises TraceError where the points are not (n, 2), none or not finite, and where k_max is below 1.
    """
    xy = _checked_points(points)
    blocks = block_points(xy)
    last = min(default_k_max(float(np.ptp(blocks.x))) if k_max is None else k_max, len(xy))
    if last < 1:
        raise TraceError(f"k_max={k_max} must be 1 or more components")
    tell = progress or (lambda _done, _total: None)
    fits = _FitsByCount(blocks, reg_covar=reg_covar_m2)
    steps = [*range(2, last + 1), *range(last - 1, 1, -1)]
    fits.offer(single_component(blocks, reg_covar=reg_covar_m2))
    for done, k in enumerate(steps):
        tell(done, len(steps))
        fits.improve(k, start_from=k - 1 if done < last - 1 else k + 1)
    tell(len(steps), len(steps))
    return MixtureSweep(mixtures=tuple(mixture_of(blocks, fits.best[k]) for k in range(1, last + 1)))


def default_k_max(length_m: float) -> int:
    """Largest number of components worth trying for points that extend over `length_m`."""
    return min(max(2, int(np.ceil(COMPONENTS_PER_METRE * length_m))), MAX_COMPONENTS)


def _checked_points(points: npt.ArrayLike) -> FloatArray:
    """Points (n, 2) as an array of floats. Raises TraceError where they are not (n, 2), none or not finite."""
    xy = np.asarray(points, dtype=float)
    if xy.ndim != 2 or xy.shape[1] != 2 or not len(xy):
        raise TraceError(f"points of shape {xy.shape} must be (n, 2), n at least 1: x and y of every fix")
    bad = np.flatnonzero(~np.isfinite(xy).all(axis=1))
    if bad.size:
        raise TraceError(f"point {bad[0]} is {tuple(xy[bad[0]].tolist())}; every coordinate must be finite; drop such fixes")
    return xy


class _FitsByCount:
    """The best fit so far for each number of components, in the axes of the blocks."""

    def __init__(self, blocks: PointBlocks, *, reg_covar: float) -> None:
        self.blocks, self.reg_covar = blocks, reg_covar
        self.trial_blocks, self.split_blocks = blocks.subset(TRIAL_POINTS), blocks.subset(SPLIT_POINTS)
        self.best: dict[int, Fit] = {}

    def improve(self, k: int, *, start_from: int) -> None:
        """Offer the most likely of the starts that split or merge components of the fit with one less or one more."""
        source = self.best[start_from].components
        if start_from < k:
            starts = splits(source, self.split_blocks, count=STARTS_PER_COUNT, reg_covar=self.reg_covar)
        else:
            starts = merges(source, count=STARTS_PER_COUNT)
        trials = [self._try(start) for start in starts]
        self.offer(max(trials, key=lambda trial: trial.log_likelihood).components)

    def offer(self, start: Components) -> None:
        """Carry a start to convergence; keep the fit where it is the most likely of its number of components."""
        fit = run_em(self.blocks, start, reg_covar=self.reg_covar, tol=TOLERANCE, max_iterations=MAX_ITERATIONS)
        k = len(start.weights)
        if k not in self.best or fit.log_likelihood > self.best[k].log_likelihood:
            self.best[k] = fit

    def _try(self, start: Components) -> Fit:
        return run_em(self.trial_blocks, start, reg_covar=self.reg_covar, tol=0.0, max_iterations=TRIAL_ITERATIONS)
