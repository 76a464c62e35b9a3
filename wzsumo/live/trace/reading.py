"""What one trace says: its offsets cell by cell, and how its own receiver scatters."""

from dataclasses import dataclass

import numba
import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.live.ground import Ground

WANDER_SD_M = 0.25  # of a driver's place in the lane, 0.2 to 0.4 m in naturalistic driving
WILD_SDS = 4.0  # a cell farther than this from the median of five neighbours is left out: multipath, a jump
LAG = 6  # cells apart, over which the slow part of the error is read off
RAMP_CELLS = 5  # ahead of where a trace is beside the lanes, in which it leaves them
MIN_CELLS = 4  # a shorter trace says nothing
LONG_VEHICLE_M = 7.0  # from this length on, a truck or a bus
MAX_OFFSET_M = 60.0  # from the lanes: beyond, a fix is on another road


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """One trace on the cells of a ground.

    `offset` (m,) [m] from lane 0's middle, `found` (m,) where there is one, `seen` (m,) where it
    counts for the lanes: it is not wild, and not on a ramp. `white` [m] the sd of noise that is new from cell to cell, `walk`
    [m^2] the variance of the error's change from one cell to the next, as estimated: it may be negative. `kind` is 1 for
    a long vehicle, else 0. `first` and `last` are the first and last cell with a fix.
    """

    offset: FloatArray
    found: BoolArray
    seen: BoolArray
    white: float
    walk: float
    kind: int
    first: int
    last: int
    seconds_per_m: float
    start_s: float
    end_s: float


def read_trace(
    ground: Ground, stations: FloatArray, offsets: FloatArray, times: FloatArray, *, length: float | None = None
) -> Reading | None:
    """What a trace with fixes (n,) in order of time says of the ground; None where it is not on it, or too short."""
    sideways = ground.lane_offsets(stations, offsets)
    low = ground.cells[0] - ground.spacing / 2
    y, count, white, walk, first, last, pace = _read(
        stations, sideways, times, low, ground.spacing, len(ground.cells), ground.width * (ground.n_lanes - 1)
    )
    if np.count_nonzero(count) < MIN_CELLS:
        return None
    found = count > 0
    _drop_wild(y, count, max(white, 0.1))
    _drop_ramps(y, count, ground.width, ground.n_lanes)
    if np.count_nonzero(count) < MIN_CELLS:
        return None
    return Reading(
        offset=y, found=found, seen=count > 0, white=white, walk=walk,
        kind=int(length is not None and length >= LONG_VEHICLE_M),
        first=first, last=last, seconds_per_m=pace, start_s=float(times[0]), end_s=float(times[-1]),
    )  # fmt: skip


@numba.njit(cache=True, nogil=True)
def _read(
    s: FloatArray, d: FloatArray, time: FloatArray, low: float, spacing: float, m: int, across: float
) -> tuple[FloatArray, FloatArray, float, float, int, int, float]:
    total, count = np.zeros(m), np.zeros(m)
    first_time, last_time = 0.0, 0.0
    first, last = m, -1
    for i in range(len(s)):
        cell = int(np.floor((s[i] - low) / spacing))
        if 0 <= cell < m and -MAX_OFFSET_M < d[i] < across + MAX_OFFSET_M:
            total[cell] += d[i]
            count[cell] += 1
            if cell < first:
                first, first_time = cell, time[i]
            if cell > last:
                last, last_time = cell, time[i]
    for t in range(m):
        if count[t] > 0:
            total[t] /= count[t]
    white, walk = _scatter(total, count)
    length = max(last - first, 1) * spacing
    return total, count, white, walk, first, last, max(last_time - first_time, 0.0) / length


@numba.njit(cache=True, nogil=True)
def _scatter(y: FloatArray, count: FloatArray) -> tuple[float, float]:
    """(white [m], walk [m^2]): of medians of second differences, and of squared changes over LAG cells."""
    at = np.nonzero(count)[0]
    k = len(at)
    if k < 5:
        return 0.3, np.nan
    second = np.empty(k - 2)
    for i in range(1, k - 1):
        share = (at[i] - at[i - 1]) / (at[i + 1] - at[i - 1])
        middle = y[at[i - 1]] + share * (y[at[i + 1]] - y[at[i - 1]])
        second[i - 1] = abs(y[at[i]] - middle) / np.sqrt(1 + share**2 + (1 - share) ** 2)
    white = 1.4826 * np.median(second)
    return white, walk_of(y, count > 0, white)


@numba.njit(cache=True, nogil=True)
def walk_of(y: FloatArray, seen: BoolArray, white: float) -> float:
    """Variance [m^2] of a series' change from cell to cell, less its noise; of a median, it may be negative; nan: too short."""
    at = np.nonzero(seen)[0]
    k = len(at)
    if k < 5:
        return np.nan
    mean_gap = (at[-1] - at[0]) / (k - 1)
    apart = min(max(int(LAG / mean_gap + 0.5), 1), k // 3)
    change = np.empty(k - apart)
    for i in range(k - apart):
        change[i] = (y[at[i + apart]] - y[at[i]]) ** 2 / (at[i + apart] - at[i])
    far = 2.198 * np.median(change)  # the median of a squared normal variate is 0.4549 of its variance
    return far - 2 * white**2 / (mean_gap * apart)


@numba.njit(cache=True, nogil=True)
def _drop_wild(y: FloatArray, count: FloatArray, white: float) -> None:
    at = np.nonzero(count)[0]
    k = len(at)
    wild = np.zeros(k, dtype=np.bool_)
    window = np.empty(5)
    for i in range(k):
        a = min(max(i - 2, 0), max(k - 5, 0))
        n = min(5, k - a)
        for j in range(n):
            window[j] = y[at[a + j]]
        wild[i] = abs(y[at[i]] - np.median(window[:n])) > WILD_SDS * white + 0.8
    for i in range(k):
        if wild[i]:
            count[at[i]] = 0


@numba.njit(cache=True, nogil=True)
def _drop_ramps(y: FloatArray, count: FloatArray, width: float, n_lanes: int) -> None:
    """Drop the cells at the ends of a trace that lie a lane's width and more beyond the lanes, and RAMP_CELLS more."""
    at = np.nonzero(count)[0]
    k = len(at)
    low, high = -width, n_lanes * width
    last = k
    while last > 0 and not low < y[at[last - 1]] < high:
        last -= 1
    first = 0
    while first < last and not low < y[at[first]] < high:
        first += 1
    for i in range(k):
        if (last < k and at[i] > at[max(last - 1, 0)] - RAMP_CELLS) or (
            first > 0 and at[i] < at[min(first, k - 1)] + RAMP_CELLS
        ):
            count[at[i]] = 0
