"""What each point of a scan's lines is: sharp, flat, smooth, or the middle of a post; kernels of `features`."""

import numpy as np
from numba import njit

from wzsumo.frames import BoolArray, FloatArray, IntArray

SIDE = 5  # neighbours to either side that the curvature is taken over, as in the authors' own program
LARGEST_GAP = 4  # azimuth steps between neighbours that still count as one line; drop-out leaves holes
STEP_SHARE = 0.05  # a jump in range beyond this share of it hides what is behind, or is seen almost edge on
WIDEST_POST_M = 0.6  # of what is taken for a post: drums are 18 in wide, MUTCD 6K.07
NEITHER, EDGE, POST, PLANAR, SMOOTH = 0, 1, 2, 3, 4


@njit(cache=True, error_model="numpy", nogil=True)
def classify_lines(
    points: FloatArray, image: IntArray, standing: BoolArray, numbers: IntArray,
    limits: FloatArray, kind: IntArray, place: FloatArray,
) -> None:  # fmt: skip
    """Fill `kind` (n,) and, of posts, `place` (n, 3). `image` (rings, columns) holds the number of each point, -1 for none.

    `numbers` = sectors, edges and planars a sector; `limits` = sharpest, smoothest curvature, nearest range [m].
    """
    rings, columns = image.shape
    for ring in range(rings):
        line = np.empty(columns, np.int64)
        at = np.empty(columns, np.int64)
        n = 0
        for col in range(columns):
            if image[ring, col] >= 0:
                line[n], at[n] = image[ring, col], col
                n += 1
        if n <= 2 * SIDE:
            continue
        reach = np.empty(n)
        for k in range(n):
            x, y, z = points[line[k]]
            reach[k] = np.sqrt(x * x + y * y + z * z)
        curvature = _curvature(points, line[:n], at[:n], reach, limits[2])
        _mark_posts(points, line[:n], at[:n], reach, standing, np.array([limits[2], 2 * np.pi / columns]), kind, place)
        for sector in range(numbers[0]):
            first, last = n * sector // numbers[0], n * (sector + 1) // numbers[0]
            _mark_edges(line[first:last], curvature[first:last], standing, numbers[1], limits[0], kind)
            _mark_planars(line[first:last], curvature[first:last], numbers[2], limits[1], kind)


@njit(cache=True, error_model="numpy", nogil=True)
def _curvature(points: FloatArray, line: IntArray, at: IntArray, reach: FloatArray, nearest: float) -> FloatArray:
    """|sum over 2 SIDE neighbours of (X_j - X_i)| / (2 SIDE |X_i|) along one line; -1 where it says nothing.

    Beside a step in range it says nothing: what is hidden behind the step, and what of the nearer thing is seen, changes
    with the place of the sensor.
    """
    n = len(line)
    curvature = np.full(n, -1.0)
    summed = np.zeros((n + 1, 3))  # up to each point; a window's sum is a difference of two
    step = np.full(n, -1)  # the last step in range up to each point
    for k in range(n):
        for a in range(3):
            summed[k + 1, a] = summed[k, a] + points[line[k], a]
        if k > 0:
            jump = abs(reach[k] - reach[k - 1]) > STEP_SHARE * min(reach[k], reach[k - 1])
            step[k] = k if jump or at[k] - at[k - 1] > LARGEST_GAP else step[k - 1]
    for k in range(SIDE, n - SIDE):
        if reach[k] < nearest or step[k + SIDE] > k - SIDE:
            continue
        square = 0.0
        for a in range(3):
            square += (summed[k + SIDE + 1, a] - summed[k - SIDE, a] - (2 * SIDE + 1) * points[line[k], a]) ** 2
        curvature[k] = np.sqrt(square) / (2 * SIDE * reach[k])
    return curvature


@njit(cache=True, error_model="numpy", nogil=True)
def _mark_posts(
    points: FloatArray, line: IntArray, at: IntArray, reach: FloatArray, standing: BoolArray,
    limits: FloatArray, kind: IntArray, place: FloatArray,
) -> None:  # fmt: skip
    """Mark the middle of each narrow run of standing points before a farther background; `limits` = range, azimuth step.

    A run of m points covers m azimuth steps on average, half of them is the way from its nearest point to the axis. Of one
    point alone it is known that the thing was not missed, so that it is thinner than that: half a step on average.
    """
    n = len(line)
    first = 0
    for k in range(1, n + 1):
        inside = k < n and at[k] - at[k - 1] <= LARGEST_GAP
        if inside and abs(reach[k] - reach[k - 1]) <= STEP_SHARE * min(reach[k], reach[k - 1]):
            continue
        last = k - 1
        middle = (first + last) // 2
        steps = at[last] - at[first] + 1 if last > first else 0.5
        width = steps * limits[1] * reach[middle]
        before = first == 0 or at[first] - at[first - 1] > LARGEST_GAP or reach[first - 1] > reach[first]
        behind = k == n or at[k] - at[last] > LARGEST_GAP or reach[k] > reach[last]
        if width < WIDEST_POST_M and before and behind and reach[middle] > limits[0] and standing[line[middle]]:
            kind[line[middle]] = POST
            towards = np.empty(3)
            for a in range(3):
                towards[a] = points[line[first], a] / reach[first] + points[line[last], a] / reach[last]
            towards *= (reach[middle] + width / 2) / np.sqrt(np.sum(towards**2))
            place[line[middle]] = towards
        first = k


@njit(cache=True, error_model="numpy", nogil=True)
def _mark_edges(
    line: IntArray, curvature: FloatArray, standing: BoolArray, count: int, limit: float,
    kind: IntArray,
) -> None:  # fmt: skip
    """Mark the sharpest standing points of a sector, neighbours too: a far cone is two or three points on a line."""
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
    """Mark all smooth points of a sector, and the flattest as planars, no two of these within SIDE of each other."""
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
        blocked[max(flattest - SIDE, 0) : flattest + SIDE + 1] = True
