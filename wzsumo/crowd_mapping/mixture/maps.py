"""From the density of vehicle centres to the area that may be driven on: the paper's squares and the swept region.

The mixtures are those of stations and offsets on a road: a lane is straight there, however the road bends, and a component
follows it. In x and y one that spans 80 m of a bend of 300 m radius leaves it by 2.7 m.
"""

import math

import numpy as np
import numpy.typing as npt
import shapely
from pydantic import Field

from wzsumo.crowd_mapping.mixture.mixture import Mixture
from wzsumo.crowd_mapping.mixture.selection import MOST_COMPONENTS
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import UNKNOWN, OccupancyGrid, cells_inside
from wzsumo.road import Road
from wzsumo.spec import Spec

STRAY_SHARE = 0.05  # of the mean number of fixes a metre; speeds in a zone differ by a factor of two or three, not of twenty
OUTLINE_STEP_M = 5.0  # between the points of a stretch's outline: on a radius of 300 m its chords are 1 cm off
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])  # of a rectangle, in half sides


class MixtureSpec(Spec):
    """How many components are tried, and how the fitted mixture becomes an area."""

    # None: 30 for each 657 m, the zone of Chen et al. 2022, who show K up to about 30; see `selection.default_k_max`.
    k_max: int | None = Field(None, ge=1, le=MOST_COMPONENTS)
    # No component is narrower. Vehicles wander by as much within seconds; where simulated ones do not, components would tell
    # the lines of single ones apart without end, and leave lane changes to a broad one. Of 0.001, 0.05, 0.1 and 0.25 m the
    # one with the highest precision before recall falls (seven zones, seeds 82, 91, 95).
    least_sd_m: float = Field(0.05, gt=0, le=1)
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


def swept_map(mixture: Mixture, *, road: Road, half_width_m: float, spec: MixtureSpec, grid: OccupancyGrid) -> OccupancyGrid:
    """The stretches of `road` that vehicle centres keep to, widened by half a vehicle: 0 there, unknown elsewhere.

    A component stands for a stretch of lane: uniform along, so that it is 2 sqrt(3) standard deviations long (its ellipse
    would overshoot a kink of the lane by a fifth of that), and across as wide as the ellipse of `mass_share`, but taken to be
    at least `driver_sd_m` wide: a few traces cannot show how drivers scatter, and one alone gives a width of nothing.
    Components that gather strays (`stands_for_a_stretch`) are left out.
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


def driven_lines(mixture: Mixture) -> FloatArray:
    """Lines (K, 2, 2), ends (station, offset) [m], in the middle of the stretches that the components stand for."""
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
