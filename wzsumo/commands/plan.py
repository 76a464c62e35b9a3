"""The command `plan`: a path on a ROS map. It imports few modules, so that it starts quickly."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from wzsumo.commands.terminal.arguments import number, speed_mps
from wzsumo.files.output import staged_file
from wzsumo.files.ros_map import read_map
from wzsumo.frames import pose_of_degrees
from wzsumo.grid import FREE_THRESHOLD
from wzsumo.planning.plan import load_kernels, plan_path
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.vehicle import VehicleGeometry

MORE = "Poses are of the centre of the REAR AXLE: X Y in metres of the map's frame, DEG counter-clockwise from +x."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("map", type=Path, metavar="MAP.yaml", help="a map of `wzsumo map`, or any of ROS map_server")
    pose = ("X", "Y", "DEG")
    parser.add_argument("--start", type=number, nargs=3, required=True, metavar=pose, help="pose at which the path begins")
    parser.add_argument("--goal", type=number, nargs=3, required=True, metavar=pose, help="pose at which it ends")
    parser.add_argument("--out", type=Path, required=True, metavar="PATH.csv", help="the file to write, one row a pose")
    parser.add_argument("--speed-mps", type=speed_mps, default=10.0, help="limits the curvature: v^2 k <= 2 m/s2 (default 10)")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Status, clearance and times of a plan on a ROS map, after writing its path; nothing is written where there is no path."""
    spec = PlannerSpec(planned_speed_mps=args.speed_mps, max_p_occupied=FREE_THRESHOLD)
    with staged_file(args.out) as staged:
        grid = read_map(args.map)
        load_kernels()  # before the clock of planning starts
        start, goal = pose_of_degrees(args.start), pose_of_degrees(args.goal)
        plan = plan_path(grid, start=start, goal=goal, vehicle=VehicleGeometry(), spec=spec)
        if plan.path is not None:
            plan.path.to_csv(staged)
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
