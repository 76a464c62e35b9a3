"""Alignment: a road's axis of straights and arcs in closed form, and points beside it."""

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

import numpy as np

from wzsumo.frames import FloatArray

ARC_POINTS_M = 5.0  # between the points of an arc in a road file: 8 mm of chord error at a radius of 400 m


@dataclass(frozen=True, kw_only=True)
class Alignment:
    """Pieces (length [m], curvature [1/m], positive to the left) one after another, from station `first` [m].

    `pose` (x [m], y [m], heading [rad]) is that of the axis at station `first`. The road goes straight on beyond both ends.
    """

    pieces: tuple[tuple[float, float], ...]
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    first: float = 0.0

    @property
    def last(self) -> float:
        """Station [m] at which the last piece ends."""
        return self.first + sum(length for length, _ in self.pieces)

    def heading(self, s: FloatArray) -> FloatArray:
        """Headings (n,) [rad] of the axis at stations s (n,) [m], not wrapped."""
        piece, along = self._place(s)
        return np.asarray(self._starts[piece, 2] + self._curvature[piece] * along)

    def to_xy(self, s: FloatArray, offset: FloatArray) -> FloatArray:
        """Points (n, 2) [m] at stations s and offsets to the left of the axis (n,) [m]."""
        piece, along = self._place(s)
        x0, y0, h0 = self._starts[piece].T
        half_turn = self._curvature[piece] * along / 2
        chord = along * np.sinc(half_turn / np.pi)  # 2 sin(half turn) / curvature, which holds for a straight too
        heading = h0 + 2 * half_turn
        x = x0 + chord * np.cos(h0 + half_turn) - offset * np.sin(heading)
        y = y0 + chord * np.sin(h0 + half_turn) + offset * np.cos(heading)
        return np.column_stack([x, y])

    def knots(self) -> FloatArray:
        """Stations (n,) [m] of the points that a polyline of this axis needs."""
        parts = [np.array([self.first])]
        at = self.first
        for length, curvature in self.pieces:
            count = 1 if curvature == 0 else int(np.ceil(length / ARC_POINTS_M))
            parts.append(at + length * np.arange(1, count + 1) / count)
            at += length
        return np.concatenate(parts)

    @cached_property
    def _curvature(self) -> FloatArray:
        return np.array([0.0, *(curvature for _, curvature in self.pieces), 0.0])

    @cached_property
    def _begins(self) -> FloatArray:
        return np.array([self.first, *accumulate((length for length, _ in self.pieces), initial=self.first)])

    @cached_property
    def _starts(self) -> FloatArray:
        """Poses (pieces + 2, 3) at the beginning of each piece; the first and the last piece are the straights beyond."""
        x, y, heading = self.pose
        poses = [self.pose, self.pose]
        for length, curvature in self.pieces:
            half_turn = curvature * length / 2
            chord = length * float(np.sinc(half_turn / np.pi))
            x, y = x + chord * float(np.cos(heading + half_turn)), y + chord * float(np.sin(heading + half_turn))
            heading += 2 * half_turn
            poses.append((x, y, heading))
        return np.array(poses)

    def _place(self, s: FloatArray) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], FloatArray]:
        """(piece (n,), metres (n,) from its beginning) of stations s; negative metres ahead of the first station."""
        station = np.asarray(s, dtype=float)
        piece = np.searchsorted(self._begins[1:], station, side="right")
        return piece, station - self._begins[piece]
