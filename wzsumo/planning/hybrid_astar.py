# ruff: noqa: PLR0917  (kernels take many plain arguments by position)
"""Hybrid A*: best-first search over arcs of the rear axle, with continuous poses and states told apart by bins.

Sources: Dolgov, Thrun, Montemerlo and Diebel, Path Planning for Autonomous Vehicles in Unknown Semi-structured Environments,
IJRR 2010; weighted A*: Pohl 1970. Kernels work in metres from the map's lower-left corner.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.planning.connection import connect
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.footprint import pose_is_free

FOUND, EXHAUSTED, LIMIT_REACHED = range(3)
IntArray = npt.NDArray[np.int64]


class Lattice(NamedTuple):
    """How the search steps and what a step costs beyond its length times the multiplier. Lengths in metres."""

    curvatures: FloatArray  # (k,) 1/m, of the arcs tried at each state
    step_m: float  # length of an arc
    check_m: float  # distance between checked poses
    xy_bin_m: float  # states in one bin of position and heading count as one
    heading_bin: float  # rad
    turn_cost: float  # an arc at the curvature limit costs 1 + turn_cost times its length
    change_cost_m: float  # of a change of curvature as large as the limit
    goal_range_m: float  # from here on each state is tried to be joined with the goal


def search(
    field: FieldArray,
    multiplier: FieldArray,
    cost_to_go: FieldArray,
    *,
    resolution: float,
    body: FloatArray,
    margin: float,
    start: FloatArray,
    goal: FloatArray,
    lattice: Lattice,
    weight: float,
    max_expansions: int,
) -> tuple[int, int, FloatArray]:
    """(FOUND, EXHAUSTED or LIMIT_REACHED, expansions, segments (n, 2): length [m] and curvature [1/m] from the start).

    `start` and `goal` are poses (3,) in metres from the map's corner; `weight` >= 1 is what the heuristic counts for.
    """
    return _search(field, multiplier, cost_to_go, resolution, body, margin, start, goal, lattice, weight, max_expansions)


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _search(  # noqa: C901
    field: FieldArray,
    multiplier: FieldArray,
    cost_to_go: FieldArray,
    resolution: float,
    body: FloatArray,
    margin: float,
    start: FloatArray,
    goal: FloatArray,
    lattice: Lattice,
    weight: float,
    max_expansions: int,
) -> tuple[int, int, FloatArray]:
    curvatures = lattice.curvatures
    n_checks = max(1, math.ceil(lattice.step_m / lattice.check_m - 1e-9))
    arcs = _arcs(curvatures, lattice.step_m, n_checks)
    sharpest = np.abs(curvatures).max()
    capacity = 4096
    poses, cost = np.empty((capacity, 3)), np.empty(capacity)
    parent, arc_of = np.empty(capacity, dtype=np.int64), np.empty(capacity, dtype=np.int64)
    closed = np.zeros(capacity, dtype=np.bool_)
    slots = 4 * capacity
    keys, holder = np.full(slots, -1, dtype=np.int64), np.empty(slots, dtype=np.int64)
    queue_cost, queue_node = np.empty(4 * capacity), np.empty(4 * capacity, dtype=np.int64)
    poses[0], cost[0], parent[0], arc_of[0] = start, 0.0, -1, -1
    key = _key(start[0], start[1], start[2], lattice.xy_bin_m, lattice.heading_bin)
    slot = _slot(keys, key)
    keys[slot], holder[slot] = key, 0
    n_nodes, n_queue, n_expansions = 1, 1, 0
    queue_cost[0], queue_node[0] = 0.0, 0
    # A finished way ends with the segments that join its last state with the goal; only the best one so far is kept.
    best_total, best_last = math.inf, -1
    best_segments = np.zeros((3, 2))
    while n_queue > 0:
        if queue_cost[0] >= best_total:
            break
        node = queue_node[0]
        n_queue = _pop(queue_cost, queue_node, n_queue)
        if closed[node]:
            continue
        if n_expansions >= max_expansions:
            if best_last >= 0:
                break
            return LIMIT_REACHED, n_expansions, np.zeros((0, 2))
        x, y, heading = poses[node]
        closed[node] = True
        n_expansions += 1
        last_curvature = curvatures[arc_of[node]] if arc_of[node] >= 0 else 0.0
        if math.hypot(goal[0] - x, goal[1] - y) <= lattice.goal_range_m:
            extra, segments = connect(
                field, multiplier, resolution, body, margin, poses[node], goal, curvatures, lattice.check_m, lattice.turn_cost,
                lattice.change_cost_m, last_curvature, best_total - cost[node],
            )  # fmt: skip
            if cost[node] + extra < best_total:
                best_total, best_last, best_segments = cost[node] + extra, node, segments
        cos, sin = math.cos(heading), math.sin(heading)
        for arc in range(len(curvatures)):
            curvature = curvatures[arc]
            travelled = 0.0
            to_x, to_y, to_heading = x, y, heading
            for check in range(n_checks):
                to_x = x + cos * arcs[arc, check, 0] - sin * arcs[arc, check, 1]
                to_y = y + sin * arcs[arc, check, 0] + cos * arcs[arc, check, 1]
                to_heading = heading + arcs[arc, check, 2]
                if not pose_is_free(field, resolution, to_x, to_y, to_heading, body, margin):
                    travelled = math.inf
                    break
                travelled += multiplier[int(to_y / resolution), int(to_x / resolution)]
            if travelled == math.inf:
                continue
            onward = cost_to_go[int(to_y / resolution), int(to_x / resolution)]
            step_cost = travelled * lattice.step_m / n_checks * (1 + lattice.turn_cost * (curvature / sharpest) ** 2)
            reached = cost[node] + step_cost + lattice.change_cost_m * abs(curvature - last_curvature) / sharpest
            if not reached + onward < best_total:
                continue
            key = _key(to_x, to_y, to_heading, lattice.xy_bin_m, lattice.heading_bin)
            slot = _slot(keys, key)
            if keys[slot] == key:
                known = holder[slot]
                if closed[known] or cost[known] <= reached:
                    continue
                closed[known] = True
            if n_nodes == capacity:
                capacity *= 2
                poses, cost, parent = _grown_rows(poses), _grown(cost), _grown(parent)
                arc_of, closed = _grown(arc_of), _grown(closed)
            keys[slot], holder[slot] = key, n_nodes
            poses[n_nodes, 0], poses[n_nodes, 1], poses[n_nodes, 2] = to_x, to_y, to_heading
            cost[n_nodes], parent[n_nodes], arc_of[n_nodes], closed[n_nodes] = reached, node, arc, False
            if n_queue == len(queue_cost):
                queue_cost, queue_node = _grown(queue_cost), _grown(queue_node)
            n_queue = _push(queue_cost, queue_node, n_queue, reached + weight * onward, n_nodes)
            n_nodes += 1
            if 2 * n_nodes > len(keys):
                keys, holder = _rehashed(keys, holder)
    if best_last < 0:
        return EXHAUSTED, n_expansions, np.zeros((0, 2))
    return FOUND, n_expansions, _segments(parent, arc_of, best_last, curvatures, lattice.step_m, best_segments)


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _arcs(curvatures: FloatArray, step_m: float, n_checks: int) -> FloatArray:
    """Poses (k, n, 3) along each arc from the origin."""
    arcs = np.empty((len(curvatures), n_checks, 3))
    for arc in range(len(curvatures)):
        for check in range(n_checks):
            length = step_m * (check + 1) / n_checks
            turn = curvatures[arc] * length
            # sin(turn) / curvature and (1 - cos(turn)) / curvature, also on a straight.
            half = turn / 2
            chord = length * (math.sin(half) / half if half != 0 else 1.0)
            arcs[arc, check, 0], arcs[arc, check, 1] = chord * math.cos(half), chord * math.sin(half)
            arcs[arc, check, 2] = turn
    return arcs


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _key(x: float, y: float, heading: float, xy_bin_m: float, heading_bin: float) -> int:
    n_headings = math.ceil(2 * math.pi / heading_bin)
    turned = int((heading % (2 * math.pi)) / heading_bin) % n_headings
    return (int(x / xy_bin_m) << 40) | (int(y / xy_bin_m) << 16) | turned


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _slot(keys: IntArray, key: int) -> int:
    """Slot of a key in an open-addressing table: its own, or the free one where it belongs."""
    mask = len(keys) - 1
    # Fibonacci hashing (Knuth, TAOCP 3, 6.4): the high bits of key * 2^64 / golden ratio are well mixed.
    slot = ((key * 7046029254386353131) >> 24) & mask
    while keys[slot] != -1 and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _rehashed(keys: IntArray, holder: IntArray) -> tuple[IntArray, IntArray]:
    wider_keys, wider_holder = np.full(2 * len(keys), -1, dtype=np.int64), np.empty(2 * len(keys), dtype=np.int64)
    for old in range(len(keys)):
        if keys[old] != -1:
            slot = _slot(wider_keys, keys[old])
            wider_keys[slot], wider_holder[slot] = keys[old], holder[old]
    return wider_keys, wider_holder


@njit(cache=True, error_model="numpy")
def _grown(values):  # type: ignore[no-untyped-def]
    wider = np.empty(2 * len(values), dtype=values.dtype)
    wider[: len(values)] = values
    return wider


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _grown_rows(values: FloatArray) -> FloatArray:
    wider = np.empty((2 * len(values), values.shape[1]))
    wider[: len(values)] = values
    return wider


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _push(queue_cost: FloatArray, queue_node: IntArray, size: int, cost: float, node: int) -> int:
    """Size of the binary heap after one more entry."""
    place = size
    while place > 0 and queue_cost[(place - 1) >> 1] > cost:
        queue_cost[place], queue_node[place] = queue_cost[(place - 1) >> 1], queue_node[(place - 1) >> 1]
        place = (place - 1) >> 1
    queue_cost[place], queue_node[place] = cost, node
    return size + 1


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _pop(queue_cost: FloatArray, queue_node: IntArray, size: int) -> int:
    """Size of the binary heap after its first entry is gone."""
    size -= 1
    cost, node = queue_cost[size], queue_node[size]
    place = 0
    while True:
        child = 2 * place + 1
        if child >= size:
            break
        if child + 1 < size and queue_cost[child + 1] < queue_cost[child]:
            child += 1
        if queue_cost[child] >= cost:
            break
        queue_cost[place], queue_node[place] = queue_cost[child], queue_node[child]
        place = child
    queue_cost[place], queue_node[place] = cost, node
    return size


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _segments(
    parent: IntArray, arc_of: IntArray, last: int, curvatures: FloatArray, step_m: float, final: FloatArray
) -> FloatArray:
    n_arcs, node = 0, last
    while parent[node] >= 0:
        n_arcs, node = n_arcs + 1, parent[node]
    segments = np.empty((n_arcs + len(final), 2))
    segments[n_arcs:] = final
    node = last
    for place in range(n_arcs - 1, -1, -1):
        segments[place, 0], segments[place, 1] = step_m, curvatures[arc_of[node]]
        node = parent[node]
    return segments
