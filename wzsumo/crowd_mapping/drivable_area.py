"""From the density of vehicle centres to the area that may be driven on: the paper's squares and the swept region."""

import math

import numpy as np
import numpy.typing as npt
from pydantic import Field
from scipy.ndimage import distance_transform_edt

from wzsumo.crowd_mapping.mixture import Mixture
from wzsumo.frames import FloatArray
from wzsumo.grid import UNKNOWN, OccupancyGrid
from wzsumo.spec import Spec

BoolArray = npt.NDArray[np.bool_]


class MixtureSpec(Spec):
    """How many components are tried, and how the fitted mixture becomes an area."""

    k_max: int = Field(30, ge=1, le=200)  # Chen et al. 2022 show K up to about 30
    criterion: str = Field("bic", pattern="^(bic|aic)$")  # ibid.: "the lowest AIC and BIC"
    n_samples: int = Field(5000, ge=1)  # ibid.
    mass_share: float = Field(0.95, gt=0, lt=1)  # ibid.: samples within the 95 % region
    literal_square_m: float = Field(0.127, gt=0)  # ibid.: 5 by 5 inch
    square_m: float = Field(1.524, gt=0)  # 5 by 5 FOOT: the smallest round size that joins the samples (see the README)


def samples_inside(mixture: Mixture, *, spec: MixtureSpec, seed: int) -> FloatArray:
    """`n_samples` points (n, 2) [m] drawn from the mixture within its highest-density region of `mass_share`."""
    level = mixture.density_level(spec.mass_share, seed=seed)
    kept: list[FloatArray] = []
    count = 0
    for attempt in range(50):
        drawn = mixture.sample(math.ceil(1.2 * spec.n_samples / spec.mass_share), seed=seed + attempt)
        kept.append(drawn[mixture.log_density(drawn) >= level])
        count += len(kept[-1])
        if count >= spec.n_samples:
            break
    return np.vstack(kept)[: spec.n_samples]


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


def swept_map(mixture: Mixture, *, half_width_m: float, spec: MixtureSpec, grid: OccupancyGrid, seed: int) -> OccupancyGrid:
    """The region that holds `mass_share` of vehicle centres, widened by half a vehicle: 0 there, unknown elsewhere."""
    level = mixture.density_level(spec.mass_share, seed=seed)
    inside = _dense_cells(mixture, level=level, grid=grid)
    if not inside.any():
        return grid.with_p_occupied(np.full(grid.shape, UNKNOWN))
    distance = distance_transform_edt(~inside, sampling=grid.resolution)
    # The distance is counted from centres of cells inside, whose outer edges lie half a cell farther out.
    swept = distance <= half_width_m - grid.resolution / 2
    return grid.with_p_occupied(np.where(swept, 0.0, UNKNOWN))


def _dense_cells(mixture: Mixture, *, level: float, grid: OccupancyGrid) -> BoolArray:
    """Cells (rows, cols) whose centre has at least the log density `level`; looked for component by component.

    The density at a point is at most the sum over components of their own, so that a cell above the level lies within the
    ellipse of one of them where that component alone reaches level - log K.
    """
    inside = np.zeros(grid.shape, dtype=bool)
    for weight, mean, covariance in zip(mixture.weights, mixture.means, mixture.covariances, strict=True):
        peak = math.log(max(weight, 1e-300)) - math.log(2 * math.pi) - 0.5 * math.log(np.linalg.det(covariance))
        reach = math.sqrt(max(2 * (peak - (level - math.log(len(mixture.weights)))), 0.0))
        extent = reach * np.sqrt(np.diag(covariance))
        (row_0, row_1), (col_0, col_1) = grid.cell_of([mean - extent, mean + extent])
        rows = np.arange(max(row_0, 0), min(row_1 + 1, grid.shape[0]))
        cols = np.arange(max(col_0, 0), min(col_1 + 1, grid.shape[1]))
        if rows.size and cols.size:
            centres = grid.centre_of(rows[:, None], cols[None, :])
            dense = mixture.log_density(centres.reshape(-1, 2)).reshape(centres.shape[:2]) >= level
            inside[np.ix_(rows, cols)] |= dense
    return inside
