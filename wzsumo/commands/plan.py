"""The verb `plan`: a path on any ROS map. Alone in its module, for it starts in a third of the time that all verbs take."""

from pathlib import Path
from typing import Any

import numpy as np

from wzsumo.errors import MapError
from wzsumo.files.output import staged_folder
from wzsumo.files.ros_map import read_map
from wzsumo.grid import FREE_THRESHOLD
from wzsumo.planning.plan import load_kernels, plan_path
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.vehicle import VehicleGeometry


def plan_on_map(map_yaml: Path, out: Path, *, start: list[float], goal: list[float], speed_mps: float) -> dict[str, Any]:
    """Plan on a ROS map and write the path; status, clearance and times. No path: nothing is written."""
    grid = read_map(map_yaml)
    if not (np.isfinite(start).all() and np.isfinite(goal).all()):
        raise MapError(f"--start {start} and --goal {goal} must be finite numbers X Y DEG")
    spec = PlannerSpec(planned_speed_mps=speed_mps, max_p_occupied=FREE_THRESHOLD)
    load_kernels()  # not part of what planning takes
    plan = plan_path(grid, start=_pose(start), goal=_pose(goal), vehicle=VehicleGeometry(), spec=spec)
    if plan.path is not None:
        with staged_folder(out.parent) as stage:
            plan.path.to_csv(stage / out.name)
    return {
        "status": str(plan.status),
        "reason": plan.reason,
        "length_m": float(plan.path.arc_length[-1]) if plan.path else None,
        "min_clearance_m": plan.min_clearance_m if plan.path else None,
        "max_curvature_1pm": float(np.abs(plan.path.curvature).max()) if plan.path else None,
        "speed_mps": plan.speed_mps if plan.path else None,
        "plan_ms": plan.timings_ms["total"],
        "timings_ms": plan.timings_ms,
        "n_expansions": plan.n_expansions,
    }


def _pose(values: list[float]) -> tuple[float, float, float]:
    x, y, heading_deg = values
    return x, y, float(np.deg2rad(heading_deg))
