"""The files of one case in its result folder."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from wzsumo import __version__
from wzsumo.case.assessment import lidar_figures
from wzsumo.case.case import CaseResult
from wzsumo.case.crowd import Crowd
from wzsumo.case.evaluation import MethodResult
from wzsumo.errors import SpecError
from wzsumo.files.layout import write_layout
from wzsumo.files.result_folder import RESULT_FORMAT
from wzsumo.files.ros_map import write_map
from wzsumo.metrics.network_traffic import network_figures
from wzsumo.metrics.traffic import TrafficMeasures
from wzsumo.planning.plan import Plan
from wzsumo.scenario.scenario import Scenario
from wzsumo.spec import write_toml

NOT_RUN = {"slam": "not part of this run; `make baselines` runs it in the paper's zone, --method in any other"}


def write_case(result: CaseResult, folder: Path) -> dict[str, Any]:
    """The content of result.json; written to `folder` with layout, traffic, traces, mixture, maps, paths and drives."""
    facility = result.scenario.facility()
    write_layout(facility.layout, folder, frame=facility.frame)
    write_toml(result.scenario.model_dump(mode="json"), folder / "scenario.toml")
    _write_traffic(result.fleet.traffic, folder)
    if result.fleet.network is not None:
        result.fleet.network.edges.to_csv(folder / "traffic" / "edges.csv", index=False, float_format="%.3f")
    _write_traces(result.collected, used=result.crowd.traces if result.crowd else result.collected, folder=folder)
    if result.crowd and result.crowd.is_fitted:
        _write_crowd(result.crowd, folder)
    for name, method in result.methods.items():
        _write_method(folder, name, method)
    for name, plan in result.to_open_lane.items():
        _write_path(folder, f"{name}_to_open_lane", plan)
    content: dict[str, Any] = _without_nan(result_json(result))
    (folder / "result.json").write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return content


def result_json(result: CaseResult) -> dict[str, Any]:
    """The figures of a case by the names that result.json has for them."""
    scenario, fleet = result.scenario, result.fleet
    return {
        "scenario": scenario.name,
        "seed": scenario.seed,
        "version": __version__,
        "format": RESULT_FORMAT,
        "n_collected": int(result.collected["vehicle_id"].nunique()),
        "n_traces": int((result.crowd.traces if result.crowd else result.collected)["vehicle_id"].nunique()),
        "n_components": result.crowd.mixture.n_components if result.crowd and result.crowd.is_fitted else None,
        "n_components_rule": scenario.mixture.criterion,
        "fleet": asdict(fleet.summary),
        "traffic": asdict(fleet.traffic.summary) | {"hcm_queue_discharge_vph": _hcm_queue_discharge_vph(scenario)},
        "network": network_figures(fleet.network) if fleet.network else {},
        "drivers": scenario.zone_simulation().demand.drivers.model_dump(mode="json") if scenario.road else {},
        "methods": {name: method.figures for name, method in result.methods.items()},
        "slam": lidar_figures(result.lidar) if result.lidar else {},
        "not_run": {} if result.lidar else NOT_RUN,
        "warnings": result.warnings,
        "timings_s": dict(result.seconds),
    }


def _hcm_queue_discharge_vph(scenario: Scenario) -> float | None:
    """What the HCM lets the zone discharge [veh/h], all lanes; None where its model does not hold."""
    try:
        return scenario.capacity().queue_discharge_all_lanes_vph
    except SpecError:
        return None


def _without_nan(value: Any) -> Any:
    """The value with None for every number that is not finite: JSON knows no NaN."""
    if isinstance(value, Mapping):
        return {key: _without_nan(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _write_traces(collected: pd.DataFrame, *, used: pd.DataFrame, folder: Path) -> None:
    """Write traces.parquet: every collected trace as it was reported; `used` marks those that made the maps."""
    traces = collected.assign(used=collected["vehicle_id"].isin(used["vehicle_id"].unique()))
    traces.to_parquet(folder / "traces.parquet", index=False)


def _write_crowd(crowd: Crowd, folder: Path) -> None:
    """Write what was learned of the traces: mixture_sweep.csv, mixture.json, samples.csv."""
    crowd.sweep.table.to_csv(folder / "mixture_sweep.csv", index=False)
    mixture = {name: getattr(crowd.mixture, name).tolist() for name in ("weights", "means", "covariances")}
    (folder / "mixture.json").write_text(json.dumps(mixture), encoding="utf-8")
    pd.DataFrame(crowd.samples, columns=["x_m", "y_m"]).to_csv(folder / "samples.csv", index=False, float_format="%.4f")


def _write_method(folder: Path, name: str, result: MethodResult) -> None:
    """Write a method's map, and its path and drive where there are any."""
    for kind in ("maps", "paths", "drives"):
        (folder / kind).mkdir(exist_ok=True)
    write_map(result.grid, folder / "maps", name=name)
    _write_path(folder, name, result.plan)
    if result.run:
        result.run.log.to_csv(folder / "drives" / f"{name}.csv", index=False, float_format="%.5f")
        result.run.traffic.to_parquet(folder / "drives" / f"{name}_traffic.parquet", index=False)


def _write_path(folder: Path, name: str, plan: Plan) -> None:
    """Write paths/NAME.csv where the plan has a path."""
    if plan.path:
        plan.path.to_csv(folder / "paths" / f"{name}.csv")


def _write_traffic(measures: TrafficMeasures, folder: Path) -> None:
    """Write traffic/{vehicles,minutes,stations}.csv and traffic/cells.parquet; `metrics.traffic` says what the columns are."""
    traffic = folder / "traffic"
    traffic.mkdir()
    for name in ("vehicles", "minutes", "stations"):
        getattr(measures, name).to_csv(traffic / f"{name}.csv", index=False, float_format="%.4f")
    measures.grid.table().to_parquet(traffic / "cells.parquet", index=False)
