"""What a worker of a sweep does: simulate a fleet, or evaluate cases on a simulated fleet. Bytes in, plain values out.

Workers need no folder in common: what a simulation gives comes back as the bytes of a Parquet file, and goes out again so.
"""

import io
import json
import resource
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from wzsumo.case.assessment import assess
from wzsumo.case.baselines import BASELINE_METHODS, HD_MAP_METHODS, SLAM_METHODS, Baselines, map_baselines
from wzsumo.case.case import drive_plan, quiet_progress
from wzsumo.case.crowd import Crowd, learn_from, reported_traces, traces_over_zone
from wzsumo.case.map_and_plan import map_of_zone, plan_for
from wzsumo.case.map_updates import arriving_crowds, new_maps, plan_to_set_out_with
from wzsumo.case.replanning import NewMap
from wzsumo.ego import EgoRun
from wzsumo.errors import InputError
from wzsumo.files.output import parquet_bytes
from wzsumo.grid import OccupancyGrid
from wzsumo.metrics.fleet import summarise_fleet
from wzsumo.metrics.traffic import measure_traffic
from wzsumo.planning.plan import Plan, PlanStatus, load_kernels
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.site import Site, prepare_site
from wzsumo.sensing.equipped import choose_equipped, first_traces
from wzsumo.simulation.files import SumoFiles, write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.simulation.trips import read_trips, trips_file
from wzsumo.sweep.study_case import StudyCase

FLEET_FIGURES = (
    "n_passed", "mean_speed_activity_mps", "throughput_vph", "mean_delay_s", "max_queue_length_m", "n_hard_braking",
)  # fmt: skip
# Sections of a scenario that a map does not depend on, once the crowd is learned from. One that is forgotten here costs a map.
_AFTER_MAP = frozenset({"name", "planner", "control", "plant", "map_updates", "slam"})
_FLEET = b"fleet"  # key of the fleet's summary in the Parquet file
_ONE_SIMULATION = threading.Lock()  # libsumo allows one a process, and a Dask worker may run several threads


def simulate(scenario: Scenario) -> bytes:
    """A Parquet file with the true traces over the zone, and the fleet's summary in its metadata."""
    layout = scenario.layout()
    with _ONE_SIMULATION, _in_processor_seconds() as spent, tempfile.TemporaryDirectory(prefix="wzsumo-") as folder:
        files = write_sumo_files(layout, Path(folder), spec=scenario.zone_simulation(), seed=scenario.seed)
        fleet = simulate_fleet(files, on_second=lambda _time: None)
        traffic = measure_traffic(
            fleet, read_trips(trips_file(files)), layout, dt=files.step_length, warm_up_s=scenario.simulation.demand.warm_up_s
        )
    summary = asdict(summarise_fleet(fleet, layout)) | asdict(traffic.summary) | {"simulation_cpu_s": spent[0]}
    table = pa.Table.from_pandas(traces_over_zone(fleet, layout), preserve_index=False)
    metadata = dict(table.schema.metadata or {}) | {_FLEET: json.dumps(summary).encode()}
    return parquet_bytes(table.replace_schema_metadata(metadata))


def evaluate(simulated: bytes, cases: Sequence[StudyCase]) -> list[dict[str, Any]]:
    """One row a case, on the fleet that `simulate` gave for all of them; those of one source should be neighbours.

    A case that cannot be, such as one that asks for more traces than the fleet gives, has status REFUSED and the reason.
    """
    over_zone, fleet = read_simulated(simulated)
    shared = _Shared(over_zone)
    load_kernels()  # not part of what planning takes
    rows = []
    for case in cases:
        with _in_processor_seconds() as spent:
            try:
                row = shared.collection_of(case) | shared.evaluation_of(case) | {"status": "DONE"}
            except InputError as error:
                row = {"status": "REFUSED", "reason": str(error)}
        known = {"case": case.id} | {f"fleet_{name}": fleet[name] for name in FLEET_FIGURES}
        rows.append(known | row | {"case_cpu_s": spent[0]})
    return rows


def read_simulated(simulated: bytes) -> tuple[pd.DataFrame, dict[str, Any]]:
    """The traces over the zone and the fleet's summary. Raises OSError where a byte of the file is not as it was written."""
    table = pq.read_table(io.BytesIO(simulated), page_checksum_verification=True)
    return table.to_pandas(), json.loads(table.schema.metadata[_FLEET])


