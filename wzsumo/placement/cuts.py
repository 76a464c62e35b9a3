"""Edges cut into pieces: ids, lengths, shapes, and where a position on the old edge lies now."""

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wzsumo.frames import FloatArray, arc_length
from wzsumo.placement.net import NetEdge, NetLane, decimals_of, parse_heights, parse_shape

# SUMO inserts vehicles at random places of an edge and lets them choose a lane there: an edge shorter than a vehicle with its
# gap leaves no room for that. A cut nearer than this to an end of its edge moves to that end, or is left out.
SHORTEST_PIECE_M = 10.0


@dataclass(frozen=True, kw_only=True, eq=False)
class CutEdge:
    """One edge and the positions [m] at which it is cut, ascending, in between 0 and its length."""

    edge: NetEdge
    positions: tuple[float, ...]

    @cached_property
    def ids(self) -> tuple[str, ...]:
        """Ids of the pieces. None is the old one, so that a file which still names that fails loudly."""
        return tuple(f"{self.edge.id}.wz{number}" for number in range(len(self.positions) + 1))

    @cached_property
    def bounds(self) -> tuple[float, ...]:
        """Positions [m] on the old edge where the pieces begin, and its length."""
        return (0.0, *self.positions, self.edge.length)

    def nodes(self) -> tuple[str, ...]:
        """Ids of the nodes between the pieces."""
        return tuple(f"{self.edge.id}.wzn{number}" for number in range(len(self.positions)))

    def piece_at(self, position: float, *, ends: bool = False) -> int:
        """Number of the piece that holds a position [m]; at a cut the later one, with `ends` the earlier one."""
        return (bisect_left if ends else bisect_right)(self.positions, position)

    def on_piece(self, position: float, *, ends: bool = False) -> tuple[int, float]:
        """(number of the piece, position [m] on it) of a position on the old edge."""
        number = self.piece_at(position, ends=ends)
        return number, position - self.bounds[number]

    def lane_length(self, lane: NetLane, number: int) -> float:
        """Length [m] of a lane of a piece: all pieces together are as long as the lane was, to SUMO's centimetre."""
        first, last = (round(lane.length * share, 2) for share in self._shares(number))
        return round(last - first, 2) if number < len(self.positions) else lane.length - first

    def shape_text(self, shape: str, number: int) -> str:
        """The part of a lane's or an edge's shape that a piece has."""
        points, heights = parse_shape(shape), parse_heights(shape)
        columns = points if heights is None else np.column_stack([points, heights])
        return text_of_shape(cut_line(columns, *self._shares(number)), decimals=decimals_of(shape))

    def _shares(self, number: int) -> tuple[float, float]:
        """Shares of the edge's length where a piece begins and ends; every lane is cut at the same."""
        return self.bounds[number] / self.edge.length, self.bounds[number + 1] / self.edge.length


def cut_line(points: FloatArray, first: float, last: float) -> FloatArray:
    """The part of a line (n, 2 or 3) between two shares of its length in the plane."""
    along = arc_length(points[:, :2])
    start, end = first * along[-1], last * along[-1]
    inside = (along > start + 1e-6) & (along < end - 1e-6)
    ends = [[np.interp(s, along, column) for column in points.T] for s in (start, end)]
    return np.vstack([ends[0], points[inside], ends[1]])


def text_of_shape(points: FloatArray, *, decimals: int = 2) -> str:
    """A shape as SUMO writes it."""
    return " ".join(",".join(f"{value:.{decimals}f}" for value in point) for point in points)


def number_text(value: float) -> str:
    """A length or position [m] as SUMO reads it: to the millimetre, with two decimals at least."""
    text = f"{value:.3f}"
    return text[:-1] if text.endswith("0") else text
