"""Hybrid A*: best-first search over arcs of the rear axle. Poses are continuous; poses in one bin count as one state.

Kernels work in metres from the map's lower-left corner.
Sources: Dolgov, Thrun, Montemerlo and Diebel, Path Planning for Autonomous Vehicles in Unknown Semi-structured Environments,
IJRR 2010; the weight on the heuristic: Pohl, Heuristic search viewed as path finding in a graph, 1970.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from wzsumo.frames import FloatArray, IntArray
from wzsumo.planning.connection import connect, shortest_length
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.footprint import Body, pose_is_free
from wzsumo.planning.lattice import Lattice
from wzsumo.planning.terrain import Terrain

FOUND, EXHAUSTED, LIMIT_REACHED = range(3)
# After the first connection with the goal the search goes on for some expansions, in which a cheaper path may turn up: few if
# the connection costs about as much as the cost to go, many if it is dearer because it cuts through what the search would go
# round. All five numbers are set on the maps of analysis/benchmarks/planning.py.
_EXTRA_EXPANSIONS_FAIR, _EXTRA_EXPANSIONS_DEAR = 20, 500
_FAIR_COST_RATIO = 1.2  # a connection is fair up to this times the cost to go
_FAIR_COST_EXCESS_M = 2.0  # and this more
_VAIN_CONNECTIONS_PER_SKIP = 16  # after every so many vain connections one more state is passed over before the next
_OPEN, _CLOSED = 0, 1
_NO_KEY = -1


@njit(cache=True, error_model="numpy")
def search(  # noqa: C901 - the loop of A*, with its arrays at hand
    terrain: Terrain,
    cost_to_go: FieldArray,
    body: Body,
    lattice: Lattice,
    start: FloatArray,
    goal: FloatArray,
    weight: float,
    max_expansions: int,
) -> tuple[int, int, FloatArray]:
    """(FOUND, EXHAUSTED or LIMIT_REACHED; expansions; segments (n, 2) from the start: length [m] and curvature [1/m]).

    `start` and `goal` are poses (3,); `weight` >= 1 is the weight of the heuristic.
    """
    arcs = _arcs(lattice)
    capacity = 4096
    xs, ys, headings, costs = np.empty(capacity), np.empty(capacity), np.empty(capacity), np.empty(capacity)
    parents, arc_of = np.empty(capacity, dtype=np.int64), np.empty(capacity, dtype=np.int64)
    states = np.empty(capacity, dtype=np.int64)
    keys, holders = _empty_table(4 * capacity)
    queue_costs, queue_nodes = np.empty(capacity), np.empty(capacity, dtype=np.int64)
    xs[0], ys[0], headings[0], costs[0] = start[0], start[1], start[2], 0.0
    parents[0], arc_of[0], states[0] = -1, -1, _OPEN
    n_nodes = 1
    n_queue = _push(queue_costs, queue_nodes, 0, 0.0, 0)
    n_expansions, n_vain, next_connection, stop_at = 0, 0, 0, max_expansions
    best_total, best_last, best_end = math.inf, -1, np.zeros((3, 2))
    while n_queue > 0 and n_expansions < stop_at and queue_costs[0] < weight * best_total:
        node = queue_nodes[0]
        n_queue = _pop(queue_costs, queue_nodes, n_queue)
        if states[node] == _CLOSED:
            continue
        states[node] = _CLOSED
        n_expansions += 1
        x, y, heading, cost = xs[node], ys[node], headings[node], costs[node]
        last_curvature = lattice.curvatures[arc_of[node]] if node > 0 else 0.0
        near_goal = math.hypot(goal[0] - x, goal[1] - y) <= lattice.goal_range_m
        if near_goal and n_expansions > next_connection:
            extra, end = connect(terrain, body, lattice, x, y, heading, last_curvature, goal, best_total - cost)
            if extra < math.inf:
                promised = float(cost_to_go[int(y / terrain.resolution) + 1, int(x / terrain.resolution) + 1])
                fair = extra <= _FAIR_COST_RATIO * promised + _FAIR_COST_EXCESS_M
                stop_at = min(stop_at, n_expansions + (_EXTRA_EXPANSIONS_FAIR if fair else _EXTRA_EXPANSIONS_DEAR))
                best_total, best_last, best_end = cost + extra, node, end
            else:
                n_vain += 1
                next_connection = n_expansions + n_vain // _VAIN_CONNECTIONS_PER_SKIP
        cos, sin = math.cos(heading), math.sin(heading)
        for arc in range(len(lattice.curvatures)):
            travelled = _cost_of_arc(terrain, body, lattice, arcs, arc, x, y, heading)
            if travelled == math.inf:
                continue
            curvature = lattice.curvatures[arc]
            to_x = x + cos * arcs[arc, -1, 0] - sin * arcs[arc, -1, 1]
            to_y = y + sin * arcs[arc, -1, 0] + cos * arcs[arc, -1, 1]
            to_heading = heading + arcs[arc, -1, 2]
            reached = cost + travelled + lattice.change_cost_m * abs(curvature - last_curvature) / lattice.sharpest
            onward = float(cost_to_go[int(to_y / terrain.resolution) + 1, int(to_x / terrain.resolution) + 1])
            if near_goal:
                onward = max(onward, shortest_length(to_x, to_y, to_heading, goal, 1 / lattice.sharpest))
            if not reached + onward < best_total:
                continue
            key = _key(to_x, to_y, to_heading, lattice)
            slot = _slot(keys, key)
            if keys[slot] == key:
                known = holders[slot]
                if states[known] == _CLOSED or costs[known] <= reached:
                    continue
                states[known] = _CLOSED  # so that its entry in the queue is passed over
            if n_nodes == len(xs):
                xs, ys, headings, costs = _grown(xs), _grown(ys), _grown(headings), _grown(costs)
                parents, arc_of, states = _grown(parents), _grown(arc_of), _grown(states)
            keys[slot], holders[slot] = key, n_nodes
            xs[n_nodes], ys[n_nodes], headings[n_nodes], costs[n_nodes] = to_x, to_y, to_heading, reached
            parents[n_nodes], arc_of[n_nodes], states[n_nodes] = node, arc, _OPEN
            if n_queue == len(queue_costs):
                queue_costs, queue_nodes = _grown(queue_costs), _grown(queue_nodes)
            n_queue = _push(queue_costs, queue_nodes, n_queue, reached + weight * onward, n_nodes)
            n_nodes += 1
            if 2 * n_nodes > len(keys):
                keys, holders = _rehashed(keys, holders)
    if best_last >= 0:
        return FOUND, n_expansions, _segments(parents, arc_of, best_last, lattice, best_end)
    return LIMIT_REACHED if n_queue > 0 else EXHAUSTED, n_expansions, np.zeros((0, 2))


@njit(cache=True, error_model="numpy")
def _arcs(lattice: Lattice) -> FloatArray:
    """Poses (k, n, 3) to be checked along each of k arcs from the origin; the last one is the arc's end."""
    n = max(1, math.ceil(lattice.step_m / lattice.check_m - 1e-9))
    arcs = np.empty((len(lattice.curvatures), n, 3))
    for arc in range(len(lattice.curvatures)):
        for check in range(n):
            length = lattice.step_m * (check + 1) / n
            half = lattice.curvatures[arc] * length / 2
            chord = length * (math.sin(half) / half if half != 0 else 1.0)
            arcs[arc, check, 0], arcs[arc, check, 1], arcs[arc, check, 2] = (
                chord * math.cos(half),
                chord * math.sin(half),
                2 * half,
            )
    return arcs


