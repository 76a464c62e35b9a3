"""The analytic end of a search: the cheapest Dubins curve from a state to the goal that the body can follow.

Clearance and p(occupied) cost here what they cost in the search; every curvature of the search is tried, gentle ones too.
"""

import math

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.planning.dubins import N_WORDS, dubins_word, segment_sign
from wzsumo.planning.footprint import Body, pose_is_free
from wzsumo.planning.lattice import Lattice
from wzsumo.planning.terrain import Terrain


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
    """(cost, segments (3, 2): length [m] and curvature [1/m]) of the cheapest free curve below `limit`; else infinite cost."""
    best, segments = math.inf, np.zeros((3, 2))
    for bend in lattice.curvatures:
        if bend <= 0:
            continue
        for word in range(N_WORDS):
            lengths = dubins_word(word, goal[0] - x, goal[1] - y, heading, goal[2], 1 / bend)
            if not lengths[0] + lengths[1] + lengths[2] < min(best, limit):
                continue
            cost = _cost_along(terrain, body, lattice, x, y, heading, last_curvature, word, bend, lengths, min(best, limit))
            if cost < best:
                best = cost
                for segment in range(3):
                    segments[segment, 0] = lengths[segment]
                    segments[segment, 1] = segment_sign(word, segment) * bend
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
    bend: float,
    lengths: tuple[float, float, float],
    limit: float,
) -> float:
    """Cost of one curve, infinite where the body touches a blocked cell or the cost reaches the limit."""
    resolution, cost = terrain.resolution, 0.0
    for segment in range(3):
        if lengths[segment] == 0:
            continue
        curvature = segment_sign(word, segment) * bend
        cost += lattice.change_cost_m * abs(curvature - last_curvature) / lattice.sharpest
        last_curvature = curvature
        n = max(1, math.ceil(lengths[segment] / lattice.check_m))
        step = lengths[segment] / n
        half = curvature * step / 2
        chord = step * (math.sin(half) / half if half != 0 else 1.0)
        margin = lattice.sweep_margin * abs(curvature)
        dearer = step * (1 + lattice.turn_cost * abs(curvature) / lattice.sharpest)
        for _ in range(n):
            x += chord * math.cos(heading + half)
            y += chord * math.sin(heading + half)
            heading += 2 * half
            if not pose_is_free(terrain.distance, resolution, body, x, y, heading, margin):
                return math.inf
            cost += dearer * terrain.multiplier[int(y / resolution) + 1, int(x / resolution) + 1]
            if not cost < limit:
                return math.inf
    return cost
