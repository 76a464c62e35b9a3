"""Charts of the lanes' shape: for each place, shape and size of a step, in all lanes together and in each lane."""

from dataclasses import dataclass, replace

import numba
import numpy as np
import numpy.typing as npt

from wzsumo.frames import FloatArray, IntArray
from wzsumo.live.charts.evidence import ODD_SHARE, bounded
from wzsumo.live.ground import Ground
from wzsumo.live.trace.shape import EDGE_GAPS, N_SHAPES, Steps

FORGOTTEN_AFTER = 300  # traces: what grew for longer without an alarm is a habit
SIZES_M = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)  # of steps that are looked for, positive to the left
HABIT_SD_M = 0.2  # of steps that drivers and decoder show at a place although nothing changed: corners cut, places to merge
YOUNG_INFORMATION = 100.0  # 1/m^2: a place at which less is known (sd of 0.1 m) learns from every trace
DEAD_SDS = 1.5  # of the map's own error: a step that small is none
SPENT_CELLS = 4  # to each side of a place where evidence was not confirmed
LEARNED_BELOW = 1.0  # nats: while no chart of a place says more, what traces show there belongs to the map
LEARNED_SDS = 2.0  # from the habit, beyond which a trace is learned as if it lay there
MOST_INFORMATION = 2000.0  # 1/m^2 that is remembered about the map's own error
SQUARES_RATE = 0.005  # of the running mean of squares at a place, so slow that a change passes unnoticed
MOST_SQUARE = 9.0
SCATTER_RATE = 0.02  # of the running mean of traces' scatter

Counts = npt.NDArray[np.int32]


@dataclass(frozen=True, kw_only=True, eq=False)
class ShapeCharts:
    """Evidence (charts, shapes, sizes, m) [nats]; charts are the lanes, and behind them all lanes together.

    `since` holds the number of the trace behind which the evidence began to grow. `known` (charts, shapes, m, 2) are sums of
    estimate / variance and 1 / variance of traces that showed the map's own error, `pending` of those since. `squares`
    (shapes, m) is how much traces scatter at a place, in units of what they say themselves.
    """

    evidence: FloatArray
    since: Counts
    known: FloatArray
    pending: FloatArray
    squares: FloatArray
    usual_scatter: float


def first_shape_charts(ground: Ground) -> ShapeCharts:
    """Charts of a map that no trace has been compared with yet."""
    m, charts = len(ground.cells), ground.n_lanes + 1
    evidence = np.zeros((charts, N_SHAPES, len(SIZES_M), m))
    known = np.zeros((charts, N_SHAPES, m, 2))
    known[..., 1] = 1 / (2 * ground.edge_sd**2 + HABIT_SD_M**2)
    return ShapeCharts(
        evidence=evidence, since=np.zeros(evidence.shape, dtype=np.int32), known=known, pending=np.zeros_like(known),
        squares=np.ones((N_SHAPES, m)), usual_scatter=1.0,
    )  # fmt: skip


def add_steps(charts: ShapeCharts, steps: Steps, *, alike: float, number: int) -> ShapeCharts:
    """The charts after trace `number`, which does as the one before did with a chance of `alike`."""
    evidence, since, known = charts.evidence.copy(), charts.since.copy(), charts.known.copy()
    pending, squares = charts.pending.copy(), charts.squares.copy()
    _add(steps.estimate, steps.variance, steps.lane, np.array(SIZES_M), evidence, since, known, pending, squares,
         ODD_SHARE + (1 - ODD_SHARE) * alike, number)  # fmt: skip
    usual = charts.usual_scatter + SCATTER_RATE * (min(steps.scatter, 4.0) - charts.usual_scatter)
    return ShapeCharts(evidence=evidence, since=since, known=known, pending=pending, squares=squares, usual_scatter=usual)


