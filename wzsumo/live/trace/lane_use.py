"""How a trace used the lanes: what its ways answer to the questions of the lane charts, with probabilities."""

from dataclasses import dataclass
from functools import lru_cache

import numba
import numpy as np

from wzsumo.frames import FloatArray, IntArray
from wzsumo.live.ground import Ground
from wzsumo.live.trace.decoding import Places, Ways

REACH_M = 400.0  # in which drivers leave a lane ahead of a closure, or return behind it
REACHES_M = (
    REACH_M,
    1000.0,
)  # ahead of a cell, over which it is asked who left the lane: some merge as soon as they read a sign
APPROACH_M = 1000.0  # ahead of a closure or behind it, from where on its lane's users count
MOVED_M = 350.0  # into the closed ground, up to which an end may be moved
MIN_USE_M = 100.0  # driven in closed ground, from where on a vehicle uses it


@dataclass(frozen=True, kw_only=True)
class Windows:
    """Cells: `reach` long the stretch in which lanes are left; `reaches` over which it is asked who left; `approach` and
    `inside` how far ends are followed.
    """

    reach: int
    reaches: tuple[int, ...]
    approach: int
    inside: int
    min_use: int

    @property
    def places(self) -> int:
        """Number of places around an end."""
        return self.approach + self.inside + 1


@lru_cache(maxsize=64)
def windows_of(ground: Ground) -> Windows:
    """The windows in cells of a ground."""
    cells = [max(1, round(length / ground.spacing)) for length in (REACH_M, APPROACH_M, MOVED_M, MIN_USE_M)]
    reaches = tuple(max(1, round(length / ground.spacing)) for length in REACHES_M)
    return Windows(reach=cells[0], reaches=reaches, approach=cells[1], inside=cells[2], min_use=cells[3])


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneUse:
    """`left`, `stayed`, `came` (REACHES, L, m): share of ways that left lane k over a reach ahead of a cell, stayed, or came.

    `leaves` and `enters` (L, places): at which place around the start of the closure ways left the lane for it, and at which
    they came in behind its end; `followed` (2, L, 2): the first and the last of these places that the trace passes.
    `uses` (L,): share that drives on closed ground, -1 where the trace does not pass it.
    """

    left: FloatArray
    stayed: FloatArray
    came: FloatArray
    leaves: FloatArray
    enters: FloatArray
    followed: IntArray
    uses: FloatArray


def use_of_lanes(ground: Ground, ways: Ways) -> LaneUse:
    """How the ways used the lanes."""
    windows = windows_of(ground)
    left, stayed, came, leaves, enters, followed, uses = _use(
        ways.places,
        ways.weights,
        ground.closures,
        np.array(windows.reaches),
        windows.approach,
        windows.inside,
        windows.min_use,
        ground.n_lanes,
    )
    return LaneUse(left=left, stayed=stayed, came=came, leaves=leaves, enters=enters, followed=followed, uses=uses)


@numba.njit(cache=True, nogil=True)
def _use(  # noqa: C901 - the questions share the pass over ways and cells
    ways: Places, weights: FloatArray, ends: IntArray, reaches: IntArray, approach: int, inside: int, min_use: int, n_lanes: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray]:
    n, m = ways.shape
    shape = (len(reaches), n_lanes, m)
    left, stayed, came = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    leaves, enters = np.zeros((n_lanes, approach + inside + 1)), np.zeros((n_lanes, approach + inside + 1))
    uses = -np.ones(n_lanes)
    followed = np.zeros((2, n_lanes, 2), dtype=np.int64)
    passed = np.nonzero(ways[0] >= 0)[0]
    for k in range(n_lanes):
        start, end = ends[k]
        latest, earliest = min(start + inside, end - 1), max(end - inside, start + 1)
        if start >= 0:
            followed[0, k, 0] = max(start - approach, passed[0]) - start + approach
            followed[0, k, 1] = min(latest - 1, passed[-1]) - start + approach
            followed[1, k, 0] = max(earliest + 1, passed[0]) - end + inside
            followed[1, k, 1] = min(end + approach, passed[-1]) - end + inside
        for i in range(n):
            way, part = ways[i], weights[i]
            for j in range(len(reaches)):
                reach = reaches[j]
                for t in range(reach // 4, m):
                    if way[t] < 0:
                        continue
                    a = max(t - reach, 0)
                    while a < t and way[a] < 0:
                        a += 1
                    if t - a < reach // 4:
                        continue
                    was, is_in = abs(way[a] - 3 * k) <= 1, abs(way[t] - 3 * k) <= 1
                    if was and is_in:
                        stayed[j, k, t] += part
                    elif was:
                        left[j, k, t] += part
                    elif is_in:
                        came[j, k, t] += part
            if start < 0:
                continue
            run, longest, passes = 0, 0, False
            for t in range(start + 2, end - 1):
                passes = passes or way[t] >= 0
                run = run + 1 if way[t] >= 0 and abs(way[t] - 3 * k) <= 1 else 0
                longest = max(longest, run)
            if passes:
                uses[k] = max(uses[k], 0.0)
                if longest >= min(min_use, max(end - start - 4, 1)):
                    uses[k] += part
            # Where the way leaves the lane for the closure: its last cell in the lane ahead of the closure's last quarter.
            last = -1
            for t in range(max(start - approach, 0), latest + 1):
                if way[t] >= 0 and abs(way[t] - 3 * k) <= 1:
                    last = t
            if 0 <= last < latest and way[latest] >= 0:
                leaves[k, last - start + approach] += part
            for t in range(earliest, min(end + approach, m - 1) + 1):
                if way[t] >= 0 and abs(way[t] - 3 * k) <= 1:
                    if t > earliest and way[earliest] >= 0:
                        enters[k, t - end + inside] += part
                    break
    return left, stayed, came, leaves, enters, followed, uses
