"""PathFrame: stations and offsets along a ReferencePath, for a controller that asks for one point a control step.

It holds plain tuples of floats: one value of a tuple is read several times quicker than one of an array. The path goes on
straight beyond both ends, so that a look-ahead past the goal and a position before the first pose are defined.
"""

from bisect import bisect_right
from dataclasses import dataclass
from math import copysign, hypot, sqrt
from typing import Self

import numpy as np

from wzsumo.errors import InputError
from wzsumo.frames import BoolArray, arc_length
from wzsumo.path import ReferencePath

Point = tuple[float, float]
_MIN_STEP_M = 1e-6  # points nearer than this count as one: a segment needs a direction


@dataclass(frozen=True, kw_only=True)
class PathPosition:
    """Position of a point along and beside the path."""

    segment: int  # index of the segment it is beside
    station_m: float  # along the path; negative before its start, more than its length past its end
    cross_track_m: float  # positive to the left


@dataclass(frozen=True, kw_only=True)
class PathFrame:
    """Polyline of n points: coordinates, stations, curvature, and unit directions of its n - 1 segments. World, metres."""

    points: tuple[Point, ...]
    stations: tuple[float, ...]
    directions: tuple[Point, ...]
    curvatures: tuple[float, ...]  # 1/m, at the points

    @classmethod
    def of(cls, path: ReferencePath) -> Self:
        """Frame of a path, points that repeat left out. Raises InputError where the path has no length."""
        poses = path.poses[distinct_poses(path)]
        points = poses[:, :2]
        if len(points) < 2:
            raise InputError(f"a path of {len(path.poses)} poses in one place has no direction; give two poses or more, apart")
        stations = arc_length(points)
        directions = np.diff(points, axis=0) / np.diff(stations)[:, None]
        return cls(
            points=tuple((x, y) for x, y in points.tolist()),
            stations=tuple(stations.tolist()),
            directions=tuple((x, y) for x, y in directions.tolist()),
            curvatures=tuple(ReferencePath(poses=poses).curvature.tolist()),
        )

    @property
    def length_m(self) -> float:
        """Length of the path."""
        return self.stations[-1]

    def locate(self, x: float, y: float, *, near: int | None) -> PathPosition:
        """Position of a world point: the nearest on the whole path, or downhill from segment `near` on its branch."""
        segment = self._nearest_segment(x, y) if near is None else near
        along, left = self._components(segment, x, y)
        while along > self._length(segment) and segment < len(self.directions) - 1:
            ahead, left_ahead = self._components(segment + 1, x, y)
            if ahead < 0:  # beside the corner between two segments: the corner itself is nearest
                return self._at_corner(segment + 1, x, y, side=left)
            segment, along, left = segment + 1, ahead, left_ahead
        while along < 0 and segment > 0:
            behind, left_behind = self._components(segment - 1, x, y)
            if behind > self._length(segment - 1):
                return self._at_corner(segment, x, y, side=left)
            segment, along, left = segment - 1, behind, left_behind
        return PathPosition(segment=segment, station_m=self.stations[segment] + along, cross_track_m=left)

    def point_at(self, station_m: float) -> Point:
        """World point at a station."""
        segment = self._segment_at(station_m)
        along = station_m - self.stations[segment]
        (x, y), (dx, dy) = self.points[segment], self.directions[segment]
        return x + along * dx, y + along * dy

    def curvature_at(self, station_m: float) -> float:
        """Curvature [1/m] at a station, positive to the left; none before the start and past the end."""
        if not 0 <= station_m <= self.length_m:
            return 0.0
        segment = self._segment_at(station_m)
        share = (station_m - self.stations[segment]) / self._length(segment)
        return (1 - share) * self.curvatures[segment] + share * self.curvatures[segment + 1]

    def first_point_beyond(self, radius_m: float, *, x: float, y: float, segment: int) -> Point:
        """First path point after `segment` at `radius_m` or more from (x, y); past the end, the point at just that distance."""
        for px, py in self.points[segment + 1 :]:
            if hypot(px - x, py - y) >= radius_m:
                return px, py
        (px, py), (dx, dy) = self.points[-1], self.directions[-1]
        along = (x - px) * dx + (y - py) * dy
        reach = along + sqrt(along**2 + radius_m**2 - (x - px) ** 2 - (y - py) ** 2)
        return px + reach * dx, py + reach * dy

    def _nearest_segment(self, x: float, y: float) -> int:
        distances = np.hypot(*(np.array(self.points) - (x, y)).T)
        return min(int(distances.argmin()), len(self.directions) - 1)

    def _segment_at(self, station_m: float) -> int:
        return min(max(bisect_right(self.stations, station_m) - 1, 0), len(self.directions) - 1)

    def _components(self, segment: int, x: float, y: float) -> Point:
        (px, py), (dx, dy) = self.points[segment], self.directions[segment]
        return (x - px) * dx + (y - py) * dy, (y - py) * dx - (x - px) * dy

    def _length(self, segment: int) -> float:
        return self.stations[segment + 1] - self.stations[segment]

    def _at_corner(self, corner: int, x: float, y: float, *, side: float) -> PathPosition:
        px, py = self.points[corner]
        return PathPosition(
            segment=corner, station_m=self.stations[corner], cross_track_m=copysign(hypot(x - px, y - py), side)
        )


def distinct_poses(path: ReferencePath) -> BoolArray:
    """Mask (n,) of the poses of a path that are not in the place of the pose before."""
    steps = np.hypot(*np.diff(path.poses[:, :2], axis=0).T)
    return np.concatenate([[True], steps > _MIN_STEP_M])
