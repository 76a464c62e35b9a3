"""What it costs at least to drive from a cell to the goal: obstacles, clearance and p(occupied) counted as in the search."""

import math

import numpy as np
from numba import njit

from wzsumo.planning.distance_field import FieldArray

UNREACHABLE = np.float32(np.inf)
_DIAGONAL = np.float32(math.sqrt(2))


def cost_to_go(multiplier: FieldArray, *, goal_cell: tuple[int, int], resolution: float) -> FieldArray:
    """Least costs (rows, cols) [m, times multiplier] to the goal's cell over 8 neighbours; infinite where there is no way.

    A step costs its length times the mean `multiplier` (>= 1, infinite in cells that cannot be entered) of its two cells.
    Buckets as wide as the shortest step take the place of a heap: whatever lies in the lowest bucket is final.
    Sources: Dijkstra 1959; Dial, Algorithm 360, Comm. ACM 12 (1969); Dinitz 1978 (the width of the buckets).
    """
    finite = multiplier[np.isfinite(multiplier)]
    dearest = float(finite.max()) if finite.size else 1.0
    n_buckets = math.ceil(math.sqrt(2) * dearest) + 2
    return _cost_to_go(multiplier, goal_cell[0], goal_cell[1], np.float32(resolution), n_buckets)


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _cost_to_go(multiplier: FieldArray, goal_row: int, goal_col: int, resolution: np.float32, n_buckets: int) -> FieldArray:
    rows, cols = multiplier.shape
    cost = np.full((rows, cols), UNREACHABLE, dtype=np.float32)
    capacity = 1024
    bucket = np.empty((n_buckets, capacity), dtype=np.int32)
    filled = np.zeros(n_buckets, dtype=np.int64)
    cost[goal_row, goal_col] = np.float32(0.0)
    bucket[0, 0] = goal_row * cols + goal_col
    filled[0] = 1
    waiting, level = 1, 0
    width = resolution
    while waiting > 0:
        slot = level % n_buckets
        while filled[slot] > 0:
            filled[slot] -= 1
            waiting -= 1
            cell = bucket[slot, filled[slot]]
            row, col = cell // cols, cell % cols
            here = cost[row, col]
            if int(here / width) < level:
                continue
            for d_row in range(-1, 2):
                for d_col in range(-1, 2):
                    if d_row == 0 and d_col == 0:
                        continue
                    to_row, to_col = row + d_row, col + d_col
                    if to_row < 0 or to_col < 0 or to_row >= rows or to_col >= cols:
                        continue
                    length = _DIAGONAL if d_row != 0 and d_col != 0 else np.float32(1.0)
                    reached = here + length * width * np.float32(0.5) * (multiplier[row, col] + multiplier[to_row, to_col])
                    if reached < cost[to_row, to_col]:
                        cost[to_row, to_col] = reached
                        target = int(reached / width) % n_buckets
                        if filled[target] == capacity:
                            wider = np.empty((n_buckets, 2 * capacity), dtype=np.int32)
                            wider[:, :capacity] = bucket
                            bucket, capacity = wider, 2 * capacity
                        bucket[target, filled[target]] = to_row * cols + to_col
                        filled[target] += 1
                        waiting += 1
        level += 1
    return cost
