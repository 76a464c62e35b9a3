"""Guide: lines along which vehicles drive, such as lane centres. A path may leave them, at a price.

On a map of free space alone the middle between two lanes is the safest place; among other drivers it is the worst.
"""

import math

import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.distance_field import FieldArray, distance_field


def off_guide(lines: FloatArray, *, grid: OccupancyGrid, slack_m: float, reach_m: float) -> FieldArray:
    """How far each cell (rows, cols) is off the nearest of `lines` (n, 2, 2), ends x, y [m, world].

    0 up to `slack_m` from a line, 1 from `reach_m` on, in between the square of the share: with a reach of half a lane it is
    largest on the line between two lanes.
    """
    rows, cols = grid.shape
    # The distance field takes what lies outside its cells for marked: a rim as wide as the reach keeps that away.
    rim = math.ceil(reach_m / grid.resolution) + 1
    marked = np.zeros((rows + 2 * rim, cols + 2 * rim), dtype=np.float32)
    row, col = grid.cell_of(_points_along(lines, step_m=grid.resolution))
    near = (row >= -rim) & (row < rows + rim) & (col >= -rim) & (col < cols + rim)
    marked[row[near] + rim, col[near] + rim] = 1
    distance = distance_field(marked, max_p_occupied=0.5, resolution=float(grid.resolution), limit_m=reach_m)
    off = np.maximum(distance[rim:-rim, rim:-rim] - np.float32(slack_m), 0) / np.float32(max(reach_m - slack_m, 1e-6))
    return np.asarray(off * off)


def _points_along(lines: FloatArray, *, step_m: float) -> FloatArray:
    """Points (m, 2) on the lines, at most `step_m` apart, both ends among them."""
    lengths = np.hypot(*(lines[:, 1] - lines[:, 0]).T)
    counts = np.ceil(lengths / step_m).astype(int) + 1
    which = np.repeat(np.arange(len(lines)), counts)
    place = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = place / np.maximum(counts[which] - 1, 1)
    return np.asarray(lines[which, 0] + share[:, None] * (lines[which, 1] - lines[which, 0]))
