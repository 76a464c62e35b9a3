"""Votes of scans on the cells of a map: hits, their heights, and the log-odds of being occupied.

A ray votes for free in the cells that it crosses so low that it would have met a device; a standing point votes for occupied.
Within one scan a hit overrules rays that pass. Updates and clamping of log-odds: Hornung et al. 2013, OctoMap.
"""

import numpy as np
import numpy.typing as npt
from numba import njit
from pydantic import Field

from wzsumo.frames import BoolArray, FloatArray, IntArray
from wzsumo.grid import UNKNOWN, OccupancyGrid
from wzsumo.lidar_mapping.posed_scan import PosedScan
from wzsumo.spec import Spec

CountArray = npt.NDArray[np.int32]
SEEN_FREE, SEEN_HIT = 1, 2


class VoteSpec(Spec):
    """How a scan votes on a cell."""

    max_range_m: float = Field(default=60.0, gt=0)  # of returns that vote; a cone gets six rays there
    hit_log_odds: float = Field(default=0.85, gt=0)  # Hornung et al. 2013, p = 0.7
    miss_log_odds: float = Field(default=-0.4, lt=0)  # ibid., p = 0.4
    log_odds_limits: tuple[float, float] = (-2.0, 3.5)  # ibid., p = 0.12 and 0.97
    carve_height_m: float = Field(default=0.4, gt=0)  # rays vote for free below it; higher ones may pass over a 28 in cone


class Votes:
    """The votes of all scans so far, over the cells of a map."""

    def __init__(self, cells: OccupancyGrid, spec: VoteSpec) -> None:
        self.cells = cells
        self.scans_added = 0
        self.count: CountArray = np.zeros(cells.shape, np.int32)  # standing points
        self.scans: CountArray = np.zeros(cells.shape, np.int32)  # scans with a standing point
        self.height: FloatArray = np.full(cells.shape, -np.inf)  # of the highest standing point above the car's ground [m]
        self.misses: CountArray = np.zeros(cells.shape, np.int32)  # scans that saw it free
        self.log_odds: FloatArray = np.full(cells.shape, np.nan)  # nan: never seen
        self._seen = np.zeros(cells.shape, np.int8)
        self._spec = spec

    def add(self, posed: PosedScan) -> None:
        """Add the votes of one posed scan."""
        spec, sensor, pose = self._spec, posed.sensor, np.ascontiguousarray(posed.pose)
        cloud = np.ascontiguousarray(posed.cloud)
        frame = np.array([*self.cells.origin, self.cells.resolution, spec.max_range_m])
        _carve(cloud, sensor, pose, frame, spec.carve_height_m, self._seen)
        _hit(cloud, posed.standing, sensor, pose, frame, self.count, self.scans, self.height, self._seen)
        updates = np.array([spec.miss_log_odds, spec.hit_log_odds, *spec.log_odds_limits])
        _vote(self._seen, self.log_odds, self.misses, updates, self._window(pose[:3, :3] @ sensor + pose[:3, 3]))
        self.scans_added += 1

    @property
    def p_occupied(self) -> FloatArray:
        """Probabilities (rows, cols), UNKNOWN where no scan voted."""
        return _probability(self.log_odds)

    def p_standing(self, *, scans: int) -> FloatArray:
        """The same for what stands: all votes of a cell count alike, and hits in fewer than `scans` scans not at all.

        Clamped log-odds forget: after many free votes three hits make a cell occupied. A vehicle that follows the car hits each
        cell of its way for some tenths of a second and hides it from later rays. Over the whole drive its cell was seen free
        many times more often than hit; a device was hit in most scans that saw it.
        """
        hits = np.where(self.scans < scans, 0, self.scans)
        total = hits * self._spec.hit_log_odds + self.misses * self._spec.miss_log_odds
        return _probability(np.where(self.scans + self.misses == 0, np.nan, np.clip(total, *self._spec.log_odds_limits)))

    def _window(self, centre: FloatArray) -> IntArray:
        """First row, last row + 1, first column, last column + 1 of the cells that a scan from `centre` can reach."""
        reach = self._spec.max_range_m + 2 * self.cells.resolution
        rows, cols = self.cells.cell_of([centre[:2] - reach, centre[:2] + reach])
        limits = [np.clip(np.add(ends, (0, 1)), 0, size) for ends, size in zip((rows, cols), self.cells.shape, strict=True)]
        return np.concatenate(limits).astype(np.int64)


def _probability(log_odds: FloatArray) -> FloatArray:
    """Probabilities of log-odds; UNKNOWN for nan."""
    return np.where(np.isnan(log_odds), UNKNOWN, 1 / (1 + np.exp(-np.nan_to_num(log_odds))))


