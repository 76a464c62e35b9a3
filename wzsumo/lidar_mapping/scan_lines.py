"""Kernels of `features`: which points of the scan lines are edges, planar points, smooth points or middles of posts.

A scan line holds the returns of one ring in the order of their azimuth columns.
"""

import numpy as np
from numba import njit

from wzsumo.frames import BoolArray, FloatArray, IntArray

HALF_WINDOW = 5  # neighbours on either side that a curvature is computed from; Zhang & Singh's program
MAX_GAP_STEPS = 4  # azimuth steps between neighbours of one line: drop-out leaves holes. Chosen by us
RANGE_JUMP_SHARE = 0.05  # of the range; a larger jump between neighbours separates two things. Chosen by us
MAX_POST_WIDTH_M = 0.6  # drums are 18 in = 0.46 m wide, MUTCD 6K.07; the rest is an azimuth step at a long range
NEITHER, EDGE, POST, PLANAR, SMOOTH = 0, 1, 2, 3, 4


@njit(cache=True, error_model="numpy", nogil=True)
def classify_lines(
    points: FloatArray, image: IntArray, standing: BoolArray, counts: IntArray,
    limits: FloatArray, kind: IntArray, place: FloatArray,
) -> None:  # fmt: skip
    """Fill `kind` (n,) and, for posts, `place` (n, 3). `image` (rings, columns) holds the index of each point, -1 for none.

    `counts` = sectors, edges and planar points per sector; `limits` = least curvature of an edge, greatest curvature of a
    planar point, least range [m].
    """
    rings, columns = image.shape
    for ring in range(rings):
        line = np.empty(columns, np.int64)
        column = np.empty(columns, np.int64)
        n = 0
        for col in range(columns):
            if image[ring, col] >= 0:
                line[n], column[n] = image[ring, col], col
                n += 1
        if n <= 2 * HALF_WINDOW:
            continue
        range_ = np.empty(n)
        for k in range(n):
            x, y, z = points[line[k]]
            range_[k] = np.sqrt(x * x + y * y + z * z)
        curvature = _curvature(points, line[:n], column[:n], range_, limits[2])
        _mark_posts(points, line[:n], column[:n], range_, standing, np.array([limits[2], 2 * np.pi / columns]), kind, place)
        for sector in range(counts[0]):
            first, last = n * sector // counts[0], n * (sector + 1) // counts[0]
            _mark_edges(line[first:last], curvature[first:last], standing, counts[1], limits[0], kind)
            _mark_planars(line[first:last], curvature[first:last], counts[2], limits[1], kind)


@njit(cache=True, error_model="numpy", nogil=True)
def _curvature(points: FloatArray, line: IntArray, column: IntArray, range_: FloatArray, min_range: float) -> FloatArray:
    """Curvatures (n,) of one line: |sum over 2 HALF_WINDOW neighbours of (X_j - X_i)| / (2 HALF_WINDOW |X_i|), -1 for none.

    A point has no curvature where its window holds a jump in range or a gap: what the sensor sees beside a jump changes with
    the sensor's place (Zhang & Singh 2014, Fig. 4).
    """
    n = len(line)
    curvature = np.full(n, -1.0)
    summed = np.zeros((n + 1, 3))  # cumulative sum of the points
    last_jump = np.full(n, -1)  # index of the last jump or gap up to each point
    for k in range(n):
        for a in range(3):
            summed[k + 1, a] = summed[k, a] + points[line[k], a]
        if k > 0:
            jump = abs(range_[k] - range_[k - 1]) > RANGE_JUMP_SHARE * min(range_[k], range_[k - 1])
            last_jump[k] = k if jump or column[k] - column[k - 1] > MAX_GAP_STEPS else last_jump[k - 1]
    for k in range(HALF_WINDOW, n - HALF_WINDOW):
        if range_[k] < min_range or last_jump[k + HALF_WINDOW] > k - HALF_WINDOW:
            continue
        square = 0.0
        for a in range(3):
            square += (
                summed[k + HALF_WINDOW + 1, a] - summed[k - HALF_WINDOW, a] - (2 * HALF_WINDOW + 1) * points[line[k], a]
            ) ** 2
        curvature[k] = np.sqrt(square) / (2 * HALF_WINDOW * range_[k])
    return curvature


@njit(cache=True, error_model="numpy", nogil=True)
def _mark_posts(
    points: FloatArray, line: IntArray, column: IntArray, range_: FloatArray, standing: BoolArray,
    limits: FloatArray, kind: IntArray, place: FloatArray,
) -> None:  # fmt: skip
    """Mark the middle of each narrow run of standing points in front of a farther background.

    `limits` = least range [m], azimuth step [rad]. A run over m azimuth steps is taken for m steps wide, a run of one point for
    half a step, because the rays on both sides missed it. The axis lies half the width behind the run's surface.
    """
    n = len(line)
    first = 0
    for k in range(1, n + 1):
        connected = k < n and column[k] - column[k - 1] <= MAX_GAP_STEPS
        if connected and abs(range_[k] - range_[k - 1]) <= RANGE_JUMP_SHARE * min(range_[k], range_[k - 1]):
            continue
        last = k - 1
        middle = (first + last) // 2
        steps = column[last] - column[first] + 1 if last > first else 0.5
        width = steps * limits[1] * range_[middle]
        free_before = first == 0 or column[first] - column[first - 1] > MAX_GAP_STEPS or range_[first - 1] > range_[first]
        free_behind = k == n or column[k] - column[last] > MAX_GAP_STEPS or range_[k] > range_[last]
        narrow = width < MAX_POST_WIDTH_M and range_[middle] > limits[0]
        if narrow and free_before and free_behind and standing[line[middle]]:
            kind[line[middle]] = POST
            towards = np.empty(3)
            for a in range(3):
                towards[a] = points[line[first], a] / range_[first] + points[line[last], a] / range_[last]
            towards *= (range_[middle] + width / 2) / np.sqrt(np.sum(towards**2))
            place[line[middle]] = towards
        first = k


@njit(cache=True, error_model="numpy", nogil=True)
def _mark_edges(
    line: IntArray, curvature: FloatArray, standing: BoolArray, count: int, limit: float,
    kind: IntArray,
) -> None:  # fmt: skip
    """Mark the sharpest standing points of a sector, up to `count`. Neighbours may both be edges: a far cone has few points."""
    for _ in range(count):
        sharpest = -1
        for k in range(len(line)):
            sharper = curvature[k] >= limit and (sharpest < 0 or curvature[k] > curvature[sharpest])
            if sharper and standing[line[k]] and kind[line[k]] == NEITHER:
                sharpest = k
        if sharpest < 0:
            break
        kind[line[sharpest]] = EDGE


@njit(cache=True, error_model="numpy", nogil=True)
def _mark_planars(line: IntArray, curvature: FloatArray, count: int, limit: float, kind: IntArray) -> None:
    """Mark all smooth points of a sector; up to `count` of the flattest, farther apart than HALF_WINDOW, are planar."""
    for k in range(len(line)):
        if 0 <= curvature[k] <= limit and kind[line[k]] == NEITHER:
            kind[line[k]] = SMOOTH
    blocked = np.zeros(len(line), np.bool_)
    for _ in range(count):
        flattest = -1
        for k in range(len(line)):
            if kind[line[k]] == SMOOTH and not blocked[k] and (flattest < 0 or curvature[k] < curvature[flattest]):
                flattest = k
        if flattest < 0:
            break
        kind[line[flattest]] = PLANAR
        blocked[max(flattest - HALF_WINDOW, 0) : flattest + HALF_WINDOW + 1] = True
