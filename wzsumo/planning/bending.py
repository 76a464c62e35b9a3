"""Bending of a line of evenly spaced points: the banded linear system that makes its third differences small.

The sum of squared third differences stands for the change of curvature along the line. With data term W, points p, targets q
and third differences D, the line minimises (p - q)' W (p - q) + stiffness |D p|^2.
Source: Whittaker, On a New Method of Graduation, 1923.
"""

import math
from collections.abc import Sequence

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray

BANDWIDTH = 3  # of the matrix D'D below its diagonal


def stiffness_of(wavelength_m: float, step_m: float) -> float:
    """The weight of the squared third differences that damps waves shorter than `wavelength_m` to less than half."""
    return float((wavelength_m / (2 * math.pi * step_m)) ** (2 * BANDWIDTH))


def end_chords(headings: Sequence[float] | FloatArray, step_m: float) -> FloatArray:
    """Chords (2, 2) [m] from the point before to the point after either end of a line with these headings (2,) there."""
    return 2 * step_m * np.array([[math.cos(heading), math.sin(heading)] for heading in headings])


@njit(cache=True, error_model="numpy")
def bending_matrix(n: int) -> FloatArray:
    """Lower band (n, 4) of D'D: [i, k] = (D'D)[i, i - k], D the third differences -1, 3, -3, 1 of the line.

    At each end one more difference reaches to a mirror point beyond it. The chord from there to the point inside is given, so
    that the heading at the end is kept and the curvature is free.
    """
    band = np.zeros((n, BANDWIDTH + 1))
    factors = (-1.0, 3.0, -3.0, 1.0)
    for first in range(n - BANDWIDTH):
        for one in range(4):
            for other in range(one + 1):
                band[first + one, one - other] += factors[one] * factors[other]
    for end, beside in ((1, 2), (n - 2, n - 3)):
        band[end, 0] += 16.0
        band[beside, 0] += 1.0
        band[max(end, beside), 1] -= 4.0
    return band


@njit(cache=True, error_model="numpy")
def add_bending(line: FloatArray, first_chord: float, last_chord: float, stiffness: float, pull: FloatArray) -> None:
    """Add to the pull on one coordinate what straightens the line: minus the gradient of half the squared differences.

    `first_chord` and `last_chord` are that coordinate of the chords over either end.
    """
    n = len(line)
    bend = stiffness * (line[2] - 4 * line[1] + 3 * line[0] + first_chord)
    pull[1] += 4 * bend
    pull[2] -= bend
    for i in range(n - BANDWIDTH):
        bend = stiffness * (line[i + 3] - 3 * line[i + 2] + 3 * line[i + 1] - line[i])
        pull[i] += bend
        pull[i + 1] -= 3 * bend
        pull[i + 2] += 3 * bend
        pull[i + 3] -= bend
    bend = stiffness * (4 * line[n - 2] + last_chord - 3 * line[n - 1] - line[n - 3])
    pull[n - 2] -= 4 * bend
    pull[n - 3] += bend


@njit(cache=True, error_model="numpy")
def factorise(band: FloatArray, weights: FloatArray, stiffness: float, lower: FloatArray) -> None:
    """Fill in the Cholesky factor L of W + stiffness D'D for the inner points: lower[i, k] = L[i, i - k]."""
    for i in range(1, len(weights) - 1):
        inner = min(i - 1, BANDWIDTH)
        for back in range(inner, -1, -1):
            value = stiffness * band[i, back]
            for further in range(back + 1, inner + 1):
                value -= lower[i, further] * lower[i - back, further - back]
            lower[i, back] = value / lower[i - back, 0] if back > 0 else math.sqrt(value + weights[i])


@njit(cache=True, error_model="numpy")
def move_line(line: FloatArray, pull: FloatArray, lower: FloatArray, step: FloatArray) -> float:
    """The largest move [m] of the inner points, of which one coordinate is moved to where pull and bending balance."""
    n, moved = len(line), 0.0
    for i in range(1, n - 1):
        value = pull[i]
        for back in range(1, min(i - 1, BANDWIDTH) + 1):
            value -= lower[i, back] * step[i - back]
        step[i] = value / lower[i, 0]
    for i in range(n - 2, 0, -1):
        value = step[i]
        for ahead in range(1, min(n - 2 - i, BANDWIDTH) + 1):
            value -= lower[i + ahead, ahead] * step[i + ahead]
        step[i] = value / lower[i, 0]
        line[i] += step[i]
        moved = max(moved, abs(step[i]))
    return moved
