"""Plans: from a map, a start and a goal to a checked ReferencePath, or to the reason why there is none."""

import time
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from wzsumo.errors import MapError
from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.path import ReferencePath
from wzsumo.planning.arcs import poses_along
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.footprint import POINT_BODY, Body, inscribed_radius, outline_body, pose_is_free
from wzsumo.planning.heuristic import cost_to_go
from wzsumo.planning.hybrid_astar import EXHAUSTED, FOUND, search
from wzsumo.planning.lattice import lattice_for
from wzsumo.planning.path_check import exposure_along
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.smoothing import smoothed_poses
from wzsumo.planning.terrain import Terrain, terrain_of
from wzsumo.vehicle import VehicleGeometry

__all__ = ["Plan", "PlanStatus", "PlannerSpec", "PlanningField", "compile_kernels", "plan_from", "plan_path", "prepare"]

MAX_CELLS = 40_000_000  # 16 bytes a cell while planning: 0.6 GB
PATH_STEP_M = 0.48  # smoothing may stretch it a little; a path is sampled at 0.5 m or less
MEASURED_CLEARANCE_M = 1.5  # clearance is measured up to here
# Fineness of the lattice, factor on the heuristic's weight, share of max_expansions used up by then. In a corridor the first
# comes through in some hundred expansions with the better path; among cones, where many ways are alike, the second.
_ATTEMPTS = ((1, 1.0, 0.015), (1, 1.7, 0.5), (2, 1.7, 1.0))
Pose = tuple[float, float, float]


class PlanStatus(StrEnum):
    """How planning ended."""

    FOUND = "FOUND"
    START_OCCUPIED = "START_OCCUPIED"
    GOAL_OCCUPIED = "GOAL_OCCUPIED"
    NO_PATH = "NO_PATH"
    LIMIT_REACHED = "LIMIT_REACHED"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What planning came to. Clearance and p(occupied) are of the vehicle's exact outline; nan where there is no path."""

    status: PlanStatus
    reason: str  # one sentence, empty where a path was found
    path: ReferencePath | None
    min_clearance_m: float  # to the nearest blocked cell or the map's edge; at most MEASURED_CLEARANCE_M, 0 on contact
    max_p_occupied: float  # largest p of a cell under the outline; 1 where it leaves the map
    risk_m: float  # integral along the path of the largest p under the outline
    n_expansions: int
    timings_ms: dict[str, float]  # distance_field, heuristic, search, smoothing, check, total


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanningField:
    """All that planning to one goal on one map shares, whatever the start."""

    grid: OccupancyGrid
    goal: Pose
    vehicle: VehicleGeometry
    spec: PlannerSpec
    body: Body
    terrain: Terrain
    cost_to_go: FieldArray
    timings_ms: dict[str, float]


def plan_path(grid: OccupancyGrid, *, start: Pose, goal: Pose, vehicle: VehicleGeometry, spec: PlannerSpec) -> Plan:
    """The plan from `start` to `goal`, poses (x [m], y [m], heading [rad]) of the REAR AXLE in the world.

    Raises MapError where a pose lies off the map or the map is too large.
    """
    _refuse_off_map(grid, start, name="start")
    return plan_from(prepare(grid, goal=goal, vehicle=vehicle, spec=spec), start=start)


def prepare(grid: OccupancyGrid, *, goal: Pose, vehicle: VehicleGeometry, spec: PlannerSpec) -> PlanningField:
    """What all plans to `goal` share: the distance field and the cost to go. Raises MapError as `plan_path` does."""
    _refuse_off_map(grid, goal, name="goal")
    if grid.p_occupied.size > MAX_CELLS:
        rows, cols = grid.shape
        raise MapError(
            f"a map of {rows} x {cols} = {rows * cols} cells is too large to plan on (at most {MAX_CELLS}); "
            "crop it to the road or use a coarser resolution"
        )
    began = time.perf_counter()
    body, outline = POINT_BODY if spec.body == "point" else outline_body(vehicle), outline_body(vehicle)
    reach = max(inscribed_radius(body) + spec.preferred_clearance_m, outline.disc_radius + MEASURED_CLEARANCE_M)
    terrain = terrain_of(grid, body=body, spec=spec, reach_m=reach + grid.resolution)
    measured = time.perf_counter()
    (row,), (col,) = grid.cell_of(goal[:2])
    goal_cell = int(row), int(col)
    remaining = cost_to_go(terrain.multiplier, dearest=spec.dearest_metre, goal_cell=goal_cell, resolution=grid.resolution)
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


