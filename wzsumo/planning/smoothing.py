# ruff: noqa: PLR0917  (kernels take many plain arguments by position)
"""A path without jumps of curvature: third differences made small, the body pushed off obstacles, both ends kept.

Each point is drawn to where the search put it and, where a disc of the body has less than the preferred clearance, up the slope
of the distance field; the sum of squared third differences, which stands for the change of curvature, is weighed against that.
Every round is one banded linear system (Gauss-Newton). Whoever calls this checks the result for contact again.
Sources: Whittaker, On a New Method of Graduation, 1923 (the penalty); Dolgov et al., IJRR 2010 (the obstacle term).
"""

import math

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.footprint import FIRST_DISC, RADIUS

N_ROUNDS = 8
_OBSTACLE_WEIGHT = 4.0  # of a missing metre of clearance against a metre off the searched path
_BAND = 3


def smooth(
    points: FloatArray,
    *,
    headings: tuple[float, float],
    wavelength_m: float,
    preferred_clearance_m: float,
    field: FieldArray,
    resolution: float,
    body: FloatArray,
) -> FloatArray:
    """Points (n, 2) near `points` (n, 2), n >= 8, evenly spaced on entry [m]; first and last two keep to the end headings.

    Waves shorter than `wavelength_m` are damped to less than half. The path starts and ends straight.
    """
    step = float(np.hypot(*(points[1] - points[0])))
    stiffness = (wavelength_m / (2 * math.pi * step)) ** (2 * _BAND)
    ends = [step * np.array([math.cos(heading), math.sin(heading)]) for heading in headings]
    # Two points beyond each end, in line with the end pose, make the path start and end without curvature.
    before, after = points[0] + np.outer([-2, -1], ends[0]), points[-1] + np.outer([1, 2], ends[1])
    line = np.vstack([before, points, after])
    line[3], line[-4] = points[0] + ends[0], points[-1] - ends[1]
    needed = body[RADIUS] + preferred_clearance_m
    return _smooth(line, stiffness, needed, field, resolution, body, N_ROUNDS)[2:-2]


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _smooth(
    line: FloatArray, stiffness: float, needed: float, field: FieldArray, resolution: float, body: FloatArray, n_rounds: int
) -> FloatArray:
    searched = line.copy()
    n = len(line)
    weight, pull = np.empty(n), np.empty((n, 2))
    for _ in range(n_rounds):
        for i in range(4, n - 4):
            weight[i] = 1.0
            pull[i] = searched[i] - line[i]
            along = line[i + 1] - line[i - 1]
            length = math.hypot(along[0], along[1])
            cos, sin = along[0] / length, along[1] / length
            for disc in range(FIRST_DISC, len(body)):
                distance, slope_x, slope_y = _distance_and_slope(
                    field, resolution, line[i, 0] + cos * body[disc], line[i, 1] + sin * body[disc]
                )
                missing = needed - distance
                if missing > 0:
                    weight[i] += _OBSTACLE_WEIGHT
                    pull[i, 0] += _OBSTACLE_WEIGHT * missing * slope_x
                    pull[i, 1] += _OBSTACLE_WEIGHT * missing * slope_y
        line[4:-4] += _banded_step(line, weight, pull, stiffness)
    return line


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _distance_and_slope(field: FieldArray, resolution: float, x: float, y: float) -> tuple[float, float, float]:
    """Distance [m] between cell centres by bilinear interpolation, and its gradient."""
    rows, cols = field.shape
    u = min(max(x / resolution - 0.5, 0.0), cols - 1.001)
    v = min(max(y / resolution - 0.5, 0.0), rows - 1.001)
    col, row = int(u), int(v)
    u, v = u - col, v - row
    next_col, next_row = min(col + 1, cols - 1), min(row + 1, rows - 1)
    low_left, low_right = field[row, col], field[row, next_col]
    up_left, up_right = field[next_row, col], field[next_row, next_col]
    low, high = low_left + u * (low_right - low_left), up_left + u * (up_right - up_left)
    slope_x = ((1 - v) * (low_right - low_left) + v * (up_right - up_left)) / resolution
    return low + v * (high - low), slope_x, (high - low) / resolution


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _banded_step(line: FloatArray, weight: FloatArray, pull: FloatArray, stiffness: float) -> FloatArray:
    """Step (n - 8, 2) of the inner points that solves (W + c D'D) step = pull - c D'D line, D third differences.

    Cholesky factor L of the band: lower[i, k] = L[i, i - k].
    """
    n = len(line)
    m = n - 8
    third = line[3:] - 3 * line[2:-1] + 3 * line[1:-2] - line[:-3]
    lower, step = np.zeros((m, _BAND + 1)), np.empty((m, 2))
    rows_of_squared_differences = (20.0, -15.0, 6.0, -1.0)
    for i in range(m):
        j = i + 4
        for k in range(2):
            # D'D line: the point takes part in four third differences, with 1, -3, 3, -1.
            bend = third[j - 3, k] - 3 * third[j - 2, k] + 3 * third[j - 1, k] - third[j, k]
            step[i, k] = pull[j, k] - stiffness * bend
        for back in range(min(i, _BAND), -1, -1):
            value = stiffness * rows_of_squared_differences[back] + (weight[j] if back == 0 else 0.0)
            for further in range(back + 1, min(i, _BAND) + 1):
                value -= lower[i, further] * lower[i - back, further - back]
            lower[i, back] = value / lower[i - back, 0] if back > 0 else math.sqrt(value)
    for i in range(m):
        for back in range(1, min(i, _BAND) + 1):
            step[i] -= lower[i, back] * step[i - back]
        step[i] /= lower[i, 0]
    for i in range(m - 1, -1, -1):
        for ahead in range(1, min(m - 1 - i, _BAND) + 1):
            step[i] -= lower[i + ahead, ahead] * step[i + ahead]
        step[i] /= lower[i, 0]
    return step
