"""A plan: from a map, a start and a goal to a checked ReferencePath, or to the reason why there is none."""

import math
import time
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import shapely
from shapely import LineString

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.path import ReferencePath
from wzsumo.planning.attempts import search_in_turn, speeds_to_try
from wzsumo.planning.easing import eased_points
from wzsumo.planning.footprint import outline_body, pose_is_free
from wzsumo.planning.hybrid_astar import EXHAUSTED, FOUND
from wzsumo.planning.lattice import poses_along
from wzsumo.planning.path_check import exposure_along, poses_through
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.planning_field import (
    MEASURED_CLEARANCE_M,
    PlanningField,
    Pose,
    from_corner,
    prepare_field,
    refuse_off_map,
    terrain_on,
)
from wzsumo.planning.smoothing import best_smoothing, smoothed_poses
from wzsumo.planning.terrain import Terrain
from wzsumo.vehicle import VehicleGeometry

PATH_STEP_M = 0.48  # between the poses of a path, which may lie 0.5 m apart at most; smoothing stretches it a little


class PlanStatus(StrEnum):
    """How planning ended."""

    FOUND = "FOUND"
    START_OCCUPIED = "START_OCCUPIED"
    GOAL_OCCUPIED = "GOAL_OCCUPIED"
    NO_PATH = "NO_PATH"
    LIMIT_REACHED = "LIMIT_REACHED"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The outcome of planning. Clearance and p(occupied) are of the vehicle's exact outline; nan where there is no path."""

    status: PlanStatus
    reason: str  # one sentence, empty where a path was found
    path: ReferencePath | None
    min_clearance_m: float  # to the nearest blocked cell or the map's edge; at most MEASURED_CLEARANCE_M, 0 on contact
    max_p_occupied: float  # largest p of a cell under the outline; 1 where it leaves the map
    risk_m: float  # integral along the path of the largest p under the outline
    speed_mps: float  # up to which the path's curvature keeps the lateral acceleration: the planned speed, or less
    n_expansions: int
    timings_ms: dict[str, float]  # distance_field, heuristic, search, smoothing, check, total


def plan_path(
    grid: OccupancyGrid,
    *,
    start: Pose,
    goal: Pose,
    vehicle: VehicleGeometry,
    spec: PlannerSpec,
    guide: FloatArray | None = None,
) -> Plan:
    """The plan from `start` to `goal`, poses (x [m], y [m], heading [rad]) of the REAR AXLE in the world.

    `guide` (n, 2, 2) are the ends of lines [m] along which vehicles drive, where they are known; leaving them costs.
    Raises MapError where a pose lies off the map or the map is too large.
    """
    refuse_off_map(grid, start, name="start")
    field = prepare_field(grid, goal=goal, vehicle=vehicle, spec=spec, guide=guide)
    plan = plan_from(field, start=start)
    total = plan.timings_ms["total"] + sum(field.timings_ms.values())
    return replace(plan, timings_ms=plan.timings_ms | field.timings_ms | {"total": total})


def plan_on_route(
    grid: OccupancyGrid, *, start: Pose, goal: Pose, vehicle: VehicleGeometry, spec: PlannerSpec, route: FloatArray
) -> Plan | None:
    """The plan along a line (n, 2) [m] from `start` to `goal`, without a search; None where the line is not free.

    The path is the line smoothed: as near to it as curvature and clearance let it be. It is planned for the highest of the
    speeds of `attempts.speeds_to_try` at which its curvature allows that. Raises MapError as `plan_path` does.
    """
    if not spec.smooth or spec.body != "outline":
        return None
    refuse_off_map(grid, start, name="start")
    began = time.perf_counter()
    terrain, body = terrain_on(grid, vehicle=vehicle, spec=spec, guide=np.stack([route[:-1], route[1:]], axis=1))
    measured = time.perf_counter()
    line = LineString(route - grid.origin)
    n = max(2, math.ceil(line.length / PATH_STEP_M) + 1)
    points = shapely.get_coordinates(shapely.line_interpolate_point(line, np.linspace(0.0, line.length, n)))
    at_start, at_goal = from_corner(grid, start), from_corner(grid, goal)
    points[0], points[-1] = at_start[:2], at_goal[:2]
    along = poses_through(points, ends=np.array([at_start[2], at_goal[2]]))
    for speed in speeds_to_try(spec, vehicle):
        poses, jump = best_smoothing(
            along,
            terrain=terrain,
            body=body,
            preferred_clearance_m=spec.preferred_clearance_m,
            max_curvature=spec.max_curvature(vehicle, speed_mps=speed),
            max_curvature_jump=spec.max_curvature_jump_1pm,
        )
        if poses is not None and jump <= spec.max_curvature_jump_1pm:
            smoothed = time.perf_counter()
            timings = {"distance_field": 1e3 * (measured - began), "smoothing": 1e3 * (smoothed - measured)}
            return _found(poses, grid, terrain, vehicle=vehicle, spec=spec, speed_mps=speed, timings=timings)
    return None


