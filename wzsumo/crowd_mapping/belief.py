"""p(occupied) of every cell from what a LaneStructure leaves uncertain: level, width and course of the lanes, ends of lanes."""

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from scipy.special import ndtr

from wzsumo.crowd_mapping.lane_model import LaneStructure
from wzsumo.frames import FloatArray
from wzsumo.grid import UNKNOWN, OccupancyGrid
from wzsumo.road import Road

SIDE_SD_M = 0.06  # of an edge, whatever the number of traces: drivers as a whole do not keep to the exact middle
SEEN_BAND_M = 1.8  # half a lane: beyond it from the driven lanes nothing was observed
CORRIDOR_M = 40.0  # beside the axis; farther cells are unknown without a closer look


def belief(model: LaneStructure, grid: OccupancyGrid) -> OccupancyGrid:
    """p(occupied) on the cells of `grid`; UNKNOWN away from where vehicles drove."""
    rows, cols = np.indices(grid.shape)
    centres = grid.centre_of(rows.ravel(), cols.ravel())
    p = np.full(len(centres), UNKNOWN)
    low, high = model.table.stations[[0, -1]]
    corridor = _near_axis(model.axis, centres)
    s, d = model.axis.to_sd(centres[corridor])
    inside = (s >= low) & (s <= high)
    p[np.flatnonzero(corridor)[inside]] = occupied(model, s[inside], d[inside])
    return grid.with_p_occupied(np.clip(p, 0, 1).reshape(grid.shape))


def occupied(model: LaneStructure, s: FloatArray, d: FloatArray) -> FloatArray:
    """p(occupied) (n,) at stations and offsets (n,) [m] of the model's axis."""
    levels = model.levels
    course = np.interp(s, model.table.stations, model.path.course)
    seen = (model.weights[:, None] * np.isfinite(model.table.offsets)).sum(axis=0)
    course_sd = model.path.noise_m / np.sqrt(np.maximum(np.interp(s, model.table.stations, seen), 1.0))
    right = course + levels.right - levels.width / 2
    left = right + levels.n_lanes * levels.width
    right_sd = np.sqrt(levels.right_sd**2 + (levels.width_sd / 2) ** 2 + course_sd**2 + SIDE_SD_M**2)
    left_sd = np.sqrt(levels.right_sd**2 + ((levels.n_lanes - 0.5) * levels.width_sd) ** 2 + course_sd**2 + SIDE_SD_M**2)
    above_right, below_left = ndtr((d - right) / right_sd), ndtr((left - d) / left_sd)
    more_left, known_left = _beyond(model, s, (d - left) / levels.outer_width, side=1, sd=left_sd / levels.outer_width)
    more_right, known_right = _beyond(model, s, (right - d) / levels.outer_width, side=-1, sd=right_sd / levels.outer_width)
    free = (above_right + (1 - above_right) * more_right) * (below_left + (1 - below_left) * more_left)
    seen_at = (d > right - SEEN_BAND_M - known_right * levels.outer_width) & (
        d < left + SEEN_BAND_M + known_left * levels.outer_width
    )
    return np.where(seen_at, 1 - free, UNKNOWN)


def _beyond(
    model: LaneStructure, s: FloatArray, across: FloatArray, *, side: int, sd: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Chance that a place `across` (n,) lane widths beyond the open lanes is open, and how many lanes are open there."""
    inner = model.levels.n_lanes - 1 if side > 0 else 0
    ending = model.closing.keys() | model.opening.keys()
    chance, count = np.zeros(len(s)), np.zeros(len(s))
    outwards = 0
    # A lane that was never driven ends the series: nothing is known of the way to those beyond it.
    while (lane := inner + side * (outwards + 1)) in ending:
        still_open, some_open = np.zeros(len(s)), np.zeros(len(s))
        for line, sign in ((model.closing.get(lane), 1.0), (model.opening.get(lane), -1.0)):
            if line is not None:
                still_open = np.maximum(still_open, line.open_beyond(sign * s, across - outwards))
                some_open = np.maximum(some_open, line.open_beyond(sign * s, np.zeros(len(s))))
        # Past the lane's outer edge it ends as sharply as the edge is known; short of its inner edge it is open anyway.
        outer_edge = ndtr((outwards + 1 - across) / sd)
        chance = np.where(across > outwards, still_open * outer_edge, np.maximum(chance, some_open))
        count = count + some_open
        outwards += 1
    return chance, count


def _near_axis(axis: Road, points: FloatArray) -> npt.NDArray[np.bool_]:
    """Points (n,) within some lanes of the axis, by a coarse look at its own points."""
    distance, _ = cKDTree(axis.reference_line).query(points, distance_upper_bound=CORRIDOR_M)
    return np.asarray(np.isfinite(distance))
