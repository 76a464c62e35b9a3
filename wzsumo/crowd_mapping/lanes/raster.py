"""The occupancy grid of a LaneMap."""

from collections.abc import Callable

import numpy as np
import shapely
from scipy.special import ndtr

from wzsumo.crowd_mapping.occupancy import _tiles_near
from wzsumo.frames import FloatArray
from wzsumo.grid import UNKNOWN, OccupancyGrid, cells_inside
from wzsumo.lane_map import LaneMap

OBSERVED_MARGIN_M = 1.2


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


def raster(lane_map: LaneMap, grid: OccupancyGrid, *, progress: Callable[[int, int], None] | None = None) -> OccupancyGrid:
    p = np.full(grid.shape, UNKNOWN, dtype=np.float32)
    tiles = _tiles_near(lane_map.axis, grid)
    for done, (rows, cols) in enumerate(tiles):
        s, d = lane_map.axis.to_sd(grid.centre_of(rows[:, None], cols[None, :]).reshape(-1, 2))
        p[np.ix_(rows, cols)] = p_occupied(lane_map, s, d).reshape(len(rows), len(cols))
        if progress:
            progress(done + 1, len(tiles))
    for branch in lane_map.branches:
        strip = shapely.LineString(branch.line).buffer(float(branch.width.mean()) / 2, cap_style="flat")
        inside = cells_inside(grid, strip)
        p[inside] = np.minimum(p[inside], 1 - branch.p_open)
    return grid.with_p_occupied(p)
