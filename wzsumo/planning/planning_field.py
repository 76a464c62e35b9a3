"""PlanningField: what all plans to one goal on one map share, whatever the start."""

import time
from dataclasses import dataclass

import numpy as np

from wzsumo.errors import MapError
from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.footprint import POINT_BODY, Body, inscribed_radius, outline_body
from wzsumo.planning.heuristic import cost_to_go
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.terrain import Terrain, terrain_of
from wzsumo.vehicle import VehicleGeometry

MAX_CELLS = 40_000_000  # 16 bytes a cell while planning: 0.6 GB
MEASURED_CLEARANCE_M = 1.5  # clearance is measured up to here
Pose = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanningField:
    """Distances, costs and the cost to go to one goal."""

    grid: OccupancyGrid
    goal: Pose
    vehicle: VehicleGeometry
    spec: PlannerSpec
    body: Body
    terrain: Terrain
    cost_to_go: FieldArray  # (rows + 2, cols + 2)
    timings_ms: dict[str, float]  # distance_field, heuristic


def prepare(
    grid: OccupancyGrid, *, goal: Pose, vehicle: VehicleGeometry, spec: PlannerSpec, guide: FloatArray | None = None
) -> PlanningField:
    """The field of a goal pose (x [m], y [m], heading [rad]) of the REAR AXLE, and of a guide (n, 2, 2) where there is one.

    Raises MapError where the goal lies off the map or the map is too large.
    """
    refuse_off_map(grid, goal, name="goal")
    if grid.p_occupied.size > MAX_CELLS:
        rows, cols = grid.shape
        raise MapError(
            f"a map of {rows} x {cols} = {rows * cols} cells is too large to plan on (at most {MAX_CELLS}); "
            "crop it to the road or use a coarser resolution"
        )
    began = time.perf_counter()
    outline = outline_body(vehicle)
    body = POINT_BODY if spec.body == "point" else outline
    reach = max(inscribed_radius(body) + spec.preferred_clearance_m, outline.disc_radius + MEASURED_CLEARANCE_M)
    terrain = terrain_of(grid, body=body, spec=spec, reach_m=reach + grid.resolution, guide=guide)
    measured = time.perf_counter()
    (row,), (col,) = grid.cell_of(goal[:2])
    remaining = cost_to_go(
        terrain.multiplier, dearest=spec.dearest_metre, goal_cell=(int(row), int(col)), resolution=terrain.resolution
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
