"""p(occupied) of every cell from what a LaneStructure leaves uncertain: level, width and course of the lanes, ends of lanes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree
from scipy.special import ndtr

from wzsumo.crowd_mapping.closing.lane_ends import LaneEnds
from wzsumo.crowd_mapping.lane_model import LaneStructure
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import UNKNOWN, OccupancyGrid
from wzsumo.road import Road

SIDE_SD_M = 0.06  # of an edge, whatever the number of traces: drivers as a whole do not keep to the exact middle
SEEN_BAND_M = 1.2  # half a vehicle and its sway: beyond it from the driven lanes nothing was observed
MORE_LANES_ODDS = 0.5  # prior odds of a further open lane on either side
CORRIDOR_M = 40.0  # beside the axis; farther cells are unknown without a closer look
STRIP_STEP_M = (4.0, 0.05)  # of the table along and across: edges are 0.1 m wide, tapers lean by 0.1 m in 4 m at most
TILE_M = 16.0  # side of the squares of cells that are looked at together


def belief(model: LaneStructure, grid: OccupancyGrid, *, progress: Callable[[int, int], None] | None = None) -> OccupancyGrid:
    """p(occupied) on the cells of `grid`; UNKNOWN away from where vehicles drove. `progress` is told (done, all)."""
    p = np.full(grid.shape, UNKNOWN, dtype=np.float32)
    strip = _strip(model)
    tiles = _tiles_near(model.axis, grid)
    for done, (rows, cols) in enumerate(tiles):
        s, d = model.axis.to_sd(grid.centre_of(rows[:, None], cols[None, :]))
        p[np.ix_(rows, cols)] = strip.at(s, d).reshape(len(rows), len(cols))
        if progress:
            progress(done + 1, len(tiles))
    return grid.with_p_occupied(p)


def occupied(model: LaneStructure, s: FloatArray, d: FloatArray) -> FloatArray:
    """p(occupied) (n,) at stations and offsets (n,) [m] of the model's axis, over all lanes that its traces leave possible."""
    p, known = _occupied(model, s, d)
    return np.where(known, p, UNKNOWN)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Strip:
    """p(occupied) and where it is known, on a table along the course: it changes slowly there, and cells are many."""

    stations: FloatArray
    course: FloatArray  # (stations,) offsets of the table's middle
    beside: FloatArray  # (m,) from the course
    p: FloatArray  # (stations, m)
    known: BoolArray

    def at(self, s: FloatArray, d: FloatArray) -> FloatArray:
        """p(occupied) (n,), UNKNOWN beyond the table and where nothing was seen."""
        row = (s - self.stations[0]) / STRIP_STEP_M[0]
        place = [row, (d - np.interp(s, self.stations, self.course) - self.beside[0]) / STRIP_STEP_M[1]]
        known = map_coordinates(self.known.astype(np.uint8), place, order=0, mode="constant")
        inside = (s >= self.stations[0]) & (s <= self.stations[-1]) & (known > 0)
        return np.where(inside, map_coordinates(self.p, place, order=1, mode="nearest"), UNKNOWN)


def _strip(model: LaneStructure) -> _Strip:
    low, high = model.table.stations[[0, -1]]
    stations = np.arange(low, high + STRIP_STEP_M[0] / 2, STRIP_STEP_M[0])
    course = np.interp(stations, model.table.stations, model.path.course)
    edges = [(one.levels, one.ends) for one in (model, *model.alternatives)]
    right = min(levels.right - (1 + _most(ends, -1)) * levels.outer_width for levels, ends in edges)
    left = max(levels.right + (levels.n_lanes + _most(ends, 1)) * levels.outer_width for levels, ends in edges)
    beside = np.arange(right - SEEN_BAND_M, left + SEEN_BAND_M, STRIP_STEP_M[1])
    s, e = np.meshgrid(stations, beside, indexing="ij")
    p, known = _occupied(model, s.ravel(), (course[:, None] + e).ravel())
    return _Strip(
        stations=stations, course=course, beside=beside, p=np.clip(p, 0, 1).reshape(s.shape), known=known.reshape(s.shape)
    )


def _most(ends: LaneEnds, side: int) -> int:
    return sum(lane * side > 0 for lane in ends.closing.keys() | ends.opening.keys())


