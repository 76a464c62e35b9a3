"""Plans on a map of the zone.

A path follows the route in lanes (see `planning.lane_route`): the nominal lanes before and after the announced zone, in between
the lanes that the map knows. Where no path along it is free, it follows the route that leads over free ground alone, in other
lanes. Where none is free along that either, or the map knows no lanes, a path is searched for.
"""

from functools import partial
from typing import Any

import numpy as np
import shapely
from shapely import LineString

from wzsumo.case.map_method import MadeMap, MapMethod
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.lane_route import BARRED_COST, OFFSET_STEP_M, STATION_STEP_M, LaneLine, route_offsets
from wzsumo.planning.plan import Plan, plan_on_route, plan_path
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.road import Road
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.site import Site

# A line on a bend becomes chords between some of its points: how far apart its points are, how far the chords may leave them.
BEND_POINT_SPACING_M, MAX_CHORD_ERROR_M = 5.0, 0.02


def plan_for(method: MapMethod, made: MadeMap, *, scenario: Scenario, site: Site) -> Plan:
    """The plan from the site's start to its goal by the method's planner: along the route in lanes, or else by a search.

    The search is guided by all lanes.
    """
    spec = within_lane(method.planner(scenario.planner), made, scenario=scenario, site=site)
    given: dict[str, Any] = {"start": site.start, "goal": site.goal, "vehicle": scenario.vehicle, "spec": spec}
    routes, lanes = lanes_to_goal(made, scenario=scenario, site=site)
    along = (plan_on_route(made.grid, route=route, **given) for route in routes)
    return next((plan for plan in along if plan), None) or plan_path(made.grid, guide=lanes, **given)


def within_lane(planner: PlannerSpec, made: MadeMap, *, scenario: Scenario, site: Site) -> PlannerSpec:
    """The planner that wishes for no more clearance than a lane has on either side: more would be the neighbour's lane."""
    road = site.layout.road
    width = made.lane_width_m or road.own_width / road.own_lanes
    beside = max((width - scenario.vehicle.width_m) / 2, site.cells.resolution)
    return planner.model_copy(update={"preferred_clearance_m": min(planner.preferred_clearance_m, beside)})


def lanes_to_goal(made: MadeMap, *, scenario: Scenario, site: Site) -> tuple[tuple[FloatArray, ...], FloatArray]:
    """The routes (n, 2) [m] in lanes from start to goal, the best first, and lines (n, 2, 2) along all lanes.

    There is no route where the map knows no lanes.
    """
    road, layout = site.layout.road, site.layout
    mapped = made.mapped or (layout.start, layout.end)
    nominal = nominal_lanes(road, beside=mapped)
    in_zone = [part for line in made.lines if (part := line.between(*mapped)) is not None]
    all_lanes = np.concatenate([_chords(line.stations, line.offsets, road) for line in (*nominal, *in_zone)])
    if not in_zone:
        return (), all_lanes
    (first, last), ends = road.to_sd([site.start[:2], site.goal[:2]])
    stations = np.linspace(first, last, max(2, int(np.ceil((last - first) / STATION_STEP_M)) + 1))
    offsets = np.arange(-road.right_shoulder, road.left_edge, OFFSET_STEP_M)
    find = partial(
        route_offsets, stations, (*nominal, *in_zone), ends=(float(ends[0]), float(ends[1])), offsets=offsets,
        speed_mps=scenario.planner.planned_speed_mps,
        blocked=_blocked(made.grid, stations, offsets, road=road, half_width_m=scenario.vehicle.width_m / 2),
    )  # fmt: skip
    best, around = find(), find(blocked_cost=BARRED_COST)
    routes = (best,) if np.array_equal(best, around) else (best, around)
    return tuple(road.to_xy(stations, route) for route in routes), all_lanes


def nominal_lanes(road: Road, *, beside: tuple[float, float]) -> list[LaneLine]:
    """The lane centres of the road before and after the stations [m] of the announced zone, or of a map."""
    return [
        LaneLine(stations=np.array(stretch), offsets=np.full(2, road.lane_centre(lane)))
        for stretch in ((0.0, beside[0]), (beside[1], road.length))
        if stretch[0] < stretch[1]
        for lane in range(road.own_lanes)
    ]


def _blocked(grid: OccupancyGrid, stations: FloatArray, offsets: FloatArray, *, road: Road, half_width_m: float) -> BoolArray:
    """Where (n, m) a vehicle that drives along the road would touch a cell that is not free, looked at beside its middle."""
    blocked = np.zeros((len(stations), len(offsets)), dtype=bool)
    for beside in (-half_width_m, 0.0, half_width_m):
        row, col = grid.cell_of(road.to_xy(stations[:, None], offsets + beside).reshape(-1, 2))
        inside = (row >= 0) & (row < grid.shape[0]) & (col >= 0) & (col < grid.shape[1])
        free = np.zeros(len(row), dtype=bool)
        free[inside] = grid.free[row[inside], col[inside]]
        blocked |= ~free.reshape(blocked.shape)
    return blocked


def _chords(stations: FloatArray, offsets: FloatArray, road: Road) -> FloatArray:
    """Lines (n, 2, 2) [m] in the world that follow the road along a line of stations and offsets."""
    fine = shapely.get_coordinates(shapely.segmentize(LineString(np.column_stack([stations, offsets])), BEND_POINT_SPACING_M))
    points = shapely.get_coordinates(LineString(road.to_xy(*fine.T)).simplify(MAX_CHORD_ERROR_M))
    return np.stack([points[:-1], points[1:]], axis=1)