def plan_from(field: PlanningField, *, start: Pose) -> Plan:
    """The plan from `start` to the field's goal. Raises MapError where `start` lies off the map."""
    _refuse_off_map(field.grid, start, name="start")
    began = time.perf_counter()
    grid, terrain, body, spec = field.grid, field.terrain, field.body, field.spec
    at_start, at_goal = _local(grid, start), _local(grid, field.goal)
    way = f"from the start {_named(start)} to the goal {_named(field.goal)}"
    for pose, status in ((at_start, PlanStatus.START_OCCUPIED), (at_goal, PlanStatus.GOAL_OCCUPIED)):
        if not pose_is_free(terrain.distance, grid.resolution, body, *pose, 0.0):
            return _without_path(field, status, _contact_at(field, start if pose is at_start else field.goal, status))
    (row,), (col,) = grid.cell_of(start[:2])
    if not np.isfinite(field.cost_to_go[row + 1, col + 1]):
        return _without_path(field, PlanStatus.NO_PATH, f"no free corridor, as wide as the body, leads {way}")
    sharpest = spec.max_curvature(field.vehicle)
    n_expansions, outcome, segments = 0, EXHAUSTED, np.zeros((0, 2))
    for fineness, haste, share in _ATTEMPTS:
        lattice = lattice_for(body, max_curvature=sharpest, fineness=fineness)
        limit = max(int(share * spec.max_expansions) - n_expansions, 1)
        weight = haste * spec.heuristic_weight
        outcome, n, segments = search(terrain, field.cost_to_go, body, lattice, at_start, at_goal, weight, limit)
        n_expansions += n
        if outcome == FOUND or n_expansions >= spec.max_expansions:
            break
    searched = time.perf_counter()
    timings = {"search": 1e3 * (searched - began)}
    if outcome != FOUND:
        tried = f"with curvature up to {sharpest:.4f} 1/m ({spec.planned_speed_mps:g} m/s), {n_expansions} states tried"
        if outcome == EXHAUSTED:
            status, reason = PlanStatus.NO_PATH, f"no way {way} can be driven {tried}"
        else:
            status, reason = PlanStatus.LIMIT_REACHED, f"no way {way} was found {tried}, max_expansions={spec.max_expansions}"
        return _without_path(field, status, reason, n_expansions=n_expansions, timings=timings)
    poses = poses_along(at_start, segments, max_step_m=PATH_STEP_M)
    if spec.smooth:
        poses = smoothed_poses(
            poses,
            terrain=terrain,
            body=body,
            preferred_clearance_m=spec.preferred_clearance_m,
            max_curvature=sharpest,
            max_curvature_jump=spec.max_curvature_jump_1pm,
        )
    smoothed = time.perf_counter()
    exposure = exposure_along(
        poses,
        p_occupied=grid.p_occupied,
        max_p_occupied=spec.max_p_occupied,
        terrain=terrain,
        body=outline_body(field.vehicle),
        limit_m=MEASURED_CLEARANCE_M,
    )
    timings |= {"smoothing": 1e3 * (smoothed - searched), "check": 1e3 * (time.perf_counter() - smoothed)}
    return Plan(
        status=PlanStatus.FOUND,
        reason="",
        path=ReferencePath(poses=poses + np.array([*grid.origin, 0.0])),
        min_clearance_m=exposure.min_clearance_m,
        max_p_occupied=exposure.max_p_occupied,
        risk_m=exposure.risk_m,
        n_expansions=n_expansions,
        timings_ms=_with_total(field, timings),
    )


def compile_kernels() -> None:
    """Compile every kernel of the planner, or load it from the cache, on a map of a few cells."""
    grid = OccupancyGrid(p_occupied=np.zeros((40, 120), dtype=np.float32), resolution=0.5, origin=(0.0, 0.0))
    plan_path(
        grid, start=(5.0, 10.0, 0.0), goal=(50.0, 10.0, 0.0), vehicle=VehicleGeometry.model_validate({}), spec=PlannerSpec()
    )


def _refuse_off_map(grid: OccupancyGrid, pose: Pose, *, name: str) -> None:
    if not np.isfinite(pose).all():
        raise MapError(f"{name} ({pose[0]}, {pose[1]}, {pose[2]}) must be finite: x, y [m] and heading [rad]")
    if not grid.contains(pose[:2])[0]:
        x_min, y_min, x_max, y_max = grid.bounds
        raise MapError(
            f"{name} ({pose[0]:.2f}, {pose[1]:.2f}) lies off the map, which covers x {x_min:.2f}..{x_max:.2f}, "
            f"y {y_min:.2f}..{y_max:.2f} m; give a point on it"
        )


def _local(grid: OccupancyGrid, pose: Pose) -> FloatArray:
    return np.array([pose[0] - grid.origin[0], pose[1] - grid.origin[1], pose[2]])


def _with_total(field: PlanningField, timings: dict[str, float]) -> dict[str, float]:
    parts = {"distance_field": 0.0, "heuristic": 0.0, "search": 0.0, "smoothing": 0.0, "check": 0.0}
    parts |= field.timings_ms | timings
    return parts | {"total": sum(parts.values())}


def _without_path(
    field: PlanningField, status: PlanStatus, reason: str, *, n_expansions: int = 0, timings: dict[str, float] | None = None
) -> Plan:
    return Plan(
        status=status,
        reason=reason,
        path=None,
        min_clearance_m=float("nan"),
        max_p_occupied=float("nan"),
        risk_m=float("nan"),
        n_expansions=n_expansions,
        timings_ms=_with_total(field, timings or {}),
    )


def _named(pose: Pose) -> str:
    return f"({pose[0]:.2f}, {pose[1]:.2f}, {np.rad2deg(pose[2]):.1f} deg)"


def _contact_at(field: PlanningField, pose: Pose, status: PlanStatus) -> str:
    end = "start" if status == PlanStatus.START_OCCUPIED else "goal"
    body = "the outline" if field.spec.body == "outline" else "the point"
    inflated = f" within {field.spec.inflation_radius_m:g} m" if field.spec.inflation_radius_m > 0 else ""
    return (
        f"at the {end} {_named(pose)} {body} touches a cell{inflated} with p_occupied >= {field.spec.max_p_occupied:g}, "
        "or leaves the map"
    )
