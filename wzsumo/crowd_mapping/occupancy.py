"""p(occupied) from a LaneStructure: what its uncertain level, width, course and ends of lanes say of each place.

A place at offset d beside the lanes that go through, with edges r (right) and l (left), is free with the probability

    p(free) = [Phi_r + (1 - Phi_r) o_r] [Phi_l + (1 - Phi_l) o_l] u,   Phi_r = Phi((d - r) / sd_r),  Phi_l = Phi((l - d) / sd_l)

sd_r and sd_l [m] combine the standard deviations of the edge's level, of the course (that of one trace over the root of their
number) and 0.06 m. o_r and o_l are the probabilities that a lane beside is open there: a lane that ends is open ahead of its
taper's line (`lane_ends`), and a lane that none of n traces in k lanes drove in may yet be open, with odds 0.5 (k / (k + 1))^n.
u is the probability that the lane of the place is open (`lane_use`). All hypotheses are summed with their probabilities; places
of which less than half of the probability says anything are unknown.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree
from scipy.special import ndtr

from wzsumo.crowd_mapping.closing.lane_ends import LaneEnds
from wzsumo.crowd_mapping.lane_model import LaneStructure
from wzsumo.frames import BoolArray, FloatArray, IntArray
from wzsumo.grid import UNKNOWN, OccupancyGrid
from wzsumo.road import Road

EDGE_SD_M = 0.06  # of an edge, however many traces there are: drivers as a whole are off the lanes' middles. Chosen by us
OBSERVED_MARGIN_M = 1.2  # half a vehicle and its sway: farther from the driven lanes nothing was observed. Chosen by us
FURTHER_LANE_PRIOR_ODDS = 0.5  # that another lane is open on either side; chosen by us
CORRIDOR_M = 40.0  # beside the axis; cells farther away are unknown
# Of the table from which cells are interpolated: edges are 0.1 m wide, tapers lean by 0.1 m in 4 m at most.
TABLE_STEP_ALONG_M, TABLE_STEP_ACROSS_M = 4.0, 0.05
TILE_M = 16.0  # side of the squares of cells that are filled together


def occupancy_grid(
    model: LaneStructure, grid: OccupancyGrid, *, progress: Callable[[int, int], None] | None = None
) -> OccupancyGrid:
    """p(occupied) on the cells of `grid`; UNKNOWN away from where vehicles drove. `progress` is told (done, all)."""
    p = np.full(grid.shape, UNKNOWN, dtype=np.float32)
    table = _tabulate_occupancy(model)
    tiles = _tiles_near(model.axis, grid)
    for done, (rows, cols) in enumerate(tiles):
        s, d = model.axis.to_sd(grid.centre_of(rows[:, None], cols[None, :]))
        p[np.ix_(rows, cols)] = table.at(s, d).reshape(len(rows), len(cols))
        if progress:
            progress(done + 1, len(tiles))
    return grid.with_p_occupied(p)


def p_occupied(model: LaneStructure, s: FloatArray, d: FloatArray) -> FloatArray:
    """p(occupied) (n,) at stations and offsets (n,) [m] of the model's axis; UNKNOWN away from where vehicles drove."""
    p, known = _over_hypotheses(model, s, d)
    return np.where(known, p, UNKNOWN)


@dataclass(frozen=True, kw_only=True, eq=False)
class _OccupancyTable:
    """p(occupied), and where it is known, on a table along the course: cells are many, and it changes slowly along the road.

    Rows (n,) are at `stations` [m], columns (m,) at distances `beside` [m] from the offsets `course` (n,) [m] of the course.
    """

    stations: FloatArray
    course: FloatArray
    beside: FloatArray
    p: FloatArray
    known: BoolArray

    def at(self, s: FloatArray, d: FloatArray) -> FloatArray:
        """p(occupied) (n,), UNKNOWN beyond the table and where nothing was observed."""
        row = (s - self.stations[0]) / TABLE_STEP_ALONG_M
        place = [row, (d - np.interp(s, self.stations, self.course) - self.beside[0]) / TABLE_STEP_ACROSS_M]
        known = map_coordinates(self.known.astype(np.uint8), place, order=0, mode="constant")
        inside = (s >= self.stations[0]) & (s <= self.stations[-1]) & (known > 0)
        return np.where(inside, map_coordinates(self.p, place, order=1, mode="nearest"), UNKNOWN)


def _tabulate_occupancy(model: LaneStructure) -> _OccupancyTable:
    low, high = model.table.stations[[0, -1]]
    stations = np.arange(low, high + TABLE_STEP_ALONG_M / 2, TABLE_STEP_ALONG_M)
    course = np.interp(stations, model.table.stations, model.path.course)
    lanes = [(one.levels, one.ends) for one in (model, *model.alternatives)]
    right = min(levels.right - (1 + _ending_lanes(ends, -1)) * levels.outer_width for levels, ends in lanes)
    left = max(levels.right + (levels.n_lanes + _ending_lanes(ends, 1)) * levels.outer_width for levels, ends in lanes)
    beside = np.arange(right - OBSERVED_MARGIN_M, left + OBSERVED_MARGIN_M, TABLE_STEP_ACROSS_M)
    s, e = np.meshgrid(stations, beside, indexing="ij")
    p, known = _over_hypotheses(model, s.ravel(), (course[:, None] + e).ravel())
    return _OccupancyTable(
        stations=stations, course=course, beside=beside, p=np.clip(p, 0, 1).reshape(s.shape), known=known.reshape(s.shape)
    )