def _occupied(model: LaneStructure, s: FloatArray, d: FloatArray) -> tuple[FloatArray, BoolArray]:
    total, known = np.zeros(len(s)), np.zeros(len(s))
    for one in (model, *model.alternatives):
        p, seen = _occupied_by(one, s, d)
        total += np.where(seen, one.chance * p, 0.0)
        known += np.where(seen, one.chance, 0.0)
    # What less than half of the belief says anything about is unknown; its neighbours' values lead smoothly up to it.
    return np.where(known > 0, total / np.maximum(known, 1e-9), 1.0), known > 0.5


def _occupied_by(model: LaneStructure, s: FloatArray, d: FloatArray) -> tuple[FloatArray, BoolArray]:
    """(p(occupied), where anything was seen) if the open lanes are those of one model."""
    levels = model.levels
    course = np.interp(s, model.table.stations, model.path.course)
    seen = (model.weights[:, None] * np.isfinite(model.table.offsets)).sum(axis=0)
    course_sd = _course_scatter(model, s) / np.sqrt(np.maximum(np.interp(s, model.table.stations, seen), 1.0))
    right = course + levels.right - levels.width / 2
    left = right + levels.n_lanes * levels.width
    right_sd, left_sd = (
        np.sqrt(levels.level_sd(edge) ** 2 + course_sd**2 + SIDE_SD_M**2) for edge in (-0.5, levels.n_lanes - 0.5)
    )
    above_right, below_left = ndtr((d - right) / right_sd), ndtr((left - d) / left_sd)
    more_left, known_left = _beyond(model, s, (d - left) / levels.outer_width, side=1, sd=left_sd / levels.outer_width)
    more_right, known_right = _beyond(model, s, (right - d) / levels.outer_width, side=-1, sd=right_sd / levels.outer_width)
    # Another lane may be open that none of the n traces happened to drive in: they did so with chance (k / (k + 1))^n.
    missed = (levels.n_lanes / (levels.n_lanes + 1)) ** model.weights.sum()
    missed *= MORE_LANES_ODDS / (1 + MORE_LANES_ODDS * missed)
    more_left, more_right = np.maximum(more_left, missed), np.maximum(more_right, missed)
    free = (above_right + (1 - above_right) * more_right) * (below_left + (1 - below_left) * more_left)
    inside = (d > right) & (d < left)
    free[inside] *= model.use.open_at(s[inside], (d[inside] - right[inside]) / levels.width)
    seen_at = (d > right - SEEN_BAND_M - known_right * levels.outer_width) & (
        d < left + SEEN_BAND_M + known_left * levels.outer_width
    )
    return 1 - free, seen_at


def _course_scatter(model: LaneStructure, s: FloatArray) -> FloatArray:
    """Standard deviation [m] (n,) of one trace about the course: its noise, and on a bend its constant error as that turns."""
    path = model.path
    along = 0.0 if path.bias_effect is None else np.interp(s, model.table.stations, path.bias_effect[:, 0])
    return np.asarray(np.hypot(path.errors.noise_m, path.errors.bias_m * along) + 0.0 * s)


def _beyond(
    model: LaneStructure, s: FloatArray, across: FloatArray, *, side: int, sd: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Chance that a place `across` (n,) lane widths beyond the open lanes is open, and how many lanes are open there."""
    inner = model.levels.n_lanes - 1 if side > 0 else 0
    ending = model.ends.closing.keys() | model.ends.opening.keys()
    chance, count = np.zeros(len(s)), np.zeros(len(s))
    outwards = 0
    # A lane that was never driven ends the series: nothing is known of the way to those beyond it.
    while (lane := inner + side * (outwards + 1)) in ending:
        still_open, some_open = np.zeros(len(s)), np.zeros(len(s))
        for line, sign in ((model.ends.closing.get(lane), 1.0), (model.ends.opening.get(lane), -1.0)):
            if line is not None:
                still_open = np.maximum(still_open, line.open_beyond(sign * s, across - outwards))
                some_open = np.maximum(some_open, line.open_beyond(sign * s, np.zeros(len(s))))
        # Past the lane's outer edge it ends as sharply as the edge is known; short of its inner edge it is open anyway.
        outer_edge = ndtr((outwards + 1 - across) / sd)
        chance = np.where(across > outwards, still_open * outer_edge, np.maximum(chance, some_open))
        count = count + some_open
        outwards += 1
    return chance, count


def _tiles_near(axis: Road, grid: OccupancyGrid) -> list[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]]:
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
