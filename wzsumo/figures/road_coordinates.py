"""Points, areas and maps in road coordinates, station and lateral offset, so that a figure shows a bend like a straight."""

from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.road import Road

VERTEX_SPACING_M = 5.0  # of an outline; a chord of 5 m is 1 cm off an arc with a radius of 300 m


def points_in_road_coordinates(points: npt.ArrayLike, road: Road) -> FloatArray:
    """Stations and lateral offsets (n, 2) [m] of world points (n, 2)."""
    return np.column_stack(road.to_sd(points))


def area_in_road_coordinates(area: BaseGeometry, road: Road) -> BaseGeometry:
    """A polygon or several of the world, with stations as x and lateral offsets as y."""
    fine = shapely.segmentize(area, VERTEX_SPACING_M)
    return shapely.transform(fine, lambda points: points_in_road_coordinates(points, road))


def cells_in_road_coordinates(
    values: npt.NDArray[Any], grid: OccupancyGrid, road: Road, *, stations: FloatArray, offsets: FloatArray
) -> np.ma.MaskedArray[Any, Any]:
    """Image (m, n) of a grid's values (rows, cols) at stations (n,) and lateral offsets (m,), masked outside the grid."""
    points = road.to_xy(stations[None, :], offsets[:, None]).reshape(-1, 2)
    on_grid = grid.contains(points)
    image = np.zeros(len(points), dtype=values.dtype)
    image[on_grid] = values[grid.cell_of(points[on_grid])]
    return np.ma.MaskedArray(image, mask=~on_grid).reshape(len(offsets), len(stations))
