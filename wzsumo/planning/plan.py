"""Plans: from a map, a start and a goal to a checked ReferencePath, or to the reason why there is none."""

import time
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from wzsumo.errors import MapError
from wzsumo.frames import FloatArray, wrap_angle
from wzsumo.grid import OccupancyGrid
from wzsumo.path import ReferencePath
from wzsumo.planning.arcs import poses_along
from wzsumo.planning.distance_field import FieldArray, distance_field
from wzsumo.planning.footprint import POINT_BODY, inscribed_radius, outline_body, pose_is_free, sweep_margin
from wzsumo.planning.heuristic import cost_to_go
from wzsumo.planning.hybrid_astar import EXHAUSTED, LIMIT_REACHED, Lattice, search
from wzsumo.planning.path_check import exposure_along, first_contact
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.smoothing import smooth
from wzsumo.vehicle import VehicleGeometry

__all__ = ["Plan", "PlanStatus", "PlannerSpec", "PlanningField", "compile_kernels", "plan_from", "plan_path", "prepare"]

MAX_CELLS = 40_000_000  # 16 bytes a cell while planning: 0.6 GB
PATH_STEP_M = 0.48  # smoothing may stretch it a little; a path is sampled at 0.5 m or less
MEASURED_CLEARANCE_M = 1.5  # clearance is measured up to here
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
    body: FloatArray
    distance: FieldArray  # m, less the inflation radius
    multiplier: FieldArray
    cost_to_go: FieldArray
    goal_is_free: bool
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
    body = POINT_BODY if spec.body == "point" else outline_body(vehicle)
    inner = inscribed_radius(body)
    reach = max(inner + spec.preferred_clearance_m, float(outline_body(vehicle)[3]) + MEASURED_CLEARANCE_M)
    distance = distance_field(
        grid.p_occupied,
        max_p_occupied=spec.max_p_occupied,
        resolution=grid.resolution,
        limit_m=reach + grid.resolution + spec.inflation_radius_m,
    )
    if spec.inflation_radius_m > 0:
        distance = np.maximum(distance - np.float32(spec.inflation_radius_m), np.float32(0))
    multiplier = _multiplier(grid, distance, inner, spec)
    measured = time.perf_counter()
    row, col = grid.cell_of(goal[:2])
    remaining = cost_to_go(multiplier, goal_cell=(int(row[0]), int(col[0])), resolution=grid.resolution)
    done = time.perf_counter()
    return PlanningField(
        grid=grid,
        goal=goal,
        vehicle=vehicle,
        spec=spec,
        body=body,
        distance=distance,
        multiplier=multiplier,
        cost_to_go=remaining,
        goal_is_free=bool(pose_is_free(distance, grid.resolution, *_local(grid, goal), body, 0.0)),
        timings_ms={"distance_field": 1e3 * (measured - began), "heuristic": 1e3 * (done - measured)},
    )


