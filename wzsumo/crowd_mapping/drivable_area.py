"""From the density of vehicle centres to the area that may be driven on: the paper's squares and the swept region."""

import math

import numpy as np
import numpy.typing as npt
from pydantic import Field

from wzsumo.crowd_mapping.mixture import Mixture
from wzsumo.frames import FloatArray
from wzsumo.grid import UNKNOWN, OccupancyGrid
from wzsumo.spec import Spec

STRAY_SHARE = 0.05  # of the mean number of fixes a metre; speeds in a zone differ by a factor of two or three, not of twenty
BoolArray = npt.NDArray[np.bool_]
CELLS_AT_ONCE = 1_000_000  # of one stretch: a diagonal one on a fine map would need gigabytes


class MixtureSpec(Spec):
    """How many components are tried, and how the fitted mixture becomes an area."""

    k_max: int = Field(30, ge=1, le=200)  # Chen et al. 2022 show K up to about 30
    criterion: str = Field("bic", pattern="^(bic|aic)$")  # ibid.: "the lowest AIC and BIC"
    n_samples: int = Field(5000, ge=1)  # ibid.
    mass_share: float = Field(0.95, gt=0, lt=1)  # ibid.: samples within the 95 % confidence interval
    literal_square_m: float = Field(0.127, gt=0)  # ibid.: 5 by 5 inch
    square_m: float = Field(1.524, gt=0)  # 5 by 5 FOOT: the smallest round size that joins the samples (see the README)

    driver_sd_m: float = Field(0.25, ge=0, le=1)  # swept: drivers' scatter in a lane, 0.2-0.4 m in naturalistic studies
    copies: int = Field(0, ge=0, le=20)  # of each trace, moved sideways by as much: see `augmentation`


def samples_inside(mixture: Mixture, *, spec: MixtureSpec, seed: int) -> FloatArray:
    """`n_samples` points (n, 2) [m] drawn from the mixture within the region of `inside_region`."""
    kept = np.empty((0, 2))
    for attempt in range(50):  # each draw keeps at least `mass_share` of its points
        drawn = mixture.sample(math.ceil(1.2 * spec.n_samples / spec.mass_share), seed=seed + attempt)
        kept = np.vstack([kept, drawn[inside_region(mixture, drawn, mass_share=spec.mass_share)]])
        if len(kept) >= spec.n_samples:
            break
    return kept[: spec.n_samples]


def inside_region(mixture: Mixture, points: npt.ArrayLike, *, mass_share: float) -> BoolArray:
    """Whether points (n, 2) lie in the ellipse of any component that holds `mass_share` of that component.

    The union of the ellipses holds at least that share of the mixture. It is one piece where the components overlap; the
    highest-density region is not: it leaves out whole stretches that are driven fast, because fixes come by time.
    In two dimensions the squared Mahalanobis distance is exponential: its quantile is -2 log(1 - share).
    """
    xy = np.asarray(points, dtype=float)
    inside = np.zeros(len(xy), dtype=bool)
    for mean, covariance in zip(mixture.means, mixture.covariances, strict=True):
        offset = xy - mean
        squared = np.einsum("ij,jk,ik->i", offset, np.linalg.inv(covariance), offset)
        inside |= squared <= -2 * math.log(1 - mass_share)
    return inside


def squares_map(samples: npt.ArrayLike, *, side_m: float, grid: OccupancyGrid) -> OccupancyGrid:
    """The paper's inverse occupancy grid on the cells of `grid`: 0 where a square around a sample lies, 1 elsewhere.

    A square covers the cells whose centre is in it, and at least the cell that holds the sample.
    """
    points = np.asarray(samples, dtype=float)
    covered = np.zeros(grid.shape, dtype=bool)
    half = side_m / 2
    low_row, low_col = grid.cell_of(points - half + grid.resolution / 2)
    high_row, high_col = grid.cell_of(points + half - grid.resolution / 2)
    own_row, own_col = grid.cell_of(points)
    first_row, first_col = np.minimum(low_row, own_row), np.minimum(low_col, own_col)
    last_row, last_col = np.maximum(high_row, own_row), np.maximum(high_col, own_col)
    for row_0, col_0, row_1, col_1 in zip(first_row, first_col, last_row, last_col, strict=True):
        covered[max(row_0, 0) : max(row_1 + 1, 0), max(col_0, 0) : max(col_1 + 1, 0)] = True
    return grid.with_p_occupied(~covered)


