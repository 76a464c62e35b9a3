"""MixtureSweep: mixtures of 1 to k_max components fitted to the same points, and the best of them by AIC or BIC.

Each count starts from the fit of the one before, with one component split in two; a second way, downwards, merges two.
Many starts are tried with a few iterations on a part of the points, few are carried to convergence on all of them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
import pandas as pd

from wzsumo.crowd_mapping.mixture.expectation_maximisation import Components, Fit, run_em
from wzsumo.crowd_mapping.mixture.mixture import REG_COVAR_M2, TOLERANCE, Mixture, check_points, fit_mixture, mixture_of
from wzsumo.crowd_mapping.mixture.point_blocks import PointBlocks, block_points
from wzsumo.crowd_mapping.mixture.split_and_merge import merges, single_component, splits
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray

Criterion = Literal["aic", "bic"]
COMPONENTS_PER_METRE = 30 / 657  # K = 1..30 on the 657 m of the zone of Chen et al. 2022
MOST_COMPONENTS = 200  # 4.4 km; the time that a sweep takes grows with the square
SWEEP_TOLERANCE = 2e-4  # a warm start ends closer than TOLERANCE's 1e-3 at no more iterations (analysis/benchmarks/mixture.py)
SWEEP_ITERATIONS = 100
# More points, iterations or trials than these lowered the best BIC by less than 0.1 % for twice the time (ibid.).
TRIAL_ITERATIONS = 8
TRIAL_POINTS = 3000  # on which starts are compared
SPLIT_POINTS = 2000  # on which the gain of each split is estimated
TRIALS = 3  # starts compared for each count


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
    seed: int,
    k_max: int | None = None,
    n_init: int | None = None,
    reg_covar_m2: float = REG_COVAR_M2,
    progress: Callable[[int, int], None] | None = None,
) -> MixtureSweep:
    """Mixtures of 1..k_max components of points (n, 2) [m]; k_max in proportion to their extent where it is not given.

    With `n_init` each count is fitted on its own from so many k-means++ starts, as scikit-learn does it: slower. Without,
    counts are fitted one from the other by splits and merges, and the seed is not used. `reg_covar_m2` is added to all
    variances: no component is narrower than its root. `progress` is told (done, all).
    """
    xy = check_points(points, n_components=1)
    blocks = block_points(xy)
    last = min(k_max or default_k_max(float(np.ptp(blocks.x))), len(xy))
    if last < 1:
        raise TraceError(f"k_max={k_max} must be 1 or more components")
    tell = progress or (lambda _done, _total: None)
    if n_init is not None:
        return MixtureSweep(mixtures=_independent(xy, last, seed=seed, n_init=n_init, reg_covar=reg_covar_m2, tell=tell))
    fits = _Fits(blocks, reg_covar=reg_covar_m2)
    steps = [*range(2, last + 1), *range(last - 1, 1, -1)]
    fits.offer(single_component(blocks, reg_covar=reg_covar_m2))
    for done, k in enumerate(steps):
        tell(done, len(steps))
        fits.improve(k, start_from=k - 1 if done < last - 1 else k + 1)
    tell(len(steps), len(steps))
    return MixtureSweep(mixtures=tuple(mixture_of(blocks, fits.best[k]) for k in range(1, last + 1)))


def default_k_max(length_m: float) -> int:
    """Largest number of components worth trying for points that extend over `length_m`."""
    return min(max(2, int(np.ceil(COMPONENTS_PER_METRE * length_m))), MOST_COMPONENTS)


class _Fits:
    """The best fit so far for each count, in the axes of the blocks."""

    def __init__(self, blocks: PointBlocks, *, reg_covar: float) -> None:
        self.blocks, self.reg_covar = blocks, reg_covar
        self.trial_blocks, self.split_blocks = blocks.subset(TRIAL_POINTS), blocks.subset(SPLIT_POINTS)
        self.best: dict[int, Fit] = {}

    def offer(self, components: Components) -> None:
        """Carry a start to convergence; keep it where it is the best of its count."""
        fit = run_em(self.blocks, components, reg_covar=self.reg_covar, tol=SWEEP_TOLERANCE, max_iterations=SWEEP_ITERATIONS)
        k = len(components.weights)
        if k not in self.best or fit.log_likelihood > self.best[k].log_likelihood:
            self.best[k] = fit

    def improve(self, k: int, *, start_from: int) -> None:
        """Offer the most promising of the splits of, or merges in, the fit with one component less or more."""
        source = self.best[start_from].components
        if start_from < k:
            starts = splits(source, self.split_blocks, count=TRIALS, reg_covar=self.reg_covar)
        else:
            starts = merges(source, count=TRIALS)
        trials = [self._try(start) for start in starts]
        self.offer(max(trials, key=lambda trial: trial.log_likelihood).components)

    def _try(self, components: Components) -> Fit:
        return run_em(self.trial_blocks, components, reg_covar=self.reg_covar, tol=0.0, max_iterations=TRIAL_ITERATIONS)


def _independent(
    xy: FloatArray, k_max: int, *, seed: int, n_init: int, reg_covar: float, tell: Callable[[int, int], None]
) -> tuple[Mixture, ...]:
    mixtures = []
    for k in range(1, k_max + 1):
        tell(k - 1, k_max)
        mixtures.append(fit_mixture(xy, n_components=k, seed=seed + k, n_init=n_init, tol=TOLERANCE, reg_covar_m2=reg_covar))
    tell(k_max, k_max)
    return tuple(mixtures)
