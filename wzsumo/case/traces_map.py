"""A map from anybody's traces: the cells around them, and the map that a method makes there."""

from typing import Any

import numpy as np
import pandas as pd

from wzsumo.case.case import Progress
from wzsumo.case.crowd import learn_from
from wzsumo.case.methods import MAP_METHODS
from wzsumo.crowd_mapping.closing.map_before import MapBefore
from wzsumo.crowd_mapping.course.reference_line import reference_line_from_traces
from wzsumo.crowd_mapping.lane_structure import LaneStructureSpec, lane_structured_map
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec
from wzsumo.errors import InputError
from wzsumo.grid import OccupancyGrid, blank_grid
from wzsumo.scenario.road_before import with_road_outside
from wzsumo.vehicle import VehicleGeometry

MAP_MARGIN_M = 10.0  # around the traces


MOST_CELLS = 100_000_000  # 1.3 km by 1.3 km at 0.127 m: 0.4 GB while the map is made


MIXTURE_FIXES = 100_000  # evenly taken for a mixture: 300 traces of 10 Hz, and as much as tells 30 components apart


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
        grid, learned = _lanes(traces, cells, half_width_m=half_width, before=before, progress=progress)
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
    before: MapBefore | None,
    progress: Progress,
) -> tuple[OccupancyGrid, dict[str, Any]]:
    spec = LaneStructureSpec(vehicle_width_m=2 * half_width_m)
    with progress("lanes", 1.0) as tell:
        made = lane_structured_map(
            traces, spec=spec, grid=cells, before=before, progress=lambda done, total: tell(done / total)
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
