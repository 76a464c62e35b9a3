"""How a drive keeps its lane: over the lines between open lanes, off the lane's middle, lane changes made and needed."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import OpenLane, WorkZoneLayout

SHARED_LINE_M = 0.05  # two lanes whose lines are nearer than this share one line: layouts have no gap between such lanes
STATION_STEP_M = 5.0  # of the stations at which lanes are looked at for the changes needed: a tenth of the shortest taper


@dataclass(frozen=True, kw_only=True)
class LaneKeeping:
    """Figures of a drive; all but the changes are of the zone, from the first device to the end of the last taper."""

    over_line_share: float  # share of the length with part of the outline over a line between two open lanes
    mean_off_middle_m: float  # mean distance of the outline's centre from the middle of its lane, while within its lines
    sd_off_middle_m: float  # standard deviation of that signed distance: the SDLP of the driving literature
    n_lane_changes: int
    n_needed_changes: int  # fewest by which the lane of the last pose can be reached from that of the first


def measure_lane_keeping(poses: FloatArray, *, vehicle: VehicleGeometry, layout: WorkZoneLayout) -> LaneKeeping:
    """The figures of driven poses (n >= 2, 3) of the REAR AXLE.

    Lanes narrower than the vehicle do not count: along a taper the rest of a closing lane is no lane to drive in.
    """
    outlines = vehicle.outline(poses)
    s, d = (of.reshape(len(poses), 4) for of in layout.road.to_sd(outlines.reshape(-1, 2)))
    station, offset = s.mean(axis=1), d.mean(axis=1)  # of the outline's centre
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    length = (np.append(steps, 0.0) + np.append(0.0, steps)) / 2
    in_zone = (station >= layout.start) & (station <= layout.end)
    over = over_a_line(s, d, layout=layout, min_width_m=vehicle.width_m)
    lane, off_middle = _nearest_lanes(station, offset, layout, min_width_m=vehicle.width_m)
    weight = np.where(in_zone, length, 0.0)
    within = np.where(over, 0.0, weight)
    known = float(within.sum()) > 0
    mean = float(np.average(off_middle, weights=within)) if known else 0.0
    return LaneKeeping(
        over_line_share=float((weight * over).sum() / max(weight.sum(), 1e-9)),
        mean_off_middle_m=float(np.average(np.abs(off_middle), weights=within)) if known else 0.0,
        sd_off_middle_m=float(np.sqrt(np.average((off_middle - mean) ** 2, weights=within))) if known else 0.0,
        n_lane_changes=int((np.diff(lane) != 0).sum()),
        n_needed_changes=_changes_needed(layout, (int(lane[0]), int(lane[-1])), (float(station[0]), float(station[-1]))),
    )


def over_a_line(s: FloatArray, d: FloatArray, *, layout: WorkZoneLayout, min_width_m: float) -> BoolArray:
    """Whether (n,) outlines with corners at stations and offsets (n, 4) lie on both sides of a line between two open lanes."""
    over = np.zeros(len(s), dtype=bool)
    station = s.mean(axis=1)
    for one, other in combinations(layout.lanes, 2):
        for right, left in ((one, other), (other, one)):
            both = _drivable(right, station, min_width_m) & _drivable(left, station, min_width_m)
            both &= np.abs(right.left(station) - left.right(station)) < SHARED_LINE_M
            beyond = d - right.left(s)
            over |= both & (beyond.min(axis=1) < 0) & (beyond.max(axis=1) > 0)
    return over


def _drivable(lane: OpenLane, station: FloatArray, min_width_m: float) -> BoolArray:
    open_here = (station >= lane.start) & (station <= lane.end)
    return np.asarray(open_here & (lane.left(station) - lane.right(station) >= min_width_m))


def _nearest_lanes(
    station: FloatArray, offset: FloatArray, layout: WorkZoneLayout, *, min_width_m: float
) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """The lanes (n,), by their place in the layout, with the nearest middles, and the offsets (n,) [m] to the left of these.

    Between the stop lines of a lane that both directions share, the lane is the ego's: that of the other direction, on the
    same ground, is none to change to.
    """
    turns = layout.taking_turns
    shared = (station >= turns.start) & (station <= turns.end) if turns else np.zeros(len(station), dtype=bool)
    off = np.array([
        np.where(
            _drivable(lane, station, min_width_m) & ~(shared & lane.opposing),
            offset - (lane.right(station) + lane.left(station)) / 2,
            np.inf,
        )
        for lane in layout.lanes
    ])  # fmt: skip
    nearest = np.argmin(np.abs(off), axis=0)
    off_middle = off[nearest, np.arange(len(station))]
    return nearest, np.where(np.isfinite(off_middle), off_middle, 0.0)


def _changes_needed(layout: WorkZoneLayout, lanes: tuple[int, int], stations: tuple[float, float]) -> int:
    """Fewest changes between lanes that share a line, from the first of `lanes` to the second; 0 where no way leads there."""
    fewest = np.full(len(layout.lanes), np.inf)
    fewest[lanes[0]] = 0
    for station in np.arange(min(stations), max(stations) + STATION_STEP_M, STATION_STEP_M):
        is_open = np.array([lane.start <= station <= lane.end and not lane.opposing for lane in layout.lanes])
        fewest[~is_open] = np.inf
        for _ in layout.lanes:
            for a, b in combinations(np.flatnonzero(is_open), 2):
                one, other = layout.lanes[a], layout.lanes[b]
                gaps = (one.left(station) - other.right(station), other.left(station) - one.right(station))
                if min(map(abs, gaps)) < SHARED_LINE_M:
                    fewest[a], fewest[b] = min(fewest[a], fewest[b] + 1), min(fewest[b], fewest[a] + 1)
    return int(fewest[lanes[1]]) if np.isfinite(fewest[lanes[1]]) else 0