def plan_from(field: PlanningField, *, start: Pose) -> Plan:
    """The plan from `start` to the field's goal; its timings leave out those of the field.

    Raises MapError where `start` lies off the map.
    """
    refuse_off_map(field.grid, start, name="start")
    began = time.perf_counter()
    at_start, at_goal = from_corner(field.grid, start), from_corner(field.grid, field.goal)
    obstacle = _obstacle(field, start)
    if obstacle is not None:
        return _without_path(*obstacle)
    found = search_in_turn(field, start=at_start, goal=at_goal)
    sharpest = field.spec.max_curvature(field.vehicle, speed_mps=found.speed_mps)
    searched = time.perf_counter()
    timings = {"search": 1e3 * (searched - began)}
    if found.outcome != FOUND:
        between = f"from the start {_named(start)} to the goal {_named(field.goal)}"
        tried = f"with curvature up to {sharpest:.4f} 1/m ({found.speed_mps:.3g} m/s), {found.n_expansions} states tried"
        if found.outcome == EXHAUSTED:
            status, reason = PlanStatus.NO_PATH, f"no way {between} can be driven {tried}"
        else:
            limit = f"max_expansions={field.spec.max_expansions}"
            status, reason = PlanStatus.LIMIT_REACHED, f"no way {between} was found {tried}, the limit is {limit}"
        return _without_path(status, reason, n_expansions=found.n_expansions, timings=timings)
    poses = _path_poses(field, at_start, found.segments, sharpest)
    timings |= {"smoothing": 1e3 * (time.perf_counter() - searched)}
    plan = _found(
        poses, field.grid, field.terrain, vehicle=field.vehicle, spec=field.spec, speed_mps=found.speed_mps, timings=timings
    )
    return replace(plan, n_expansions=found.n_expansions)


def _found(
    poses: FloatArray,
    grid: OccupancyGrid,
    terrain: Terrain,
    *,
    vehicle: VehicleGeometry,
    spec: PlannerSpec,
    speed_mps: float,
    timings: dict[str, float],
) -> Plan:
    """The plan of a path of poses (n, 3) from the map's corner."""
    began = time.perf_counter()
    exposure = exposure_along(
        poses,
        max_p_occupied=spec.max_p_occupied,
        terrain=terrain,
        body=outline_body(vehicle),
        limit_m=MEASURED_CLEARANCE_M,
    )
    return Plan(
        status=PlanStatus.FOUND,
        reason="",
        path=ReferencePath(poses=poses + np.array([*grid.origin, 0.0])),
        min_clearance_m=exposure.min_clearance_m,
        max_p_occupied=exposure.max_p_occupied,
        risk_m=exposure.risk_m,
        speed_mps=speed_mps,
        n_expansions=0,
        timings_ms=_with_total(timings | {"check": 1e3 * (time.perf_counter() - began)}),
    )


def compile_kernels() -> None:
    """Compile every kernel of the planner, or load it from the cache."""
    field = load_kernels()
    straight = np.column_stack([np.linspace(5.0, 45.0, 81), np.full(81, 10.0), np.zeros(81)])
    eased_points(straight, wavelength_m=10.0, terrain=field.terrain, body=field.body)


def load_kernels() -> PlanningField:
    """The field of a plan on a small map, made to compile or load the kernels that every plan needs."""
    grid = OccupancyGrid(p_occupied=np.zeros((40, 120), dtype=np.float32), resolution=0.5, origin=(0.0, 0.0))
    field = prepare_field(grid, goal=(50.0, 10.0, 0.0), vehicle=VehicleGeometry.model_validate({}), spec=PlannerSpec())
    plan_from(field, start=(5.0, 10.0, 0.0))
    return field


def _obstacle(field: PlanningField, start: Pose) -> tuple[PlanStatus, str] | None:
    """Why no path can exist, as far as it shows before a search: a blocked start or goal, or no corridor between them."""
    terrain, spec = field.terrain, field.spec
    for name, pose, status in (
        ("start", start, PlanStatus.START_OCCUPIED),
        ("goal", field.goal, PlanStatus.GOAL_OCCUPIED),
    ):
        if not pose_is_free(terrain.distance, terrain.resolution, field.body, *from_corner(field.grid, pose), 0.0):
            body = f"the {spec.body} touches a cell"
            inflated = f" within {spec.inflation_radius_m:g} m" if spec.inflation_radius_m > 0 else ""
            blocked = f"with p_occupied >= {spec.max_p_occupied:g}, or leaves the map"
            return status, f"at the {name} {_named(pose)} {body}{inflated} {blocked}"
    (row,), (col,) = field.grid.cell_of(start[:2])
    if math.isinf(field.cost_to_go[row + 1, col + 1]):
        between = f"from the start {_named(start)} to the goal {_named(field.goal)}"
        return PlanStatus.NO_PATH, f"no free corridor, as wide as the body, leads {between}"
    return None


def _path_poses(field: PlanningField, start: FloatArray, segments: FloatArray, max_curvature: float) -> FloatArray:
    """Poses (n, 3) of the path from the map's corner, smoothed where the spec asks for it."""
    step = PATH_STEP_M if field.spec.body == "outline" else min(PATH_STEP_M, field.terrain.resolution)
    poses = poses_along(start, segments, max_step_m=step)
    if not field.spec.smooth:
        return poses
    return smoothed_poses(
        poses,
        terrain=field.terrain,
        body=field.body,
        preferred_clearance_m=field.spec.preferred_clearance_m,
        max_curvature=max_curvature,
        max_curvature_jump=field.spec.max_curvature_jump_1pm,
    )


def _without_path(status: PlanStatus, reason: str, *, n_expansions: int = 0, timings: dict[str, float] | None = None) -> Plan:
    return Plan(
        status=status,
        reason=reason,
        path=None,
        min_clearance_m=float("nan"),
        max_p_occupied=float("nan"),
        risk_m=float("nan"),
        speed_mps=float("nan"),
        n_expansions=n_expansions,
        timings_ms=_with_total(timings or {}),
    )


def _with_total(timings: dict[str, float]) -> dict[str, float]:
    parts = dict.fromkeys(("distance_field", "heuristic", "search", "smoothing", "check"), 0.0) | timings
    return parts | {"total": sum(parts.values())}


def _named(pose: Pose) -> str:
    return f"({pose[0]:.2f}, {pose[1]:.2f}, {np.rad2deg(pose[2]):.1f} deg)"
