"""The kernel of `Road.to_sd`: stations and lateral offsets of points beside a polyline whose offset lines are mitred.

A map converts a million cells at a time. Successive points are usually neighbours, so each search starts where the last ended.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray

POINTS_PER_CIRCLE = 16  # consecutive points of the line within one bounding circle


class MitredLine(NamedTuple):
    """A polyline of n points ready for `project`; `normals` (n, 2) are the mitre normals of the points."""

    points: FloatArray
    normals: FloatArray
    tangents: FloatArray  # (n - 1, 2), of unit length
    lengths: FloatArray  # (n - 1,) [m] of the segments
    stations: FloatArray  # (n,) [m]
    circles: FloatArray  # (blocks, 3): centre and radius [m] around POINTS_PER_CIRCLE points each


def mitred_line(points: FloatArray, normals: FloatArray) -> MitredLine:
    """The line through `points` (n, 2) [m], with the circles that let the search skip most points."""
    steps = np.diff(points, axis=0)
    lengths = np.hypot(*steps.T)
    blocks = [points[first : first + POINTS_PER_CIRCLE] for first in range(0, len(points), POINTS_PER_CIRCLE)]
    centres = [(block.min(axis=0) + block.max(axis=0)) / 2 for block in blocks]
    radii = [np.hypot(*(block - centre).T).max() for block, centre in zip(blocks, centres, strict=True)]
    return MitredLine(
        points=np.ascontiguousarray(points),
        normals=np.ascontiguousarray(normals),
        tangents=steps / lengths[:, None],
        lengths=lengths,
        stations=np.concatenate([[0.0], np.cumsum(lengths)]),
        circles=np.column_stack([centres, radii]),
    )


@njit(cache=True)
def project(xy: FloatArray, line: MitredLine) -> tuple[FloatArray, FloatArray]:
    """Stations and offsets to the left (m,) [m] of points (m, 2)."""
    station, offset = np.empty(len(xy)), np.empty(len(xy))
    nearest = 0
    for i in range(len(xy)):
        x, y = xy[i, 0], xy[i, 1]
        nearest = _nearest_point(x, y, line, nearest)
        segment, share = _segment_beside(x, y, line, min(nearest, len(line.lengths) - 1))
        station[i] = line.stations[segment] + share * line.lengths[segment]
        offset[i] = _local(x, y, line, segment)[1]
    return station, offset


@njit(cache=True)
def _nearest_point(x: float, y: float, line: MitredLine, guess: int) -> int:
    best, best_square = guess, _square(x - line.points[guess, 0], y - line.points[guess, 1])
    best_distance = np.sqrt(best_square)
    for block in range(len(line.circles)):
        reach = best_distance + line.circles[block, 2]
        if _square(x - line.circles[block, 0], y - line.circles[block, 1]) > reach * reach:
            continue
        for i in range(block * POINTS_PER_CIRCLE, min((block + 1) * POINTS_PER_CIRCLE, len(line.points))):
            square = _square(x - line.points[i, 0], y - line.points[i, 1])
            if square < best_square:
                best, best_square, best_distance = i, square, np.sqrt(square)
    return best


@njit(cache=True)
def _square(x: float, y: float) -> float:
    return x * x + y * y


@njit(cache=True)
def _segment_beside(x: float, y: float, line: MitredLine, segment: int) -> tuple[int, float]:
    """The segment between whose mitres the point lies, and the share of the way along it; not in [0, 1) beyond both ends."""
    share = _share_along(x, y, line, segment)
    for _ in range(len(line.lengths)):
        step = 1 if share >= 1 else (-1 if share < 0 else 0)
        moved = segment + step
        if step == 0 or moved < 0 or moved == len(line.lengths):
            break
        moved_share = _share_along(x, y, line, moved)
        if (step > 0 and moved_share < 0) or (step < 0 and moved_share >= 1):
            # On the outer side of a bend neither of two neighbours may hold the point: the present one keeps it.
            return segment, min(max(share, 0.0), 1.0)
        segment, share = moved, moved_share
    return segment, share


@njit(cache=True)
def _share_along(x: float, y: float, line: MitredLine, segment: int) -> float:
    along, offset = _local(x, y, line, segment)
    tangent_x, tangent_y = line.tangents[segment, 0], line.tangents[segment, 1]
    start = offset * (line.normals[segment, 0] * tangent_x + line.normals[segment, 1] * tangent_y)
    end = line.lengths[segment] + offset * (line.normals[segment + 1, 0] * tangent_x + line.normals[segment + 1, 1] * tangent_y)
    return (along - start) / (end - start)


@njit(cache=True)
def _local(x: float, y: float, line: MitredLine, segment: int) -> tuple[float, float]:
    """Distances along and to the left of a segment [m], from its start."""
    tangent_x, tangent_y = line.tangents[segment, 0], line.tangents[segment, 1]
    from_x, from_y = x - line.points[segment, 0], y - line.points[segment, 1]
    return from_x * tangent_x + from_y * tangent_y, from_y * tangent_x - from_x * tangent_y
