# ruff: noqa: PLR0917  (kernels take many plain arguments by position)
"""A path without jumps of curvature: third differences made small, the body pushed off obstacles, both ends kept.

Each point is drawn to where the search put it and, where a disc of the body has less than the preferred clearance, away from
the obstacle; the sum of squared third differences, which stands for the change of curvature, is weighed against that. Every
round is one banded linear system (Gauss-Newton). Whoever calls this checks the result for contact again.
Sources: Whittaker, On a New Method of Graduation, 1923 (the penalty); Dolgov et al., IJRR 2010 (the obstacle term).
"""

import math

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.path import ReferencePath
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.footprint import Body, sweep_margin
from wzsumo.planning.path_check import first_contact
from wzsumo.planning.terrain import Terrain

# Wavelength [m] and share of the preferred clearance that is asked for, the smoothest first.
_LADDER = ((60.0, 1.0), (60.0, 0.5), (40.0, 1.0), (40.0, 0.5), (25.0, 0.5), (15.0, 0.3), (8.0, 0.1), (4.0, 0.0))
_FEWEST_POINTS = 9
_N_ROUNDS = 8
_SETTLED_M = 0.005  # rounds end when no point moves farther
_OBSTACLE_WEIGHT = 4.0  # of a missing metre of clearance against a metre off the searched path
_INSISTED_SHARE = 0.6  # with less than this share of the preferred clearance the weight doubles every round
_BAND = 3
_ENDS = 4  # points at each end that do not move: two beyond it, two on it


def smoothed_poses(
    poses: FloatArray,
    *,
    terrain: Terrain,
    body: Body,
    preferred_clearance_m: float,
    max_curvature: float,
    max_curvature_jump: float,
) -> FloatArray:
    """Poses (n, 3) under the strongest smoothing that keeps off blocked cells and within the limits [1/m].

    `poses` (n, 3) are free and evenly spaced. Where no smoothing keeps the jumps of curvature within their limit, the one
    with the least jumps; where none is free and within `max_curvature`, the poses as they were given.
    """
    if len(poses) < _FEWEST_POINTS:
        return poses
    step = float(np.hypot(*(poses[1, :2] - poses[0, :2])))
    best, least_jump = poses, math.inf
    for wavelength_m, clearance_share in _LADDER:
        points = smooth(
            poses[:, :2],
            headings=(poses[0, 2], poses[-1, 2]),
            wavelength_m=wavelength_m,
            preferred_clearance_m=clearance_share * preferred_clearance_m,
            terrain=terrain,
            body=body,
        )
        chords = points[2:] - points[:-2]
        headings = np.concatenate([poses[:1, 2], np.arctan2(chords[:, 1], chords[:, 0]), poses[-1:, 2]])
        candidate = np.column_stack([points, headings])
        curvature = ReferencePath(poses=candidate).curvature
        jump = float(np.abs(np.diff(curvature)).max())
        if np.abs(curvature).max() > max_curvature or jump >= least_jump:
            continue
        margins = sweep_margin(body, step_m=step) * np.abs(curvature)
        if first_contact(candidate, margins, terrain, body) < 0:
            best, least_jump = candidate, jump
            if jump <= max_curvature_jump:
                break
    return best


