"""LaneMap: the lanes along a road as traces and announcements show them, with their uncertainty.

A raster (`OccupancyGrid`), the guides of the planner and every export come from this one noun. Stations and offsets are in the
frame of `axis`: metres along its reference line, and metres to the left of its right edge line. `LaneMap.to_xy` turns them into
world points, so that a reader of the map need not know more about the axis.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wzsumo.errors import MapError
from wzsumo.frames import FloatArray
from wzsumo.grid import FREE_THRESHOLD, OCCUPIED_THRESHOLD
from wzsumo.road import Road

Interval = tuple[float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class MappedLane:
    """One lane at the stations (n,) of its map.

    `right` and `left` (n,) [m] are the offsets of its two lines, `right_sd` and `left_sd` (n,) [m] their standard deviations.
    `p_open` (n, m) is the probability that the lane is open in each of m strips of equal width, from its right line to its left
    one: along a taper the strips close one after the other. 0.5 says that nothing is known. `n_traces` is the number of traces
    that drove in the lane somewhere.
    """

    right: FloatArray
    left: FloatArray
    right_sd: FloatArray
    left_sd: FloatArray
    p_open: FloatArray
    n_traces: int

    @property
    def middle(self) -> FloatArray:
        """Offsets (n,) [m] of the middle between the lines."""
        return (self.right + self.left) / 2

    @property
    def p_open_middle(self) -> FloatArray:
        """Probability (n,) that the lane is open at its middle."""
        m = self.p_open.shape[1]
        return np.asarray((self.p_open[:, (m - 1) // 2] + self.p_open[:, m // 2]) / 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class MappedBranch:
    """Ground that traces drove and that is no lane of the road, such as a ramp: a strip along a line.

    `line` (n, 2) [m] is the middle of the strip in the world, `width` (n,) [m] its width, `p_open` the probability that it may
    be driven, `n_traces` the number of traces that drove it.
    """

    line: FloatArray
    width: FloatArray
    p_open: float
    n_traces: int


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneMap:
    """Lanes along a road, from the rightmost to the leftmost, at ascending stations (n,) [m] of `axis`.

    `n_traces` is the number of traces that it was made of, `first_time_s` and `last_time_s` are the times of their first and
    last fix, on the clock of the traces. `warnings` say what the map's reader must know of its weaknesses, one sentence each.
    """

    axis: Road
    stations: FloatArray
    lanes: tuple[MappedLane, ...]
    branches: tuple[MappedBranch, ...] = ()
    n_traces: int
    first_time_s: float
    last_time_s: float
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.stations)
        if n < 2 or not (np.diff(self.stations) > 0).all():
            raise MapError(f"a lane map needs two ascending stations or more (given: {n})")
        for number, lane in enumerate(self.lanes):
            shapes = {array.shape for array in (lane.right, lane.left, lane.right_sd, lane.left_sd)}
            if shapes != {(n,)} or len(lane.p_open) != n:
                given = f"{sorted(shapes)}, {lane.p_open.shape}"
                raise MapError(f"lane {number} must have a value at each of {n} stations (given: {given})")
            if not ((lane.p_open >= 0) & (lane.p_open <= 1)).all():
                raise MapError(f"lane {number}: p_open must lie between 0 and 1")

    def to_xy(self, stations: npt.ArrayLike, offsets: npt.ArrayLike) -> FloatArray:
        """World points (..., 2) [m] at stations and offsets [m], broadcast together."""
        return self.axis.to_xy(stations, offsets)

    def open_intervals(self, lane: int) -> tuple[Interval, ...]:
        """Intervals (from, to) of stations [m] in which the middle of a lane is free: P(open) above 0.804."""
        return self._intervals(self.lanes[lane].p_open_middle > 1 - FREE_THRESHOLD)

    def closed_intervals(self, lane: int) -> tuple[Interval, ...]:
        """Intervals (from, to) of stations [m] in which the middle of a lane is closed: P(open) below 0.35."""
        return self._intervals(self.lanes[lane].p_open_middle < 1 - OCCUPIED_THRESHOLD)

    def _intervals(self, chosen: npt.NDArray[np.bool_]) -> tuple[Interval, ...]:
        """The intervals over which `chosen` (n,) holds; they end half-way to the next station that is not chosen."""
        borders = np.concatenate([self.stations[:1], (self.stations[1:] + self.stations[:-1]) / 2, self.stations[-1:]])
        ends = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(int)))
        return tuple((float(borders[start]), float(borders[end])) for start, end in zip(ends[::2], ends[1::2], strict=True))