@njit(cache=True, error_model="numpy")
def _cost_of_arc(
    terrain: Terrain, body: Body, lattice: Lattice, arcs: FloatArray, arc: int, x: float, y: float, heading: float
) -> float:
    """Length times multiplier along an arc, dearer with curvature; infinite where the body touches a blocked cell."""
    cos, sin, resolution = math.cos(heading), math.sin(heading), terrain.resolution
    margin, n, total = lattice.sweep_margin * abs(lattice.curvatures[arc]), arcs.shape[1], 0.0
    for check in range(n):
        to_x = x + cos * arcs[arc, check, 0] - sin * arcs[arc, check, 1]
        to_y = y + sin * arcs[arc, check, 0] + cos * arcs[arc, check, 1]
        to_heading = heading + arcs[arc, check, 2]
        if not pose_is_free(terrain.distance, resolution, body, to_x, to_y, to_heading, margin):
            return math.inf
        total += terrain.multiplier[int(to_y / resolution) + 1, int(to_x / resolution) + 1]
    return total * lattice.step_m / n * (1 + lattice.turn_cost * abs(lattice.curvatures[arc]) / lattice.sharpest)


@njit(cache=True, error_model="numpy")
def _key(x: float, y: float, heading: float, lattice: Lattice) -> int:
    """Number of the bin of position and heading that holds a pose."""
    turned = int((heading % (2 * math.pi)) / lattice.heading_bin)  # below 3600: bins are 0.1 degrees or wider
    return (int(x / lattice.xy_bin_m) << 40) | (int(y / lattice.xy_bin_m) << 16) | turned


