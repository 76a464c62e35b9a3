# ruff: noqa: PLR0917  (kernels take many plain arguments by position)
"""What the exact outline meets along a path: contact, clearance, p(occupied)."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.footprint import FIRST_DISC, FRONT, HALF_WIDTH, RADIUS, REAR, pose_is_free, row_span


@dataclass(frozen=True, kw_only=True)
class Exposure:
    """What the outline meets along a path."""

    min_clearance_m: float  # from the outline to the nearest blocked cell, at most the limit of measurement
    max_p_occupied: float  # largest p(occupied) of a cell that the outline touches
    risk_m: float  # integral along the path of the largest p(occupied) under the outline


def exposure_along(
    poses: FloatArray,
    *,
    p_occupied: FieldArray,
    max_p_occupied: float,
    field: FieldArray,
    resolution: float,
    body: FloatArray,
    limit_m: float,
) -> Exposure:
    """The exposure of a body along poses (n, 3) in metres from the map's corner. Outside the map all is blocked."""
    clearance = _min_clearance(poses, p_occupied, max_p_occupied, field, resolution, body, limit_m)
    p_under = _max_p_under(poses, p_occupied, resolution, body)
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    risk = float(np.sum(steps * (p_under[1:] + p_under[:-1]) / 2))
    return Exposure(min_clearance_m=clearance, max_p_occupied=float(p_under.max()), risk_m=risk)


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def first_contact(poses: FloatArray, margins: FloatArray, field: FieldArray, resolution: float, body: FloatArray) -> int:
    """Index of the first pose whose body, wider by its margin [m], touches a blocked cell; -1 where none does."""
    for i in range(len(poses)):
        if not pose_is_free(field, resolution, poses[i, 0], poses[i, 1], poses[i, 2], body, margins[i]):
            return i
    return -1


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _max_p_under(poses: FloatArray, p_occupied: FieldArray, resolution: float, body: FloatArray) -> FloatArray:
    """Largest p (n,) of the cells that the outline touches at each pose; 1 where it leaves the map."""
    rows, cols = p_occupied.shape
    largest = np.zeros(len(poses))
    for i in range(len(poses)):
        x, y, cos, sin = poses[i, 0], poses[i, 1], math.cos(poses[i, 2]), math.sin(poses[i, 2])
        reach_up = max(sin * body[REAR], sin * body[FRONT]) + abs(cos) * body[HALF_WIDTH]
        reach_down = min(sin * body[REAR], sin * body[FRONT]) - abs(cos) * body[HALF_WIDTH]
        for row in range(math.floor((y + reach_down) / resolution), math.floor((y + reach_up) / resolution) + 1):
            low, high = row_span(
                x, y, cos, sin, body[REAR], body[FRONT], body[HALF_WIDTH], row * resolution, (row + 1) * resolution
            )
            left, right = math.floor(low / resolution), math.floor(high / resolution)
            if row < 0 or row >= rows or left < 0 or right >= cols:
                largest[i] = 1.0
                break
            for col in range(left, right + 1):
                largest[i] = max(largest[i], p_occupied[row, col])
    return largest


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _min_clearance(
    poses: FloatArray,
    p_occupied: FieldArray,
    max_p_occupied: float,
    field: FieldArray,
    resolution: float,
    body: FloatArray,
    limit_m: float,
) -> float:
    """Least distance [m] of the outline from a blocked cell, at most `limit_m`."""
    rows, cols = field.shape
    best = limit_m
    for i in range(len(poses)):
        x, y, cos, sin = poses[i, 0], poses[i, 1], math.cos(poses[i, 2]), math.sin(poses[i, 2])
        bound = math.inf
        for disc in range(FIRST_DISC, len(body)):
            row, col = math.floor((y + sin * body[disc]) / resolution), math.floor((x + cos * body[disc]) / resolution)
            inside = 0 <= row < rows and 0 <= col < cols
            bound = min(bound, (field[row, col] if inside else 0.0) - body[RADIUS] - resolution * 0.7072)
        if bound >= best:
            continue
        reach_x = max(abs(cos * body[REAR]), abs(cos * body[FRONT])) + abs(sin) * body[HALF_WIDTH] + best
        reach_y = max(abs(sin * body[REAR]), abs(sin * body[FRONT])) + abs(cos) * body[HALF_WIDTH] + best
        for row in range(math.floor((y - reach_y) / resolution), math.floor((y + reach_y) / resolution) + 1):
            for col in range(math.floor((x - reach_x) / resolution), math.floor((x + reach_x) / resolution) + 1):
                inside = 0 <= row < rows and 0 <= col < cols
                if inside and p_occupied[row, col] < max_p_occupied:
                    continue
                d_x, d_y = (col + 0.5) * resolution - x, (row + 0.5) * resolution - y
                ahead, left = cos * d_x + sin * d_y, cos * d_y - sin * d_x
                best = min(best, _gap(ahead, left, cos, sin, resolution / 2, body, best))
    return best


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _gap(ahead: float, left: float, cos: float, sin: float, half_cell: float, body: FloatArray, best: float) -> float:
    """Distance between the outline and a square cell whose centre lies at (ahead, left) in the vehicle's frame; 0 on contact.

    Two convex outlines that do not meet are nearest at a corner of one of them.
    """
    out = max(body[REAR] - ahead, ahead - body[FRONT], 0.0)
    side = max(abs(left) - body[HALF_WIDTH], 0.0)
    if out * out + side * side > (best + half_cell * 1.4143) ** 2:
        return best
    reach = half_cell * (abs(cos) + abs(sin))
    middle, half_length = (body[REAR] + body[FRONT]) / 2, (body[FRONT] - body[REAR]) / 2
    # The square's axes separate too: the outline's extent along the map's x and y.
    d_x, d_y = cos * (ahead - middle) - sin * left, sin * (ahead - middle) + cos * left
    extent_x = half_length * abs(cos) + body[HALF_WIDTH] * abs(sin) + half_cell
    extent_y = half_length * abs(sin) + body[HALF_WIDTH] * abs(cos) + half_cell
    if out <= reach and side <= reach and abs(d_x) <= extent_x and abs(d_y) <= extent_y:
        return 0.0
    nearest = math.inf
    for along in (-half_cell, half_cell):
        for across in (-half_cell, half_cell):
            corner_ahead, corner_left = ahead + cos * along + sin * across, left + cos * across - sin * along
            out = max(body[REAR] - corner_ahead, corner_ahead - body[FRONT], 0.0)
            side = max(abs(corner_left) - body[HALF_WIDTH], 0.0)
            nearest = min(nearest, math.hypot(out, side))
    for end in (body[REAR], body[FRONT]):
        for flank in (-body[HALF_WIDTH], body[HALF_WIDTH]):
            to_x, to_y = cos * (end - ahead) - sin * (flank - left), sin * (end - ahead) + cos * (flank - left)
            nearest = min(nearest, math.hypot(max(abs(to_x) - half_cell, 0.0), max(abs(to_y) - half_cell, 0.0)))
    return nearest
