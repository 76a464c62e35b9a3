"""Dubins' curves: the shortest ways, forward only, between two poses along arcs of one radius and straights.

Source: Dubins 1957; closed forms of the six words after Shkel and Lumelsky, Classification of the Dubins set, 2001.
"""

import math

from numba import njit

N_WORDS = 6
# Signs of curvature of the three segments of each word: LSL, RSR, LSR, RSL, RLR, LRL.
_SIGNS = ((1, 0, 1), (-1, 0, -1), (1, 0, -1), (-1, 0, 1), (-1, 1, -1), (1, -1, 1))
_TURN = 2 * math.pi


@njit(cache=True, error_model="numpy")
def dubins_word(
    word: int, d_x: float, d_y: float, start_heading: float, goal_heading: float, radius: float
) -> tuple[float, float, float]:
    """Lengths [m] of the three segments of one word over the way (d_x, d_y); infinite first length where there is none."""
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
    if word < 2 and p < 1e-6:  # one arc: where to go straight on is undefined
        t, q = (b - a if word == 0 else a - b), 0.0
    return radius * _forward(t), radius * p, radius * _forward(q)


@njit(cache=True, error_model="numpy")
def segment_sign(word: int, segment: int) -> int:
    """Sign of the curvature of a word's segment, 0 on the straight."""
    return _SIGNS[word][segment]


@njit(cache=True, error_model="numpy")
def _forward(angle: float) -> float:
    """The angle in [0, 2 pi); what is a full turn but for rounding is none."""
    turned = angle % _TURN
    return 0.0 if turned > _TURN - 1e-9 else turned
