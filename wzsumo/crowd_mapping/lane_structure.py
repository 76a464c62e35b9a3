"""The lane-structured crowd map: traces in, p(occupied) out, with the model behind it and figures about it."""

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd

from wzsumo.crowd_mapping.closing.map_before import MapBefore
from wzsumo.crowd_mapping.lane_fit import fit_lane_structure
from wzsumo.crowd_mapping.lane_model import LaneStructure, LaneStructureSpec
from wzsumo.crowd_mapping.occupancy import occupancy_grid
from wzsumo.grid import OccupancyGrid

__all__ = ["LaneStructureSpec", "LaneStructuredMap", "MapBefore", "describe", "lane_structured_map"]


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneStructuredMap:
    """The map, the model behind it and one row of figures about it."""

    grid: OccupancyGrid
    model: LaneStructure
    report: dict[str, object]


def lane_structured_map(
    traces: pd.DataFrame,
    *,
    spec: LaneStructureSpec,
    grid: OccupancyGrid,
    before: MapBefore | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> LaneStructuredMap:
    """The lane-structured map of a trace table on the cells of `grid`, whose values are not used.

    `before` is the road before the zone and where the zone is announced. `progress` is told (done, all). No random numbers are
    drawn: the same traces give the same map.
    """
    model = fit_lane_structure(traces, spec=spec, before=before)
    return LaneStructuredMap(grid=occupancy_grid(model, grid, progress=progress), model=model, report=describe(model))


def describe(model: LaneStructure) -> dict[str, object]:
    """Figures of a model, units in the names."""
    levels = model.levels
    return {
        "n_traces": len(model.weights),
        "n_dropped": len(model.table.dropped),
        "dropped": model.table.dropped.to_dict("records"),
        "open_lanes": levels.n_lanes - len(levels.interior),
        "lanes_closed_between_open_ones": list(levels.interior),
        "lane_width_m": levels.width,
        "lane_width_sd_m": levels.width_sd,
        "closed_side": model.closed_side,
        "spread_between_traces_m": levels.spread,
        "drift_m_per_10_m": model.path.errors.drift_m,
        "noise_m": model.path.errors.noise_m,
        "constant_error_m": model.path.errors.bias_m,
        "taper_end_m": {lane: line.end for lane, line in model.ends.closing.items()},
        "taper_end_sd_m": {lane: line.end_sd for lane, line in model.ends.closing.items()},
        "shifts": [(shift.start, shift.end, shift.size) for shift in model.shifts],
    }
