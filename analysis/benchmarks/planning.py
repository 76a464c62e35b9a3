# ruff: noqa: E402  (the maps come from tests/planning, which this file's own name would hide)
"""Planning time on one lane closure of 900 x 30 m, against the floor and against peers where these can be imported.

    python analysis/benchmarks/planning.py [--runs 11] [--json FILE]

Medians and ranges in ms of one process, one thread. The floor is the clipped distance field plus one front over the same grid
(`cost_to_go`), timed in the same run. Peers (PyPI `pathplanning` 0.2, `ompl` 2.0) drive the same outline on the same map;
PythonRobotics' Hybrid A* took 391 s on this problem in one run with helped settings and is not run here.
"""

import argparse
import importlib.util
import json
import os
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path[0] = str(Path(__file__).parents[2] / "tests")

import numpy as np
from planning.grids import Alignment, work_zone_grid

from wzsumo.frames import advance
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.distance_field import distance_field
from wzsumo.planning.footprint import outline_body
from wzsumo.planning.plan import compile_kernels, plan_from, plan_path
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.planning_field import cost_to_go, prepare_field
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
Pose = tuple[float, float, float]
CASES: dict[str, dict[str, Any]] = {
    "corridor, 0.25 m": {"resolution": 0.25},
    "corridor, 0.127 m": {"resolution": 0.127},
    "cones alone, 0.25 m": {"resolution": 0.25, "kind": "cones"},
    "cones alone, 0.127 m": {"resolution": 0.127, "kind": "cones"},
    "corridor at 23 deg, 0.25 m": {"resolution": 0.25, "alignment": Alignment(angle=0.4)},
    "corridor on radius 300 m, 0.25 m": {"resolution": 0.25, "alignment": Alignment(radius_m=300.0)},
    "cones on radius 900 m, 0.25 m": {"resolution": 0.25, "kind": "cones", "alignment": Alignment(radius_m=900.0)},
}


def timed(run: Callable[[], object], n: int) -> list[float]:
    """Wall times [ms] of n runs."""
    times = []
    for _ in range(n):
        began = time.perf_counter()
        run()
        times.append(1e3 * (time.perf_counter() - began))
    return times


def summary(times: list[float]) -> dict[str, float]:
    return {"median": statistics.median(times), "min": min(times), "max": max(times), "n": len(times)}


def shown(figures: dict[str, float]) -> str:
    return f"{figures['median']:8.1f} ({figures['min']:.1f} .. {figures['max']:.1f}, n {figures['n']})"


def floor(grid: OccupancyGrid, goal: Pose, n: int) -> list[float]:
    multiplier = prepare_field(grid, goal=goal, vehicle=CAR, spec=PlannerSpec()).terrain.multiplier
    (row,), (col,) = grid.cell_of(goal[:2])

    def run() -> None:
        distance_field(grid.p_occupied, max_p_occupied=0.196, resolution=grid.resolution, limit_m=3.0)
        dearest = PlannerSpec().max_metre_cost
        cost_to_go(multiplier, max_metre_cost=dearest, goal_cell=(int(row), int(col)), resolution=grid.resolution)

    return timed(run, n)


def pathplanning_run(grid: OccupancyGrid, start: Pose, goal: Pose) -> Callable[[], object] | None:
    """The best of five settings tried on this problem: 0.5 m cells, 72 headings, arcs of 1 m; its pose is the centre."""
    if importlib.util.find_spec("pathplanning") is None:
        return None
    from pathplanning.core.contracts import ContinuousProblem, GoalState
    from pathplanning.core.params import HybridAStarParams
    from pathplanning.planners.kinodynamic.hybrid_astar import plan_hybrid_astar
    from pathplanning.spaces.ackermann_grid import AckermannGridSpace

    space = AckermannGridSpace(
        ~grid.free,
        resolution=grid.resolution,
        origin=grid.origin,
        wheelbase=CAR.wheelbase_m,
        max_steering_angle=np.arctan(CAR.wheelbase_m / 5.5),
        footprint_length=CAR.length_m,
        footprint_width=CAR.width_m,
    )
    params = HybridAStarParams(
        max_expansions=2_000_000,
        time_budget_s=60.0,
        xy_resolution=0.5,
        heading_bins=72,
        primitive_length=1.0,
        analytic_expansion_distance=60.0,
        allow_reverse=False,
    )
    ends = [np.asarray(advance(pose, CAR.axle_to_centre_m)) for pose in (start, goal)]
    problem = ContinuousProblem(space=space, start=ends[0], goal=GoalState(ends[1]))

    def run() -> None:
        result = plan_hybrid_astar(problem, params=params)
        assert result.success, result.stop_reason

    return run


