"""What the command line does, one function a verb: files in, files out, figures returned."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from tqdm import tqdm

from wzsumo.crowd_mapping.drivable_area import MixtureSpec
from wzsumo.errors import InputError, SpecError
from wzsumo.grid import blank_grid
from wzsumo.output import staged_folder
from wzsumo.simulation.files import write_sumo_files
from wzsumo.study.foreign_traces import map_foreign_traces
from wzsumo.study.interface import run_case
from wzsumo.study.layout_figure import draw_zone
from wzsumo.study.layout_files import layout_geojson, write_layout
from wzsumo.study.mapping_methods import learn_from
from wzsumo.study.report import write_report
from wzsumo.study.result_folder import ResultFolder
from wzsumo.study.result_store import MANIFEST, read_study
from wzsumo.study.scenario import load_scenario
from wzsumo.study.study_file import find_case
from wzsumo.study.sweep_report import write_sweep_report

Figures = dict[str, Any]


def lay_out_scenario(scenario: Path, out: Path) -> Figures:
    """Write layout.geojson, devices.csv and layout.png; lengths and areas of the zone."""
    layout = load_scenario(scenario).layout()
    with staged_folder(out) as stage:
        write_layout(layout, stage)
        drawing = ResultFolder(folder=stage, result={}, layout=layout_geojson(layout))
        draw_zone(drawing).savefig(stage / "layout.png")
    return {
        "areas_m": {area.name: round(area.length, 3) for area in layout.areas},
        "start_m": layout.start,
        "end_m": layout.end,
        "n_devices": len(layout.devices),
        "drivable_m2": layout.drivable.area,
        "closed_area_m2": layout.closed_area.area,
        "pavement_m2": layout.pavement.area,
    }


def capacity_of_scenario(scenario: Path) -> Figures:
    """Capacity, queue discharge and free-flow speed of a scenario's zone by the HCM, and the flow that arrives at it."""
    spec = load_scenario(scenario)
    try:
        capacity = spec.capacity()
    except SpecError as error:
        raise SpecError(f"{scenario}: {error}") from None
    return asdict(capacity) | {"demand_flow_vph": spec.simulation.demand.flow_vph}


def write_net(scenario: Path, out: Path) -> Figures:
    """Write the SUMO files of a scenario; edges and lanes."""
    spec = load_scenario(scenario)
    with staged_folder(out) as stage:
        files = write_sumo_files(spec.layout(), stage, spec=spec.zone_simulation(), seed=spec.seed)
    return {"config": str(out / files.config.name), "edges": {edge.id: len(edge.through) for edge in files.edges}}


def run_scenario(scenario: Path, out: Path, *, seed: int | None, methods: list[str] | None, in_window: bool) -> Figures:
    """Run a whole case into `out`; its result."""
    return run_case(load_scenario(scenario, seed=seed), out, methods=methods, progress=progress_bar, in_window=in_window)


def run_case_again(folder: Path, out: Path, *, case: str, in_window: bool) -> Figures:
    """Run one case of a study alone, with its maps, paths, figures and report; its result."""
    found = find_case(read_study(folder), case)
    return run_case(found.scenario, out, methods=[found.method], progress=progress_bar, in_window=in_window)


def map_traces(traces: Path, out: Path, *, method: str, seed: int, resolution_m: float, road: Path | None = None) -> Figures:
    """Write map.pgm and map.yaml of anybody's traces; what they are made of and what was left out."""
    return map_foreign_traces(
        traces, out, method=method, seed=seed, resolution_m=resolution_m, road=road, progress=progress_bar
    )


def report_again(folder: Path) -> Figures:
    """Write the report of a run's or a study's folder again."""
    if (folder / MANIFEST).is_file():
        return {"report": str(write_sweep_report(folder))}
    if not (folder / "result.json").is_file():
        raise InputError(f"{folder}: holds no result.json; name the --out folder of a finished `wzsumo run` or `wzsumo sweep`")
    try:
        json.loads((folder / "result.json").read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{folder / 'result.json'}: not JSON ({error}); run the scenario again") from None
    return {"report": str(write_report(folder))}


def warm_up() -> Figures:
    """Compile every numba kernel once, so that no first run waits."""
    from wzsumo.crowd_mapping.lane_structure import LaneStructureSpec, lane_structured_map
    from wzsumo.crowd_mapping.reference_line import axis_of
    from wzsumo.lidar_mapping import slam_map
    from wzsumo.metrics import fleet_conflicts
    from wzsumo.planning import plan
    from wzsumo.sensing import gnss, raycast

    for stage in (fleet_conflicts, plan, gnss, raycast, slam_map):
        stage.compile_kernels()
    s = np.arange(0.0, 300.0, 5.0)
    traces = pd.concat(
        pd.DataFrame({"vehicle_id": f"v{n}", "time_s": s / 20, "x_m": s, "y_m": 0.2 * n + 0.01 * np.sin(s)}) for n in range(4)
    )
    learn_from(traces, road=axis_of(np.array([[0.0, 0.0], [300.0, 0.0]])), spec=MixtureSpec(k_max=4), seed=1)
    cells = blank_grid((-10.0, -10.0, 310.0, 10.0), resolution=0.5, p_occupied=1.0)
    lane_structured_map(traces, spec=LaneStructureSpec(posted_speed_mph=45), grid=cells, seed=1)
    return {"warm": True}


@contextmanager
def progress_bar(name: str, total: float) -> Iterator[Any]:
    """A bar on stderr; its value is called with how far the step has come."""
    with tqdm(total=total, desc=f"{name:<24}", bar_format="{desc}{percentage:3.0f} %|{bar:30}| {elapsed}<{remaining}") as bar:

        def tell(done: float) -> None:
            bar.update(min(done, total) - bar.n)

        yield tell
