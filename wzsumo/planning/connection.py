# ruff: noqa: PLR0917  (kernels take many plain arguments by position)
"""The analytic end of a search: the cheapest Dubins curve from a state to the goal that the body can follow.

Clearance and p(occupied) cost here what they cost in the search; several radii are tried, gentle ones too.
"""

import math

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.dubins import N_WORDS, dubins_word, segment_sign
from wzsumo.planning.footprint import pose_is_free


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def connect(
    field: FieldArray,
    multiplier: FieldArray,
    resolution: float,
    body: FloatArray,
    margin: float,
    pose: FloatArray,
    goal: FloatArray,
    curvatures: FloatArray,
    check_m: float,
    turn_cost: float,
    change_cost_m: float,
    last_curvature: float,
    limit: float,
) -> tuple[float, FloatArray]:
    """(cost, segments (3, 2): length [m] and curvature [1/m]) of the cheapest free curve below `limit`; else infinite cost."""
    best, segments = math.inf, np.zeros((3, 2))
    sharpest = np.abs(curvatures).max()
    for bend in curvatures:
        if bend <= 0:
            continue
        for word in range(N_WORDS):
            lengths = dubins_word(word, goal[0] - pose[0], goal[1] - pose[1], pose[2], goal[2], 1 / bend)
            if not lengths[0] + lengths[1] + lengths[2] < min(best, limit):
                continue
            cost = _cost_along(
                field, multiplier, resolution, body, margin, pose, lengths, word, bend, sharpest, check_m, turn_cost,
                change_cost_m, last_curvature, min(best, limit),
            )  # fmt: skip
            if cost < min(best, limit):
                best = cost
                for segment in range(3):
                    segments[segment, 0] = lengths[segment]
                    segments[segment, 1] = segment_sign(word, segment) * bend
    return best, segments


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _cost_along(
    field: FieldArray,
    multiplier: FieldArray,
    resolution: float,
    body: FloatArray,
    margin: float,
    pose: FloatArray,
    lengths: tuple[float, float, float],
    word: int,
    bend: float,
    sharpest: float,
    check_m: float,
    turn_cost: float,
    change_cost_m: float,
    last_curvature: float,
    limit: float,
) -> float:
    """Cost of one curve, infinite where the body touches a blocked cell or the cost passes the limit."""
    x, y, heading = pose[0], pose[1], pose[2]
    cost = 0.0
    for segment in range(3):
        if lengths[segment] == 0:
            continue
        curvature = segment_sign(word, segment) * bend
        cost += change_cost_m * abs(curvature - last_curvature) / sharpest
        last_curvature = curvature
        n = max(1, math.ceil(lengths[segment] / check_m))
        step = lengths[segment] / n
        half = curvature * step / 2
        chord = step * (math.sin(half) / half if half != 0 else 1.0)
        dearer = 1 + turn_cost * (curvature / sharpest) ** 2
        for _ in range(n):
            x += chord * math.cos(heading + half)
            y += chord * math.sin(heading + half)
            heading += 2 * half
            if not pose_is_free(field, resolution, x, y, heading, body, margin):
                return math.inf
            cost += step * dearer * multiplier[int(y / resolution), int(x / resolution)]
            if cost >= limit:
                return math.inf
    return cost
