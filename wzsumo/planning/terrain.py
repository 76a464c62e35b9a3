"""The map as the kernels use it: how far obstacles are, and what a metre of path costs in each cell.

A metre costs 1 + clearance_cost * lacking^2 + occupancy_cost * p + guide_cost * off. `lacking` is the missing share of the
preferred clearance, `p` the p(occupied) of the cell and `off` how far the cell is off the guide, from 0 to 1.
Kernels work in metres from the map's lower-left corner.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.distance_field import FieldArray, distance_field
from wzsumo.planning.footprint import Body, inscribed_radius
from wzsumo.planning.planner_spec import PlannerSpec


class Terrain(NamedTuple):
    """Fields of one map for one body."""

    distance: FieldArray  # (rows, cols) m from a cell's centre to the nearest blocked square less the inflation; 0: blocked
    multiplier: FieldArray  # (rows + 2, cols + 2) cost of a metre, >= 1; infinite where no axle can be and around the map
    p_occupied: FieldArray  # (rows, cols)
    resolution: float  # m


def terrain_of(
    grid: OccupancyGrid, *, body: Body, spec: PlannerSpec, reach_m: float, guide: FloatArray | None = None
) -> Terrain:
    """The terrain of a map and of a guide (n, 2, 2), lines that vehicles drive along; distances are at most `reach_m` [m]."""
    # Kernels are compiled for one kind of array alone, a contiguous and writable one.
    p_occupied = np.require(grid.p_occupied, dtype=np.float32, requirements=["C", "W"])
    resolution = float(grid.resolution)
    distance = distance_field(
        p_occupied,
        max_p_occupied=spec.max_p_occupied,
        resolution=resolution,
        limit_m=reach_m + spec.inflation_radius_m,
    )
    if spec.inflation_radius_m > 0:
        distance = np.maximum(distance - np.float32(spec.inflation_radius_m), np.float32(0))
    multiplier = np.empty((distance.shape[0] + 2, distance.shape[1] + 2), dtype=np.float32)
    _fill_multiplier(
        multiplier,
        distance,
        p_occupied,
        np.float32(inscribed_radius(body)),
        np.float32(resolution * np.sqrt(0.5)),
        np.float32(1 / spec.preferred_clearance_m),
        np.float32(spec.clearance_cost),
        np.float32(spec.occupancy_cost),
    )
    if guide is not None and len(guide):
        _add_guide(
            multiplier,
            offsets_from_guide(guide, grid=grid, slack_m=spec.guide_slack_m, reach_m=spec.guide_reach_m),
            np.float32(spec.guide_cost),
        )
    return Terrain(distance=distance, multiplier=multiplier, p_occupied=p_occupied, resolution=resolution)


# No value is nan: without that case the compiler turns the loop over a row into vector code.
@njit(cache=True, error_model="numpy", fastmath={"nnan", "nsz"})
def _fill_multiplier(
    multiplier: FieldArray,
    distance: FieldArray,
    p_occupied: FieldArray,
    inscribed: np.float32,
    half_diagonal: np.float32,
    per_clearance: np.float32,
    clearance_cost: np.float32,
    occupancy_cost: np.float32,
) -> None:
    """Cost of a metre in each cell, inside a border of one cell."""
    rows, cols = distance.shape
    zero, one, infinite = np.float32(0.0), np.float32(1.0), np.float32(np.inf)
    for col in range(cols + 2):
        multiplier[0, col] = multiplier[rows + 1, col] = infinite
    for row in range(rows):
        multiplier[row + 1, 0] = multiplier[row + 1, cols + 1] = infinite
        for col in range(cols):
            apart = distance[row, col]
            lacking = min(max(one - (apart - inscribed) * per_clearance, zero), one)
            cost = one + clearance_cost * lacking * lacking + occupancy_cost * p_occupied[row, col]
            # A point of the cell may be half a diagonal farther from the obstacle than its centre.
            fits = (apart > zero) & (apart + half_diagonal >= inscribed)
            multiplier[row + 1, col + 1] = cost if fits else infinite


@njit(cache=True, error_model="numpy")
def _add_guide(multiplier: FieldArray, off: FieldArray, guide_cost: np.float32) -> None:
    """Make each metre dearer by how far it is off the guide; `off` has no border."""
    rows, cols = off.shape
    for row in range(rows):
        for col in range(cols):
            multiplier[row + 1, col + 1] += guide_cost * off[row, col]


def offsets_from_guide(lines: FloatArray, *, grid: OccupancyGrid, slack_m: float, reach_m: float) -> FieldArray:
    """How far each cell (rows, cols) is off the nearest of `lines` (n, 2, 2), given by their ends x, y [m, world].

    It is 0 up to `slack_m` from a line, 1 from `reach_m` on, and in between the square of the share of the distance. With a
    reach of half a lane it is greatest on the line between two lanes.
    """
    rows, cols = grid.shape
    # The distance field takes everything outside its cells for marked: a rim as wide as the reach keeps that away.
    rim = math.ceil(reach_m / grid.resolution) + 1
    marked = np.zeros((rows + 2 * rim, cols + 2 * rim), dtype=np.float32)
    row, col = grid.cell_of(_points_along(lines, step_m=grid.resolution))
    near = (row >= -rim) & (row < rows + rim) & (col >= -rim) & (col < cols + rim)
    marked[row[near] + rim, col[near] + rim] = 1
    distance = distance_field(marked, max_p_occupied=0.5, resolution=float(grid.resolution), limit_m=reach_m)
    off = np.maximum(distance[rim:-rim, rim:-rim] - np.float32(slack_m), 0) / np.float32(max(reach_m - slack_m, 1e-6))
    return np.asarray(off * off)


def _points_along(lines: FloatArray, *, step_m: float) -> FloatArray:
    """Points (m, 2) on the lines, at most `step_m` apart, with both ends of each."""
    lengths = np.hypot(*(lines[:, 1] - lines[:, 0]).T)
    counts = np.ceil(lengths / step_m).astype(int) + 1
    which = np.repeat(np.arange(len(lines)), counts)
    place = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = place / np.maximum(counts[which] - 1, 1)
    return np.asarray(lines[which, 0] + share[:, None] * (lines[which, 1] - lines[which, 0]))
