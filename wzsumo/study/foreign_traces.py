"""A map from anybody's traces: what of a file can be used, the map, and what was learned and left out."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wzsumo.crowd_mapping.drivable_area import MixtureSpec
from wzsumo.crowd_mapping.lane_structure import LaneStructureSpec, lane_structured_map
from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.crowd_mapping.reference_line import reference_line_from_traces
from wzsumo.crowd_mapping.usable_traces import usable_traces
from wzsumo.errors import InputError
from wzsumo.grid import OccupancyGrid, blank_grid, write_map
from wzsumo.output import staged_folder
from wzsumo.study.case import Progress
from wzsumo.study.mapping_methods import MAP_METHODS, learn_from
from wzsumo.study.road_before import check_on_road, read_map_before, with_road_outside
from wzsumo.traces_file import read_fixes
from wzsumo.vehicle import VehicleGeometry

MAP_MARGIN_M = 10.0  # around the traces
MOST_CELLS = 100_000_000  # 1.3 km by 1.3 km at 0.127 m: 0.4 GB while the map is made
MIXTURE_FIXES = 100_000  # evenly taken for a mixture: 300 traces of 10 Hz, and as much as tells 30 components apart
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


def map_of_traces(
    traces: pd.DataFrame,
    *,
    source: str,
    method: str,
    seed: int,
    resolution_m: float,
    before: MapBefore | None,
    progress: Progress,
) -> tuple[OccupancyGrid, dict[str, Any]]:
    """The map of usable traces, and what was learned of them. Raises InputError, naming `source`, where they spread too far."""
    cells = _cells_around(traces, source=source, resolution_m=resolution_m)
    half_width = float(traces["width_m"].median()) / 2 if "width_m" in traces else VehicleGeometry().width_m / 2
    if method == "lanes":
        grid, learned = _lanes(traces, cells, half_width_m=half_width, seed=seed, before=before, progress=progress)
    else:
        grid, learned = _by_mixture(method, traces, cells, half_width_m=half_width, seed=seed, progress=progress)
    return grid, {"vehicle_width_m": 2 * half_width, **learned}


def _cells_around(traces: pd.DataFrame, *, source: str, resolution_m: float) -> OccupancyGrid:
    points = traces[["x_m", "y_m"]].to_numpy()
    low, high = points.min(axis=0) - MAP_MARGIN_M, points.max(axis=0) + MAP_MARGIN_M
    area = float(np.prod(high - low))
    if area / resolution_m**2 > MOST_CELLS:
        coarser = np.ceil(100 * np.sqrt(area / MOST_CELLS)) / 100
        raise InputError(
            f"{source}: the traces spread over {high[0] - low[0]:.0f} m by {high[1] - low[1]:.0f} m, at --resolution-m "
            f"{resolution_m:g} more than {MOST_CELLS / 1e6:.0f} million cells; cut the file to one zone or give --resolution-m "
            f"{coarser:g}"
        )
    return blank_grid((float(low[0]), float(low[1]), float(high[0]), float(high[1])), resolution=resolution_m, p_occupied=1.0)


def _lanes(
    traces: pd.DataFrame,
    cells: OccupancyGrid,
    *,
    half_width_m: float,
    seed: int,
    before: MapBefore | None,
    progress: Progress,
) -> tuple[OccupancyGrid, dict[str, Any]]:
    spec = LaneStructureSpec(vehicle_width_m=2 * half_width_m)
    with progress("lanes", 1.0) as tell:
        made = lane_structured_map(
            traces, spec=spec, grid=cells, seed=seed, before=before, progress=lambda done, total: tell(done / total)
        )
    figures = {key: value for key, value in made.report.items() if key not in {"dropped", "n_dropped", "n_traces"}}
    return with_road_outside(made.grid, before) if before else made.grid, figures


def _by_mixture(
    method: str, traces: pd.DataFrame, cells: OccupancyGrid, *, half_width_m: float, seed: int, progress: Progress
) -> tuple[OccupancyGrid, dict[str, Any]]:
    spec = MixtureSpec()
    part = traces.iloc[:: max(1, -(-len(traces) // MIXTURE_FIXES))]
    with progress("mixtures", 1.0) as tell:
        crowd = learn_from(
            part,
            road=reference_line_from_traces(part),
            spec=spec,
            seed=seed,
            progress=lambda done, total: tell(done / total),
        )
    grid = MAP_METHODS[method](crowd, spec=spec, cells=cells, half_width_m=half_width_m, before=None, seed=seed)
    return grid, {"n_components": crowd.mixture.n_components}


def _tell_dropped(dropped: pd.DataFrame) -> None:
    for vehicle_id, n_fixes, reason in dropped.head(TOLD_DROPS).itertuples(index=False):
        sys.stderr.write(f"left out: {vehicle_id}, {n_fixes} fix(es): {reason}\n")
    if len(dropped) > TOLD_DROPS:
        sys.stderr.write(f"left out: {len(dropped) - TOLD_DROPS} more; --json lists them all\n")