@njit(cache=True, error_model="numpy")
def _empty_table(size: int) -> tuple[IntArray, IntArray]:
    """An open-addressing table without entries: keys, and the nodes that hold them. Its size is a power of two."""
    keys, holders = np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64)
    for slot in range(size):
        keys[slot] = _NO_KEY
    return keys, holders


@njit(cache=True, error_model="numpy")
def _slot(keys: IntArray, key: int) -> int:
    """Slot of a key; where the table does not hold it, the free slot that it would take."""
    mask = len(keys) - 1
    # Fibonacci hashing (Knuth, TAOCP 3, 6.4): the high bits of key times 2^64 / golden ratio are well mixed.
    slot = ((key * 7046029254386353131) >> 24) & mask
    while keys[slot] not in (_NO_KEY, key):
        slot = (slot + 1) & mask
    return slot


@njit(cache=True, error_model="numpy")
def _rehashed(keys: IntArray, holders: IntArray) -> tuple[IntArray, IntArray]:
    """The same entries in a table of twice the size."""
    wider_keys, wider_holders = _empty_table(2 * len(keys))
    for old in range(len(keys)):
        if keys[old] != _NO_KEY:
            slot = _slot(wider_keys, keys[old])
            wider_keys[slot], wider_holders[slot] = keys[old], holders[old]
    return wider_keys, wider_holders


@njit(cache=True, error_model="numpy")
def _grown(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The values in an array of twice the length."""
    wider = np.empty(2 * len(values), dtype=values.dtype)
    for index in range(len(values)):
        wider[index] = values[index]
    return wider


@njit(cache=True, error_model="numpy")
def _push(queue_costs: FloatArray, queue_nodes: IntArray, size: int, cost: float, node: int) -> int:
    """Size of the binary heap after one more entry."""
    place = size
    while place > 0:
        above = (place - 1) >> 1
        if queue_costs[above] <= cost:
            break
        queue_costs[place], queue_nodes[place] = queue_costs[above], queue_nodes[above]
        place = above
    queue_costs[place], queue_nodes[place] = cost, node
    return size + 1


@njit(cache=True, error_model="numpy")
def _pop(queue_costs: FloatArray, queue_nodes: IntArray, size: int) -> int:
    """Size of the binary heap after its first entry is gone."""
    size -= 1
    cost, node, place, child = queue_costs[size], queue_nodes[size], 0, 1
    while child < size:
        if child + 1 < size and queue_costs[child + 1] < queue_costs[child]:
            child += 1
        if queue_costs[child] >= cost:
            break
        queue_costs[place], queue_nodes[place] = queue_costs[child], queue_nodes[child]
        place, child = child, 2 * child + 1
    queue_costs[place], queue_nodes[place] = cost, node
    return size


@njit(cache=True, error_model="numpy")
def _segments(parents: IntArray, arc_of: IntArray, last: int, lattice: Lattice, end: FloatArray) -> FloatArray:
    """Segments (n, 2) of the arcs that lead to a node, then the three of the curve that joins it with the goal."""
    n_arcs, node = 0, last
    while parents[node] >= 0:
        n_arcs, node = n_arcs + 1, parents[node]
    segments, node = np.empty((n_arcs + 3, 2)), last
    for place in range(n_arcs - 1, -1, -1):
        segments[place, 0], segments[place, 1] = lattice.step_m, lattice.curvatures[arc_of[node]]
        node = parents[node]
    for place in range(3):
        segments[n_arcs + place, 0], segments[n_arcs + place, 1] = end[place, 0], end[place, 1]
    return segments