def ompl_run(grid: OccupancyGrid, start: Pose, goal: Pose) -> Callable[[], object] | None:
    """RRT* until its first path, Dubins curves of 5.5 m, validity by four discs in Python on our distance field."""
    try:
        import ompl.base as ob
        import ompl.geometric as og
        import ompl.util as ou
    except ImportError:
        return None
    ou.noOutputHandler()
    body = outline_body(CAR)

    def run() -> None:
        field = distance_field(grid.p_occupied, max_p_occupied=0.196, resolution=grid.resolution, limit_m=3.0)
        x_min, y_min, x_max, y_max = grid.bounds
        rows, cols = grid.shape
        clear, offsets, resolution = float(body.disc_radius), [float(v) for v in body.disc_offsets], grid.resolution

        def valid(state: ob.State) -> bool:
            x, y, heading = state.getX() - x_min, state.getY() - y_min, state.getYaw()
            cos, sin = np.cos(heading), np.sin(heading)
            for offset in offsets:
                row, col = int((y + sin * offset) / resolution), int((x + cos * offset) / resolution)
                if not (0 <= row < rows and 0 <= col < cols) or field[row, col] < clear:
                    return False
            return True

        space = ob.DubinsStateSpace(5.5)
        bounds = ob.RealVectorBounds(2)
        for axis, (low, high) in enumerate(((x_min, x_max), (y_min, y_max))):
            bounds.setLow(axis, low)
            bounds.setHigh(axis, high)
        space.setBounds(bounds)
        setup = og.SimpleSetup(space)
        setup.setStateValidityChecker(valid)
        setup.getSpaceInformation().setStateValidityCheckingResolution(0.5 / space.getMaximumExtent())
        ends = []
        for pose in (start, goal):
            state = space.allocState()
            state.setXY(pose[0], pose[1])
            state.setYaw(pose[2])
            ends.append(state)
        setup.setStartAndGoalStates(ends[0], ends[1], 0.1)
        objective = ob.PathLengthOptimizationObjective(setup.getSpaceInformation())
        objective.setCostThreshold(ob.Cost(1e9))  # any path will do
        setup.setOptimizationObjective(objective)
        setup.setPlanner(og.RRTstar(setup.getSpaceInformation()))
        setup.setup()
        setup.solve(60.0)
        assert setup.haveExactSolutionPath(), "no path within 60 s"

    return run


def measure(case: str, n: int) -> dict[str, Any]:
    grid, start, goal = work_zone_grid(**CASES[case])
    spec = PlannerSpec()
    plan = plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=spec)
    field = prepare_field(grid, goal=goal, vehicle=CAR, spec=spec)
    figures: dict[str, Any] = {
        "cells": grid.p_occupied.size,
        "status": str(plan.status),
        "expansions": plan.n_expansions,
        "plan": summary(timed(lambda: plan_path(grid, start=start, goal=goal, vehicle=CAR, spec=spec), n)),
        "replan": summary(timed(lambda: plan_from(field, start=start), n)),
        "floor": summary(floor(grid, goal, n)),
        "parts_ms": {key: round(value, 2) for key, value in plan.timings_ms.items()},
    }
    if plan.path is not None:
        curvature = plan.path.curvature
        figures |= {
            "length_m": float(plan.path.arc_length[-1]),
            "min_clearance_m": plan.min_clearance_m,
            "max_curvature_1pm": float(np.abs(curvature).max()),
            "max_curvature_jump_1pm": float(np.abs(np.diff(curvature)).max()),
        }
    for name, peer in (("pathplanning", pathplanning_run), ("ompl RRT*", ompl_run)):
        run = peer(grid, start, goal) if case.startswith("corridor, ") else None
        figures[name] = summary(timed(run, n)) if run else None
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=11)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    compile_kernels()
    results = {}
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; times in ms: median (min .. max, n)")
    for case in CASES:
        results[case] = figures = measure(case, options.runs)
        print(f"\n{case}: {figures['cells']} cells, {figures['status']}, {figures['expansions']} expansions")
        if "length_m" in figures:
            print(
                f"  path           {figures['length_m']:8.1f} m, clearance {figures['min_clearance_m']:.2f} m, "
                f"curvature {figures['max_curvature_1pm']:.4f} 1/m, jump {figures['max_curvature_jump_1pm']:.5f} 1/m"
            )
        for name in ("plan", "replan", "floor", "pathplanning", "ompl RRT*"):
            if figures[name] is not None:
                ratio = figures[name]["median"] / figures["plan"]["median"]
                print(f"  {name:12} {shown(figures[name])}   {ratio:.2f} x plan")
            elif case.startswith("corridor, "):
                print(f"  {name:12} not installed")
    if options.json:
        options.json.write_text(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()