def smooth(
    points: FloatArray,
    *,
    headings: tuple[float, float],
    wavelength_m: float,
    preferred_clearance_m: float,
    terrain: Terrain,
    body: Body,
) -> FloatArray:
    """Points (n, 2) near `points` (n, 2), n >= 5, evenly spaced on entry [m]; the first and last two along the end headings.

    Waves shorter than `wavelength_m` are damped to less than half. The path starts and ends straight.
    """
    step = float(np.hypot(*(points[1] - points[0])))
    stiffness = (wavelength_m / (2 * math.pi * step)) ** (2 * _BAND)
    first, last = (step * np.array([math.cos(heading), math.sin(heading)]) for heading in headings)
    # Two points beyond each end, in line with the end pose, make the path start and end without curvature.
    line = np.vstack([points[0] + np.outer([-2, -1, 0, 1], first), points[2:-2], points[-1] + np.outer([-1, 0, 1, 2], last)])
    x, y = np.ascontiguousarray(line[:, 0]), np.ascontiguousarray(line[:, 1])
    _smooth(x, y, stiffness, preferred_clearance_m, terrain, body)
    return np.column_stack([x, y])[2:-2]


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _smooth(x: FloatArray, y: FloatArray, stiffness: float, preferred_clearance_m: float, terrain: Terrain, body: Body) -> None:
    """Move the inner points of the line, in place."""
    n = len(x)
    searched_x, searched_y, weights = x.copy(), y.copy(), np.empty(n)
    pull_x, pull_y, insistence = np.empty(n), np.empty(n), np.full(n, _OBSTACLE_WEIGHT)
    lower = np.empty((n, _BAND + 1))
    insisted = body.half_width + _INSISTED_SHARE * preferred_clearance_m
    for _ in range(_N_ROUNDS):
        for i in range(_ENDS, n - _ENDS):
            d_x, d_y = x[i + 1] - x[i - 1], y[i + 1] - y[i - 1]
            length = math.hypot(d_x, d_y)
            cos, sin = d_x / length, d_y / length
            count, push, nearest = _push_off(terrain, body, x[i], y[i], cos, sin, body.half_width + preferred_clearance_m)
            if nearest < insisted:
                insistence[i] *= 2
            weights[i] = 1 + insistence[i] * count
            pull_x[i] = searched_x[i] - x[i] - insistence[i] * push * sin
            pull_y[i] = searched_y[i] - y[i] + insistence[i] * push * cos
        _factorise(weights, stiffness, lower)
        moved = max(_step(x, pull_x, stiffness, lower), _step(y, pull_y, stiffness, lower))
        if moved < _SETTLED_M:
            break


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _push_off(
    terrain: Terrain, body: Body, x: float, y: float, cos: float, sin: float, needed: float
) -> tuple[int, float, float]:
    """(Number of obstacles too near to the discs, sum of the pushes to the left [m], distance [m] of the nearest one)."""
    count, push, nearest = 0, 0.0, math.inf
    for offset in body.disc_offsets:
        disc_x, disc_y = x + cos * offset, y + sin * offset
        near, slope_x, slope_y = _distance_and_slope(terrain.distance, terrain.resolution, disc_x, disc_y)
        nearest = min(nearest, near)
        if near >= needed:
            continue
        away_x, away_y = slope_x / max(math.hypot(slope_x, slope_y), 0.5), slope_y / max(math.hypot(slope_x, slope_y), 0.5)
        # As far as the near obstacle lies behind, the way away from it is free. What lies ahead from there pushes back.
        ahead = (
            near + _distance_and_slope(terrain.distance, terrain.resolution, disc_x + near * away_x, disc_y + near * away_y)[0]
        )
        missing_ahead = max(needed - ahead, 0.0)
        count += 2 if missing_ahead > 0 else 1
        # Only across the path: along it a push would bunch the points.
        push += (needed - near - missing_ahead) * (cos * away_y - sin * away_x)
    return count, push, nearest


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _distance_and_slope(distance: FieldArray, resolution: float, x: float, y: float) -> tuple[float, float, float]:
    """Distance [m] at a point, bilinear between cell centres, and its gradient."""
    rows, cols = distance.shape
    u = min(max(x / resolution - 0.5, 0.0), cols - 1.0)
    v = min(max(y / resolution - 0.5, 0.0), rows - 1.0)
    col, row = max(min(int(u), cols - 2), 0), max(min(int(v), rows - 2), 0)
    next_col, next_row = min(col + 1, cols - 1), min(row + 1, rows - 1)
    u, v = u - col, v - row
    low_left, low_right = distance[row, col], distance[row, next_col]
    high_left, high_right = distance[next_row, col], distance[next_row, next_col]
    low, high = low_left + u * (low_right - low_left), high_left + u * (high_right - high_left)
    slope_x = ((1 - v) * (low_right - low_left) + v * (high_right - high_left)) / resolution
    return low + v * (high - low), slope_x, (high - low) / resolution


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _factorise(weights: FloatArray, stiffness: float, lower: FloatArray) -> None:
    """Cholesky factor of W + stiffness D'D for the inner points, D third differences: lower[i, k] = L[i, i - k]."""
    n = len(weights)
    for i in range(_ENDS, n - _ENDS):
        inner = min(i - _ENDS, _BAND)
        for back in range(inner, -1, -1):
            # Diagonals of D'D, from the differences 1, -3, 3, -1.
            value = stiffness * (20.0 if back == 0 else -15.0 if back == 1 else 6.0 if back == 2 else -1.0)
            for further in range(back + 1, inner + 1):
                value -= lower[i, further] * lower[i - back, further - back]
            lower[i, back] = value / lower[i - back, 0] if back > 0 else math.sqrt(value + weights[i])


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _step(line: FloatArray, pull: FloatArray, stiffness: float, lower: FloatArray) -> float:
    """Move one coordinate of the inner points to where pull and bending balance; returns the largest move [m]."""
    n = len(line)
    step = np.empty(n)
    for i in range(_ENDS, n - _ENDS):
        bend = 20 * line[i] - 15 * (line[i - 1] + line[i + 1]) + 6 * (line[i - 2] + line[i + 2]) - (line[i - 3] + line[i + 3])
        value = pull[i] - stiffness * bend
        for back in range(1, min(i - _ENDS, _BAND) + 1):
            value -= lower[i, back] * step[i - back]
        step[i] = value / lower[i, 0]
    moved = 0.0
    for i in range(n - _ENDS - 1, _ENDS - 1, -1):
        value = step[i]
        for ahead in range(1, min(n - _ENDS - 1 - i, _BAND) + 1):
            value -= lower[i + ahead, ahead] * step[i + ahead]
        step[i] = value / lower[i, 0]
        moved = max(moved, abs(step[i]))
    for i in range(_ENDS, n - _ENDS):
        line[i] += step[i]
    return moved
