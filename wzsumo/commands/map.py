"""A map from anybody's traces: what of a file can be used, the map, and what was learned and left out."""

import sys
from pathlib import Path
from typing import Any

import pandas as pd

from wzsumo.case.case import Progress
from wzsumo.case.traces_map import map_of_traces
from wzsumo.crowd_mapping.cleaning.usable_traces import usable_traces
from wzsumo.errors import InputError
from wzsumo.files.output import staged_folder
from wzsumo.files.ros_map import write_map
from wzsumo.files.traces import read_fixes
from wzsumo.scenario.road_before import check_on_road, read_map_before

TOLD_DROPS = 8  # on stderr; the result holds them all


def map_foreign_traces(
    path: Path, out: Path, *, method: str, seed: int, resolution_m: float, road: Path | None, progress: Progress
) -> dict[str, Any]:
    """Write map.pgm and map.yaml of the traces in a file; what they are made of and what was left out.

    `road` is a file that says how the road was before the zone; `lanes` joins what it learns to it. Raises InputError where
    the file makes no map of one zone, and where the traces are not on the road.
    """
    if road and method != "lanes":
        raise InputError(f"--road {road}: the method {method} makes no use of the road; leave --road out or take lanes")
    before = read_map_before(road) if road else None
    table = read_fixes(path)
    usable = usable_traces(table, source=str(path))
    n_fixes, traces = len(table), usable.traces
    del table
    _tell_dropped(usable.dropped)
    if before:
        check_on_road(traces, before, source=str(path), road_source=str(road))
    grid, learned = map_of_traces(
        traces, source=str(path), method=method, seed=seed, resolution_m=resolution_m, before=before, progress=progress
    )
    with staged_folder(out) as stage:
        write_map(grid, stage)
    return {
        "map": str(out / "map.yaml"),
        "method": method,
        "n_traces": int(traces["vehicle_id"].nunique()),
        "n_fixes": n_fixes,
        "n_fixes_used": len(traces),
        "dropped": usable.dropped.astype({"n_fixes": int}).to_dict("records"),
        "free_m2": float(grid.free.sum() * resolution_m**2),
        **learned,
    }


def _tell_dropped(dropped: pd.DataFrame) -> None:
    for vehicle_id, n_fixes, reason in dropped.head(TOLD_DROPS).itertuples(index=False):
        sys.stderr.write(f"left out: {vehicle_id}, {n_fixes} fix(es): {reason}\n")
    if len(dropped) > TOLD_DROPS:
        sys.stderr.write(f"left out: {len(dropped) - TOLD_DROPS} more; --json lists them all\n")
