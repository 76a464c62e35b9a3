"""Observations: lateral offsets of traces at common stations, how much each says, and how its receiver scatters."""

from dataclasses import dataclass, replace
from functools import cached_property

import numba
import numpy as np
import pandas as pd

from wzsumo.frames import BoolArray, FloatArray, IntArray
from wzsumo.road import Road

SPACING_M = 20.0  # of the stations: a lane change takes 60 m and more
MAX_STATIONS = 400  # on longer roads the stations lie farther apart
FEWEST_STATIONS = 10  # on shorter roads they lie nearer
WANDER_LENGTH_M = 60.0  # over which a driver's place in the lane is correlated (lateral position studies: 1 to 3 s)
WANDER_SD_M = 0.25  # of a driver's place in the lane, 0.2 to 0.4 m in naturalistic driving
MAX_BRIDGE_M = 45.0  # between two fixes, over which a trace is taken to be straight: 1.5 s at 30 m/s
MAX_OFFSET_M = 60.0  # from the axis: beyond, a fix is on another road


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """`offset` (traces, stations) [m] and the weight `eta` in (0, 1] of each, 0 where a trace has no fix nearby.

    `variance` (traces, stations) [m^2] is that of wander and white noise; `speed` (traces,) [m/s] the median while it moves;
    `ids` name the traces. A fix of a trace far from its neighbours counts at its nearest station.
    """

    axis: Road
    stations: FloatArray
    offset: FloatArray
    eta: FloatArray
    variance: FloatArray
    speed: FloatArray
    slowness: FloatArray  # (traces, stations) [s/m] time spent per metre around each station
    stated_sd: FloatArray  # (traces,) [m] of positions, as receivers state it; NaN where they do not
    ids: tuple[str, ...]

    @property
    def spacing(self) -> float:
        """Distance [m] between stations."""
        return float(self.stations[1] - self.stations[0])

    @cached_property
    def reached(self) -> BoolArray:
        """Which stations (traces, stations) a trace drove: from its first fix to its last, those between two fixes too."""
        seen = self.eta > 0
        return np.asarray(np.logical_or.accumulate(seen, axis=1) & np.logical_or.accumulate(seen[:, ::-1], axis=1)[:, ::-1])

    def of(self, chosen: IntArray | BoolArray) -> "Observations":
        """Those of some of the traces, by number or by mask."""
        return replace(
            self,
            offset=self.offset[chosen],
            eta=self.eta[chosen],
            variance=self.variance[chosen],
            speed=self.speed[chosen],
            slowness=self.slowness[chosen],
            stated_sd=self.stated_sd[chosen],
            ids=tuple(str(name) for name in np.asarray(self.ids)[chosen]),
        )


def observe(traces: pd.DataFrame, axis: Road) -> Observations:
    """Observations of a checked trace table, sorted by vehicle and time, on an axis."""
    s, d = axis.to_sd(traces[["x_m", "y_m"]].to_numpy())
    near = np.abs(d - np.median(d)) < MAX_OFFSET_M
    code, ids = pd.factorize(traces["vehicle_id"])
    low, high = np.quantile(s[near], [0.001, 0.999])
    spacing = max(min(SPACING_M, (high - low) / FEWEST_STATIONS), (high - low) / MAX_STATIONS)
    stations = low + spacing * (np.arange(max(2, int(np.ceil((high - low) / spacing)) + 1)))
    shape = (len(ids), len(stations))
    offset, eta, slowness = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    white, speed = np.zeros(len(ids)), np.zeros(len(ids))
    first = np.searchsorted(code, np.arange(len(ids) + 1))
    time = traces["time_s"].to_numpy(dtype=float)
    _tabulate(s, d, time, near, first, stations, offset, eta, slowness, white, speed)
    variance = np.repeat(WANDER_SD_M**2 + white[:, None] ** 2, shape[1], axis=1)
    return Observations(
        axis=axis, stations=stations, offset=offset, eta=eta, variance=variance, speed=speed, slowness=slowness,
        stated_sd=_stated_sd(traces, code, len(ids)),
        ids=tuple(str(name) for name in ids),
    )  # fmt: skip


def _stated_sd(traces: pd.DataFrame, code: IntArray, n: int) -> FloatArray:
    """Median (n,) [m] of what each receiver states of its error."""
    if "position_sd_m" not in traces:
        return np.full(n, np.nan)
    return traces["position_sd_m"].groupby(code).median().reindex(range(n)).to_numpy(dtype=float)


