"""The result of one map method in a case: its map, the plan on it, the drive along the plan, and their figures."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from wzsumo.case.assessment import assess, goal_figures, lidar_figures
from wzsumo.case.closed_loop import Drive, drive_path
from wzsumo.case.crowd import sets_out_s
from wzsumo.case.lidar_baseline import LidarBaseline
from wzsumo.case.map_method import MadeMap, MapMethod
from wzsumo.case.plans import plan_for
from wzsumo.case.replanning import NewMap
from wzsumo.case.sources import Sources
from wzsumo.case.watch import Watch
from wzsumo.case.zone import SimulatedZone
from wzsumo.ego import EgoRun
from wzsumo.grid import OccupancyGrid
from wzsumo.path import ReferencePath
from wzsumo.planning.path_check import free_until
from wzsumo.planning.plan import Plan, PlanStatus
from wzsumo.scenario.scenario import Pose, Scenario
from wzsumo.scenario.site import Site, site_with_open_goal

DRIVE_LIMIT_S = 400.0  # of the wait for room on the road, and of the drive; what takes longer has TIMED_OUT; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class MethodResult:
    """The map, the plan on it, the drive (None where the ego did not drive), and their figures."""

    made: MadeMap
    plan: Plan
    run: EgoRun | None
    figures: dict[str, Any]

    @property
    def grid(self) -> OccupancyGrid:
        """The map that was scored and planned on."""
        return self.made.grid


def evaluate(
    method: MapMethod,
    sources: Sources,
    *,
    scenario: Scenario,
    site: Site,
    made: MadeMap | None = None,
    drives: bool = True,
    watch: Watch,
) -> MethodResult:
    """The result of one method. Both `wzsumo run` and a sweep call this, so that they report the same for the same case.

    `made` is the method's map where it has been made already; `drives` says whether the ego drives along the plan.
    """
    zone, crowd = sources.zone, method.crowd_of(sources)
    with watch.timing(f"map {method.name}"):
        made = made or method.map_of_zone(sources)
    plan = plan_for(method, made, scenario=scenario, site=site)
    with watch.timing(f"drive {method.name}"):
        maps = new_maps(method, made, sources, scenario=scenario, site=site) if drives else ()
        run = drive_plan(plan, zone, name=method.name, scenario=scenario, site=site, maps=maps, watch=watch) if drives else None
    figures = assess(made, plan, run, crowd=crowd, over_zone=zone.over_zone, scenario=scenario, site=site)
    return MethodResult(made=made, plan=plan, run=run, figures=figures)


def plan_to_open_lane(
    method: MapMethod, result: MethodResult, *, scenario: Scenario, site: Site
) -> tuple[Plan | None, dict[str, Any]]:
    """The plan to the goal in the open lane, None where the scenario names none, and figures of the plans to both goals."""
    goals = {"own_lane": goal_figures(result.plan, lane=scenario.route.goal_lane, scenario=scenario, site=site)}
    lane, open_site = scenario.route.open_goal_lane, site_with_open_goal(site)
    if lane is None or open_site is None:
        return None, goals
    plan = plan_for(method, result.made, scenario=scenario, site=open_site)
    goals["open_lane"] = goal_figures(plan, lane=lane, scenario=scenario, site=open_site)
    return plan, goals


def drive_plan(
    plan: Plan, zone: SimulatedZone, *, name: str, scenario: Scenario, site: Site, maps: Iterable[NewMap] = (), watch: Watch
) -> EgoRun | None:
    """The ego's run along the plan through the zone's traffic, None where the plan has no path. `maps` reach it on the way."""
    if plan.path is None:
        return None
    drive = Drive(
        vehicle=scenario.vehicle, control=scenario.control, plant=scenario.plant,
        depart_s=sets_out_s(zone.over_zone, scenario), time_limit_s=DRIVE_LIMIT_S, in_window=watch.in_window,
        doubtful_speed_mps=scenario.control.target_speed_mps * (scenario.live.doubtful_speed_share if scenario.live else 1.0),
    )  # fmt: skip
    with watch.progress(f"drive on {name}", float(plan.path.arc_length[-1])) as tell, zone.sumo_files() as files:
        return drive_path(plan.path, layout=site.layout, files=files, drive=drive, on_step=tell, new_maps=maps)


def new_maps(method: MapMethod, made: MadeMap, sources: Sources, *, scenario: Scenario, site: Site) -> tuple[NewMap, ...]:
    """The maps that reach the ego after `made`, each with the functions that plan on it and say how far a path is free."""
    found, grid = [], made.grid
    for arriving in method.arriving(sources):
        plan = None
        if arriving.made is not None:
            plan, grid = (
                partial(_plan_from, method=method, made=arriving.made, scenario=scenario, site=site),
                arriving.made.grid,
            )
        free = partial(_free_until, grid=grid, scenario=scenario)
        found.append(NewMap(time_s=arriving.time_s, plan=plan, free_until=free, doubtful=arriving.doubtful))
    return tuple(found)


def _plan_from(start: Pose, *, method: MapMethod, made: MadeMap, scenario: Scenario, site: Site) -> Plan:
    """The plan to the goal or, where no path leads there, to the one in the open lane, where the scenario names one."""
    here = replace(site, start=start)
    plan, open_site = plan_for(method, made, scenario=scenario, site=here), site_with_open_goal(here)
    if plan.path is None and open_site is not None:
        other = plan_for(method, made, scenario=scenario, site=open_site)
        return other if other.path is not None else plan
    return plan


def _free_until(path: ReferencePath, start_m: float, *, grid: OccupancyGrid, scenario: Scenario) -> float:
    return free_until(path, grid, start_m=start_m, vehicle=scenario.vehicle, spec=scenario.planner)


def table_row(result: MethodResult, *, lidar: LidarBaseline | None, drives: bool) -> dict[str, Any]:
    """The row of a sweep's table: figures by column (see `sweep.results`).

    `lidar` is the mapping drive of the map, None for a map of another source; `drives` says whether the ego was to drive.
    """
    figures = dict(result.figures)
    del figures["replans"]  # a table has their number alone
    alarms, n_false = figures.pop("alarms"), len(figures.pop("false_alarms"))
    first = alarms[0] if alarms else {}
    figures |= {"alarm": first.get("kind"), "alarm_at_s": first.get("at_s"), "n_alarms": len(alarms), "n_false_alarms": n_false}
    planned, driven, measured, conduct = (figures.pop(name) or {} for name in ("planned", "driven", "drive", "conduct"))
    figures |= {f"slam_{name}": value for name, value in (lidar_figures(lidar) if lidar else {}).items()}
    figures |= {f"planned_{name}": value for name, value in planned.items()}
    figures |= {f"driven_{name}": value for name, value in (driven | measured | conduct).items()}
    path = result.plan.path
    if path is not None and not drives:
        figures |= {"outcome": None, "reason": "", "clean": None, "faults": ""}
    return figures | {
        "path_length_m": float(path.arc_length[-1]) if path else None,
        "safe_plan": result.plan.status == PlanStatus.FOUND and _keeps_clear(planned),
    }


def _keeps_clear(planned: dict[str, float]) -> bool:
    """Whether the outline along the planned path touches no device, no edge of the pavement and not the closed area."""
    clearances = (planned["min_clearance_devices_m"], planned["min_clearance_road_edge_m"])
    return min(clearances) > 0 and planned["closed_area_share"] == 0
