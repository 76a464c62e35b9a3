"""A piecewise linear course through noisy values at equally spaced stations."""

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray

MAX_REWEIGHTINGS = 12
SETTLED_M = 5e-4  # reweighting stops where no value moves by more
MIN_PRECISION_PER_M2 = 1e-9  # of a station without a value: with 0 the equations would lose their rank
MIN_SECOND_DIFFERENCE_M = 1e-4  # a smaller one would weigh without bound


def trend_filter(values: FloatArray, precisions: FloatArray, *, scale: float) -> FloatArray:
    """Piecewise linear course c (n,) through values v (n,) [m] with precisions p (n,) [1/m^2], 0 where unknown.

    Minimises  sum_i p_i (v_i - c_i)^2 / 2 + sum_i |c_i - 2 c_{i+1} + c_{i+2}| / scale  by reweighted least squares
    (Kim, Koh, Boyd and Gorinevsky 2009, "l1 trend filtering").
    """
    n = len(values)
    if n < 3 or not precisions.any():
        return np.array(values, dtype=float)
    return np.asarray(_filter(np.where(precisions > 0, values, 0.0), precisions + MIN_PRECISION_PER_M2, scale))


@njit(cache=True)
def _filter(values: FloatArray, precisions: FloatArray, scale: float) -> FloatArray:
    n = len(values)
    stiffness = np.full(n - 2, 1 / scale**2)
    course = values
    for _ in range(MAX_REWEIGHTINGS):
        before, course = course, _smooth(values, precisions, stiffness)
        if np.abs(course - before).max() < SETTLED_M:
            break
        for i in range(n - 2):
            stiffness[i] = 1 / (scale * max(abs(course[i] - 2 * course[i + 1] + course[i + 2]), MIN_SECOND_DIFFERENCE_M))
    return course


@njit(cache=True)
def _smooth(values: FloatArray, precisions: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Solution c of (P + D' S D) c = P v for second differences D, by the L diag(d) L' factors of the five bands."""
    n = len(values)
    main, first, second = precisions.copy(), np.zeros(n), np.zeros(n)  # bands; `first[i]` couples i and i + 1
    for i in range(n - 2):
        s = stiffness[i]
        main[i] += s
        main[i + 1] += 4 * s
        main[i + 2] += s
        first[i] -= 2 * s
        first[i + 1] -= 2 * s
        second[i] = s
    c = precisions * values
    for i in range(n):
        if i > 1:
            main[i] -= second[i - 2] ** 2 * main[i - 2]
            c[i] -= second[i - 2] * c[i - 2]
        if i > 0:
            main[i] -= first[i - 1] ** 2 * main[i - 1]
            c[i] -= first[i - 1] * c[i - 1]
            first[i] -= first[i - 1] * second[i - 1] * main[i - 1]
        first[i] /= main[i]
        second[i] /= main[i]
    c /= main
    for i in range(n - 2, -1, -1):
        c[i] -= first[i] * c[i + 1]
        if i < n - 2:
            c[i] -= second[i] * c[i + 2]
    return c
