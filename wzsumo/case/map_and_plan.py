"""The two steps that each method takes: from the crowd to its map of the zone, and from that map to a plan."""

from collections import Counter
from dataclasses import replace

import numpy as np
from shapely import LineString

from wzsumo.case.crowd import Crowd
from wzsumo.case.guides import guides_for
from wzsumo.case.methods import MAP_METHODS, planner_for
from wzsumo.crowd_mapping.closing.map_before import MapBefore
from wzsumo.frames import BoolArray
from wzsumo.grid import OccupancyGrid, cells_inside
from wzsumo.planning.plan import Plan, plan_path
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.site import Site


def map_of_zone(method: str, crowd: Crowd, *, scenario: Scenario, site: Site) -> OccupancyGrid:
    """The map that a method makes of the crowd; outside the zone, where the road is as it was, the nominal map holds."""
    make = MAP_METHODS[method]
    half_width = scenario.vehicle.width_m / 2
    before = MapBefore(road=site.layout.road, start=site.layout.start, end=site.layout.end)
    learned = make(crowd, spec=scenario.mixture, cells=site.cells, half_width_m=half_width, before=before, seed=scenario.seed)
    return learned.with_p_occupied(np.where(site.nominal, 0.0, learned.p_occupied))


def plan_for(method: str, grid: OccupancyGrid, *, scenario: Scenario, site: Site, crowd: Crowd | None) -> Plan:
    """The plan from the site's start to its goal by the planner that belongs to the method, with the first guide that has one.

    `crowd` is what the map was made of, None for any other map. Where the outline is planned for, the ground that vehicles of
    the crowd drove over is free. Timings [ms] are those of all guides that were tried.
    """
    spec, timings = planner_for(method, scenario.planner), Counter[str]()
    if crowd is not None and spec.body == "outline":
        grid = grid.with_p_occupied(np.where(driven_ground(crowd, scenario=scenario, cells=grid), 0.0, grid.p_occupied))
    for guide in guides_for(crowd, site=site):
        plan = plan_path(grid, start=site.start, goal=site.goal, vehicle=scenario.vehicle, spec=spec, guide=guide)
        timings.update(plan.timings_ms)
        if plan.path is not None:
            break
    return replace(plan, timings_ms=dict(timings))


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
