"""A path without jumps of curvature: third differences made small, the body pushed off obstacles, both ends kept.

Each point is drawn to where the search put it and, where a disc of the body has less than the preferred clearance, away from
the obstacle; the sum of squared third differences, which stands for the change of curvature, is weighed against that. Every
round is one banded linear system (Gauss-Newton). Whoever calls this checks the result for contact again.
Sources: Whittaker, On a New Method of Graduation, 1923 (the penalty); Dolgov et al., IJRR 2010 (the obstacle term).
"""

import math
from collections.abc import Iterator

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.path import ReferencePath
from wzsumo.planning.bending import BAND, add_bending, advance_line, bending_matrix, factorise, stiffness_of, ways_at_ends
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.easing import EASING_LADDER_M, eased_points
from wzsumo.planning.footprint import Body, sweep_margin
from wzsumo.planning.path_check import cost_along, poses_through, touching_poses
from wzsumo.planning.terrain import Terrain

# Wavelength [m] and share of the preferred clearance that is asked for, tried in turn. On a work zone of 900 m with corridors
# of 3.6 m, straight, turned and bent, the first gave clearances of 0.51 to 0.65 m (analysis/benchmarks/planning.py).
_LADDER = (
    (90.0, 0.7), (60.0, 0.7), (40.0, 0.7), (60.0, 0.35), (40.0, 0.35), (25.0, 0.35), (15.0, 0.2), (8.0, 0.1), (4.0, 0.01),
)  # fmt: skip
# The first of these that costs little more than the searched path is taken, else the cheapest of them: one that cuts
# through what that went round comes nearer to obstacles, and costs more.
_N_STRONG = 3
_DEARER, _DEAREST = 1.05, 1.2  # times the cost of the searched path: little more, and the most for any
_FEWEST_POINTS = 9
_N_ROUNDS = 8
_SETTLED_M = 0.01  # rounds end when no point moves farther
_OBSTACLE_WEIGHT = 4.0  # of a missing metre of clearance against a metre off the searched path
_INSISTED_SHARE = 0.85  # below this share of the clearance asked for the weight grows from round to round,
_INSISTENCE = 12.0  # by this factor times what is lacking: the nearest obstacles come to count most
_STRIDE = 2  # obstacles are looked at from every second point, a metre apart


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

    `poses` (n, 3) are free and evenly spaced. Clearance and p(occupied) may cost little more than before.
    Where no smoothing keeps the jumps of curvature within their limit, the one with the least jumps; where none is free and
    within `max_curvature`, the poses as they were given.
    """
    if len(poses) < _FEWEST_POINTS:
        return poses
    step = float(np.hypot(*(poses[1, :2] - poses[0, :2])))
    searched = cost_along(poses, terrain)
    best, least = poses, (math.inf, math.inf)
    for number, points in enumerate(_tries(poses, preferred_clearance_m, terrain, body), start=1):
        if number > _N_STRONG and least[0] <= max_curvature_jump:
            break
        candidate = poses_through(points, ends=poses[[0, -1], 2])
        curvature = ReferencePath(poses=candidate).curvature
        jump = float(np.abs(np.diff(curvature)).max())
        cost = cost_along(candidate, terrain)
        rank = (max(jump, max_curvature_jump), cost)  # all jumps within the limit are alike
        if np.abs(curvature).max() > max_curvature or cost > _DEAREST * searched or rank >= least:
            continue
        if touching_poses(candidate, sweep_margin(body, step_m=step), terrain, body).any():
            continue
        best, least = candidate, rank
        if jump <= max_curvature_jump and cost <= _DEARER * searched:
            break
    return best


def _tries(poses: FloatArray, preferred_clearance_m: float, terrain: Terrain, body: Body) -> Iterator[FloatArray]:
    """Points (n, 2) of smoother and smoother compliance: off the obstacles first, then within the room that the poses have."""
    headings = (poses[0, 2], poses[-1, 2])
    for wavelength_m, clearance_share in _LADDER:
        clearance_m = clearance_share * preferred_clearance_m
        yield smooth(
            poses[:, :2], headings=headings, wavelength_m=wavelength_m, clearance_m=clearance_m, terrain=terrain, body=body
        )
    for wavelength_m in EASING_LADDER_M:
        yield eased_points(poses, wavelength_m=wavelength_m, terrain=terrain, body=body)


def smooth(
    points: FloatArray,
    *,
    headings: tuple[float, float],
    wavelength_m: float,
    clearance_m: float,
    terrain: Terrain,
    body: Body,
) -> FloatArray:
    """Points (n, 2) near `points` (n, 2), n >= 6, evenly spaced on entry [m]; ends and the headings there are kept.

    Waves shorter than `wavelength_m` are damped to less than half.
    """
    step = float(np.hypot(*(points[1] - points[0])))
    stiffness = stiffness_of(wavelength_m, step)
    x, y = points[:, 0].copy(), points[:, 1].copy()
    ways = ways_at_ends(headings, step)
    _smooth(x, y, ways, stiffness, clearance_m, terrain, body)
    return np.column_stack([x, y])


@njit(cache=True, error_model="numpy")
def _smooth(
    x: FloatArray,
    y: FloatArray,
    ways: FloatArray,
    stiffness: float,
    clearance_m: float,
    terrain: Terrain,
    body: Body,
) -> None:
    """Move the inner points of the line in place; `ways` (2, 2) lead from the point before to the one after each end."""
    n = len(x)
    searched_x, searched_y, weights = x.copy(), y.copy(), np.empty(n)
    pull_x, pull_y, insistence = np.empty(n), np.empty(n), np.full(n, _OBSTACLE_WEIGHT)
    band, lower, step = bending_matrix(n), np.empty((n, BAND + 1)), np.empty(n)
    insisted = body.half_width + _INSISTED_SHARE * clearance_m
    for _ in range(_N_ROUNDS):
        for i in range(1, n - 1):
            weights[i], pull_x[i], pull_y[i] = 1.0, searched_x[i] - x[i], searched_y[i] - y[i]
        for i in range(1, n - 1, _STRIDE):
            d_x, d_y = x[i + 1] - x[i - 1], y[i + 1] - y[i - 1]
            length = math.sqrt(d_x * d_x + d_y * d_y)
            cos, sin = d_x / length, d_y / length
            count, push, nearest = _push_off(terrain, body, x[i], y[i], cos, sin, body.half_width + clearance_m)
            insistence[i] *= 1 + _INSISTENCE * max(insisted - nearest, 0.0) / clearance_m
            weight = _STRIDE * insistence[i]
            weights[i] += weight * count
            pull_x[i] -= weight * push * sin
            pull_y[i] += weight * push * cos
        add_bending(x, ways[0, 0], ways[1, 0], stiffness, pull_x)
        add_bending(y, ways[0, 1], ways[1, 1], stiffness, pull_y)
        factorise(band, weights, stiffness, lower)
        moved = max(advance_line(x, pull_x, lower, step), advance_line(y, pull_y, lower, step))
        if moved < _SETTLED_M:
            break


@njit(cache=True, error_model="numpy")
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
        steepness = max(math.sqrt(slope_x * slope_x + slope_y * slope_y), 0.5)
        away_x, away_y = slope_x / steepness, slope_y / steepness
        # As far as the near obstacle lies behind, the way away from it is free. What lies ahead from there pushes back.
        ahead = (
            near + _distance_and_slope(terrain.distance, terrain.resolution, disc_x + near * away_x, disc_y + near * away_y)[0]
        )
        missing_ahead = max(needed - ahead, 0.0)
        count += 2 if missing_ahead > 0 else 1
        # Only across the path: along it a push would bunch the points.
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
