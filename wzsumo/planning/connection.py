"""The analytic end of a search: the cheapest Dubins curve from a state to the goal that the body can follow.

A Dubins curve consists of three segments, arcs of one radius or straight; its word names them: L, S, R (left, straight, right).
Clearance and p(occupied) cost here what they cost in the search, and every curvature of the search is tried.
Source: Dubins, On Curves of Minimal Length with a Constraint on Average Curvature, 1957.
"""

import math

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.planning.footprint import Body, pose_is_free
from wzsumo.planning.lattice import Lattice
from wzsumo.planning.terrain import Terrain

N_WORDS = 6  # LSL, RSR, LSR, RSL, RLR, LRL
# Signs of curvature of the three segments of each word.
_SIGNS = ((1, 0, 1), (-1, 0, -1), (1, 0, -1), (-1, 0, 1), (-1, 1, -1), (1, -1, 1))
_TURN = 2 * math.pi


@njit(cache=True, error_model="numpy")
def connect(
    terrain: Terrain,
    body: Body,
    lattice: Lattice,
    x: float,
    y: float,
    heading: float,
    last_curvature: float,
    goal: FloatArray,
    limit: float,
) -> tuple[float, FloatArray]:
    """(Cost, segments (3, 2): length [m] and curvature [1/m]) of the cheapest free curve below `limit`; else infinite cost."""
    best, segments = math.inf, np.zeros((3, 2))
    for curvature in lattice.curvatures:
        if curvature <= 0:
            continue
        for word in range(N_WORDS):
            lengths = dubins_word(word, goal[0] - x, goal[1] - y, heading, goal[2], 1 / curvature)
            if not lengths[0] + lengths[1] + lengths[2] < min(best, limit):
                continue
            cost = _cost_along(
                terrain, body, lattice, x, y, heading, last_curvature, word, curvature, lengths, min(best, limit)
            )
            if cost < best:
                best = cost
                for segment in range(3):
                    segments[segment, 0] = lengths[segment]
                    segments[segment, 1] = segment_sign(word, segment) * curvature
    return best, segments


@njit(cache=True, error_model="numpy")
def shortest_length(x: float, y: float, heading: float, goal: FloatArray, radius: float) -> float:
    """Length [m] of the shortest Dubins curve to the goal, obstacles or not."""
    shortest = math.inf
    for word in range(N_WORDS):
        lengths = dubins_word(word, goal[0] - x, goal[1] - y, heading, goal[2], radius)
        shortest = min(shortest, lengths[0] + lengths[1] + lengths[2])
    return shortest


@njit(cache=True, error_model="numpy")
def _cost_along(
    terrain: Terrain,
    body: Body,
    lattice: Lattice,
    x: float,
    y: float,
    heading: float,
    last_curvature: float,
    word: int,
    sharpness: float,
    lengths: tuple[float, float, float],
    limit: float,
) -> float:
    """Cost of a word with arcs of curvature `sharpness`; infinite where the body touches a blocked cell or from `limit` on."""
    resolution, cost = terrain.resolution, 0.0
    for segment in range(3):
        if lengths[segment] == 0:
            continue
        curvature = segment_sign(word, segment) * sharpness
        cost += lattice.change_cost_m * abs(curvature - last_curvature) / lattice.sharpest
        last_curvature = curvature
        n = max(1, math.ceil(lengths[segment] / lattice.check_m))
        step = lengths[segment] / n
        half = curvature * step / 2
        chord = step * (math.sin(half) / half if half != 0 else 1.0)
        margin = lattice.sweep_margin * abs(curvature)
        step_cost = step * (1 + lattice.turn_cost * abs(curvature) / lattice.sharpest)
        for _ in range(n):
            x += chord * math.cos(heading + half)
            y += chord * math.sin(heading + half)
            heading += 2 * half
            if not pose_is_free(terrain.distance, resolution, body, x, y, heading, margin):
                return math.inf
            cost += step_cost * terrain.multiplier[int(y / resolution) + 1, int(x / resolution) + 1]
            if not cost < limit:
                return math.inf
    return cost


@njit(cache=True, error_model="numpy")
def dubins_word(
    word: int, d_x: float, d_y: float, start_heading: float, goal_heading: float, radius: float
) -> tuple[float, float, float]:
    """Lengths [m] of the three segments of one word to a goal off by (d_x, d_y).

    A word that does not lead there has an infinite first length.
    """
    d = math.hypot(d_x, d_y) / radius
    bearing = math.atan2(d_y, d_x)
    a, b = (start_heading - bearing) % _TURN, (goal_heading - bearing) % _TURN
    sin_a, cos_a, sin_b, cos_b, cos_ab = math.sin(a), math.cos(a), math.sin(b), math.cos(b), math.cos(a - b)
    none = (math.inf, math.inf, math.inf)
    if word == 0:
        square = 2 + d * d - 2 * cos_ab + 2 * d * (sin_a - sin_b)
        towards = math.atan2(cos_b - cos_a, d + sin_a - sin_b)
        t, p, q = towards - a, math.sqrt(max(square, 0.0)), b - towards
    elif word == 1:
        square = 2 + d * d - 2 * cos_ab + 2 * d * (sin_b - sin_a)
        towards = math.atan2(cos_a - cos_b, d - sin_a + sin_b)
        t, p, q = a - towards, math.sqrt(max(square, 0.0)), towards - b
    elif word == 2:
        square = d * d - 2 + 2 * cos_ab + 2 * d * (sin_a + sin_b)
        if square < 0:
            return none
        p = math.sqrt(square)
        towards = math.atan2(-cos_a - cos_b, d + sin_a + sin_b) - math.atan2(-2.0, p)
        t, q = towards - a, towards - b
    elif word == 3:
        square = d * d - 2 + 2 * cos_ab - 2 * d * (sin_a + sin_b)
        if square < 0:
            return none
        p = math.sqrt(square)
        towards = math.atan2(cos_a + cos_b, d - sin_a - sin_b) - math.atan2(2.0, p)
        t, q = a - towards, b - towards
    else:
        side = 1.0 if word == 4 else -1.0
        cosine = (6 - d * d + 2 * cos_ab + side * 2 * d * (sin_a - sin_b)) / 8
        if abs(cosine) > 1:
            return none
        p = _TURN - math.acos(cosine)
        towards = math.atan2(side * (cos_a - cos_b), d - side * (sin_a - sin_b))
        t = (side * (a - towards) + p / 2) % _TURN
        q = side * (a - b) - t + p
    if word < 2 and p < 1e-6:  # one arc alone: the direction of a straight of no length is undefined
        t, q = (b - a if word == 0 else a - b), 0.0
    return radius * _forward(t), radius * p, radius * _forward(q)


@njit(cache=True, error_model="numpy")
def segment_sign(word: int, segment: int) -> int:
    """Sign of the curvature of a word's segment, 0 on the straight."""
    return _SIGNS[word][segment]


@njit(cache=True, error_model="numpy")
def _forward(angle: float) -> float:
    """The angle in [0, 2 pi); a full turn but for rounding is 0."""
    turned = angle % _TURN
    return 0.0 if turned > _TURN - 1e-9 else turned
