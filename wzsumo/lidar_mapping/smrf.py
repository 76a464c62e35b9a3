"""Simple Morphological Filter (SMRF): which points of a cloud are ground.

The lowest point of each cell makes a surface. Morphological openings by disks of growing radius remove objects from it, the
holes are filled, and points near the remaining terrain are ground. Source: Pingel, Clarke & McBride 2013, An improved simple
morphological filter for the terrain classification of airborne LIDAR data, ISPRS J. Photogramm. 77, 21-30. Net cutting, their
option for buildings wider than the window, is left out.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit
from pydantic import Field
from scipy.ndimage import spline_filter

from wzsumo.errors import CloudError, NoGroundError
from wzsumo.frames import BoolArray, FloatArray, IntArray
from wzsumo.lidar_mapping.membrane import fill_holes
from wzsumo.scan import check_cloud
from wzsumo.spec import Spec

LOW_OUTLIER_SLOPE = 5.0  # 500 %, for the inverted surface and a window of one cell; Pingel et al. 2013, Section 2
FILL_TOLERANCE_M = 1e-3  # of filled holes, far below the elevation threshold; chosen by us
MAX_SURFACE_CELLS = 30_000_000  # 30 km^2 at 1 m; at 135 bytes a cell their surfaces take 4 GiB
MAX_CELLS_PER_POINT = 400  # points 20 cells apart do not determine a surface; chosen by us
ALWAYS_ALLOWED_CELLS = 1_000_000  # a cloud on fewer cells may be sparser; chosen by us


class SmrfSpec(Spec):
    """Parameters of SMRF. Defaults: the single set of Pingel et al. 2013 for all airborne samples; ranges: their Table 3."""

    cell_m: float = Field(default=1.0, gt=0)  # ibid., all samples
    slope: float = Field(default=0.15, gt=0, le=10)  # rise over run of the steepest ground; ibid.
    window_m: float = Field(default=18.0, gt=0, le=500)  # radius of the widest opening; ibid.
    elevation_threshold_m: float = Field(default=0.5, ge=0)  # of ground points from the terrain; ibid.; Chen et al. 2022: 0.2 m
    elevation_scalar: float = Field(default=1.25, ge=0)  # metres added to that threshold per unit of slope; ibid.


def ground_mask(points: npt.ArrayLike, spec: SmrfSpec) -> BoolArray:
    """Whether each point (n, 3) [m] is ground: |z - terrain| <= elevation_threshold_m + elevation_scalar * slope.

    Terrain and its slope are those of the provisional ground surface at the point's x and y.
    Raises CloudError for an empty cloud, values that are not finite or too wide an extent, NoGroundError where every cell is an
    object or an outlier.
    """
    cloud = check_cloud(points, source="cloud")
    return _near_terrain(cloud, _estimate_terrain(cloud, spec), spec)


def compile_kernels() -> None:
    """Compile, or load from the cache, every kernel of SMRF."""
    corner = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [3.0, 3.0, 0.0]])
    ground_mask(corner, SmrfSpec(window_m=1.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Terrain:
    """The provisional ground: heights [m] and slopes (rows, cols) at nodes `cell` [m] apart, row = y up, [0, 0] at `origin`."""

    height: FloatArray
    slope: FloatArray
    cell: float
    origin: tuple[float, float]


def _estimate_terrain(cloud: FloatArray, spec: SmrfSpec) -> _Terrain:
    """Provisional ground surface of a cloud (n, 3): its lowest points, without low outliers and objects, holes filled.

    Raises NoGroundError where no cell is left.
    """
    low = np.floor(np.array([cloud[:, 0].min(), cloud[:, 1].min()]) / spec.cell_m + 0.5)
    high = np.floor(np.array([cloud[:, 0].max(), cloud[:, 1].max()]) / spec.cell_m + 0.5)
    cols, rows = (int(n) for n in high - low + 1)
    _check_extent(rows, cols, len(cloud), spec.cell_m)
    lowest = np.full((rows, cols), np.inf)
    _keep_lowest(cloud, low, spec.cell_m, lowest)
    empty = ~np.isfinite(lowest)
    surface = fill_holes(np.where(empty, np.nan, lowest), empty, tolerance=FILL_TOLERANCE_M)
    low_outliers = object_cells(-surface, LOW_OUTLIER_SLOPE, max_radius=1, cell=spec.cell_m)
    widest = min(int(np.ceil(spec.window_m / spec.cell_m - 1e-9)), rows + cols)  # a wider disk covers the whole surface
    hole = empty | low_outliers | object_cells(surface, spec.slope, max_radius=widest, cell=spec.cell_m)
    if hole.all():
        raise NoGroundError("cloud: no ground in it; every cell stands above or lies below its neighbours: take a wider cloud")
    height = fill_holes(surface, hole, tolerance=FILL_TOLERANCE_M)
    return _Terrain(
        height=height,
        slope=_slope(height, spec.cell_m),
        cell=spec.cell_m,
        origin=(float(low[0] * spec.cell_m), float(low[1] * spec.cell_m)),
    )


def _check_extent(rows: int, cols: int, n_points: int, cell_m: float) -> None:
    """Raise CloudError for a surface of more cells than fit into memory, or than its points determine."""
    remedy = "take out stray points, give x, y, z in metres, or set a larger cell_m"
    if rows * cols > MAX_SURFACE_CELLS:
        raise CloudError(f"cloud: {cols:.4g} x {rows:.4g} cells of {cell_m} m are more than {MAX_SURFACE_CELLS}; {remedy}")
    if rows * cols > max(ALWAYS_ALLOWED_CELLS, MAX_CELLS_PER_POINT * n_points):
        raise CloudError(
            f"cloud: {n_points} points on {cols} x {rows} cells of {cell_m} m are less than one in {MAX_CELLS_PER_POINT} "
            f"cells; {remedy}"
        )


@njit(cache=True, error_model="numpy", nogil=True)
def _keep_lowest(cloud: FloatArray, first: FloatArray, cell: float, lowest: FloatArray) -> None:
    """Lower each cell of `lowest` to its lowest point; `first` = column and row of cell [0, 0] in the world's grid."""
    for i in range(len(cloud)):
        col = int(np.floor(cloud[i, 0] / cell + 0.5) - first[0])
        row = int(np.floor(cloud[i, 1] / cell + 0.5) - first[1])
        lowest[row, col] = min(lowest[row, col], cloud[i, 2])


