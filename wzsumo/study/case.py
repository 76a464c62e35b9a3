"""One case from the zone to its figures: the page that reads like the paper."""

import json
import math
import time
from collections.abc import Iterable
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd

from wzsumo import __version__
from wzsumo.ego import EgoRun, Outcome
from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid, blank_grid, cells_inside, write_map
from wzsumo.metrics.clearance import clearance_along
from wzsumo.metrics.fleet import passages, summarise_fleet
from wzsumo.metrics.map_quality import map_quality
from wzsumo.planning.plan import Plan, plan_path
from wzsumo.sensing.equipped import choose_equipped, first_traces
from wzsumo.sensing.gnss import report
from wzsumo.simulation.files import SumoFiles, write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.spec import write_toml
from wzsumo.study.closed_loop import Drive, drive_path
from wzsumo.study.layout_files import write_layout
from wzsumo.study.mapping_methods import MAP_METHODS, Crowd, learn_from, planner_for
from wzsumo.study.scenario import Scenario
from wzsumo.work_zone import WorkZoneLayout

WARM_UP_S = 120.0  # the road is full after the slowest vehicle has passed it once (1.8 km at 21 m/s: 87 s)
DRIVE_LIMIT_S = 400.0
TRACE_MARGIN_M = 50.0  # traces reach this far beyond the zone, so that what is learned joins the nominal map
NOT_RUN = {"slam": "the LiDAR SLAM baseline is not part of this run"}


class Progress(Protocol):
    """Tells a person how far a long step is."""

    def __call__(self, name: str, total: float) -> Any:
        """A context manager whose value is called with how far the step has come, in the unit of `total`."""


