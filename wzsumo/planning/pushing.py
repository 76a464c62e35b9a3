"""Smoothing that pushes the body off obstacles: third differences of the line are made small, both ends are kept.

Each point is drawn to its place on the searched path and, where a disc of the body has less than the clearance asked for, away
from the obstacle. The sum of squared third differences, which stands for the change of curvature, is weighed against that.
Every round is one banded linear system (Gauss-Newton). The caller checks the result for contact again.
Sources: Whittaker, On a New Method of Graduation, 1923 (the penalty); Dolgov et al., IJRR 2010 (the obstacle term).
"""

import math
from collections.abc import Sequence

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.planning.bending import BANDWIDTH, add_bending, bending_matrix, end_chords, factorise, move_line, stiffness_of
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.footprint import Body
from wzsumo.planning.terrain import Terrain

_N_ROUNDS = 8  # at most; chosen by us
_SETTLED_M = 0.01  # rounds end when no point moves farther; chosen by us
_OBSTACLE_WEIGHT = 4.0  # of a missing metre of clearance against a metre off the searched path; chosen by us
# Below this share of the clearance asked for, the weight grows from round to round, by a factor of 1 + _WEIGHT_GROWTH times the
# missing share: the nearest obstacles come to count most. Both are chosen by us.
_INSISTED_SHARE, _WEIGHT_GROWTH = 0.85, 12.0
_STRIDE = 2  # obstacles are looked at from every second point, a metre apart


def smooth(
    points: FloatArray,
    *,
    headings: Sequence[float] | FloatArray,
    wavelength_m: float,
    clearances_m: FloatArray,
    terrain: Terrain,
    body: Body,
) -> FloatArray:
    """Points (n, 2) near `points` (n, 2), n >= 6, evenly spaced on entry [m]; both ends and the headings there are kept.

    The clearances asked for are `clearances_m` (n,). Waves shorter than `wavelength_m` are damped to less than half.
    """
    step = float(np.hypot(*(points[1] - points[0])))
    stiffness = stiffness_of(wavelength_m, step)
    x, y = points[:, 0].copy(), points[:, 1].copy()
    chords = end_chords(headings, step)
    _smooth(x, y, chords, stiffness, clearances_m, terrain, body)
    return np.column_stack([x, y])


@njit(cache=True, error_model="numpy")
def _smooth(
    x: FloatArray,
    y: FloatArray,
    chords: FloatArray,
    stiffness: float,
    clearances_m: FloatArray,
    terrain: Terrain,
    body: Body,
) -> None:
    """Move the inner points of the line in place; `chords` (2, 2) run over either end."""
    n = len(x)
    searched_x, searched_y, weights = x.copy(), y.copy(), np.empty(n)
    pull_x, pull_y, obstacle_weights = np.empty(n), np.empty(n), np.full(n, _OBSTACLE_WEIGHT)
    band, lower, step = bending_matrix(n), np.empty((n, BANDWIDTH + 1)), np.empty(n)
    for _ in range(_N_ROUNDS):
        for i in range(1, n - 1):
            weights[i], pull_x[i], pull_y[i] = 1.0, searched_x[i] - x[i], searched_y[i] - y[i]
        for i in range(1, n - 1, _STRIDE):
            d_x, d_y = x[i + 1] - x[i - 1], y[i + 1] - y[i - 1]
            length = math.sqrt(d_x * d_x + d_y * d_y)
            cos, sin = d_x / length, d_y / length
            count, push, nearest = _push_off(terrain, body, x[i], y[i], cos, sin, body.half_width + clearances_m[i])
            insisted = body.half_width + _INSISTED_SHARE * clearances_m[i]
            obstacle_weights[i] *= 1 + _WEIGHT_GROWTH * max(insisted - nearest, 0.0) / clearances_m[i]
            weight = _STRIDE * obstacle_weights[i]
            weights[i] += weight * count
            pull_x[i] -= weight * push * sin
            pull_y[i] += weight * push * cos
        add_bending(x, chords[0, 0], chords[1, 0], stiffness, pull_x)
        add_bending(y, chords[0, 1], chords[1, 1], stiffness, pull_y)
        factorise(band, weights, stiffness, lower)
        moved = max(move_line(x, pull_x, lower, step), move_line(y, pull_y, lower, step))
        if moved < _SETTLED_M:
            break


@njit(cache=True, error_model="numpy")
def _push_off(
    terrain: Terrain, body: Body, x: float, y: float, cos: float, sin: float, needed: float
) -> tuple[int, float, float]:
    """(Number of obstacles that are too near to the discs, sum of the pushes to the left [m], distance [m] of the nearest)."""
    count, push, nearest = 0, 0.0, math.inf
    for offset in body.disc_offsets:
        disc_x, disc_y = x + cos * offset, y + sin * offset
        near, slope_x, slope_y = _distance_and_slope(terrain.distance, terrain.resolution, disc_x, disc_y)
        nearest = min(nearest, near)
        if near >= needed:
            continue
        steepness = max(math.sqrt(slope_x * slope_x + slope_y * slope_y), 0.5)
        away_x, away_y = slope_x / steepness, slope_y / steepness
        # For `near` metres the direction away from the obstacle is free. What lies ahead from there pushes back.
        ahead = (
            near + _distance_and_slope(terrain.distance, terrain.resolution, disc_x + near * away_x, disc_y + near * away_y)[0]
        )
        missing_ahead = max(needed - ahead, 0.0)
        count += 2 if missing_ahead > 0 else 1
        # Only across the path: a push along it would bunch the points.
        push += (needed - near - missing_ahead) * (cos * away_y - sin * away_x)
    return count, push, nearest


@njit(cache=True, error_model="numpy")
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
