"""What lies on a road, unrolled: stations along x and lateral offsets along y, so that a bend is drawn like a straight."""

from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.road import Road

VERTEX_SPACING_M = 5.0  # of an outline: on a radius of 300 m its chords are 1 cm off


def unrolled_points(points: npt.ArrayLike, road: Road) -> FloatArray:
    """(station, offset) (n, 2) [m] of world points (n, 2)."""
    return np.column_stack(road.to_sd(points))


def unrolled_area(area: BaseGeometry, road: Road) -> BaseGeometry:
    """A polygon of the world, or several, with stations for x and offsets for y."""
    fine = shapely.segmentize(area, VERTEX_SPACING_M)
    return shapely.transform(fine, lambda points: unrolled_points(points, road))


def unrolled_cells(
    values: npt.NDArray[Any], grid: OccupancyGrid, road: Road, *, stations: FloatArray, offsets: FloatArray
) -> np.ma.MaskedArray[Any, Any]:
    """Values (rows, cols) of a grid's cells at every station (n,) and offset (m,): an image (m, n), masked off the grid."""
    points = road.to_xy(stations[None, :], offsets[:, None]).reshape(-1, 2)
    on_grid = grid.contains(points)
    image = np.zeros(len(points), dtype=values.dtype)
    image[on_grid] = values[grid.cell_of(points[on_grid])]
    return np.ma.MaskedArray(image, mask=~on_grid).reshape(len(offsets), len(stations))
