"""How a trace fits a LaneStructure: what tells a work zone that has moved."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from wzsumo.crowd_mapping.course.common_path import lanes_along, without_turning
from wzsumo.crowd_mapping.course.station_table import tabulate
from wzsumo.crowd_mapping.lane_model import LaneStructure
from wzsumo.tables import check_traces


@dataclass(frozen=True, kw_only=True)
class TraceFit:
    """How a trace fits the model: mean square of its normalised departures (1 is usual) and its sideways shift [m]."""

    mean_square: float
    shift_m: float
    n_stations: int


def fit_of(model: LaneStructure, trace: pd.DataFrame) -> TraceFit:
    """How one vehicle's trace fits the model, in whichever lanes it drove."""
    row = tabulate(check_traces(trace, source="trace"), model.axis, stations=model.table.stations).offsets[:1]
    path, levels = model.path, model.levels
    lanes, _ = lanes_along(path.course, row, width=levels.outer_width, sizes=path.sizes, turning=path.turning)
    own = row - path.course - levels.outer_width * lanes
    rest = without_turning(own, sizes=path.sizes, turning=path.turning)[0]
    rest = rest[np.isfinite(rest)]
    level = float(np.median(rest)) - levels.right
    shift = level - levels.width * np.clip(np.rint(level / levels.width), 0, levels.n_lanes - 1)
    within = rest - np.median(rest)
    # Half of a random walk's variance over the trace stays about its own middle.
    variance = path.noise_m**2 + path.drift_m**2 * len(rest) / 6
    square = float((within**2).mean() / variance * (len(rest) - 1) + (shift / levels.spread) ** 2) / len(rest)
    return TraceFit(mean_square=square, shift_m=float(shift), n_stations=len(rest))
