"""The two steps that each method takes: from the crowd to its map of the zone, and from that map to a plan."""

from collections import Counter
from dataclasses import replace

import numpy as np

from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.plan import Plan, plan_path
from wzsumo.study.driven_ground import driven_ground
from wzsumo.study.guides import guides_for
from wzsumo.study.mapping_methods import MAP_METHODS, Crowd, planner_for
from wzsumo.study.scenario import Scenario
from wzsumo.study.site import Site


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