class _Shared:
    """What neighbouring cases have in common, kept for the next: the site, what maps are made of, whole evaluations."""

    def __init__(self, over_zone: pd.DataFrame) -> None:
        self._over_zone = over_zone
        self._passed_at_s = over_zone.groupby("vehicle_id")["time_s"].max()
        self._site: tuple[str, Site] | None = None
        self._learned: tuple[str, Crowd | Baselines] | None = None
        self._maps: dict[str, OccupancyGrid] = {}  # of that source
        self._evaluations: dict[str, dict[str, Any]] = {}  # of that source

    def collection_of(self, case: StudyCase) -> dict[str, Any]:
        """How many equipped vehicles passed, and how long it took until as many had passed as the map uses."""
        if case.method in BASELINE_METHODS:
            return {}
        crowd = case.scenario.crowd
        equipped = choose_equipped(self._passed_at_s.index, penetration=crowd.penetration, seed=case.scenario.seed)
        first_traces(equipped, crowd.used, key="crowd.used")
        in_turn = self._passed_at_s[equipped].sort_values().to_numpy()
        waited_s = in_turn[crowd.used - 1] - self._passed_at_s.min()
        return {"n_equipped": len(equipped), "minutes_to_collect": float(waited_s) / 60}

    def evaluation_of(self, case: StudyCase) -> dict[str, Any]:
        learned = self._learned_for(case)
        if case.evaluation not in self._evaluations:
            site = self._site_of(case.scenario)
            grid = self._map_of(case, learned, site)
            self._evaluations[case.evaluation] = _evaluated(case, learned, grid, self._over_zone, site)
        return self._evaluations[case.evaluation]

    def _map_of(self, case: StudyCase, learned: Crowd | Baselines, site: Site) -> OccupancyGrid:
        """The method's map, which cases share that differ in how the ego plans and drives."""
        if isinstance(learned, Baselines):
            return learned.maps[case.method]
        key = case.method + case.scenario.model_dump_json(exclude=set(_AFTER_MAP))
        if key not in self._maps:
            self._maps = {key: map_of_zone(case.method, learned, scenario=case.scenario, site=site)}
        return self._maps[key]

    def _site_of(self, scenario: Scenario) -> Site:
        key = scenario.model_dump_json(include={"road", "work_zone", "route", "map", "vehicle"})
        if self._site is None or self._site[0] != key:
            self._site = (key, prepare_site(scenario))
        return self._site[1]

    def _learned_for(self, case: StudyCase) -> Crowd | Baselines:
        if self._learned is None or self._learned[0] != case.source:
            baseline = case.method in BASELINE_METHODS
            learned = _baselines(case, self._site_of(case.scenario)) if baseline else self._crowd(case.scenario)
            self._learned, self._evaluations, self._maps = (case.source, learned), {}, {}
        return self._learned[1]

    def _crowd(self, scenario: Scenario) -> Crowd:
        used = reported_traces(self._over_zone, scenario, which="used")
        return learn_from(used, road=self._site_of(scenario).layout.road, spec=scenario.mixture, seed=scenario.seed)


def _baselines(case: StudyCase, site: Site) -> Baselines:
    """The maps of before, or those of a LiDAR drive through the fleet, which sees more of the road than the traces cover."""
    if case.method not in SLAM_METHODS:
        return map_baselines(HD_MAP_METHODS, pd.DataFrame(), scenario=case.scenario, site=site, progress=quiet_progress)
    with _simulation_files(case.scenario, site) as files:
        fleet = simulate_fleet(files, on_second=lambda _time: None)
    return map_baselines(SLAM_METHODS, fleet, scenario=case.scenario, site=site, progress=quiet_progress)


def _evaluated(
    case: StudyCase, learned: Crowd | Baselines, grid: OccupancyGrid, over_zone: pd.DataFrame, site: Site
) -> dict[str, Any]:
    scenario, maps = case.scenario, tuple[NewMap, ...]()
    if isinstance(learned, Baselines):
        crowd, slam = None, learned.slam
        plan = plan_for(case.method, grid, scenario=scenario, site=site, crowd=None)
    else:
        crowd, slam = learned, {}
        plan = plan_to_set_out_with(case.method, grid, scenario=scenario, site=site, crowd=crowd)
        maps = (
            new_maps(arriving_crowds(over_zone, scenario, site), case.method, scenario=scenario, site=site)
            if case.drive
            else ()
        )
    run = _drive(plan, case, site, maps) if case.drive else None
    figures = assess(grid, plan, run, crowd=crowd, over_zone=over_zone, scenario=scenario, site=site)
    figures |= {f"slam_{name}": value for name, value in slam.items()}
    del figures["replans"]  # their number stays
    planned, driven, measured = (figures.pop(name) or {} for name in ("planned", "driven", "drive"))
    figures |= {f"planned_{name}": value for name, value in planned.items()}
    figures |= {f"driven_{name}": value for name, value in (driven | measured).items()}
    if plan.path is not None and not case.drive:
        figures |= {"outcome": None, "reason": ""}
    return figures | {
        "path_length_m": float(plan.path.arc_length[-1]) if plan.path else None,
        "safe_plan": plan.status == PlanStatus.FOUND and _keeps_clear(planned),
    }


def _keeps_clear(planned: dict[str, float]) -> bool:
    """Whether the outline along the planned path touches no device, no edge of the pavement and not the closed area."""
    clearances = (planned["min_clearance_devices_m"], planned["min_clearance_road_edge_m"])
    return min(clearances) > 0 and planned["closed_area_share"] == 0


def _drive(plan: Plan, case: StudyCase, site: Site, maps: Sequence[NewMap]) -> EgoRun | None:
    scenario = case.scenario
    with _simulation_files(scenario, site) as files:
        return drive_plan(plan, case.method, scenario=scenario, site=site, files=files, progress=quiet_progress, new_maps=maps)


@contextmanager
def _simulation_files(scenario: Scenario, site: Site) -> Iterator[SumoFiles]:
    with _ONE_SIMULATION, tempfile.TemporaryDirectory(prefix="wzsumo-") as folder:
        yield write_sumo_files(site.layout, Path(folder), spec=scenario.zone_simulation(), seed=scenario.seed)


@contextmanager
def _in_processor_seconds() -> Iterator[list[float]]:
    """A list that holds the processor time [s] of the block, and of the programs it ran, once it is over."""
    spent: list[float] = []
    began = _processor_s()
    yield spent
    spent.append(round(_processor_s() - began, 4))


def _processor_s() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.thread_time() + children.ru_utime + children.ru_stime
