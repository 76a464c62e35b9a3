"""Where a trace steps aside: estimates of edges and bumps along its course, free of its receiver's bias.

A trace's offset from the lanes that it drove in is a level that walks at random (the receiver's slow error) plus noise.
Filtered from the front, the level at a cell is what all cells up to it say;
filtered from the back, what all cells from it on say. An
**edge** over a gap of cells is the difference of the two across the gap, whatever the course does in between; a **bump** is the
mean within the gap above the mean of the two. Their variances follow from the filters. What is left is scaled by the trace's
own scatter, the median of all its edges.
"""

from dataclasses import dataclass

import numba
import numpy as np

from wzsumo.frames import BoolArray, FloatArray, IntArray
from wzsumo.live.ground import Ground
from wzsumo.live.trace.decoding import Places, Ways
from wzsumo.live.trace.reading import WANDER_SD_M, Reading, walk_of

EDGE_GAPS = (0, 2, 4, 8, 12)  # cells; sharp, and tapers of up to 300 m
BUMP_GAPS = (2, 3, 5)  # cells; a row of devices of 60 m that was moved, and longer ones
N_SHAPES = len(EDGE_GAPS) + len(BUMP_GAPS)
CHANGE_SD_M = 0.35  # of the offset by which a lane change differs from a lane's width
OWN_WALK = 0.4  # weight of a trace's own estimate beside the usual one
LEAST_WALK = 0.0004  # [m^2] a cell
AGREED = 0.75  # of the ways' weight, which must agree on a cell for it to count
MARGIN = 16  # cells beside closed ground, where many change lanes, in which the closed lane has no chart of its own
USUAL_WEIGHT = 4.0  # cells' worth, of the usual scatter beside a trace's own


@dataclass(frozen=True, kw_only=True, eq=False)
class Steps:
    """Estimates (shapes, m) [m] of edges and bumps that begin behind a cell, and variances, infinite where there is none.

    `lane` (shapes, m): in which lane the trace drove before and behind, -1 where that is not sure. `residual` (m,) [m] is the
    offset from the lanes, nan where it is not known; `walk` [m^2] is the
    variance of its change from cell to cell as estimated.
    """

    estimate: FloatArray
    variance: FloatArray
    lane: IntArray
    residual: FloatArray
    scatter: float
    walk: float


def steps_of(ground: Ground, reading: Reading, ways: Ways, *, usual_walk: float, usual_scatter: float) -> Steps:
    """Where the trace steps aside. `usual_walk` [m^2] is the usual change of errors from cell to cell; `usual_scatter`
    is that of other traces, 1 where their variances are as the model says.
    """
    residual, shown, lane = _residuals(reading.offset, reading.seen, ways.places, ways.weights, ground.width, ground.n_lanes)
    noise = reading.white**2 + 3 * WANDER_SD_M**2 / 2
    own = walk_of(residual, shown, reading.white)
    own = usual_walk if np.isnan(own) else own
    walk = max(OWN_WALK * own + (1 - OWN_WALK) * usual_walk, LEAST_WALK)
    estimate, variance, lanes = _steps(
        residual, shown, lane, noise, walk, np.array(EDGE_GAPS), np.array(BUMP_GAPS), ground.closed
    )
    scatter = _scatter(estimate[: len(EDGE_GAPS)], variance[: len(EDGE_GAPS)], usual_scatter)
    return Steps(
        estimate=estimate,
        variance=variance * scatter,
        lane=lanes,
        residual=np.where(shown, residual, np.nan),
        scatter=scatter,
        walk=own,
    )


@numba.njit(cache=True, nogil=True)
def _residuals(  # noqa: C901 - one pass over ways and cells
    y: FloatArray, seen: BoolArray, ways: Places, weights: FloatArray, width: float, n_lanes: int
) -> tuple[FloatArray, BoolArray, IntArray]:
    """(offsets from the lanes of the way that the others agree with most, whether they agree, lanes driven in or -1).

    Ways that run beside each other all along, a lane apart, agree: which of them is true does not matter for steps.
    """
    n, m = ways.shape
    reach = 3 * n_lanes
    best, best_score = 0, -1.0
    for i in range(n):
        score = 0.0
        for j in range(n):
            for t in range(m):
                if ways[i, t] == ways[j, t]:
                    score += weights[j]
        if score > best_score:
            best, best_score = i, score
    shift = np.zeros(n, dtype=np.int64)
    for i in range(n):
        count = np.zeros(2 * reach + 1, dtype=np.int64)
        for t in range(m):
            if ways[i, t] >= 0:
                count[ways[i, t] - ways[best, t] + reach] += 1
        shift[i] = np.argmax(count) - reach
    residual, shown, lane = np.zeros(m), np.zeros(m, dtype=np.bool_), -np.ones(m, dtype=np.int64)
    for t in range(m):
        place = ways[best, t]
        if place < 0:
            continue
        agree, same = 0.0, 0.0
        for i in range(n):
            if ways[i, t] - place == shift[i]:
                agree += weights[i]
            if ways[i, t] == place:
                same += weights[i]
        if place % 3 == 0 and same >= AGREED:
            lane[t] = place // 3
        residual[t] = y[t] - place * width / 3
        shown[t] = seen[t] and place % 3 == 0 and agree >= AGREED
    # A change of lanes between two cells is told to the filters by the lane of the reference way.
    for t in range(m):
        if lane[t] < 0 and ways[best, t] >= 0 and ways[best, t] % 3 == 0:
            lane[t] = -2 - ways[best, t] // 3
    return residual, shown, lane