def object_cells(surface: FloatArray, slope: float, *, max_radius: int, cell: float) -> BoolArray:
    """Cells that some opening of a surface (rows, cols) lowers by more than slope * radius * cell.

    The radius grows from 1 to `max_radius` cells; each opening is applied to the result of the last one.
    """
    objects = np.zeros(surface.shape, dtype=bool)
    for radius in range(1, max_radius + 1):
        opened = open_by_disk(surface, radius=radius)
        objects |= surface - opened > slope * radius * cell
        surface = opened
    return objects


def open_by_disk(surface: FloatArray, *, radius: int) -> FloatArray:
    """The opening (dilation of the erosion) of a surface (rows, cols) by the disk dx^2 + dy^2 <= radius^2 [cells].

    Cells beyond the border are ignored, as in Matlab's imopen.
    """
    chords = np.floor(np.sqrt(radius**2 - np.arange(radius + 1.0) ** 2) + 1e-9).astype(np.int64)
    eroded = _erode(np.ascontiguousarray(surface, dtype=np.float64), chords)
    return np.asarray(-_erode(-eroded, chords))  # dilation is the erosion of the negative


@njit(cache=True, error_model="numpy", nogil=True)
def _erode(surface: FloatArray, chords: IntArray) -> FloatArray:
    """Minimum of a surface over the disk whose row at distance dy reaches chords[dy] cells to either side.

    `running` holds the minimum over [-w, w] along each row, for w growing from 0. From w = 2 on, [-w, w] is the union of
    [-w, w - 2] and [-w + 2, w], so each step costs one minimum per cell. A row of the disk is used when w equals its chord.
    """
    rows, cols = surface.shape
    radius = chords.size - 1
    running, grown = surface.copy(), surface.copy()
    eroded = np.full((rows, cols), np.inf)
    for w in range(radius + 1):
        if w > 0:
            for row in range(rows):
                _grow_row(running[row], grown[row], w)
            running, grown = grown, running
        for dy in range(radius + 1):
            if chords[dy] != w:
                continue
            for row in range(rows):
                if row + dy < rows:
                    _take_minimum(eroded[row], running[row + dy])
                if dy > 0 and row >= dy:
                    _take_minimum(eroded[row], running[row - dy])
    return eroded