@njit(cache=True, error_model="numpy", nogil=True)
def _carve(
    cloud: FloatArray, sensor: FloatArray, pose: FloatArray, frame: FloatArray, height: float, seen: npt.NDArray[np.int8]
) -> None:
    """Mark cells below each ray as seen free, from where the ray is lower than `height` above the car's ground to its return.

    A ray is sampled every half cell, so a corner that it cuts by less may be left out. Returns come column by column from the
    lowest layer up, so most rays pass over the end of the last ray; the cells up to there are marked already and are skipped.
    """
    rows, cols = seen.shape
    sx, sy = _in_cells(sensor, pose, frame)
    last_x, last_y, last_share = sx, sy, 1.0
    for i in range(len(cloud)):
        z = cloud[i, 2]
        if z >= height or (cloud[i, 0] - sensor[0]) ** 2 + (cloud[i, 1] - sensor[1]) ** 2 >= frame[3] ** 2:
            continue
        ex, ey = _in_cells(cloud[i], pose, frame)
        length = np.hypot(ex - sx, ey - sy)
        share = 0.0 if sensor[2] <= height else (sensor[2] - height) / (sensor[2] - z)
        begin = share
        along = ((last_x - sx) * (ex - sx) + (last_y - sy) * (ey - sy)) / max(length, 1e-9)
        aside = abs((last_x - sx) * (ey - sy) - (last_y - sy) * (ex - sx)) / max(length, 1e-9)
        if aside < 0.25 and last_share * along <= share * length < along < length:
            share = along / length
        last_x, last_y, last_share = ex, ey, begin
        steps = int((1.0 - share) * length * 2.0) + 1
        for k in range(steps):
            t = share + (1.0 - share) * k / steps
            col, row = int(np.floor(sx + t * (ex - sx))), int(np.floor(sy + t * (ey - sy)))
            if 0 <= row < rows and 0 <= col < cols:
                seen[row, col] = SEEN_FREE


@njit(cache=True, error_model="numpy", nogil=True)
def _hit(
    cloud: FloatArray, standing: BoolArray, sensor: FloatArray, pose: FloatArray, frame: FloatArray,
    count: CountArray, scans: CountArray, height: FloatArray, seen: npt.NDArray[np.int8],
) -> None:  # fmt: skip
    """Mark the cells of ground returns as seen free, then those of standing returns as hit, and count the latter."""
    rows, cols = seen.shape
    for wanted in (False, True):
        for i in range(len(cloud)):
            near = (cloud[i, 0] - sensor[0]) ** 2 + (cloud[i, 1] - sensor[1]) ** 2 < frame[3] ** 2
            if standing[i] != wanted or not near:
                continue
            x, y = _in_cells(cloud[i], pose, frame)
            col, row = int(np.floor(x)), int(np.floor(y))
            if not (0 <= row < rows and 0 <= col < cols):
                continue
            if wanted:
                scans[row, col] += seen[row, col] != SEEN_HIT
                count[row, col] += 1
                height[row, col] = max(height[row, col], cloud[i, 2])
            seen[row, col] = SEEN_HIT if wanted else SEEN_FREE


@njit(cache=True, error_model="numpy", inline="always")
def _in_cells(point: FloatArray, pose: FloatArray, frame: FloatArray) -> tuple[float, float]:
    """Column and row, not rounded, of a point in the car's frame; `frame` = x, y of the map's corner, cell edge, range [m]."""
    x = pose[0, 0] * point[0] + pose[0, 1] * point[1] + pose[0, 2] * point[2] + pose[0, 3]
    y = pose[1, 0] * point[0] + pose[1, 1] * point[1] + pose[1, 2] * point[2] + pose[1, 3]
    return (x - frame[0]) / frame[2], (y - frame[1]) / frame[2]


@njit(cache=True, error_model="numpy", nogil=True)
def _vote(seen: npt.NDArray[np.int8], odds: FloatArray, misses: CountArray, update: FloatArray, window: IntArray) -> None:
    """Add a scan's votes to log-odds and misses, clear them; `update` = log-odds of a miss and a hit, lower and upper limit."""
    for row in range(window[0], window[1]):
        for col in range(window[2], window[3]):
            if seen[row, col] == 0:
                continue
            before = 0.0 if np.isnan(odds[row, col]) else odds[row, col]
            after = before + (update[1] if seen[row, col] == SEEN_HIT else update[0])
            odds[row, col] = min(max(after, update[2]), update[3])
            misses[row, col] += seen[row, col] == SEEN_FREE
            seen[row, col] = 0
