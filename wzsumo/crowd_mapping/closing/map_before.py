"""MapBefore: the road as it was before the work zone, and where the zone is announced; the lanes are anchored to it.

Outside the announced zone drivers keep to the road's known lanes. This says which of the road's lanes the open ones are, where
they lie (better than the levels of the traces do), and that every lane is open up to the zone's first device.

The anchor is one Kalman step. State: right and width of the open lanes, with their covariance P. Observation: the middle of the
open lanes outside the zone, z = h (right, width) with h = (1, (n_lanes - 1) / 2), which lies at the middle of the road's lanes:

    R    = (pi/2 noise^2 / n_outside + drift^2 n_inside / 6) / n_traces + 0.05^2
    gain = P h / (h P h + R),    log fit = -1/2 miss^2 / (h P h + R) - 1/2 log(h P h + R) + log p(lanes that close, shifts)

noise and drift [m] are those of the traces at and between stations, n_outside and n_inside numbers of stations. pi/2 is the
loss of a median against a mean; between two known ends a random walk strays by a sixth of its variance from end to end.
"""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.crowd_mapping.course.common_path import CommonPath
from wzsumo.crowd_mapping.course.shifts import Shift
from wzsumo.crowd_mapping.course.station_table import StationTable
from wzsumo.crowd_mapping.hypotheses.announcement import AnnouncedZone
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels
from wzsumo.errors import TraceError
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.road import Road

STRIPED_WIDTH_SD_M = 0.03  # of the width of striped lanes; chosen by us
LANE_MOVE_LENGTHS_M = np.arange(20.0, 201.0, 20.0)  # of a move over by a lane: from a lane change to L/2 at 75 mph
MIN_STATIONS_OUTSIDE = 2  # the zone, without which nothing is anchored
# Of MUTCD's six drawings of stationary work on a freeway (11th ed., TA-33 to TA-39 without 35) one, TA-36, closes no lane.
P_ALL_OPEN = 0.2
# That lanes shift first towards a closed lane, not away from the work as in TA-36; chosen by us.
P_SHIFT_TOWARDS_CLOSED = 0.05
P_CLOSED_ON_BOTH_SIDES = 0.05  # of the open lanes: none of those drawings has it. Chosen by us
CENTRING_SD_M = 0.05  # of drivers as a whole about the middle of lanes beside devices; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class MapBefore:
    """The road, and the stations [m] on it of the announced zone's first and last device."""

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
    def announced(self) -> AnnouncedZone:
        """The announced zone, with the road's shoulders beside the lanes of this direction."""
        shoulders = (self.road.right_shoulder, 0.0 if self.road.opposing_lanes else self.road.left_shoulder)
        return AnnouncedZone(
            first_device=self.start,
            last_device=self.end,
            shoulders_lanes=(shoulders[0] / self.lane_width, shoulders[1] / self.lane_width),
        )


@dataclass(frozen=True, kw_only=True)
class Anchor:
    """Levels anchored to the road's lanes: the road's lane that lane 0 is, and the log of how well hypothesis and road agree.

    `first_lane` is None where no trace reaches beyond the zone, or where the open lanes do not fit on the road.
    """

    levels: LaneLevels
    first_lane: int | None
    log_fit: float