def _ending_lanes(ends: LaneEnds, side: int) -> int:
    """Number of lanes that end on a side of the open ones: 1 the left, -1 the right."""
    return sum(lane * side > 0 for lane in ends.closing.keys() | ends.opening.keys())


def _over_hypotheses(model: LaneStructure, s: FloatArray, d: FloatArray) -> tuple[FloatArray, BoolArray]:
    """(p(occupied), where it is known) (n,), the hypotheses summed with their probabilities."""
    total, known = np.zeros(len(s)), np.zeros(len(s))
    for one in (model, *model.alternatives):
        p, observed = _of_hypothesis(one, s, d)
        total += np.where(observed, one.chance * p, 0.0)
        known += np.where(observed, one.chance, 0.0)
    # Unknown places keep a value, for the table is interpolated: it leads smoothly from one place to the next.
    return np.where(known > 0, total / np.maximum(known, 1e-9), 1.0), known > 0.5


def _of_hypothesis(model: LaneStructure, s: FloatArray, d: FloatArray) -> tuple[FloatArray, BoolArray]:
    """(p(occupied), where anything was observed) (n,) if the lanes are those of one model."""
    levels = model.levels
    course = np.interp(s, model.table.stations, model.path.course)
    seen = (model.weights[:, None] * np.isfinite(model.table.offsets)).sum(axis=0)
    course_sd = _scatter_about_course(model, s) / np.sqrt(np.maximum(np.interp(s, model.table.stations, seen), 1.0))
    right = course + levels.right - levels.width / 2
    left = right + levels.n_lanes * levels.width
    right_sd, left_sd = (
        np.sqrt(levels.level_sd(edge) ** 2 + course_sd**2 + EDGE_SD_M**2) for edge in (-0.5, levels.n_lanes - 0.5)
    )
    above_right, below_left = ndtr((d - right) / right_sd), ndtr((left - d) / left_sd)
    outer = levels.outer_width
    open_left, lanes_left = _open_beside(model, s, (d - left) / outer, side=1, sd=left_sd / outer)
    open_right, lanes_right = _open_beside(model, s, (right - d) / outer, side=-1, sd=right_sd / outer)
    # n traces miss one of k + 1 lanes, all used alike, with probability (k / (k + 1))^n.
    missed = (levels.n_lanes / (levels.n_lanes + 1)) ** model.weights.sum()
    missed *= FURTHER_LANE_PRIOR_ODDS / (1 + FURTHER_LANE_PRIOR_ODDS * missed)
    open_left, open_right = np.maximum(open_left, missed), np.maximum(open_right, missed)
    free = (above_right + (1 - above_right) * open_right) * (below_left + (1 - below_left) * open_left)
    inside = (d > right) & (d < left)
    free[inside] *= model.use.open_at(s[inside], (d[inside] - right[inside]) / levels.width)
    observed = (d > right - OBSERVED_MARGIN_M - lanes_right * outer) & (d < left + OBSERVED_MARGIN_M + lanes_left * outer)
    return 1 - free, observed


def _scatter_about_course(model: LaneStructure, s: FloatArray) -> FloatArray:
    """Standard deviation [m] (n,) of one trace about the course: its noise, and on a bend its bias, which turns."""
    path = model.path
    along = 0.0 if path.bias_effect is None else np.interp(s, model.table.stations, path.bias_effect[:, 0])
    return np.asarray(np.hypot(path.errors.noise_m, path.errors.bias_m * along) + 0.0 * s)


def _open_beside(
    model: LaneStructure, s: FloatArray, across: FloatArray, *, side: int, sd: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Probability (n,) that a place `across` (n,) lane widths beyond the open lanes is open, and how many lanes are open there.

    `sd` (n,) [lane widths] is that of the open lanes' edge on this side.
    """
    inner = model.levels.n_lanes - 1 if side > 0 else 0
    ending = model.ends.closing.keys() | model.ends.opening.keys()
    chance, count = np.zeros(len(s)), np.zeros(len(s))
    outwards = 0
    # A lane of which nothing is known ends the series: the lanes beyond it cannot be reached.
    while (lane := inner + side * (outwards + 1)) in ending:
        still_open, some_open = np.zeros(len(s)), np.zeros(len(s))
        for line, sign in ((model.ends.closing.get(lane), 1.0), (model.ends.opening.get(lane), -1.0)):
            if line is not None:
                still_open = np.maximum(still_open, line.open_beyond(sign * s, across - outwards))
                some_open = np.maximum(some_open, line.open_beyond(sign * s, np.zeros(len(s))))
        # The lane's outer edge is as sharp as the open lanes' edge is known; inwards of its inner edge it does not count.
        outer_edge = ndtr((outwards + 1 - across) / sd)
        chance = np.where(across > outwards, still_open * outer_edge, np.maximum(chance, some_open))
        count = count + some_open
        outwards += 1
    return chance, count


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
