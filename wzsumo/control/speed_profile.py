"""How fast the path may be driven: by its curvature, and by the braking for bends ahead."""

from bisect import bisect_right
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from wzsumo.control.path_frame import distinct_poses
from wzsumo.control.regulated_pursuit import RegulatedSpec
from wzsumo.frames import FloatArray, arc_length
from wzsumo.path import ReferencePath

_CURVATURE_WINDOW_M = 3.0  # curvature is the mean over this: jitter of single poses must not slow the ego down; chosen by us


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
    def of(cls, path: ReferencePath, *, spec: RegulatedSpec) -> Self:
        """Profile of a path: v^2 <= a_lateral / curvature, reached by braking with `slowdown_mps2`, left with `speedup_mps2`.

        An ego that sped up freely between two bends would brake for the second at once: a surge.
        """
        kept = distinct_poses(path)
        stations = arc_length(path.poses[kept, :2])
        squares = spec.max_lateral_mps2 / np.maximum(np.abs(_mean_curvature(stations, path.poses[kept, 2])), 1e-9)
        if spec.stop_at_goal:
            squares[-1] = 0.0
        # v_i^2 <= v_j^2 + 2 b (s_j - s_i) for every j ahead: a running minimum from the end.
        braked = squares + 2 * spec.slowdown_mps2 * stations
        squares = np.minimum.accumulate(braked[::-1])[::-1] - 2 * spec.slowdown_mps2 * stations
        # And v_j^2 <= v_i^2 + 2 a (s_j - s_i) for every i behind.
        driven = squares - 2 * spec.speedup_mps2 * stations
        squares = np.minimum.accumulate(driven) + 2 * spec.speedup_mps2 * stations
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


def _mean_curvature(stations: FloatArray, headings: FloatArray) -> FloatArray:
    turned = np.unwrap(headings)
    behind = np.maximum(stations - _CURVATURE_WINDOW_M / 2, stations[0])
    ahead = np.minimum(stations + _CURVATURE_WINDOW_M / 2, stations[-1])
    return np.asarray((np.interp(ahead, stations, turned) - np.interp(behind, stations, turned)) / (ahead - behind))
