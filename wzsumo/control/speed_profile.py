"""How fast the path may be driven: by its curvature, by limits from outside, and by what lies ahead of each place."""

from bisect import bisect_right
from dataclasses import dataclass
from math import inf, sqrt
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from wzsumo.control.path_frame import distinct_poses
from wzsumo.control.regulated_pursuit import RegulatedSpec
from wzsumo.errors import InputError
from wzsumo.frames import FloatArray, arc_length
from wzsumo.path import ReferencePath

_CURVATURE_WINDOW_M = 3.0  # curvature is the mean over this length: the car does not feel what a single pose jitters


class Pace(NamedTuple):
    """A speed [m/s] to keep and its rate of change [m/s2]."""

    speed: float
    acceleration: float


@dataclass(frozen=True, kw_only=True)
class SpeedProfile:
    """Squares (n,) [m2/s2] of the highest speed at stations (n,) [m]: linear in between, which is constant deceleration."""

    stations: tuple[float, ...]
    squares: tuple[float, ...]

    @classmethod
    def of(cls, path: ReferencePath, *, spec: RegulatedSpec, speed_limits: npt.ArrayLike | None) -> Self:
        """Profile of a path and of limits (n,) [m/s], one a pose, or None. Raises InputError for limits that are not such."""
        kept = distinct_poses(path)
        stations = arc_length(path.poses[kept, :2])
        squares = spec.max_lateral_mps2 / np.maximum(np.abs(_mean_curvature(stations, path.poses[kept, 2])), 1e-9)
        if speed_limits is not None:
            squares = np.minimum(squares, _checked(speed_limits, n=len(path.poses))[kept] ** 2)
        if spec.stop_at_goal:
            squares[-1] = 0.0
        # v_i^2 <= v_j^2 + 2 b (s_j - s_i) for every j ahead: a running minimum from the end.
        braked = squares + 2 * spec.slowdown_mps2 * stations
        squares = np.minimum.accumulate(braked[::-1])[::-1] - 2 * spec.slowdown_mps2 * stations
        return cls(stations=tuple(stations.tolist()), squares=tuple(np.maximum(squares, 0.0).tolist()))

    def at(self, station_m: float) -> Pace:
        """Highest speed at a station and the acceleration that goes with it; before the start and past the end, held."""
        if station_m < 0:
            return Pace(speed=sqrt(self.squares[0]), acceleration=0.0)
        if station_m >= self.stations[-1]:
            return Pace(speed=sqrt(self.squares[-1]), acceleration=0.0)
        i = bisect_right(self.stations, station_m) - 1
        slope = (self.squares[i + 1] - self.squares[i]) / (self.stations[i + 1] - self.stations[i])
        square = self.squares[i] + slope * (station_m - self.stations[i])
        return Pace(speed=sqrt(max(square, 0.0)), acceleration=slope / 2)  # v dv/ds

    def speeds_at(self, stations: npt.ArrayLike) -> FloatArray:
        """Highest speeds (n,) [m/s] at stations (n,) [m]."""
        return np.sqrt(np.interp(np.asarray(stations, dtype=float), self.stations, self.squares))


def clearance_speed_limits(
    clearance_m: npt.ArrayLike, *, target_speed_mps: float, full_speed_clearance_m: float, min_speed_mps: float
) -> FloatArray:
    """Speed limits (n,) [m/s] for clearances (n,) [m] along a path: in proportion, where there is less than enough room.

    Source: the cost-regulated speed of Macenski et al. 2023, Equation 9, with clearance in the place of costmap cost.

    >>> clearance_speed_limits([0.1, 0.25, 2.0], target_speed_mps=20, full_speed_clearance_m=0.5, min_speed_mps=5).tolist()
    [5.0, 10.0, 20.0]
    """
    share = np.clip(np.asarray(clearance_m, dtype=float) / full_speed_clearance_m, 0.0, 1.0)
    return np.asarray(np.maximum(target_speed_mps * share, min_speed_mps))


def _mean_curvature(stations: FloatArray, headings: FloatArray) -> FloatArray:
    turned = np.unwrap(headings)
    behind = np.maximum(stations - _CURVATURE_WINDOW_M / 2, stations[0])
    ahead = np.minimum(stations + _CURVATURE_WINDOW_M / 2, stations[-1])
    return np.asarray((np.interp(ahead, stations, turned) - np.interp(behind, stations, turned)) / (ahead - behind))


def _checked(speed_limits: npt.ArrayLike, *, n: int) -> FloatArray:
    limits = np.asarray(speed_limits, dtype=float)
    if limits.shape != (n,) or not (limits >= 0).all() or not (limits < inf).all():
        raise InputError(f"speed_limits of shape {limits.shape} must be ({n},), one speed of 0 m/s or more for each pose")
    return limits
