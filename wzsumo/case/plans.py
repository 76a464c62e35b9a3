"""Plans on a map of the zone, and the lines that they are guided by.

Guides are the nominal lanes where the road is as it was. In between they are the lines of vehicles that left the zone in the
goal's lane: where the work parts the traffic, the lines on its other side lead to other lanes.
"""

from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pandas as pd
import shapely
from shapely import LineString

from wzsumo.case.crowd import Crowd
from wzsumo.case.map_method import MapMethod
from wzsumo.crowd_mapping.mixture.maps import driven_lines
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.plan import Plan, plan_path
from wzsumo.road import Road
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.site import Site

AT_THE_END_M = 30.0  # over the last stretch of a trace the lane is told that it ended in
LEAST_DRIVEN = 0.5  # of a line
BESIDE_M = 0.91  # a quarter of a 12 ft lane: who changes lanes is so near to the line of another for a short way only
FINE_STEP_M, CHORD_ERROR_M = 5.0, 0.02  # of a line on a bend: its points, and how far chords between some of them leave it
LINE_STEP_M = 20.0  # on a bend of 300 m radius the chord leaves the arc by 0.17 m


def plan_for(method: MapMethod, grid: OccupancyGrid, *, scenario: Scenario, site: Site, crowd: Crowd | None) -> Plan:
    """The plan from the site's start to its goal by the method's planner, with the first guide that leads to a path.

    `crowd` is what the map was made of, None for a map of another source. Timings [ms] are those of all guides that were tried.
    """
    spec, timings = method.planner(scenario.planner), Counter[str]()
    for guide in guides_for(crowd, site=site):
        plan = plan_path(grid, start=site.start, goal=site.goal, vehicle=scenario.vehicle, spec=spec, guide=guide)
        timings.update(plan.timings_ms)
        if plan.path is not None:
            break
    return replace(plan, timings_ms=dict(timings))


def guides_for(crowd: Crowd | None, *, site: Site) -> tuple[FloatArray, ...]:
    """Guides, each of lines (n, 2, 2) [m], to be tried in turn on a map of the crowd, or on another map where that is None.

    Outside the announced zone nominal lane centres; inside the lines that vehicles drove who left the zone in the goal's lane.
    Where nobody did, or where these lead nowhere because the map has a gap there, the lines of all.
    """
    nominal = nominal_guide(site)
    if crowd is None:
        return (nominal,)
    lines, road = driven_lines(crowd.mixture), crowd.road
    of_all = np.concatenate([nominal, *(_on_road(line, road) for line in lines)])
    fellows = bound_for(site.goal[:2], crowd.traces, road=site.layout.road)
    if not len(fellows):
        return (of_all,)
    theirs = lines[_driven_by(np.column_stack(road.to_sd(fellows[["x_m", "y_m"]])), lines)]
    return np.concatenate([nominal, *(_on_road(line, road) for line in theirs)]), of_all


def nominal_guide(site: Site) -> FloatArray:
    """Lines (n, 2, 2) [m] of the lane centres before and after the announced zone."""
    road, layout = site.layout.road, site.layout
    lines = []
    for start, end in ((0.0, layout.start), (layout.end, road.length)):
        stations = np.linspace(start, end, max(2, int(np.ceil((end - start) / LINE_STEP_M)) + 1))
        for lane in range(road.own_lanes):
            points = road.to_xy(stations, np.full_like(stations, road.lane_centre(lane)))
            lines += [np.stack(pair) for pair in pairwise(points)]
    return np.stack(lines)


def bound_for(goal: tuple[float, float], traces: pd.DataFrame, *, road: Road) -> pd.DataFrame:
    """The traces that end in the lane in which the point `goal` (x, y) [m] lies."""
    station, offset = road.to_sd(traces[["x_m", "y_m"]])
    by_vehicle = traces["vehicle_id"]
    last = pd.Series(station, index=traces.index).groupby(by_vehicle).transform("max")
    ends = traces.assign(offset_m=offset)[station > last - AT_THE_END_M].groupby("vehicle_id")["offset_m"].mean()
    (_,), (across,) = road.to_sd(goal)
    same = ends.index[_lane_at(ends.to_numpy(), road) == _lane_at(across, road)]
    return traces[by_vehicle.isin(same)]


def _on_road(line: FloatArray, road: Road) -> FloatArray:
    """Lines (n, 2, 2) [m] that follow a bend, of one line (2, 2) of stations and offsets."""
    fine = shapely.get_coordinates(shapely.segmentize(LineString(line), FINE_STEP_M))
    points = shapely.get_coordinates(LineString(road.to_xy(*fine.T)).simplify(CHORD_ERROR_M))
    return np.stack([points[:-1], points[1:]], axis=1)


def _lane_at(offset: npt.ArrayLike, road: Road) -> npt.NDArray[np.intp]:
    centres = np.array([road.lane_centre(lane) for lane in range(road.own_lanes)])
    return np.argmin(np.abs(np.asarray(offset)[..., None] - centres), axis=-1)


def _driven_by(fixes: FloatArray, lines: FloatArray) -> BoolArray:
    """Which lines (n,) have fixes (m, 2) within BESIDE_M of them that span LEAST_DRIVEN of their length or more.

    Both are in stations and offsets.
    """
    way = lines[:, 1] - lines[:, 0]
    length = np.maximum(np.hypot(*way.T), 1e-9)
    ahead = way / length[:, None]
    offset = fixes[None] - lines[:, None, 0]
    along = np.einsum("nmk,nk->nm", offset, ahead)
    across = offset[..., 1] * ahead[:, None, 0] - offset[..., 0] * ahead[:, None, 1]
    beside = (np.abs(across) < BESIDE_M) & (along >= 0) & (along <= length[:, None])
    first, last = np.where(beside, along, np.inf).min(axis=1), np.where(beside, along, -np.inf).max(axis=1)
    return np.asarray(last - first >= LEAST_DRIVEN * length)
