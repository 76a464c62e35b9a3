"""OccupancyGrid: p(occupied) in the cells of a regular grid. cells_inside: the cells within an area."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from wzsumo.errors import MapError
from wzsumo.frames import BoolArray, FloatArray

FREE_THRESHOLD = 0.196  # ROS map_server's default free_thresh: p_occupied below it is free
OCCUPIED_THRESHOLD = 0.65  # ROS map_server's default occupied_thresh
UNKNOWN = 0.5  # p(occupied) where nothing was observed


@dataclass(frozen=True, kw_only=True, eq=False)
class OccupancyGrid:
    """A map: p_occupied (rows, cols) float32 in [0, 1]. Rows count upwards along y, columns along x.

    `origin` is the world point (x, y) [m] of the lower-left CORNER of cell [0, 0]; `resolution` the cell's edge [m].
    """

    p_occupied: npt.NDArray[np.float32]
    resolution: float
    origin: tuple[float, float]

    def __post_init__(self) -> None:
        p = np.asarray(self.p_occupied, dtype=np.float32)
        if p.ndim != 2 or p.size == 0:
            raise MapError(f"a map of shape {p.shape} must have rows and columns")
        if not (np.isfinite(p).all() and p.min() >= 0 and p.max() <= 1):
            raise MapError("p_occupied must be finite and in [0, 1] in every cell; mark unknown cells with 0.5")
        if not (np.isfinite(self.resolution) and self.resolution > 0 and np.isfinite(self.origin).all()):
            raise MapError(f"resolution={self.resolution} m must be above 0 and origin={self.origin} finite")
        object.__setattr__(self, "p_occupied", p)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, cols = self.p_occupied.shape
        return rows, cols

    @property
    def free(self) -> BoolArray:
        """Cells (rows, cols) where a vehicle may be: p_occupied below FREE_THRESHOLD. Unknown is not free."""
        return np.asarray(self.p_occupied < FREE_THRESHOLD)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """World extent (x_min, y_min, x_max, y_max) [m]."""
        rows, cols = self.shape
        x, y = self.origin
        return x, y, x + cols * self.resolution, y + rows * self.resolution

    def cell_of(self, points: npt.ArrayLike) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Rows and columns (n,) of the cells that hold world points (n, 2); outside the map they exceed the shape."""
        xy = np.asarray(points, dtype=float).reshape(-1, 2)
        col, row = np.floor((xy - self.origin) / self.resolution).astype(np.intp).T
        return row, col

    def centre_of(self, row: npt.ArrayLike, col: npt.ArrayLike) -> FloatArray:
        """World points (..., 2) of the centres of cells."""
        x = self.origin[0] + (np.asarray(col, dtype=float) + 0.5) * self.resolution
        y = self.origin[1] + (np.asarray(row, dtype=float) + 0.5) * self.resolution
        return np.stack(np.broadcast_arrays(x, y), axis=-1)

    def contains(self, points: npt.ArrayLike) -> BoolArray:
        """Whether world points (n, 2) lie on the map."""
        row, col = self.cell_of(points)
        return np.asarray((row >= 0) & (row < self.shape[0]) & (col >= 0) & (col < self.shape[1]))

    def with_p_occupied(self, p_occupied: npt.ArrayLike) -> "OccupancyGrid":
        """A map of the same cells with other values."""
        return OccupancyGrid(
            p_occupied=np.asarray(p_occupied, dtype=np.float32), resolution=self.resolution, origin=self.origin
        )


def blank_grid(bounds: tuple[float, float, float, float], *, resolution: float, p_occupied: float) -> OccupancyGrid:
    """A map with one value everywhere over (x_min, y_min, x_max, y_max) [m], its edges on multiples of the resolution."""
    low = np.floor(np.array(bounds[:2]) / resolution + 1e-9)
    high = np.maximum(np.ceil(np.array(bounds[2:]) / resolution - 1e-9), low + 1)
    cols, rows = (high - low).astype(int)
    x, y = low * resolution
    return OccupancyGrid(
        p_occupied=np.full((rows, cols), p_occupied, dtype=np.float32),
        resolution=resolution,
        origin=(float(x), float(y)),
    )


def cells_inside(grid: OccupancyGrid, area: BaseGeometry) -> BoolArray:
    """Cells (rows, cols) whose centre lies inside `area`, of polygons.

    Even-odd rule: each side of the area toggles all cells to its right in the rows that it crosses. The result differs from a
    point-in-polygon test of every centre only for centres exactly on a side, and takes a fraction of its time.
    """
    rows, cols = grid.shape
    toggles = np.zeros((rows, cols + 1), dtype=bool)
    for ring in shapely.get_parts(area.boundary):
        x, y = ((shapely.get_coordinates(ring) - grid.origin) / grid.resolution - 0.5).T  # in cells, from the first centre
        low, high = np.minimum(y[:-1], y[1:]), np.maximum(y[:-1], y[1:])
        first, end = (np.clip(np.ceil(limit), 0, rows).astype(np.intp) for limit in (low, high))  # rows that each side crosses
        side = np.repeat(np.arange(len(first)), end - first)
        row = np.arange(len(side)) - np.repeat(np.cumsum(end - first) - end, end - first)
        crossing = x[side] + (row - y[side]) / (y[side + 1] - y[side]) * (x[side + 1] - x[side])
        np.logical_xor.at(toggles, (row, np.clip(np.ceil(crossing), 0, cols).astype(np.intp)), True)
    return np.logical_xor.accumulate(toggles, axis=1)[:, :cols]
