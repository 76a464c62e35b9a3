"""Layout: what a work zone leaves open of a road, in closed form; truth of the maps and guidance of the drivers.

Stations s [m] run along the middle of all lanes as they were before, offsets d [m] count from the right edge line, positive to
the left. Lanes count from the right, from 0. Nothing here comes from `wzsumo.mutcd`: a second opinion on the zones.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from alignment import Alignment
from shapely.geometry.base import BaseGeometry

from wzsumo.frames import BoolArray, FloatArray

TRUTH_STEP_M = 2.0  # between the corners of the truth's polygons along the road
SCORED_BESIDE_M = 15.0  # on either side of all ground that the kind leaves open on the main road
SCORED_FROM_END_M = 30.0  # the ends of the traces are not scored
RAMP_SLOPE, RAMP_RADIUS_M = 0.1, 700.0  # a ramp leaves its lane with this radius, until it runs away with this slope


def smooth(share: FloatArray) -> FloatArray:
    """0 below 0, 1 above 1, and a smooth step 3 t^2 - 2 t^3 between."""
    t = np.clip(share, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


@dataclass(frozen=True, kw_only=True)
class Closure:
    """Lanes `first` to `last` closed. Stations `at` [m]: the taper begins and ends, the lanes begin to open and are open."""

    first: int
    last: int
    side: Literal["left", "right", "middle"]
    at: tuple[float, float, float, float]

    def share(self, s: FloatArray) -> FloatArray:
        """Share (n,) of the lanes' width that is closed."""
        return np.asarray(np.interp(s, self.at, [0.0, 1.0, 1.0, 0.0]))


@dataclass(frozen=True, kw_only=True)
class Move:
    """All lanes moved by `size` [m] to the left: stations at which they begin to move, are over, come back and are back."""

    size: float
    at: tuple[float, float, float, float]
    smooth_curves: bool = False  # reverse curves, as of a crossover, instead of straight lines

    def __call__(self, s: FloatArray) -> FloatArray:
        """How far (n,) [m] lanes are moved at stations s."""
        a, b, c, d = self.at
        if self.smooth_curves:
            return np.asarray(self.size * (smooth((s - a) / (b - a)) - smooth((s - c) / (d - c))))
        return np.asarray(self.size * np.interp(s, self.at, [0.0, 1.0, 1.0, 0.0]))


@dataclass(frozen=True, kw_only=True)
class Ramp:
    """A ramp on the right, one lane wide, and its auxiliary lane of `length` [m] beside lane 0, with a taper at its far end.

    An on-ramp's gore is at station `gore`, where its auxiliary lane begins; an off-ramp's is where it ends.
    """

    gore: float
    leaves: bool  # an off-ramp
    length: float = 200.0
    taper: float = 60.0

    def beyond(self, s: FloatArray) -> FloatArray:
        """How far (n,) [m] stations lie on the ramp's own side of the gore."""
        return np.asarray(s - self.gore if self.leaves else self.gore - s)

    def away(self, s: FloatArray) -> FloatArray:
        """How far (n,) [m] the ramp has moved to the right of the auxiliary lane."""
        x = np.maximum(self.beyond(s), 0.0)
        bend = RAMP_SLOPE * RAMP_RADIUS_M
        return np.where(x < bend, x * x / (2 * RAMP_RADIUS_M), RAMP_SLOPE * (x - bend / 2))

    def width_share(self, s: FloatArray) -> FloatArray:
        """Width (n,) of the ramp or its auxiliary lane over that of a full lane."""
        return np.clip((self.length + self.taper + self.beyond(s)) / self.taper, 0.0, 1.0)

    @property
    def span(self) -> tuple[float, float]:
        """Stations [m] between which a driver may be in the full auxiliary lane."""
        return (self.gore - self.length, self.gore) if self.leaves else (self.gore, self.gore + self.length)


