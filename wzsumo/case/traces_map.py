"""A map from a trace table: the cells around the traces, and the map that a method makes there."""

from pathlib import Path

import numpy as np
import pandas as pd

from wzsumo.case.map_method import CrowdMethod, MadeMap, MapTask, Source
from wzsumo.case.methods import METHODS, method_named, methods_from
from wzsumo.case.watch import Progress
from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.errors import InputError, SpecError
from wzsumo.geography import LocalFrame
from wzsumo.grid import OccupancyGrid, blank_grid
from wzsumo.scenario.known_road import read_known_road
from wzsumo.scenario.road_before import check_on_road, map_before
from wzsumo.vehicle import VehicleGeometry

MAP_MARGIN_M = 10.0  # around the traces; chosen by us
MAX_MAP_CELLS = 100_000_000  # 1.3 km by 1.3 km at 0.127 m: 0.4 GB while the map is made


def crowd_method(name: str, *, road: Path | None) -> CrowdMethod:
    """The method of that name. Raises InputError where it makes no map of traces, or where it cannot use the given road."""
    method = method_named(name)
    if not isinstance(method, CrowdMethod):
        known = ", ".join(methods_from(Source.CROWD))
        raise SpecError(f"method {name}: makes no map of traces; methods that do: {known}")
    if road and not method.joins_road:
        others = ", ".join(known for known, other in METHODS.items() if other.joins_road)
        raise InputError(
            f"{road}: the method {name} makes no use of the road before; leave the road out or take the method {others}"
        )
    return method


def read_road(
    road: Path | None, traces: pd.DataFrame, *, source: str, frame: LocalFrame | None = None, utc: bool = False
) -> MapBefore | None:
    """The road before the zone of a file, in metres of `frame`; None where no file is given.

    Raises InputError where the traces are not on it.
    """
    if road is None:
        return None
    known = read_known_road(road, traces=traces, frame=frame, utc=utc, source=source)
    before = map_before(known.road, known.announced)
    check_on_road(traces, before, source=source, road_source=str(road))
    return before


def map_of_traces(
    traces: pd.DataFrame,
    method: CrowdMethod,
    *,
    source: str,
    seed: int,
    resolution_m: float,
    before: MapBefore | None,
    progress: Progress,
) -> MadeMap:
    """The map of usable traces, and what was learned of them. Raises InputError, naming `source`, where they spread too far."""
    cells = _cells_around(traces, source=source, resolution_m=resolution_m)
    half_width = float(traces["width_m"].median()) / 2 if "width_m" in traces else VehicleGeometry().width_m / 2
    with progress(f"map {method.name}", 1.0) as tell:
        task = MapTask(cells=cells, half_width_m=half_width, seed=seed, before=before, tell=tell)
        made = method.map_of_traces(traces, task)
    return made._replace(figures={"vehicle_width_m": 2 * half_width, **made.figures})


def _cells_around(traces: pd.DataFrame, *, source: str, resolution_m: float) -> OccupancyGrid:
    points = traces[["x_m", "y_m"]].to_numpy()
    low, high = points.min(axis=0) - MAP_MARGIN_M, points.max(axis=0) + MAP_MARGIN_M
    area = float(np.prod(high - low))
    if area / resolution_m**2 > MAX_MAP_CELLS:
        coarser = np.ceil(100 * np.sqrt(area / MAX_MAP_CELLS)) / 100
        raise InputError(
            f"{source}: the traces spread over {high[0] - low[0]:.0f} m by {high[1] - low[1]:.0f} m, which at a resolution of "
            f"{resolution_m:g} m is more than {MAX_MAP_CELLS / 1e6:.0f} million cells; cut the traces to one zone or give a "
            f"resolution of {coarser:g} m or more"
        )
    return blank_grid((float(low[0]), float(low[1]), float(high[0]), float(high[1])), resolution=resolution_m, p_occupied=1.0)