def course_in_one_lane(path: CommonPath, stations: FloatArray, before: MapBefore) -> CommonPath:
    """The path with a course that begins and ends in the same lane of the road.

    Where most traces move over by a lane for good, the course moves with them and the other traces seem to change lanes. What
    the course moves by from ahead of the zone to behind it, in whole lanes, becomes a lane change of the traces.
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
    """The ramp (stations,) from 0 to 1 that, taken `size` [m] times off the course, leaves the least lateral movement."""
    ramps = [
        np.clip((stations - start) / length, 0.0, 1.0)
        for length in LANE_MOVE_LENGTHS_M
        for start in stations[(stations > stations[0]) & (stations < stations[-1] - length)]
    ]
    left = np.abs(np.diff(course - size * np.array(ramps), axis=1)).sum(axis=1)
    return np.asarray(ramps[int(np.argmin(left))])


def anchor_levels(
    levels: LaneLevels,
    path: CommonPath,
    table: StationTable,
    before: MapBefore,
    *,
    weights: FloatArray,
    shifts: tuple[Shift, ...],
) -> Anchor:
    """The levels corrected by the stations outside the announced zone; the table's offsets are in the frame of `before.road`.

    The log fit is minus infinity where the road has no room for the open lanes and those closed beside them.
    """
    outside = _stations_outside(table, weights, before)
    if outside.sum() < MIN_STATIONS_OUTSIDE:
        return Anchor(levels=levels, first_lane=None, log_fit=0.0)
    candidates = _possible_first_lanes(levels, before.road)
    if not candidates:
        return Anchor(levels=levels, first_lane=None, log_fit=-np.inf)
    middle = (levels.n_lanes - 1) / 2
    # The median, for behind the last device drivers are still on their way back to their lanes.
    level = float(np.median(path.course[outside]))
    observed = level + levels.right + levels.width * middle
    expected = np.array([before.road.lane_centre(lane) + before.lane_width * middle for lane in candidates])
    nearest = int(np.argmin(np.abs(expected - observed)))
    first_lane, miss = candidates[nearest], expected[nearest] - observed
    own_variance, variance = levels.level_sd(middle) ** 2, _observation_variance(path, outside, n=float(weights.sum()))
    gain = levels.covariance @ np.array([1.0, middle]) / (own_variance + variance)
    covariance = levels.covariance - np.outer(gain, gain) * (own_variance + variance)
    log_likelihood = float(-0.5 * miss**2 / (own_variance + variance) - 0.5 * np.log(own_variance + variance))
    return Anchor(
        levels=replace(
            levels,
            right=float(levels.right + gain[0] * miss),
            width=float(levels.width + gain[1] * miss),
            covariance=covariance,
        ),
        first_lane=first_lane,
        log_fit=log_likelihood + _log_prior(levels, _lanes_beside(levels, first_lane, before), shifts),
    )


def _stations_outside(table: StationTable, weights: FloatArray, before: MapBefore) -> BoolArray:
    """Stations (n,) outside the announced zone at which some trace has a fix."""
    seen = (weights[:, None] * np.isfinite(table.offsets)).sum(axis=0)
    return ((table.stations < before.start) | (table.stations > before.end)) & (seen > 0)


def _possible_first_lanes(levels: LaneLevels, road: Road) -> list[int]:
    """Lanes of the road that lane 0 may be, so that the open lanes and those closed beside them are lanes of the road."""
    return [
        lane
        for lane in range(road.own_lanes - levels.n_lanes + 1)
        if all(0 <= lane + closed < road.own_lanes for closed in levels.closed)
    ]


def _observation_variance(path: CommonPath, outside: BoolArray, *, n: float) -> float:
    """Variance [m^2] of the level of n traces at the stations outside the zone, as a measurement of their level inside it."""
    inside = max(len(outside) - int(outside.sum()), 1)
    errors = path.errors
    return float((np.pi / 2 * errors.noise_m**2 / outside.sum() + errors.drift_m**2 * inside / 6) / n + CENTRING_SD_M**2)


def _log_prior(levels: LaneLevels, closing: tuple[int, ...], shifts: tuple[Shift, ...]) -> float:
    """Log of the probability that work closes such lanes while the open ones shift like this."""
    none_closed = not (closing or levels.interior)
    towards = bool(shifts) and any(lane * shifts[0].size > 0 for lane in closing)
    both_sides = bool(closing) and closing[0] < 0 < closing[-1]
    return float(
        np.log(P_ALL_OPEN) * none_closed
        + np.log(P_SHIFT_TOWARDS_CLOSED) * towards
        + np.log(P_CLOSED_ON_BOTH_SIDES) * both_sides
    )


def closing_lanes(anchor: Anchor, before: MapBefore) -> tuple[int, ...]:
    """Lanes of the road that do not go through, as counted in `LaneLevels`: on the right (negative) and on the left."""
    if anchor.first_lane is None:
        return anchor.levels.closed
    return _lanes_beside(anchor.levels, anchor.first_lane, before)


def _lanes_beside(levels: LaneLevels, first_lane: int, before: MapBefore) -> tuple[int, ...]:
    return tuple(lane - first_lane for lane in range(before.road.own_lanes) if not 0 <= lane - first_lane < levels.n_lanes)