@numba.njit(cache=True, nogil=True)
def _tabulate(
    s: FloatArray, d: FloatArray, time: FloatArray, near: BoolArray, first: IntArray, stations: FloatArray, offset: FloatArray,
    eta: FloatArray, slowness: FloatArray, white: FloatArray, speed: FloatArray,
) -> None:  # fmt: skip
    """Fill the arrays, trace by trace."""
    spacing = stations[1] - stations[0]
    n_stations = len(stations)
    for i in range(len(first) - 1):
        a, b = first[i], first[i + 1]
        # Thin out: means over cells of half a spacing, in the order of the stations.
        cell_s, cell_d, _, cell_t = _cells(s[a:b], d[a:b], time[a:b], near[a:b], spacing / 2, stations[0], n_stations)
        k = len(cell_s)
        speed[i] = _median_speed(s[a:b], d[a:b], time[a:b])
        if k == 0:
            continue
        white[i] = _white_noise(cell_s, cell_d)
        for t in range(n_stations):
            at = stations[t]
            right = np.searchsorted(cell_s, at)
            left = right - 1
            if left >= 0 and right < k and cell_s[right] - cell_s[left] <= max(MAX_BRIDGE_M, spacing):
                share = (at - cell_s[left]) / (cell_s[right] - cell_s[left])
                offset[i, t] = cell_d[left] + share * (cell_d[right] - cell_d[left])
                eta[i, t] = min(1.0, spacing / WANDER_LENGTH_M)
                slowness[i, t] = (cell_t[right] - cell_t[left]) / (cell_s[right] - cell_s[left])
            else:
                best = -1
                for c in (left, right):
                    near_enough = 0 <= c < k and -spacing / 2 <= cell_s[c] - at < spacing / 2
                    if near_enough and (best < 0 or abs(cell_s[c] - at) < abs(cell_s[best] - at)):
                        best = c
                if best >= 0:
                    offset[i, t] = cell_d[best]
                    gap = 1e9
                    if best > 0:
                        gap = min(gap, cell_s[best] - cell_s[best - 1])
                    if best < k - 1:
                        gap = min(gap, cell_s[best + 1] - cell_s[best])
                    eta[i, t] = min(1.0, max(spacing, gap) / WANDER_LENGTH_M)
                    slowness[i, t] = 0.0


@numba.njit(cache=True, nogil=True)
def _cells(
    s: FloatArray, d: FloatArray, time: FloatArray, near: BoolArray, size: float, origin: float, n_stations: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """(stations, offsets, counts, times) of the means of fixes in cells of `size` [m], by station."""
    n_cells = int(np.ceil((n_stations + 1) * 2)) + 4
    total = np.zeros((n_cells, 3))
    count = np.zeros(n_cells)
    for j in range(len(s)):
        if near[j]:
            cell = int(np.floor((s[j] - origin) / size)) + 2
            if 0 <= cell < n_cells:
                total[cell, 0] += s[j]
                total[cell, 1] += d[j]
                total[cell, 2] += time[j]
                count[cell] += 1
    kept = np.nonzero(count)[0]
    return total[kept, 0] / count[kept], total[kept, 1] / count[kept], count[kept], total[kept, 2] / count[kept]


@numba.njit(cache=True, nogil=True)
def _white_noise(s: FloatArray, d: FloatArray) -> float:
    """Robust sd [m] of what is independent from cell to cell: second differences (variance 6 r) of neighbours."""
    k = len(s)
    size = np.empty(max(k - 2, 0))
    n = 0
    for j in range(1, k - 1):
        if s[j + 1] - s[j - 1] < 4 * MAX_BRIDGE_M:
            share = (s[j] - s[j - 1]) / (s[j + 1] - s[j - 1])
            middle = d[j - 1] + share * (d[j + 1] - d[j - 1])
            size[n] = abs(d[j] - middle) / np.sqrt(1 + share**2 + (1 - share) ** 2)
            n += 1
    if n < 5:
        return 0.3
    return 1.4826 * np.median(size[:n])


@numba.njit(cache=True, nogil=True)
def _median_speed(s: FloatArray, d: FloatArray, time: FloatArray) -> float:
    """Median speed [m/s] over steps of some seconds in which the vehicle moves; 10 m/s where none is known."""
    steps = np.empty(len(s))
    n = 0
    last = 0
    for j in range(1, len(s)):
        elapsed = time[j] - time[last]
        if elapsed >= 1.0:
            v = np.hypot(s[j] - s[last], d[j] - d[last]) / elapsed
            if v > 1.0:
                steps[n] = v
                n += 1
            last = j
    return np.median(steps[:n]) if n else 10.0


def cumulated_course(observations: Observations) -> FloatArray:
    """A course (stations,) [m] that follows the median step of the traces from station to station, and returns to its start."""
    offset, at = observations.offset.copy(), observations.stations
    for of_trace, seen in zip(offset, observations.eta > 0, strict=True):
        if seen.any():
            of_trace[~seen] = np.interp(at[~seen], at[seen], of_trace[seen])
    both = observations.reached[:, 1:] & observations.reached[:, :-1]
    step = np.where(both, np.diff(offset, axis=1), np.nan)
    median = np.zeros(step.shape[1])
    some = both.any(axis=0)
    median[some] = np.nanmedian(step[:, some], axis=0)
    course = np.r_[0.0, np.cumsum(median)]
    return np.asarray(course - np.linspace(0, course[-1], len(course)))
