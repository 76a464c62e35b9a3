"""Ground: the lanes of a map cut into cells along the road, and offsets that count from the middle of its rightmost lane."""

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np

from wzsumo.errors import MapError
from wzsumo.frames import BoolArray, FloatArray, IntArray
from wzsumo.lane_map import LaneMap, MappedBranch

CELL_M = 25.0  # a lane change takes 60 m and more; a vehicle that reports each second leaves a fix in every cell
MAX_CELLS = 400  # on longer roads cells are longer
MAX_LANES = 8
GATE_M = 100.0  # behind where a branch is clear of the lanes, over which a trace shows that its vehicle takes it


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """Cells (m,) [m, their middles] of the axis of `lanes`; `closed` (L, m): the map holds the lane to be closed there.

    `width` [m] is the mean width of a lane; `edge_sd` (m,) [m] is how well the map knows where its lanes lie.
    """

    lanes: LaneMap
    cells: FloatArray
    spacing: float
    width: float
    closed: BoolArray
    edge_sd: FloatArray

    @property
    def n_lanes(self) -> int:
        """Number of lanes."""
        return len(self.closed)

    def lane_offsets(self, stations: FloatArray, offsets: FloatArray) -> FloatArray:
        """Offsets (n,) [m] from the middle of lane 0, as if all lanes were `width` wide and lay straight beside each other."""
        middles = np.array([lane.middle for lane in self.lanes.lanes])
        return _straightened(stations, offsets, self.lanes.stations, middles, self.width)

    @cached_property
    def closures(self) -> IntArray:
        """(first, last) cell (L, 2) of the longest closure of each lane; -1 where it is open all along."""
        found = [self._longest_closure(lane) for lane in range(self.n_lanes)]
        return np.array([(-1, -1) if pair is None else pair for pair in found], dtype=np.int64)

    @cached_property
    def gates(self) -> tuple[tuple[float, float, int] | None, ...]:
        """Where each branch leaves the lanes, see `branch_gate`."""
        return tuple(branch_gate(branch, self.lanes) for branch in self.lanes.branches)

    def _longest_closure(self, lane: int) -> tuple[int, int] | None:
        marks = np.flatnonzero(np.diff(np.r_[False, self.closed[lane], False].astype(int)))
        pairs = [(int(a), int(b) - 1) for a, b in zip(marks[::2], marks[1::2], strict=True)]
        return max(pairs, key=lambda pair: pair[1] - pair[0]) if pairs else None


def ground_of(lanes: LaneMap) -> Ground:
    """The ground of a lane map. Raises MapError where it has no lanes, or more than this package decodes."""
    if not 1 <= len(lanes.lanes) <= MAX_LANES:
        raise MapError(f"a live map needs 1 to {MAX_LANES} lanes (the map has {len(lanes.lanes)})")
    low, high = float(lanes.stations[0]), float(lanes.stations[-1])
    n = int(np.clip(round((high - low) / CELL_M), 8, MAX_CELLS))
    spacing = (high - low) / n
    cells = np.asarray(low + spacing * (np.arange(n) + 0.5), dtype=float)
    at = lanes.stations
    closed = np.array([np.interp(cells, at, lane.p_open_middle) < 0.5 for lane in lanes.lanes])
    width = float(np.mean([np.median(lane.left - lane.right) for lane in lanes.lanes]))
    sd = np.mean([np.interp(cells, at, (lane.right_sd + lane.left_sd) / 2) for lane in lanes.lanes], axis=0)
    return Ground(lanes=lanes, cells=cells, spacing=spacing, width=width, closed=closed, edge_sd=sd)


def branch_gate(branch: MappedBranch, lanes: LaneMap) -> tuple[float, float, int] | None:
    """(station [m] where the branch is beside the lanes, its offset there [m] from lane 0's middle, side); None if it never is.

    The side is -1 to the right and 1 to the left. The gate is where the branch is two lanes' widths beyond the middle of the
    outer lane, or farthest from it; the offset is the median over the GATE_M behind.
    """
    s, d = lanes.axis.to_sd(branch.line)
    right = np.interp(s, lanes.stations, lanes.lanes[0].middle)
    left = np.interp(s, lanes.stations, lanes.lanes[-1].middle)
    width = float(np.median(lanes.lanes[0].left - lanes.lanes[0].right))
    beyond = np.maximum(right - d, d - left)
    if beyond.max() < width:
        return None
    at = int(np.argmax(beyond >= min(2 * width, float(beyond.max()))))
    behind = (s >= s[at]) & (s <= s[at] + GATE_M)
    return float(s[at]), float(np.median((d - right)[behind])), -1 if right[at] > d[at] else 1


@numba.njit(cache=True, nogil=True)
def _straightened(s: FloatArray, d: FloatArray, stations: FloatArray, middles: FloatArray, width: float) -> FloatArray:
    """Offsets (n,) from the first of the lanes' middles (L, stations), as if they lay `width` apart."""
    n_lanes = len(middles)
    straight = np.empty(len(s))
    at = np.empty(n_lanes)
    for i in range(len(s)):
        right = min(max(np.searchsorted(stations, s[i]), 1), len(stations) - 1)
        share = (s[i] - stations[right - 1]) / (stations[right] - stations[right - 1])
        share = min(max(share, 0.0), 1.0)
        for k in range(n_lanes):
            at[k] = middles[k, right - 1] + share * (middles[k, right] - middles[k, right - 1])
        k = 0
        while k < n_lanes - 1 and d[i] >= at[k + 1]:
            k += 1
        if k < n_lanes - 1 and d[i] >= at[0]:
            straight[i] = width * (k + (d[i] - at[k]) / max(at[k + 1] - at[k], 0.1))
        else:
            straight[i] = width * k + d[i] - at[k]
    return straight
