"""The occupancy grid of a LaneMap.

A place is free with the probability

    p(free) = sum over lanes and strips of p_open [Phi((b' - d) / sd') - Phi((b - d) / sd)]

with the strip's borders b, b' and their standard deviations: between open strips the terms cancel, at the outer lines they blur
the edge.
"""

from collections.abc import Callable

import numpy as np
import shapely
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree
from scipy.special import ndtr

from wzsumo.frames import FloatArray, IntArray
from wzsumo.grid import UNKNOWN, OccupancyGrid, cells_inside
from wzsumo.lane_map import LaneMap
from wzsumo.road import Road

OBSERVED_MARGIN_M = 1.2  # beside the outer lines: half a vehicle and its wander. Farther away nothing was observed
CORRIDOR_M = 60.0  # beside the axis; cells farther away are unknown
# Of the table from which cells are interpolated: edges are 0.1 m wide, tapers lean by 0.1 m in 4 m at most.
TABLE_STEP_ALONG_M, TABLE_STEP_ACROSS_M = 4.0, 0.05
TILE_M = 16.0  # side of the squares of cells that are filled together


def occupancy_grid(
    lane_map: LaneMap, grid: OccupancyGrid, *, progress: Callable[[int, int], None] | None = None
) -> OccupancyGrid:
    """p(occupied) on the cells of `grid`; UNKNOWN away from lanes and branches. `progress` is told (done, all)."""
    p = np.full(grid.shape, UNKNOWN, dtype=np.float32)
    tiles = _tiles_near(lane_map.axis, grid)
    table = _Table(lane_map)
    for done, (rows, cols) in enumerate(tiles):
        s, d = lane_map.axis.to_sd(grid.centre_of(rows[:, None], cols[None, :]).reshape(-1, 2))
        p[np.ix_(rows, cols)] = table.at(s, d).reshape(len(rows), len(cols))
        if progress:
            progress(done + 1, len(tiles))
    for branch in lane_map.branches:
        strip = shapely.LineString(branch.line).buffer(float(branch.width.mean()) / 2, cap_style="flat")
        inside = cells_inside(grid, strip)
        p[inside] = np.minimum(p[inside], 1 - branch.p_open)
    return grid.with_p_occupied(p)


class _Table:
    """p(occupied) along the lanes, at distances from lane 0's right line: cells are many, p changes slowly along the road."""

    def __init__(self, lane_map: LaneMap) -> None:
        low, high = lane_map.stations[[0, -1]]
        self.stations = np.arange(low, high + TABLE_STEP_ALONG_M / 2, TABLE_STEP_ALONG_M)
        self.right = np.interp(self.stations, lane_map.stations, lane_map.lanes[0].right)
        across = max(float((lane.left - lane_map.lanes[0].right).max()) for lane in lane_map.lanes)
        self.beside = np.arange(-OBSERVED_MARGIN_M, across + OBSERVED_MARGIN_M, TABLE_STEP_ACROSS_M)
        s, e = np.meshgrid(self.stations, self.beside, indexing="ij")
        self.p = p_occupied(lane_map, s.ravel(), (self.right[:, None] + e).ravel()).reshape(s.shape)

    def at(self, s: FloatArray, d: FloatArray) -> FloatArray:
        """p(occupied) (n,), UNKNOWN beyond the table."""
        row = (s - self.stations[0]) / TABLE_STEP_ALONG_M
        col = (d - np.interp(s, self.stations, self.right) - self.beside[0]) / TABLE_STEP_ACROSS_M
        inside = (s >= self.stations[0]) & (s <= self.stations[-1]) & (col >= 0) & (col <= len(self.beside) - 1)
        return np.where(inside, map_coordinates(self.p, [row, col], order=1, mode="nearest"), UNKNOWN)


def p_occupied(lane_map: LaneMap, s: FloatArray, d: FloatArray) -> FloatArray:
    """p(occupied) (n,) at stations and offsets (n,) [m]; unknown beyond the map."""
    stations = lane_map.stations
    place = np.clip((s - stations[0]) / (stations[1] - stations[0]), 0, len(stations) - 1 - 1e-9)
    row = place.astype(int)
    share = place - row

    def along(values: FloatArray) -> FloatArray:
        return values[row] + share * (values[row + 1] - values[row])

    free = np.zeros(len(s))
    low, high = np.full(len(s), np.inf), np.full(len(s), -np.inf)
    for lane in lane_map.lanes:
        right, left = along(lane.right), along(lane.left)
        right_sd, left_sd = along(lane.right_sd), along(lane.left_sd)
        m = lane.p_open.shape[1]
        below = ndtr((right - d) / right_sd)
        for j in range(m):
            f = (j + 1) / m
            border = right + f * (left - right)
            above = ndtr((border - d) / (right_sd + f * (left_sd - right_sd)))
            free += along(lane.p_open[:, j]) * (above - below)
            below = above
        low, high = np.minimum(low, right), np.maximum(high, left)
    known = (s >= stations[0]) & (s <= stations[-1]) & (d > low - OBSERVED_MARGIN_M) & (d < high + OBSERVED_MARGIN_M)
    return np.where(known, np.clip(1 - free, 0, 1), UNKNOWN)


def _tiles_near(axis: Road, grid: OccupancyGrid) -> list[tuple[IntArray, IntArray]]:
    """Rows and columns of square tiles of cells that may lie within CORRIDOR_M of the axis: a map is mostly empty."""
    side = max(1, round(TILE_M / grid.resolution))
    first_rows, first_cols = np.arange(0, grid.shape[0], side), np.arange(0, grid.shape[1], side)
    middles = grid.centre_of(first_rows[:, None] + side / 2, first_cols[None, :] + side / 2).reshape(-1, 2)
    reach = CORRIDOR_M + side * grid.resolution
    # A straight road may have a point at either end only.
    stations = np.linspace(0.0, axis.length, int(np.ceil(axis.length / TILE_M)) + 1)
    points = axis.to_xy(stations, np.zeros(len(stations)))
    distance, _ = cKDTree(points).query(middles, distance_upper_bound=reach)
    return [
        (np.arange(row, min(row + side, grid.shape[0])), np.arange(col, min(col + side, grid.shape[1])))
        for row, col in (
            (first_rows[at // len(first_cols)], first_cols[at % len(first_cols)])
            for at in np.flatnonzero(np.isfinite(distance))
        )
    ]
