"""The files of one case in its result folder."""

import json
import math
from pathlib import Path
from typing import Any

import pandas as pd

from wzsumo.case.crowd import Crowd
from wzsumo.ego import EgoRun
from wzsumo.files.ros_map import write_map
from wzsumo.grid import OccupancyGrid
from wzsumo.metrics.traffic import TrafficMeasures
from wzsumo.planning.plan import Plan


def write_traces(collected: pd.DataFrame, *, used: pd.DataFrame, folder: Path) -> None:
    """Write traces.parquet: every collected trace as it was reported; `used` marks those that made the maps."""
    traces = collected.assign(used=collected["vehicle_id"].isin(used["vehicle_id"].unique()))
    traces.to_parquet(folder / "traces.parquet", index=False)


def write_crowd(crowd: Crowd, folder: Path) -> None:
    """Write what was learned of the traces: mixture_sweep.csv, mixture.json, samples.csv."""
    crowd.sweep.table.to_csv(folder / "mixture_sweep.csv", index=False)
    mixture = {name: getattr(crowd.mixture, name).tolist() for name in ("weights", "means", "covariances")}
    (folder / "mixture.json").write_text(json.dumps(mixture), encoding="utf-8")
    pd.DataFrame(crowd.samples, columns=["x_m", "y_m"]).to_csv(folder / "samples.csv", index=False, float_format="%.4f")


def write_method(folder: Path, method: str, grid: OccupancyGrid, plan: Plan, run: EgoRun | None) -> None:
    """Write a method's map, and its path and drive where there are any."""
    for name in ("maps", "paths", "drives"):
        (folder / name).mkdir(exist_ok=True)
    write_map(grid, folder / "maps", name=method)
    write_path(folder, method, plan)
    if run:
        run.log.to_csv(folder / "drives" / f"{method}.csv", index=False, float_format="%.5f")
        run.traffic.to_parquet(folder / "drives" / f"{method}_traffic.parquet", index=False)


def write_path(folder: Path, name: str, plan: Plan) -> None:
    """Write paths/NAME.csv where the plan has a path."""
    if plan.path:
        plan.path.to_csv(folder / "paths" / f"{name}.csv")


def write_result(result: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The result as result.json has it, where a figure that there is not is null: JSON knows no NaN."""
    plain: dict[str, Any] = _without_nan(result)
    (folder / "result.json").write_text(json.dumps(plain, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return plain


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_traffic(measures: TrafficMeasures, folder: Path) -> None:
    """Write traffic/{vehicles,minutes,stations}.csv and traffic/cells.parquet; `metrics.traffic` says what the columns are."""
    traffic = folder / "traffic"
    traffic.mkdir()
    for name in ("vehicles", "minutes", "stations"):
        getattr(measures, name).to_csv(traffic / f"{name}.csv", index=False, float_format="%.4f")
    measures.grid.table().to_parquet(traffic / "cells.parquet", index=False)
