"""What it costs at least to drive from a cell to the goal: obstacles, clearance and p(occupied) counted as in the search."""

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from wzsumo.planning.distance_field import FieldArray

IntArray = npt.NDArray[np.int32]


def cost_to_go(multiplier: FieldArray, *, dearest: float, goal_cell: tuple[int, int], resolution: float) -> FieldArray:
    """Least costs (rows + 2, cols + 2) [m, times multiplier] from each cell to the goal's; infinite where there is no way.

    `multiplier` (rows + 2, cols + 2) is what a metre costs, >= 1, infinite where no axle can be and in the border of one cell
    around the map; `dearest` is no less than its largest finite value. The costs solve |grad cost| = multiplier by upwind
    differences: unlike Dijkstra's sums over 8 neighbours, which are up to 8 % too long, they are the same in every direction.
    Buckets take the place of the heap; a cell that improves later is expanded again.
    Sources: Sethian, A Fast Marching Level Set Method, PNAS 1996; Yatziv, Bartesaghi and Sapiro, O(N) implementation of the
    fast marching algorithm, J. Comput. Phys. 212 (2006).
    """
    cost = np.full_like(multiplier, np.inf)
    goal = (goal_cell[0] + 1) * multiplier.shape[1] + goal_cell[1] + 1
    _spread_costs(cost, multiplier, goal, np.float32(resolution), math.ceil(dearest) + 2)
    return cost


@njit(cache=True, error_model="numpy")
def _spread_costs(costs: FieldArray, multiplier: FieldArray, goal: int, resolution: np.float32, n_buckets: int) -> None:
    """Spread the costs, infinite on entry, from the goal's cell, given by its place in the flat array."""
    cols = multiplier.shape[1]
    metre, cost = multiplier.ravel(), costs.ravel()
    per_level = np.float32(1.0) / resolution
    capacity = 1024
    bucket = np.empty(n_buckets * capacity, dtype=np.int32)
    filled = np.zeros(n_buckets, dtype=np.int64)
    cost[goal] = np.float32(0.0)
    bucket[0] = goal
    filled[0] = 1
    waiting, level = 1, 0
    while waiting > 0:
        slot = level % n_buckets
        while filled[slot] > 0:
            filled[slot] -= 1
            waiting -= 1
            cell = bucket[slot * capacity + filled[slot]]
            here = cost[cell]
            if int(here * per_level) < level:
                continue
            for step in (-1, 1, -cols, cols):
                to = cell + step
                if cost[to] <= here or metre[to] == np.inf:
                    continue
                across, along = min(cost[to - 1], cost[to + 1]), min(cost[to - cols], cost[to + cols])
                edge = metre[to] * resolution
                apart = abs(across - along)
                if apart >= edge:
                    reached = min(across, along) + edge
                else:
                    reached = np.float32(0.5) * (across + along + np.sqrt(np.float32(2.0) * edge * edge - apart * apart))
                if reached < cost[to]:
                    cost[to] = reached
                    target = int(reached * per_level) % n_buckets
                    if filled[target] == capacity:
                        bucket = _widened(bucket, n_buckets, capacity)
                        capacity *= 2
                    bucket[target * capacity + filled[target]] = to
                    filled[target] += 1
                    waiting += 1
        level += 1


@njit(cache=True, error_model="numpy")
def _widened(bucket: IntArray, n_buckets: int, capacity: int) -> IntArray:
    """The buckets with twice the capacity."""
    wider = np.empty(2 * len(bucket), dtype=np.int32)
    for index in range(n_buckets):
        for place in range(capacity):
            wider[index * 2 * capacity + place] = bucket[index * capacity + place]
    return wider
