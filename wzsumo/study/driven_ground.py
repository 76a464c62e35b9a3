"""Ground that vehicles of the crowd drove over: a map may doubt it, a plan need not.

A map of lanes weighs where lanes may lie. Where few vehicles passed on one side of the work it doubted the edge of the lane
that they drove in, and a body fitted through nowhere but on the other side.
"""

import numpy as np
from shapely import LineString

from wzsumo.grid import BoolArray, OccupancyGrid, cells_inside
from wzsumo.study.mapping_methods import Crowd
from wzsumo.study.scenario import Scenario

FEWEST_VEHICLES = 2  # one alone may have been out of its lane
_ERRORS = 2.0  # standard deviations that a vehicle may have been off where it reported to be
_KINK_M = 0.01  # of a trace that is left out: 0.1 s of straight road need no point each


def driven_ground(crowd: Crowd, *, scenario: Scenario, cells: OccupancyGrid) -> BoolArray:
    """Cells (rows, cols) over which at least FEWEST_VEHICLES of the crowd drove.

    As wide as a vehicle, and to either side as drivers scatter in a lane, less what positions may be wrong by: where these err
    by half a metre, nothing is left.
    """
    error_m = float(np.hypot.reduce(scenario.gnss.standard_deviations_m))
    reach = scenario.vehicle.width_m / 2 + scenario.mixture.driver_sd_m - _ERRORS * error_m
    count = np.zeros(cells.shape, dtype=np.int16)
    if reach > 0:
        for _, trace in crowd.traces.groupby("vehicle_id"):
            way = LineString(trace.sort_values("time_s")[["x_m", "y_m"]].to_numpy()).simplify(_KINK_M)
            count += cells_inside(cells, way.buffer(reach, cap_style="flat"))
    return count >= FEWEST_VEHICLES
