"""One case from the zone to its figures: the page that reads like the paper."""

import time
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from wzsumo import __version__
from wzsumo.case.assessment import assess, goal_figures, site_with_open_goal
from wzsumo.case.baselines import map_baselines
from wzsumo.case.closed_loop import Drive, drive_path
from wzsumo.case.crowd import Crowd, learn_from, reported_traces, traces_over_zone
from wzsumo.case.files import write_crowd, write_method, write_path, write_result, write_traces, write_traffic
from wzsumo.case.map_and_plan import map_of_zone, plan_for
from wzsumo.case.map_updates import arriving_crowds, new_maps, plan_to_set_out_with
from wzsumo.case.replanning import NewMap
from wzsumo.ego import EgoRun
from wzsumo.errors import SpecError
from wzsumo.files.layout import write_layout
from wzsumo.grid import OccupancyGrid
from wzsumo.metrics.fleet import summarise_fleet
from wzsumo.metrics.traffic import measure_traffic
from wzsumo.planning.plan import Plan, load_kernels
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.site import Site, prepare_site
from wzsumo.simulation.files import SumoFiles, write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.simulation.trips import read_trips, trips_file
from wzsumo.spec import write_toml

DRIVE_LIMIT_S = 400.0
NOT_RUN = {"slam": "not part of this run; `make baselines` runs it in the paper's zone, --method in any other"}


class Progress(Protocol):
    """Tells a person how far a long step is."""

    def __call__(self, name: str, total: float) -> AbstractContextManager[Any]:
        """A context manager whose value is called with how far the step has come, in the unit of `total`."""


def run_case(
    scenario: Scenario, folder: Path, *, methods: Iterable[str], progress: Progress, in_window: bool = False
) -> dict[str, Any]:
    """Figures of one case, as in the result.json that it writes into `folder` beside maps, paths, drives and traces.

    `in_window` shows each drive in sumo-gui.
    """
    clock = _Clock()
    site = prepare_site(scenario)
    write_layout(site.layout, folder)
    write_toml(scenario.model_dump(mode="json"), folder / "scenario.toml")

    sumo = folder / "sumo"
    sumo.mkdir()
    simulation = scenario.zone_simulation()
    with clock.timing("network"):
        files = write_sumo_files(site.layout, sumo, spec=simulation, seed=scenario.seed)
    with clock.timing("fleet"), progress("fleet in SUMO", files.duration) as tell:
        fleet = simulate_fleet(files, on_second=tell)
    with clock.timing("traffic measures"):
        trips = read_trips(trips_file(files))
        traffic = measure_traffic(fleet, trips, site.layout, dt=files.step_length, warm_up_s=simulation.demand.warm_up_s)
    write_traffic(traffic, folder)

    over_zone = traces_over_zone(fleet, site.layout)
    collected = reported_traces(over_zone, scenario, which="collected")
    used = reported_traces(over_zone, scenario, which="used")
    write_traces(collected, used=used, folder=folder)
    with clock.timing("mixture"), progress("mixtures", 1.0) as tell:
        crowd = learn_from(
            used,
            road=site.layout.road,
            spec=scenario.mixture,
            seed=scenario.seed,
            progress=lambda done, total: tell(done / total),
        )
    write_crowd(crowd, folder)
    arriving = arriving_crowds(over_zone, scenario, site)

    chosen, results = list(methods), {}
    load_kernels()  # not part of what planning takes
    with clock.timing("baselines"):
        baselines = map_baselines(chosen, fleet, scenario=scenario, site=site, progress=progress)
    for method in chosen:
        with clock.timing(f"map {method}"):
            baseline = baselines.maps.get(method)
            grid = baseline or map_of_zone(method, crowd, scenario=scenario, site=site)
        crowd_of_map = None if baseline else crowd
        set_out = plan_for if baseline else plan_to_set_out_with
        plan = set_out(method, grid, scenario=scenario, site=site, crowd=crowd_of_map)
        maps = () if baseline else new_maps(arriving, method, scenario=scenario, site=site)
        with clock.timing(f"drive {method}"):
            run = drive_plan(
                plan, method, scenario=scenario, site=site, files=files, progress=progress, new_maps=maps, in_window=in_window
            )
        results[method] = assess(grid, plan, run, crowd=crowd_of_map, over_zone=over_zone, scenario=scenario, site=site)
        write_method(folder, method, grid, plan, run)
        results[method]["goals"] = goals_of(method, grid, plan, scenario=scenario, site=site, crowd=crowd_of_map, folder=folder)

    result = {
        "scenario": scenario.name,
        "seed": scenario.seed,
        "version": __version__,
        "n_collected": int(collected["vehicle_id"].nunique()),
        "n_traces": int(used["vehicle_id"].nunique()),
        "n_components": crowd.mixture.n_components,
        "n_components_rule": scenario.mixture.criterion,
        "fleet": asdict(summarise_fleet(fleet, site.layout)),
        "traffic": asdict(traffic.summary) | {"hcm_queue_discharge_vph": hcm_queue_discharge_vph(scenario)},
        "drivers": simulation.demand.drivers.model_dump(mode="json"),
        "methods": results,
        "slam": baselines.slam,
        "not_run": {} if baselines.slam else NOT_RUN,
        "timings_s": clock.seconds,
    }
    return write_result(result, folder)


def hcm_queue_discharge_vph(scenario: Scenario) -> float | None:
    """What the HCM lets the zone discharge [veh/h], all lanes; None where its model does not hold."""
    try:
        return scenario.capacity().queue_discharge_all_lanes_vph
    except SpecError:
        return None


def goals_of(
    method: str, grid: OccupancyGrid, plan: Plan, *, scenario: Scenario, site: Site, crowd: Crowd | None, folder: Path
) -> dict[str, dict[str, Any]]:
    """Figures of the planned paths to the ego's own lane (`plan`) and, where the scenario asks for it, to the open lane."""
    goals = {"own_lane": goal_figures(plan, lane=scenario.route.goal_lane, scenario=scenario, site=site)}
    lane, other = scenario.route.open_goal_lane, site_with_open_goal(site)
    if lane is not None and other is not None:
        to_open = plan_for(method, grid, scenario=scenario, site=other, crowd=crowd)
        goals["open_lane"] = goal_figures(to_open, lane=lane, scenario=scenario, site=other)
        write_path(folder, f"{method}_to_open_lane", to_open)
    return goals


def drive_plan(
    plan: Plan,
    method: str,
    *,
    scenario: Scenario,
    site: Site,
    files: SumoFiles,
    progress: Progress,
    new_maps: Iterable[NewMap] = (),
    in_window: bool = False,
) -> EgoRun | None:
    """The ego's run along the plan through the traffic of `files`, None where there is no path to drive.

    `new_maps` reach it on the way; `in_window` shows it in sumo-gui.
    """
    if plan.path is None:
        return None
    drive = Drive(
        vehicle=scenario.vehicle, control=scenario.control, plant=scenario.plant,
        depart_s=scenario.simulation.demand.warm_up_s, time_limit_s=DRIVE_LIMIT_S, in_window=in_window,
    )  # fmt: skip
    with progress(f"drive on {method}", float(plan.path.arc_length[-1])) as tell:
        return drive_path(plan.path, layout=site.layout, files=files, drive=drive, on_step=tell, new_maps=new_maps)


class _Clock:
    """Seconds that each step took."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def timing(self, name: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self.seconds[name] = round(time.perf_counter() - began, 3)


@contextmanager
def quiet_progress(name: str, total: float) -> Iterator[Any]:
    """A Progress that tells nobody."""
    del name, total
    yield lambda _done: None
