"""MapBefore: the road as it was before the work zone, and where the zone is announced, as a nominal map has both.

Outside the announced zone drivers keep to lanes that are known: that says which lanes the open ones are, where they lie better
than the traces' own levels do, and that every lane is open up to the zone's first device.
"""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.course.common_path import CommonPath
from wzsumo.crowd_mapping.course.shifts import Shift
from wzsumo.crowd_mapping.course.station_table import StationTable
from wzsumo.crowd_mapping.hypotheses.announcement import Announced
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray
from wzsumo.road import Road

WIDTH_SD_M = 0.03  # of the striped lanes: a painter's accuracy
RAMP_LENGTHS_M = np.arange(20.0, 201.0, 20.0)  # of a whole lane's move: from a lane change to L/2 at 75 mph
LEAST_STATIONS = 2  # outside the zone, without which nothing is anchored
# Of MUTCD's six drawings of stationary work on a freeway (11th ed., TA-33 to TA-39 without 35) one, TA-36, closes no lane.
ALL_OPEN = 0.2
TOWARDS_CLOSED = 0.05  # that lanes shift first to the side where one is closed, not away from the work as in TA-36: a guess
BOTH_SIDES = 0.05  # that lanes close on both sides of the open ones: none of those drawings has it
SHY_SD_M = 0.05  # drivers as a whole keep to the middle of lanes beside devices as exactly as before them: a guess


@dataclass(frozen=True, kw_only=True, eq=False)
class MapBefore:
    """The road, and the stations [m] on it between which the work zone is announced: from its first device to its last."""

    road: Road
    start: float
    end: float

    def __post_init__(self) -> None:
        if not self.start < self.end:
            raise TraceError(f"the announced zone must begin before it ends (given: {self.start:g} m to {self.end:g} m)")

    @property
    def lane_width(self) -> float:
        """Mean width [m] of the lanes of this direction."""
        return self.road.own_width / self.road.own_lanes

    @property
    def announced(self) -> Announced:
        """What is known of the zone's beginning and end."""
        shoulders = (self.road.right_shoulder, 0.0 if self.road.opposing_lanes else self.road.left_shoulder)
        return Announced(
            start=self.start, end=self.end, shoulders=(shoulders[0] / self.lane_width, shoulders[1] / self.lane_width)
        )


@dataclass(frozen=True, kw_only=True)
class Anchor:
    """What the lanes outside the zone say: the levels moved to them, the road's lane that lane 0 is, and how well it fits.

    `first_lane` is None where no trace reaches beyond the zone.
    """

    levels: LaneLevels
    first_lane: int | None
    log_fit: float


def with_level_ends(path: CommonPath, stations: FloatArray, before: MapBefore) -> CommonPath:
    """The path, its course beginning and ending in the same lane of the road.

    Where most traces move over by a lane for good, that is the common course and those who stay seem to change lanes. The
    road's lanes tell: what the course moves by from before the zone to after it becomes the traces' change of lanes.
    """
    ahead, behind = stations < before.start, stations > before.end
    if not (ahead.any() and behind.any()):
        return path
    width = before.lane_width
    lanes_moved = round(float(np.median(path.course[behind]) - np.median(path.course[ahead])) / width)
    if lanes_moved == 0:
        return path
    ramp = lanes_moved * _smoothing_ramp(path.course, stations, size=lanes_moved * width)
    course = path.course - width * ramp
    middle = float(course.mean())
    return replace(path, course=course - middle, lanes=path.lanes + ramp, levels=path.levels + middle)


def _smoothing_ramp(course: FloatArray, stations: FloatArray, *, size: float) -> FloatArray:
    """The ramp (stations,) from 0 to 1 that, `size` [m] times, leaves the course with the least movement to either side."""
    ramps = [
        np.clip((stations - start) / length, 0.0, 1.0)
        for length in RAMP_LENGTHS_M
        for start in stations[(stations > stations[0]) & (stations < stations[-1] - length)]
    ]
    left = np.abs(np.diff(course - size * np.array(ramps), axis=1)).sum(axis=1)
    return np.asarray(ramps[int(np.argmin(left))])


def anchored(
    levels: LaneLevels,
    path: CommonPath,
    table: StationTable,
    before: MapBefore,
    *,
    weights: FloatArray,
    shifts: tuple[Shift, ...],
) -> Anchor:
    """The levels corrected by the stations outside the announced zone, whose offsets are in the frame of `before.road`."""
    outside = (table.stations < before.start) | (table.stations > before.end)
    seen = (weights[:, None] * np.isfinite(table.offsets)).sum(axis=0)
    outside &= seen > 0
    if outside.sum() < LEAST_STATIONS:
        return Anchor(levels=levels, first_lane=None, log_fit=0.0)
    n = float(weights.sum())
    # Between two ends that are known a random walk strays by a sixth of what it would from one to the other.
    inside = max(len(outside) - int(outside.sum()), 1)
    variance = (np.pi / 2 * path.errors.noise_m**2 / outside.sum() + path.errors.drift_m**2 * inside / 6) / n + SHY_SD_M**2
    # The median, for behind the last device drivers are still on their way back to their lanes.
    level = float(np.median(path.course[outside]))
    middle = (levels.n_lanes - 1) / 2
    here = level + levels.right + levels.width * middle
    candidates = [
        lane
        for lane in range(before.road.own_lanes - levels.n_lanes + 1)
        if all(0 <= lane + closed < before.road.own_lanes for closed in levels.closed)
    ]
    if not candidates:
        return Anchor(levels=levels, first_lane=None, log_fit=-np.inf)
    centres = np.array([before.road.lane_centre(lane) + before.lane_width * middle for lane in candidates])
    own = levels.level_sd(middle) ** 2
    best = int(np.argmin(np.abs(centres - here)))
    miss = centres[best] - here
    closing = _lanes_beside(levels, candidates[best], before)
    # A Kalman step: what is observed is the level of the middle of the open lanes.
    gain = levels.covariance @ np.array([1.0, middle]) / (own + variance)
    covariance = levels.covariance - np.outer(gain, gain) * (own + variance)
    return Anchor(
        levels=replace(
            levels,
            right=float(levels.right + gain[0] * miss),
            width=float(levels.width + gain[1] * miss),
            covariance=covariance,
        ),
        first_lane=candidates[best],
        log_fit=float(-0.5 * miss**2 / (own + variance) - 0.5 * np.log(own + variance)) + _log_chance(levels, closing, shifts),
    )


def _log_chance(levels: LaneLevels, closing: tuple[int, ...], shifts: tuple[Shift, ...]) -> float:
    """Log of the chance beforehand that work closes such lanes, with the shifts that there are."""
    none_closed = not (closing or levels.interior)
    towards = bool(shifts) and any(lane * shifts[0].size > 0 for lane in closing)
    both_sides = bool(closing) and closing[0] < 0 < closing[-1]
    return float(np.log(ALL_OPEN) * none_closed + np.log(TOWARDS_CLOSED) * towards + np.log(BOTH_SIDES) * both_sides)


def lanes_that_close(levels: LaneLevels, anchor: Anchor, before: MapBefore) -> tuple[int, ...]:
    """Lanes of the road, as counted in `levels`, that do not go through: on the right (negative) and on the left."""
    return levels.closed if anchor.first_lane is None else _lanes_beside(levels, anchor.first_lane, before)


def _lanes_beside(levels: LaneLevels, first_lane: int, before: MapBefore) -> tuple[int, ...]:
    return tuple(lane - first_lane for lane in range(before.road.own_lanes) if not 0 <= lane - first_lane < levels.n_lanes)
