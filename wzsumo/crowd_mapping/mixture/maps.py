"""From a mixture of vehicle centres to the area that may be driven on: the paper's squares, and the swept region.

The mixtures are those of stations and offsets on a road. There a lane is straight, however the road bends, and a component can
follow it; in x and y a component that spans 80 m of a bend of 300 m radius leaves the bend by 2.7 m.
"""

import math

import numpy as np
import numpy.typing as npt
import shapely
from pydantic import Field

from wzsumo.crowd_mapping.mixture.mixture import Mixture
from wzsumo.crowd_mapping.mixture.selection import MAX_COMPONENTS
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import UNKNOWN, OccupancyGrid, cells_inside
from wzsumo.road import Road
from wzsumo.spec import Spec

# A component with fewer fixes a metre than this share of the mean stands for no stretch of lane. Chosen by us: speeds in a
# zone, and with them the fixes a metre, differ by a factor of two or three, not of twenty.
MIN_DENSITY_SHARE = 0.05
OUTLINE_STEP_M = 5.0  # between the points of a stretch's outline: on a radius of 300 m its chords leave the arc by 1 cm
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])  # of a rectangle, in half sides


class MixtureSpec(Spec):
    """How many components are tried, and how the fitted mixture becomes an area."""

    # None: 30 components for 657 m, the zone of Chen et al. 2022, who show K up to about 30; in proportion elsewhere.
    k_max: int | None = Field(None, ge=1, le=MAX_COMPONENTS)
    # Standard deviation below which no component is. Vehicles wander by as much within seconds. Simulated vehicles do not:
    # without a least width, components would follow the lines of single vehicles and leave lane changes to one broad component.
    # Set on our simulated traffic: of 0.001, 0.05, 0.1 and 0.25 m the highest precision before recall falls (seven zones).
    least_sd_m: float = Field(0.05, gt=0, le=1)
    criterion: str = Field("bic", pattern="^(bic|aic)$")  # ibid.: "the lowest AIC and BIC"
    n_samples: int = Field(5000, ge=1, le=1_000_000)  # ibid.
    mass_share: float = Field(0.95, gt=0, lt=1)  # ibid.: samples within the 95 % confidence interval
    literal_square_m: float = Field(0.127, gt=0)  # ibid.: 5 by 5 inch
    square_m: float = Field(1.524, gt=0)  # 5 by 5 FOOT: the smallest round size that joins the samples
    driver_sd_m: float = Field(0.25, ge=0, le=1)  # drivers' scatter across a lane; 0.2-0.4 m in naturalistic studies
    copies: int = Field(0, ge=0, le=20)  # of each trace, moved to the side by normal offsets of driver_sd_m


def samples_inside(mixture: Mixture, *, spec: MixtureSpec, seed: int) -> FloatArray:
    """`n_samples` points (n, 2) [m] drawn from the mixture inside its ellipses of `mass_share` (`inside_region`)."""
    kept, draws = np.empty((0, 2)), 0
    while len(kept) < spec.n_samples:
        # Each draw keeps about `mass_share` of its points, or more: with a fifth to spare one is nearly always enough.
        drawn = mixture.sample(math.ceil(1.2 * spec.n_samples / spec.mass_share), seed=seed + draws)
        kept = np.vstack([kept, drawn[inside_region(mixture, drawn, mass_share=spec.mass_share)]])
        draws += 1
    return kept[: spec.n_samples]


def inside_region(mixture: Mixture, points: npt.ArrayLike, *, mass_share: float) -> BoolArray:
    """Whether points (n, 2) lie in the ellipse of any component that holds `mass_share` of that component.

    In the plane the squared Mahalanobis distance of a normal point is exponential with mean 2: its quantile is
    -2 log(1 - mass_share). The union of the ellipses holds at least that share of the mixture and is one piece where components
    overlap. The highest-density region is not: fixes come by time, so it would leave out stretches that are driven fast.
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


def swept_map(mixture: Mixture, *, road: Road, half_width_m: float, spec: MixtureSpec, grid: OccupancyGrid) -> OccupancyGrid:
    """The stretches of `road` that vehicle centres keep to, widened by half a vehicle: 0 there, unknown elsewhere.

    A component stands for a rectangle, a stretch of lane. Along the lane its points are taken for uniform, so the rectangle is
    2 sqrt(3) standard deviations long; the ellipse is longer and would overshoot a kink of the lane. Across, the rectangle is
    as wide as the ellipse of `mass_share`, with a standard deviation of at least `driver_sd_m`: a few traces cannot show how
    drivers scatter. Components that gather stray fixes (`stands_for_a_stretch`) are left out.
    """
    across = math.sqrt(-2 * math.log(1 - spec.mass_share))
    driven = stands_for_a_stretch(mixture)
    variances, axes = np.linalg.eigh(mixture.covariances[driven])  # ascending: across, along
    spreads = np.maximum(np.sqrt(np.maximum(variances, 0)), spec.driver_sd_m)
    half_sides = (spreads * [across, math.sqrt(3)])[:, None, :] * axes
    corners = mixture.means[driven][:, None] + _CORNERS @ half_sides.swapaxes(1, 2)
    outlines = shapely.segmentize(shapely.polygons(corners), OUTLINE_STEP_M)
    stretches = shapely.transform(outlines, lambda points: road.to_xy(*points.T))
    free = cells_inside(grid, shapely.union_all(shapely.buffer(stretches, half_width_m)))
    return grid.with_p_occupied(np.where(free, np.float32(0.0), np.float32(UNKNOWN)))


def driven_lines(mixture: Mixture) -> tuple[FloatArray, FloatArray]:
    """Middle lines (n, 2, 2) of the stretches that components stand for, ends as (station, offset) [m]; their weights."""
    driven = stands_for_a_stretch(mixture)
    variances, axes = np.linalg.eigh(mixture.covariances[driven])
    half = math.sqrt(3) * np.sqrt(np.maximum(variances[:, 1], 0))[:, None] * axes[:, :, 1]
    return np.stack([mixture.means[driven] - half, mixture.means[driven] + half], axis=1), mixture.weights[driven]


def stands_for_a_stretch(mixture: Mixture) -> BoolArray:
    """Which components (K,) hold at least MIN_DENSITY_SHARE of the mean number of fixes a metre, as a stretch of lane does.

    EM can end with one broad component under all others, with 0.3 % of the fixes on 900 m of road: it gathers strays. The mean
    is all fixes over the components' summed length. A mean over components would fail at a stop line: a queue holds a hundred
    times as many fixes a metre as the road beyond it, and most of the components, but next to no length.
    """
    length = 2 * math.sqrt(3) * np.sqrt(np.linalg.eigvalsh(mixture.covariances)[:, 1])
    return np.asarray(mixture.weights >= MIN_DENSITY_SHARE * length / length.sum())