@numba.njit(cache=True, nogil=True)
def _add(  # noqa: C901 - one pass over places and sizes
    estimate: FloatArray, variance: FloatArray, lane: IntArray, sizes: FloatArray, evidence: FloatArray, since: Counts,
    known: FloatArray, pending: FloatArray, squares: FloatArray, odd: float, number: int,
) -> None:  # fmt: skip
    n_charts, n_shapes, n_sizes, m = evidence.shape
    for shape in range(n_shapes):
        for t in range(m):
            var = variance[shape, t]
            if var > 1e5:
                continue
            var *= max(squares[shape, t], 1.0)
            for chart in (n_charts - 1, lane[shape, t]):
                if chart < 0:
                    continue
                map_error = known[chart, shape, t, 0] / known[chart, shape, t, 1]
                dead = DEAD_SDS / np.sqrt(known[chart, shape, t, 1])
                apart = estimate[shape, t] - map_error
                most = 0.0
                for i in range(n_sizes):
                    a = sizes[i]
                    value = evidence[chart, shape, i, t]
                    none = dead if a > 0 else -dead
                    if dead > 0.8 * abs(a):
                        value = 0.0
                    else:
                        ratio = ((a - none) * apart - 0.5 * (a * a - none * none)) / var
                        if value > 0 or ratio > 0:
                            value = value + bounded(ratio, odd)
                    if value <= 0 or number - since[chart, shape, i, t] > FORGOTTEN_AFTER:
                        value = 0.0
                        since[chart, shape, i, t] = number
                    evidence[chart, shape, i, t] = value
                    most = max(most, value)
                # Habits are learned without wild traces: what lies far off counts as lying at the border.
                border = LEARNED_SDS * np.sqrt(var + 1 / known[chart, shape, t, 1])
                pending[chart, shape, t, 0] += (map_error + min(max(apart, -border), border)) / var
                pending[chart, shape, t, 1] += 1 / var
                if most < LEARNED_BELOW or known[chart, shape, t, 1] < YOUNG_INFORMATION:
                    known[chart, shape, t] += pending[chart, shape, t]
                    pending[chart, shape, t] = 0.0
                    if known[chart, shape, t, 1] > MOST_INFORMATION:
                        known[chart, shape, t] *= MOST_INFORMATION / known[chart, shape, t, 1]
                if chart == n_charts - 1:
                    square = min(apart * apart / variance[shape, t], MOST_SQUARE)
                    squares[shape, t] += SQUARES_RATE * (square - squares[shape, t])


def without_evidence(charts: ShapeCharts, cells: tuple[int, ...], *, number: int) -> ShapeCharts:
    """The charts with the evidence around some cells spent, and what was kept aside there learned as habit."""
    evidence, since, known, pending = charts.evidence.copy(), charts.since.copy(), charts.known.copy(), charts.pending.copy()
    for cell in cells:
        near = slice(max(cell - SPENT_CELLS, 0), cell + SPENT_CELLS + 1)
        evidence[..., near], since[..., near] = 0.0, number
        known[:, :, near] += pending[:, :, near]
        pending[:, :, near] = 0.0
    return replace(charts, evidence=evidence, since=since, known=known, pending=pending)


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What one family of charts says loudest: its evidence [nats] and where it stands, as indices into the charts."""

    evidence: float
    chart: int
    shape: int
    size: int
    cell: int
    other_cell: int  # of the second edge of a pair, else -1


def loudest_step(charts: ShapeCharts) -> Finding:
    """The loudest single edge or bump."""
    flat = int(np.argmax(charts.evidence))
    chart, shape, size, cell = np.unravel_index(flat, charts.evidence.shape)
    return Finding(
        evidence=float(charts.evidence.flat[flat]), chart=int(chart), shape=int(shape), size=int(size), cell=int(cell),
        other_cell=-1,
    )  # fmt: skip


def loudest_pair(charts: ShapeCharts) -> Finding:
    """The loudest stretch that is moved as a whole: an edge, and behind it one of the same size back."""
    best, chart, shape, size, cell, other = _pair(charts.evidence[:, : len(EDGE_GAPS)], np.array(EDGE_GAPS))
    return Finding(evidence=best, chart=chart, shape=shape, size=size, cell=cell, other_cell=other)


@numba.njit(cache=True, nogil=True)
def _pair(evidence: FloatArray, gaps: IntArray) -> tuple[float, int, int, int, int, int]:
    n_charts, n_shapes, n_sizes, m = evidence.shape
    best, at = 0.0, (0, 0, 0, 0, 0)
    for chart in range(n_charts):
        for shape in range(n_shapes):
            for size in range(n_sizes):
                back = n_sizes - 1 - size  # the size of the opposite sign
                high, high_at = 0.0, 0
                for t in range(gaps[shape] + 1, m):
                    first = evidence[chart, shape, size, t - gaps[shape] - 1]
                    if first > high:
                        high, high_at = first, t - gaps[shape] - 1
                    both = high + evidence[chart, shape, back, t]
                    if high > 0 and evidence[chart, shape, back, t] > 0 and both > best:
                        best, at = both, (chart, shape, size, high_at, t)
    return best, at[0], at[1], at[2], at[3], at[4]