@dataclass(frozen=True, kw_only=True)
class Layout:
    """A road of equal lanes and what is open of it; `length` [m] is that of the traces, from station 0."""

    alignment: Alignment
    length: float
    lanes: int = 2
    width: float = 3.6576
    closures: tuple[Closure, ...] = ()
    moves: tuple[Move, ...] = ()
    narrowed: tuple[float, tuple[float, float, float, float]] | None = None  # lane width [m] and its stations, as of a Move
    ramp: Ramp | None = None
    speed_mph: float = 60.0
    left_shoulder_ft: float = 4.0
    right_shoulder_ft: float = 10.0
    announced: tuple[float, float] = (0.0, 0.0)  # first and last device

    def to_xy(self, s: FloatArray, d: FloatArray) -> FloatArray:
        """Points (n, 2) [m] at stations s and offsets d (n,) [m]."""
        return self.alignment.to_xy(s, np.asarray(d) - self.lanes * self.width / 2)

    def moved(self, s: FloatArray) -> FloatArray:
        """How far (n,) [m] all lanes are moved to the left."""
        return np.asarray(sum((move(s) for move in self.moves), np.zeros(len(s))))

    def lane_width(self, s: FloatArray) -> FloatArray:
        """Width (n,) [m] of each lane."""
        if self.narrowed is None:
            return np.full(len(s), self.width)
        width, at = self.narrowed
        return np.asarray(np.interp(s, at, [self.width, width, width, self.width]))

    def lane_middle(self, lane: float | FloatArray, s: FloatArray) -> FloatArray:
        """Offsets (n,) [m] of the middle of a lane; lane -1 is an auxiliary lane or a ramp."""
        auxiliary = self.ramp.away(s) * np.clip(-np.asarray(lane), 0.0, 1.0) if self.ramp else 0.0
        return np.asarray(self.moved(s) + (lane + 0.5) * self.lane_width(s) - auxiliary)

    def edges(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Right and left edge (n,) [m] of the open ground of the main road: the line of devices or the edge line."""
        width = self.lane_width(s)
        right, left = self.moved(s), self.moved(s) + self.lanes * width
        for closure in self.closures:
            closed = (closure.last - closure.first + 1) * width * closure.share(s)
            if closure.side == "right":
                right = right + closed
            elif closure.side == "left":
                left = left - closed
        return right, left

    def hole(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Right and left line (n,) [m] of devices around lanes that are closed in the middle; equal where none is."""
        middle, half = np.zeros(len(s)), np.zeros(len(s))
        for closure in self.closures:
            if closure.side == "middle":
                middle = self.lane_middle((closure.first + closure.last) / 2, s)
                half = (closure.last - closure.first + 1) * self.lane_width(s) / 2 * closure.share(s)
        return middle - half, middle + half

    def room(self, d: FloatArray, s: FloatArray) -> FloatArray:
        """Distance (n,) [m] of points from the nearest line of devices or edge line, negative on closed ground."""
        right, left = self.edges(s)
        if self.ramp:
            right = np.where(self.ramp.width_share(s) >= 1.0, -np.inf, right)
        hole_right, hole_left = self.hole(s)
        beside = np.where(hole_left > hole_right, np.maximum(hole_right - d, d - hole_left), np.inf)
        return np.minimum.reduce([d - right, left - d, beside])

    def is_blocked(self, lane: int, s: float) -> bool:
        """Whether the lane is closed, or its taper has begun, at a station."""
        return any(c.first <= lane <= c.last and c.at[0] <= s < c.at[3] for c in self.closures)

    def drivable(self) -> BaseGeometry:
        """The ground between devices and edge lines where the map is scored: the truth."""
        s = self._stations()
        right, left = self.edges(s)
        ground: BaseGeometry = self._strip(s, right, left)
        hole_right, hole_left = self.hole(s)
        inside = hole_left > hole_right
        if inside.any():
            kept: BoolArray = inside | np.r_[inside[1:], False] | np.r_[False, inside[:-1]]
            ground = ground.difference(self._strip(s[kept], hole_right[kept], hole_left[kept]))
        if self.ramp:
            width = self.width * self.ramp.width_share(s)
            there = width > 0
            outer_left = self.moved(s) - self.ramp.away(s)
            ramp = self._strip(s[there], (outer_left - width)[there], outer_left[there])
            ground = ground.union(ramp)
        return shapely.make_valid(ground).intersection(self.scored())

    def scored(self) -> BaseGeometry:
        """The area in which a map is scored."""
        s = self._stations()
        right, left = self.edges(s)
        low, high = min(float(right.min()), 0.0), max(float(left.max()), self.lanes * self.width)
        return self._strip(s, np.full(len(s), low - SCORED_BESIDE_M), np.full(len(s), high + SCORED_BESIDE_M))

    def _stations(self) -> FloatArray:
        """Stations (n,) [m] of the truth's corners, with every one at which an edge bends."""
        start, end = SCORED_FROM_END_M, self.length - SCORED_FROM_END_M
        if self.length < 4 * SCORED_FROM_END_M:
            start, end = self.length / 10, self.length * 0.9
        bends = [at for closure in self.closures for at in closure.at] + [at for move in self.moves for at in move.at]
        bends += self.narrowed[1] if self.narrowed else ()
        s = np.unique(np.r_[np.arange(start, end, TRUTH_STEP_M), end, bends])
        return s[(s >= start) & (s <= end)]

    def _strip(self, s: FloatArray, right: FloatArray, left: FloatArray) -> shapely.Polygon:
        return shapely.Polygon(np.vstack([self.to_xy(s, right), self.to_xy(s, left)[::-1]]))
