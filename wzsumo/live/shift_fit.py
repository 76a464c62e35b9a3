"""By how much lanes have moved, from where to where: the trapezoid that explains the offsets of some traces best."""

from dataclasses import dataclass

import numba
import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.live.ground import Ground
from wzsumo.live.trace.recent import Recent

RAMPS = (0, 2, 4, 8, 12)  # cells
SEARCH = 5  # cells to each side of where the charts saw an edge
MARGIN = 24  # cells beside the stretch that tell where the lanes were before
UNSURE_NATS = 2.0  # behind the best fit: two standard deviations


@dataclass(frozen=True, kw_only=True, eq=False)
class Shift:
    """Lanes moved by `size` [m] to the left between `start` and `end` [m], the middles of its two ramps; with deviations.

    `profile` (m,) [m] is the shift at the cells, `gain` [nats] how much better the traces are explained than without it.
    """

    size: float
    size_sd: float
    gain: float
    start: float
    start_sd: float
    end: float
    end_sd: float
    start_ramp: float
    end_ramp: float
    profile: FloatArray

    def at(self, stations: FloatArray) -> FloatArray:
        """The shift (n,) [m] at stations."""
        return _trapezoid(stations, self.start, self.start_ramp, self.end, self.end_ramp) * self.size


def fit_shift(
    ground: Ground, traces: Recent, *, lane: int | None, edges: tuple[int, int | None], positive: bool
) -> Shift | None:
    """The shift that traces show near edges at two cells (None: the second one is anywhere behind); None where it is nil.

    With a lane, only its users count.
    """
    first, last = edges
    m = len(ground.cells)
    if last is None:
        ends: list[float] = [*np.arange(first + 2.0, m - 1.0, 4.0), m + 2.0 * max(RAMPS)]
    else:
        ends = list(np.arange(max(first + 1, last - SEARCH), last + SEARCH + 1.0))
    starts = np.arange(first - SEARCH, first + SEARCH + 1.0)
    ramps = [(a, b) for a in RAMPS for b in RAMPS if last is not None or a == b != 2]
    candidates = np.array(
        [(s, r[0], e, r[1]) for s in starts for e in ends for r in ramps if e - s >= max(2.0, (r[0] + r[1]) / 2)]
    )
    if not len(candidates):
        return None
    low, high = max(0, first - SEARCH - MARGIN), min(m, int(m if last is None else last + SEARCH + MARGIN))
    offsets = np.array([np.where(trace.in_lane[lane] > 0.5, trace.residual, np.nan) if lane is not None else trace.residual
                        for trace in traces])[:, low:high]  # fmt: skip
    noise, walk = np.array([trace.noise for trace in traces]), np.array([trace.walk for trace in traces])
    index = np.arange(m, dtype=float)
    shapes = _trapezoid(index[low:high], *(candidates[:, column, None] for column in range(4)))
    score, information = _scores(offsets, np.isfinite(offsets), noise, walk, shapes)
    size = score / np.maximum(information, 1e-9)
    gain = np.where((size > 0) == positive, 0.5 * score * size, 0.0)
    best = int(np.argmax(gain))
    if gain[best] <= 0:
        return None
    near = gain > gain[best] - UNSURE_NATS
    spread = [float(np.ptp(candidates[near, column])) / 4 + 0.3 for column in (0, 2)]
    start, start_ramp, end, end_ramp = candidates[best]
    spacing, origin = ground.spacing, ground.cells[0]
    return Shift(
        size=float(size[best]), size_sd=float(1 / np.sqrt(information[best])), gain=float(gain[best]),
        start=float(origin + spacing * start),
        start_sd=spacing * spread[0], end=float(origin + spacing * end), end_sd=spacing * spread[1],
        start_ramp=float(spacing * start_ramp), end_ramp=float(spacing * end_ramp),
        profile=float(size[best]) * _trapezoid(index, *candidates[best]),
    )  # fmt: skip


Number = float | FloatArray


def _trapezoid(at: FloatArray, start: Number, start_ramp: Number, end: Number, end_ramp: Number) -> FloatArray:
    """Trapezoids of height 1 (..., n), broadcast."""
    up = np.clip((at - start) / np.maximum(start_ramp, 1e-6) + 0.5, 0.0, 1.0)
    down = np.clip((end - at) / np.maximum(end_ramp, 1e-6) + 0.5, 0.0, 1.0)
    return np.asarray(np.minimum(up, down))


@numba.njit(cache=True, nogil=True)
def _scores(
    y: FloatArray, shown: BoolArray, noise: FloatArray, walk: FloatArray, shapes: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Score and information of the size of each shape, traces having unknown levels that walk at random."""
    n, m = y.shape
    score, information = np.zeros(len(shapes)), np.zeros(len(shapes))
    for c in range(len(shapes)):
        for i in range(n):
            var, level, of_shape = 1e6, 0.0, 0.0
            for t in range(m):
                var += walk[i]
                if shown[i, t]:
                    total = var + noise[i]
                    new, new_shape = y[i, t] - level, shapes[c, t] - of_shape
                    if var < 1e5:
                        score[c] += new * new_shape / total
                        information[c] += new_shape * new_shape / total
                    gain = var / total
                    level += gain * new
                    of_shape += gain * new_shape
                    var *= 1 - gain
    return score, information