@njit(cache=True, error_model="numpy", inline="always")
def _grow_row(running: FloatArray, grown: FloatArray, w: int) -> None:
    """Write to `grown` the minimum over [-w, w] of a row, given in `running` that over [-w + 1, w - 1]."""
    cols = running.size
    for col in range(1, cols - 1):
        left, right = running[col - 1], running[col + 1]
        grown[col] = left if left < right else right
    # At a border one of the two intervals is cut off, and the other one holds the rest of the window.
    grown[0], grown[cols - 1] = running[0], running[cols - 1]
    if cols > 1:
        grown[0], grown[cols - 1] = min(running[0], running[1]), min(running[cols - 1], running[cols - 2])
    if w == 1:
        _take_minimum(grown, running)


@njit(cache=True, error_model="numpy", inline="always")
def _take_minimum(target: FloatArray, other: FloatArray) -> None:
    """Lower `target` to `other` where that is lower."""
    for col in range(target.size):
        target[col] = other[col] if other[col] < target[col] else target[col]


def _slope(height: FloatArray, cell: float) -> FloatArray:
    """Slope (rows, cols) from central differences, one-sided at the border, 0 along an axis of one node."""
    steps = [np.gradient(height, cell, axis=axis) if height.shape[axis] > 1 else np.zeros_like(height) for axis in (0, 1)]
    return np.hypot(*steps)


def _near_terrain(cloud: FloatArray, terrain: _Terrain, spec: SmrfSpec) -> BoolArray:
    """Whether each point (n, 3) lies within the slope-scaled threshold of a terrain; heights and slopes by cubic splines."""
    coefficients = np.stack(
        [spline_filter(field, order=3, mode="mirror") for field in (terrain.height, terrain.slope)], axis=-1
    )
    frame = np.array([*terrain.origin, terrain.cell])
    return np.asarray(_near(cloud, coefficients, frame, np.array([spec.elevation_threshold_m, spec.elevation_scalar])))


@njit(cache=True, error_model="numpy", nogil=True)
def _near(cloud: FloatArray, coefficients: FloatArray, frame: FloatArray, limit: FloatArray) -> BoolArray:
    """Whether each point is near a terrain given by `coefficients` (rows, cols, 2): cubic B-splines of height and slope.

    Splines are mirrored at the borders as in scipy.ndimage. `frame` = x, y of node [0, 0] and the cell edge; `limit` =
    threshold [m] and metres added to it per unit of slope.
    """
    rows, cols = coefficients.shape[:2]
    near = np.empty(len(cloud), np.bool_)
    across, along = np.empty(4), np.empty(4)
    for i in range(len(cloud)):
        u, v = (cloud[i, 0] - frame[0]) / frame[2], (cloud[i, 1] - frame[1]) / frame[2]
        col, row = int(np.floor(u)), int(np.floor(v))
        _b_spline(u - col, across)
        _b_spline(v - row, along)
        z, slope = 0.0, 0.0
        for b in range(4):
            r = _mirrored(row - 1 + b, rows)
            for a in range(4):
                c, weight = _mirrored(col - 1 + a, cols), along[b] * across[a]
                z += weight * coefficients[r, c, 0]
                slope += weight * coefficients[r, c, 1]
        near[i] = abs(cloud[i, 2] - z) <= limit[0] + limit[1] * slope
    return near


@njit(cache=True, error_model="numpy", inline="always")
def _b_spline(t: float, weights: FloatArray) -> None:
    """Write the weights of the nodes at -1, 0, 1 and 2 for a cubic B-spline at t in [0, 1)."""
    rest = 1.0 - t
    weights[0], weights[3] = rest * rest * rest / 6, t * t * t / 6
    weights[1] = (4 - 6 * t * t + 3 * t * t * t) / 6
    weights[2] = (4 - 6 * rest * rest + 3 * rest * rest * rest) / 6


@njit(cache=True, error_model="numpy", inline="always")
def _mirrored(index: int, size: int) -> int:
    """The index in [0, size) that an index by at most two cells outside is mirrored to."""
    inside = abs(index)
    return max(inside if inside < size else 2 * (size - 1) - inside, 0)
