"""PlanningField: what all plans to one goal on one map share: the terrain and the least cost from each cell to the goal."""

import math
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from wzsumo.errors import MapError
from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.footprint import POINT_BODY, Body, inscribed_radius, outline_body
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.terrain import Terrain, terrain_of
from wzsumo.vehicle import VehicleGeometry

MAX_PLANNING_CELLS = 40_000_000  # 16 bytes a cell while planning: 0.6 GB
MEASURED_CLEARANCE_M = 1.5  # the clearance of a path is measured up to here; chosen by us
Pose = tuple[float, float, float]
CellNumbers = npt.NDArray[np.int32]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanningField:
    """The terrain of a map and the cost to go to one goal on it, for one vehicle and one spec."""

    grid: OccupancyGrid
    goal: Pose
    vehicle: VehicleGeometry
    spec: PlannerSpec
    body: Body
    terrain: Terrain
    cost_to_go: FieldArray  # (rows + 2, cols + 2), see the function of that name
    timings_ms: dict[str, float]  # distance_field, heuristic


def terrain_on(
    grid: OccupancyGrid, *, vehicle: VehicleGeometry, spec: PlannerSpec, guide: FloatArray | None
) -> tuple[Terrain, Body]:
    """The terrain of a map and a guide (n, 2, 2), as far as plans and their clearances are concerned, and the body on it."""
    outline = outline_body(vehicle)
    body = POINT_BODY if spec.body == "point" else outline
    reach = max(inscribed_radius(body) + spec.preferred_clearance_m, outline.disc_radius + MEASURED_CLEARANCE_M)
    return terrain_of(grid, body=body, spec=spec, reach_m=reach + grid.resolution, guide=guide), body


def prepare_field(
    grid: OccupancyGrid, *, goal: Pose, vehicle: VehicleGeometry, spec: PlannerSpec, guide: FloatArray | None = None
) -> PlanningField:
    """The field of a goal pose (x [m], y [m], heading [rad]) of the REAR AXLE, and of a guide (n, 2, 2) where there is one.

    Raises MapError where the goal lies off the map or the map is too large.
    """
    refuse_off_map(grid, goal, name="goal")
    if grid.p_occupied.size > MAX_PLANNING_CELLS:
        rows, cols = grid.shape
        raise MapError(
            f"a map of {rows} x {cols} = {rows * cols} cells is too large to plan on (at most {MAX_PLANNING_CELLS}); "
            "crop it to the road or use a coarser resolution"
        )
    began = time.perf_counter()
    terrain, body = terrain_on(grid, vehicle=vehicle, spec=spec, guide=guide)
    measured = time.perf_counter()
    (row,), (col,) = grid.cell_of(goal[:2])
    remaining = cost_to_go(
        terrain.multiplier, max_metre_cost=spec.max_metre_cost, goal_cell=(int(row), int(col)), resolution=terrain.resolution
    )
    done = time.perf_counter()
    return PlanningField(
        grid=grid,
        goal=goal,
        vehicle=vehicle,
        spec=spec,
        body=body,
        terrain=terrain,
        cost_to_go=remaining,
        timings_ms={"distance_field": 1e3 * (measured - began), "heuristic": 1e3 * (done - measured)},
    )


def refuse_off_map(grid: OccupancyGrid, pose: Pose, *, name: str) -> None:
    """Raise MapError where a pose is not finite or lies off the map."""
    if not np.isfinite(pose).all():
        raise MapError(f"{name} ({pose[0]}, {pose[1]}, {pose[2]}) must be finite: x, y [m] and heading [rad]")
    if not grid.contains(pose[:2])[0]:
        x_min, y_min, x_max, y_max = grid.bounds
        raise MapError(
            f"{name} ({pose[0]:.2f}, {pose[1]:.2f}) lies off the map, which covers x {x_min:.2f}..{x_max:.2f}, "
            f"y {y_min:.2f}..{y_max:.2f} m; give a point on it"
        )


def from_corner(grid: OccupancyGrid, pose: Pose) -> FloatArray:
    """Pose (3,) in metres from the map's lower-left corner."""
    return np.array([pose[0] - grid.origin[0], pose[1] - grid.origin[1], pose[2]], dtype=float)


def cost_to_go(multiplier: FieldArray, *, max_metre_cost: float, goal_cell: tuple[int, int], resolution: float) -> FieldArray:
    """Least costs (rows + 2, cols + 2) [m, times multiplier] from each cell to the goal's; infinite where no path leads there.

    They count obstacles, clearance and p(occupied) as the search does, but not the vehicle's turning. `multiplier` (rows + 2,
    cols + 2) is the cost of a metre, >= 1, infinite where no axle can be and in the border of one cell around the map;
    `max_metre_cost` is no less than its largest finite value. The costs solve |grad cost| = multiplier by upwind differences:
    unlike Dijkstra's sums over 8 neighbours, which are up to 8 % too long, they are the same in every direction.
    Buckets take the place of the heap; a cell that improves later is expanded again.
    Sources: Sethian, A Fast Marching Level Set Method, PNAS 1996; Yatziv, Bartesaghi and Sapiro, O(N) implementation of the
    fast marching algorithm, J. Comput. Phys. 212 (2006).
    """
    cost = np.full_like(multiplier, np.inf)
    goal = (goal_cell[0] + 1) * multiplier.shape[1] + goal_cell[1] + 1
    _spread_costs(cost, multiplier, goal, np.float32(resolution), math.ceil(max_metre_cost) + 2)
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
def _widened(bucket: CellNumbers, n_buckets: int, capacity: int) -> CellNumbers:
    """The buckets with twice the capacity."""
    wider = np.empty(2 * len(bucket), dtype=np.int32)
    for index in range(n_buckets):
        for place in range(capacity):
            wider[index * 2 * capacity + place] = bucket[index * capacity + place]
    return wider