def swept_map(mixture: Mixture, *, half_width_m: float, spec: MixtureSpec, grid: OccupancyGrid) -> OccupancyGrid:
    """The stretches of lane that vehicle centres keep to, widened by half a vehicle: 0 there, unknown elsewhere.

    A component stands for a stretch of lane: uniform along, so that it is 2 sqrt(3) standard deviations long (its ellipse
    would overshoot a kink of the lane by a fifth of that), and across as wide as the ellipse of `mass_share`, but taken to be
    at least `driver_sd_m` wide: a few traces cannot show how drivers scatter, and one alone gives a width of nothing.
    Components that gather strays (`stands_for_a_stretch`) are left out.
    """
    free = np.zeros(grid.shape, dtype=bool)
    across = math.sqrt(-2 * math.log(1 - spec.mass_share))
    driven = stands_for_a_stretch(mixture)
    for mean, covariance in zip(mixture.means[driven], mixture.covariances[driven], strict=True):
        variances, axes = np.linalg.eigh(covariance)  # ascending: across, along
        half = np.array([across, math.sqrt(3)]) * np.maximum(np.sqrt(np.maximum(variances, 0)), spec.driver_sd_m)
        _mark_stretch(free, grid, mean=mean, axes=axes, half=half, around=half_width_m)
    return grid.with_p_occupied(np.where(free, np.float32(0.0), np.float32(UNKNOWN)))


def driven_lines(mixture: Mixture) -> FloatArray:
    """Lines (K, 2, 2), ends x, y [m], in the middle of the stretches that the components stand for, as in `swept_map`."""
    driven = stands_for_a_stretch(mixture)
    variances, axes = np.linalg.eigh(mixture.covariances[driven])
    half = math.sqrt(3) * np.sqrt(np.maximum(variances[:, 1], 0))[:, None] * axes[:, :, 1]
    return np.stack([mixture.means[driven] - half, mixture.means[driven] + half], axis=1)


def stands_for_a_stretch(mixture: Mixture) -> BoolArray:
    """Which components (K,) hold as many fixes a metre as a driven stretch of lane does, STRAY_SHARE of the mean or more.

    Expectation-maximisation leaves now and then one broad component under all others: 0.3 % of the fixes on 900 m of road.
    The mean is that of the length: a queue at a stop line has a hundred times the fixes a metre of the road beyond, and most
    of the components, but next to no length.
    """
    length = 2 * math.sqrt(3) * np.sqrt(np.linalg.eigvalsh(mixture.covariances)[:, 1])
    return np.asarray(mixture.weights >= STRAY_SHARE * length / length.sum())


def _mark_stretch(
    free: BoolArray, grid: OccupancyGrid, *, mean: FloatArray, axes: FloatArray, half: FloatArray, around: float
) -> None:
    """Set the cells whose centre lies within `around` of the rectangle of half sides `half` (2,) along the columns of axes."""
    extent = np.abs(axes) @ half + around
    (row_0, row_1), (col_0, col_1) = grid.cell_of([mean - extent, mean + extent])
    rows = np.arange(max(row_0, 0), min(row_1 + 1, grid.shape[0]))
    cols = np.arange(max(col_0, 0), min(col_1 + 1, grid.shape[1]))
    for part in np.array_split(rows, max(1, rows.size * cols.size // CELLS_AT_ONCE)):
        local = (grid.centre_of(part[:, None], cols[None, :]) - mean) @ axes
        free[np.ix_(part, cols)] |= np.hypot(*np.maximum(np.abs(local) - half, 0.0).transpose(2, 0, 1)) <= around
