"""Figures of a case: the map against the truth; planned and driven path against devices, pavement edges and closed area."""

from dataclasses import asdict, fields
from typing import Any

import pandas as pd

from wzsumo.case.crowd import Crowd
from wzsumo.case.lidar_baseline import LidarBaseline
from wzsumo.case.map_method import MadeMap
from wzsumo.ego import EgoRun, Outcome
from wzsumo.metrics.clearance import clearance_along
from wzsumo.metrics.conduct import faults_of, measure_conduct
from wzsumo.metrics.contact import ContactChecker
from wzsumo.metrics.delay_behind import DelayBehind, delay_behind
from wzsumo.metrics.drive import measure_drive
from wzsumo.metrics.map_quality import quality_of_cells
from wzsumo.planning.plan import Plan
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.site import Site


def assess(
    made: MadeMap,
    plan: Plan,
    run: EgoRun | None,
    *,
    crowd: Crowd | None,
    over_zone: pd.DataFrame,
    scenario: Scenario,
    site: Site,
) -> dict[str, Any]:
    """Figures of one method, by their keys in result.json.

    `run` is None where the ego did not drive, `crowd` where the map is of another source. `over_zone` are the traces of the
    fleet in a simulation without the ego. The clearances and the closed-area share beside the map's quality are those of the
    driven path, or of the planned path where the ego did not drive.
    """
    quality = quality_of_cells(made.grid.free, drivable=site.drivable, counted=site.counted)
    moved = run if run is not None and len(run.log) > 1 else None
    planned, driven = (
        None if poses is None else clearance_along(poses, vehicle=scenario.vehicle, layout=site.layout)
        for poses in (plan.path.poses if plan.path else None, moved.poses if moved else None)
    )
    conduct = measure_conduct(moved, scenario.vehicle, site.layout) if moved else None
    if moved and conduct and driven:
        faults = faults_of(moved.outcome, conduct, driven)
    else:
        faults = (str(run.outcome if run else Outcome.NO_PATH),)
    before, after = (asdict(of) if of else None for of in (planned, driven))
    headline = after or before or {}
    return {
        "outcome": str(run.outcome if run else Outcome.NO_PATH),
        "reason": run.reason if run else f"{plan.status}: {plan.reason}",
        "n_traces": int(crowd.traces["vehicle_id"].nunique()) if crowd else None,
        "n_components": made.figures.get("n_components"),
        **asdict(quality),
        "min_clearance_devices_m": headline.get("min_clearance_devices_m"),
        "min_clearance_road_edge_m": headline.get("min_clearance_road_edge_m"),
        "closed_area_share": headline.get("closed_area_share"),
        "planned": before,
        "driven": after,
        "clean": not faults,
        "faults": "; ".join(faults),
        "conduct": asdict(conduct) if conduct else None,
        "plan_status": str(plan.status),
        "plan_speed_mps": plan.speed_mps,
        "plan_risk_m": plan.risk_m,
        "n_expansions": plan.n_expansions,
        "waited_s": run.waited_s if run else None,
        "drive_time_s": float(moved.log["time_s"].iloc[-1] - moved.log["time_s"].iloc[0]) if moved else None,
        "max_cross_track_m": float(moved.log["cross_track_m"].abs().max()) if moved else None,
        "drive": _drive_figures(moved, over_zone, scenario=scenario, site=site) if moved else None,
        "n_replans": len(run.replans) if run else 0,
        "replans": [asdict(replan) for replan in run.replans] if run else [],
        "alarms": made.figures.get("alarms", []),
        "false_alarms": made.figures.get("false_alarms", []),
        "plan_ms": plan.timings_ms["total"],
    }


def _drive_figures(run: EgoRun, over_zone: pd.DataFrame, *, scenario: Scenario, site: Site) -> dict[str, Any]:
    measured = asdict(measure_drive(run, scenario.vehicle, road=site.layout.road))
    if over_zone.empty:  # nobody passes a road that is closed: there is no pace to compare with
        return measured | dict.fromkeys((field.name for field in fields(DelayBehind)), None)
    return measured | asdict(delay_behind(run.log, run.followers, over_zone, road=site.layout.road, vehicle=scenario.vehicle))


def goal_figures(plan: Plan, *, lane: int, scenario: Scenario, site: Site) -> dict[str, Any]:
    """Figures of the planned path to one goal, as if the ego drove it exactly on an empty road."""
    figures: dict[str, Any] = {"lane": lane, "plan_status": str(plan.status), "planned_outcome": "NO_PATH"}
    if plan.path is None:
        return figures | {"reason": plan.reason, "closed_area_share": None, "n_devices_struck": None, "length_m": None}
    poses = plan.path.poses
    contact = ContactChecker(site.layout, scenario.vehicle).contact_along(poses)
    clearance = clearance_along(poses, vehicle=scenario.vehicle, layout=site.layout)
    return figures | {
        "planned_outcome": str(contact.outcome),
        "first_contact_m": contact.first_contact_m,
        "n_devices_struck": contact.n_devices_struck,
        "length_m": float(plan.path.arc_length[-1]),
        **asdict(clearance),
    }


def lidar_figures(lidar: LidarBaseline) -> dict[str, Any]:
    """Figures of a LiDAR mapping drive."""
    return {
        "vehicle_id": lidar.vehicle_id,
        "n_scans": len(lidar.poses),
        "scan_states": lidar.states,
        "ate_m": lidar.ate_m,
        "dead_reckoning_ate_m": lidar.dead_reckoning_ate_m,
        "n_devices_mapped": len(lidar.maps.devices),
        "n_links": len(lidar.maps.links),
    }
