"""What the command line does, one function a verb: files in, files out, figures returned."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from wzsumo.api import run_case
from wzsumo.case.result_folder import ResultFolder
from wzsumo.commands.map import map_foreign_traces
from wzsumo.commands.progress import progress_bar
from wzsumo.errors import InputError, SpecError
from wzsumo.figures.layout_figure import draw_zone
from wzsumo.files.layout import layout_geojson, write_layout
from wzsumo.files.output import staged_folder
from wzsumo.report.report import write_report
from wzsumo.report.sweep_report import write_sweep_report
from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.files import write_sumo_files
from wzsumo.sweep.store import MANIFEST, read_study
from wzsumo.sweep.study_file import find_case

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
    return {"config": str(out / files.config.name), "edges": {edge.id: len(edge.through_lanes) for edge in files.edges}}


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