@numba.njit(cache=True, nogil=True)
def _steps(
    y: FloatArray,
    shown: BoolArray,
    lane: IntArray,
    noise: float,
    walk: float,
    edges: IntArray,
    bumps: IntArray,
    closed: BoolArray,
) -> tuple[FloatArray, FloatArray, IntArray]:
    m = len(y)
    way = np.where(lane >= 0, lane, -2 - lane)
    near_closed = _near(closed)
    front, front_var = _filter(y, shown, way, noise, walk)
    back, back_var = _filter(y[::-1], shown[::-1], way[::-1], noise, walk)
    back, back_var = back[::-1], back_var[::-1]
    n_edges = len(edges)
    estimate = np.zeros((n_edges + len(bumps), m))
    variance = np.full((n_edges + len(bumps), m), np.inf)
    lanes = -np.ones((n_edges + len(bumps), m), dtype=np.int64)
    for shape in range(n_edges + len(bumps)):
        is_edge = shape < n_edges
        gap = edges[shape] if is_edge else bumps[shape - n_edges]
        for t in range(m - gap - 1):
            u = t + gap + 1
            if front_var[t] > 5.0 or back_var[u] > 5.0:
                continue
            change = CHANGE_SD_M**2 if way[t] != way[u] else 0.0
            if is_edge:
                estimate[shape, t] = back[u] - front[t]
                variance[shape, t] = front_var[t] + back_var[u] + walk * (gap + 1) + change
            elif change == 0.0:
                total, n = 0.0, 0
                for k in range(t + 1, u):
                    if shown[k] and way[k] == way[t]:
                        total += y[k]
                        n += 1
                if n == 0:
                    continue
                estimate[shape, t] = total / n - 0.5 * (front[t] + back[u])
                variance[shape, t] = noise / n + 0.25 * (front_var[t] + back_var[u]) + walk * (gap + 1) / 4
            if lane[t] >= 0 and lane[t] == lane[u] and not near_closed[lane[t], t : u + 1].any():
                lanes[shape, t] = lane[t]
    return estimate, variance, lanes


@numba.njit(cache=True, nogil=True)
def _near(closed: BoolArray) -> BoolArray:
    """Closed ground, and MARGIN cells ahead of it and behind it: there many change into the lane or out of it."""
    near = closed.copy()
    for lane in range(closed.shape[0]):
        for t in range(closed.shape[1]):
            if closed[lane, t]:
                near[lane, max(t - MARGIN, 0) : t + MARGIN + 1] = True
    return near


@numba.njit(cache=True, nogil=True)
def _filter(y: FloatArray, shown: BoolArray, way: IntArray, noise: float, walk: float) -> tuple[FloatArray, FloatArray]:
    """Levels (m,) that the cells up to each one say, and their variances."""
    m = len(y)
    level, variance = np.zeros(m), np.full(m, 1e6)
    now, var, before = 0.0, 1e6, -9
    for t in range(m):
        var = min(var + walk, 1e6)
        if shown[t]:
            if before >= 0 and way[t] != before:
                var += CHANGE_SD_M**2
            before = way[t]
            gain = var / (var + noise)
            now += gain * (y[t] - now)
            var *= 1 - gain
        level[t], variance[t] = now, var
    return level, variance


@numba.njit(cache=True, nogil=True)
def _scatter(estimate: FloatArray, variance: FloatArray, usual: float) -> float:
    """Variance of a trace's edges in units of what its filters say, from the median of their squares."""
    squares = np.empty(estimate.size)
    n = 0
    for i in range(estimate.shape[0]):
        for t in range(estimate.shape[1]):
            if variance[i, t] < 1e5:
                squares[n] = estimate[i, t] ** 2 / variance[i, t]
                n += 1
    if n < 10:
        return usual
    own = np.median(squares[:n]) / 0.4549
    weight = n / estimate.shape[0] / 4.0
    return max((weight * own + USUAL_WEIGHT * usual) / (weight + USUAL_WEIGHT), 0.3)