def plan_from(field: PlanningField, *, start: Pose) -> Plan:
    """The plan from `start` to the field's goal. Raises MapError where `start` lies off the map."""
    _refuse_off_map(field.grid, start, name="start")
    began = time.perf_counter()
    grid, spec = field.grid, field.spec
    at_start, at_goal = _local(grid, start), _local(grid, field.goal)
    if not pose_is_free(field.distance, grid.resolution, *at_start, field.body, 0.0):
        return _without_path(field, PlanStatus.START_OCCUPIED, f"the start {_named(start)} {_touches(field)}")
    if not field.goal_is_free:
        return _without_path(field, PlanStatus.GOAL_OCCUPIED, f"the goal {_named(field.goal)} {_touches(field)}")
    row, col = grid.cell_of(start[:2])
    if not np.isfinite(field.cost_to_go[row[0], col[0]]):
        reason = f"no free corridor as wide as the body joins the start {_named(start)} with the goal {_named(field.goal)}"
        return _without_path(field, PlanStatus.NO_PATH, reason)
    sharpest = spec.max_curvature(field.vehicle)
    lattice = _lattice(sharpest)
    outcome, n_expansions, segments = search(
        field.distance,
        field.multiplier,
        field.cost_to_go,
        resolution=grid.resolution,
        body=field.body,
        margin=sweep_margin(field.body, curvature=sharpest, step_m=lattice.check_m),
        start=at_start,
        goal=at_goal,
        lattice=lattice,
        weight=spec.heuristic_weight,
        max_expansions=spec.max_expansions,
    )
    searched = time.perf_counter()
    timings = {"search": 1e3 * (searched - began)}
    within = f"with curvature up to {sharpest:.4f} 1/m ({spec.planned_speed_mps:g} m/s), {n_expansions} states tried"
    if outcome == EXHAUSTED:
        reason = f"no way from {_named(start)} to {_named(field.goal)} can be driven {within}"
        return _without_path(field, PlanStatus.NO_PATH, reason, n_expansions=n_expansions, timings=timings)
    if outcome == LIMIT_REACHED:
        reason = f"no way from {_named(start)} to {_named(field.goal)} was found {within}, the limit max_expansions"
        return _without_path(field, PlanStatus.LIMIT_REACHED, reason, n_expansions=n_expansions, timings=timings)
    poses = poses_along(at_start, segments, max_step_m=PATH_STEP_M)
    if spec.smooth:
        poses = _smoothed(field, poses, sharpest)
    smoothed = time.perf_counter()
    exposure = exposure_along(
        poses,
        p_occupied=grid.p_occupied,
        max_p_occupied=spec.max_p_occupied,
        field=field.distance,
        resolution=grid.resolution,
        body=outline_body(field.vehicle),
        limit_m=MEASURED_CLEARANCE_M,
    )
    poses[:, :2] += grid.origin
    timings |= {"smoothing": 1e3 * (smoothed - searched), "check": 1e3 * (time.perf_counter() - smoothed)}
    return Plan(
        status=PlanStatus.FOUND,
        reason="",
        path=ReferencePath(poses=poses),
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


def _multiplier(grid: OccupancyGrid, distance: FieldArray, inner: float, spec: PlannerSpec) -> FieldArray:
    """What a metre with the rear axle in each cell costs, >= 1; infinite where no axle can be."""
    lacking = np.clip(1 - (distance - inner) / spec.preferred_clearance_m, 0, 1)
    cost = 1 + spec.clearance_cost * lacking**2 + spec.occupancy_cost * grid.p_occupied
    blocked = (distance <= 0) | (distance + 0.7072 * grid.resolution < inner)
    return np.where(blocked, np.inf, cost).astype(np.float32)


def _lattice(sharpest: float) -> Lattice:
    # Smoothing overshoots where curvature changes: the search keeps 15 % in hand.
    bends = 0.85 * sharpest * np.array([1, 1 / 4, 1 / 16])
    return Lattice(
        curvatures=np.concatenate([[0.0], bends, -bends]),
        step_m=4.0,
        check_m=1.0,
        xy_bin_m=0.5,
        heading_bin=np.deg2rad(0.5),
        turn_cost=0.3,
        change_cost_m=0.3,
        goal_range_m=100.0,
    )


def _smoothed(field: PlanningField, poses: FloatArray, sharpest: float) -> FloatArray:
    """The path under the strongest smoothing that keeps it free and its curvature within the limits."""
    best, least_jump = poses, np.inf
    for wavelength_m in (60.0, 40.0, 25.0, 15.0, 8.0):
        points = smooth(
            poses[:, :2],
            headings=(poses[0, 2], poses[-1, 2]),
            wavelength_m=wavelength_m,
            preferred_clearance_m=field.spec.preferred_clearance_m,
            field=field.distance,
            resolution=field.grid.resolution,
            body=field.body,
        )
        chords = points[2:] - points[:-2]
        headings = np.concatenate([poses[:1, 2], np.arctan2(chords[:, 1], chords[:, 0]), poses[-1:, 2]])
        candidate = np.column_stack([points, wrap_angle(headings)])
        curvature = ReferencePath(poses=candidate).curvature
        margins = field.body[1] * np.abs(curvature) * PATH_STEP_M / 2
        jump = float(np.abs(np.diff(curvature)).max())
        if np.abs(curvature).max() > sharpest or jump >= least_jump:
            continue
        if first_contact(candidate, margins, field.distance, field.grid.resolution, field.body) < 0:
            best, least_jump = candidate, jump
            if jump <= field.spec.max_curvature_jump_1pm:
                break
    return best


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


def _touches(field: PlanningField) -> str:
    what = "lies in" if field.spec.body == "point" else "lets the outline touch"
    return f"{what} a cell with p_occupied >= {field.spec.max_p_occupied:g}, or leave the map"