def run_case(scenario: Scenario, folder: Path, *, methods: Iterable[str], progress: Progress) -> dict[str, Any]:
    """Figures of one case, as in the result.json that it writes into `folder` beside maps, paths, drives and traces."""
    clock = _Clock()
    layout = scenario.layout()
    start, goal = scenario.start_and_goal(layout)
    write_layout(layout, folder)
    write_toml(scenario.model_dump(mode="json"), folder / "scenario.toml")

    sumo = folder / "sumo"
    sumo.mkdir()
    with clock.timing("network"):
        files = write_sumo_files(layout, sumo, spec=scenario.simulation, seed=scenario.seed)
    with clock.timing("fleet"), progress("fleet in SUMO", files.duration) as tell:
        fleet = simulate_fleet(files, on_second=tell)
    collected, used = _collect(fleet, layout, scenario)
    traces = pd.concat([collected.assign(used=False), used.assign(used=True)]).drop_duplicates(
        ["vehicle_id", "time_s"], keep="last", ignore_index=True
    )
    traces.to_parquet(folder / "traces.parquet", index=False)

    with clock.timing("mixture"), progress("mixtures", 2 * scenario.mixture.k_max) as tell:
        crowd = learn_from(used, spec=scenario.mixture, seed=scenario.seed, progress=lambda done, _: tell(done))
    _write_crowd(crowd, folder)
    results = {}
    for method in methods:
        with clock.timing(f"map {method}"):
            grid = build_map(method, crowd, scenario=scenario, layout=layout)
        plan = plan_path(grid, start=start, goal=goal, vehicle=scenario.vehicle, spec=planner_for(method, scenario.planner))
        with clock.timing(f"drive {method}"):
            run = _drive(plan, method, scenario=scenario, layout=layout, files=files, progress=progress)
        results[method] = _figures(grid, plan, run, crowd=crowd, scenario=scenario, layout=layout)
        _write_method(folder, method, grid, plan, run)

    result = {
        "scenario": scenario.name,
        "seed": scenario.seed,
        "version": __version__,
        "n_collected": int(traces["vehicle_id"].nunique()),
        "n_traces": int(used["vehicle_id"].nunique()),
        "n_components": crowd.mixture.n_components,
        "n_components_rule": scenario.mixture.criterion,
        "fleet": asdict(summarise_fleet(fleet, layout)),
        "methods": results,
        "not_run": NOT_RUN,
        "timings_s": clock.seconds,
    }
    result = _without_nan(result)
    (folder / "result.json").write_text(json.dumps(result, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return result


def build_map(method: str, crowd: Crowd, *, scenario: Scenario, layout: WorkZoneLayout) -> OccupancyGrid:
    """The map that a method makes of the crowd; outside the zone, where the road is as it was, the nominal map holds."""
    road = layout.road
    start, goal = scenario.start_and_goal(layout)
    (from_station, to_station), _ = road.to_sd([start[:2], goal[:2]])
    ends = (float(from_station) - 20.0, float(to_station) + 20.0)  # the vehicle reaches beyond its rear axle
    surface = road.strip(*ends, -road.right_shoulder, road.left_edge).buffer(scenario.map.margin_m)
    cells = blank_grid(surface.bounds, resolution=scenario.map.resolution_m, p_occupied=1.0)
    make = MAP_METHODS[method]
    learned = make(crowd, spec=scenario.mixture, cells=cells, half_width_m=scenario.vehicle.width_m / 2, seed=scenario.seed)
    nominal = np.zeros(cells.shape, dtype=bool)
    for stretch in ((ends[0], layout.start), (layout.end, ends[1])):
        nominal |= cells_inside(cells, road.strip(*stretch, 0.0, road.travelled_width))
    return learned.with_p_occupied(np.where(nominal, 0.0, learned.p_occupied))


def _collect(fleet: pd.DataFrame, layout: WorkZoneLayout, scenario: Scenario) -> tuple[pd.DataFrame, pd.DataFrame]:
    """(collected, used) traces of equipped vehicles over the zone, as they report them."""
    equipped = choose_equipped(passages(fleet, layout), penetration=scenario.crowd.penetration, seed=scenario.seed)
    collected_ids = first_traces(equipped, scenario.crowd.collected, key="crowd.collected")
    used_ids = first_traces(equipped, scenario.crowd.used, key="crowd.used")
    station, _ = layout.road.to_sd(fleet[["x_m", "y_m"]])
    in_zone = (station >= layout.start - TRACE_MARGIN_M) & (station <= layout.end + TRACE_MARGIN_M)
    passing = fleet[in_zone & fleet["vehicle_id"].isin(collected_ids).to_numpy()]
    reported = report(passing, spec=scenario.gnss, seed=scenario.seed)
    return reported, reported[reported["vehicle_id"].isin(used_ids)].reset_index(drop=True)


def _drive(
    plan: Plan, method: str, *, scenario: Scenario, layout: WorkZoneLayout, files: SumoFiles, progress: Progress
) -> EgoRun | None:
    if plan.path is None:
        return None
    drive = Drive(
        vehicle=scenario.vehicle, control=scenario.control, plant=scenario.plant, depart_s=WARM_UP_S, time_limit_s=DRIVE_LIMIT_S
    )
    with progress(f"drive on {method}", float(plan.path.arc_length[-1])) as tell:
        return drive_path(plan.path, layout=layout, files=files, drive=drive, on_step=tell)


def _figures(
    grid: OccupancyGrid, plan: Plan, run: EgoRun | None, *, crowd: Crowd, scenario: Scenario, layout: WorkZoneLayout
) -> dict[str, Any]:
    truth = layout.drivable_between(layout.start, layout.end)
    road = layout.road
    beside = layout.road.right_shoulder + scenario.map.margin_m
    within = road.strip(layout.start, layout.end, -beside, road.left_edge + scenario.map.margin_m)
    quality = map_quality(grid, truth=truth, within=within)

    def clearance(poses: FloatArray) -> dict[str, float]:
        return asdict(clearance_along(poses, vehicle=scenario.vehicle, layout=layout))

    planned = clearance(plan.path.poses) if plan.path else None
    driven = clearance(run.poses) if run is not None and len(run.log) > 1 else None
    first = driven or planned or {}
    return {
        "outcome": str(run.outcome if run else Outcome.NO_PATH),
        "reason": run.reason if run else f"{plan.status}: {plan.reason}",
        "n_traces": int(crowd.traces["vehicle_id"].nunique()),
        "n_components": crowd.mixture.n_components,
        **asdict(quality),
        "min_clearance_devices_m": first.get("min_clearance_devices_m"),
        "min_clearance_road_edge_m": first.get("min_clearance_road_edge_m"),
        "closed_area_share": first.get("closed_area_share"),
        "planned": planned,
        "driven": driven,
        "plan_status": str(plan.status),
        "plan_risk_m": plan.risk_m,
        "n_expansions": plan.n_expansions,
        "drive_time_s": float(run.log["time_s"].iloc[-1] - run.log["time_s"].iloc[0]) if driven and run else None,
        "max_cross_track_m": float(run.log["cross_track_m"].abs().max()) if driven and run else None,
        "plan_ms": plan.timings_ms["total"],
    }


def _write_crowd(crowd: Crowd, folder: Path) -> None:
    crowd.sweep.table.to_csv(folder / "mixture_sweep.csv", index=False)
    mixture = {name: getattr(crowd.mixture, name).tolist() for name in ("weights", "means", "covariances")}
    (folder / "mixture.json").write_text(json.dumps(mixture), encoding="utf-8")
    pd.DataFrame(crowd.samples, columns=["x_m", "y_m"]).to_csv(folder / "samples.csv", index=False, float_format="%.4f")


def _write_method(folder: Path, method: str, grid: OccupancyGrid, plan: Plan, run: EgoRun | None) -> None:
    for name in ("maps", "paths", "drives"):
        (folder / name).mkdir(exist_ok=True)
    write_map(grid, folder / "maps", name=method)
    if plan.path:
        plan.path.to_csv(folder / "paths" / f"{method}.csv")
    if run:
        run.log.to_csv(folder / "drives" / f"{method}.csv", index=False, float_format="%.5f")


def _without_nan(value: Any) -> Any:
    """JSON knows no NaN: a figure that there is not becomes null."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


class _Clock:
    """Seconds that each step took."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def timing(self, name: str) -> Any:
        began = time.perf_counter()
        yield
        self.seconds[name] = round(time.perf_counter() - began, 3)


def quiet_progress(name: str, total: float) -> Any:
    """A Progress that tells nobody."""
    del name, total

    @contextmanager
    def silent() -> Any:
        def tell(done: float) -> None:
            del done

        yield tell

    return silent()
