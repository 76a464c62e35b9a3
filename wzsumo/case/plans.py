"""Plans on a map of the zone, and the guides that lead the search for them.

A guide is a set of lines. Before and after the announced zone they are the nominal lane centres. In between they are lines that
vehicles drove which left the zone in the goal's lane: where the work parts the traffic, the lines on its other side lead to
other lanes.
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

FINAL_STRETCH_M = 30.0  # of a trace: its mean offset there says in which lane it ends; chosen by us
MIN_DRIVEN_SHARE = 0.5  # of a line's length, from which on a line counts as driven; chosen by us
# A quarter of a 12 ft lane: a vehicle that changes lanes is so near to the line of another lane for a short way only.
MAX_DISTANCE_FROM_LINE_M = 0.91
NOMINAL_LINE_LENGTH_M = 20.0  # on a bend of 300 m radius the chord leaves the arc by 0.17 m
# A line on a bend becomes chords between some of its points: how far apart its points are, how far the chords may leave them.
BEND_POINT_SPACING_M, MAX_CHORD_ERROR_M = 5.0, 0.02


def plan_for(method: MapMethod, grid: OccupancyGrid, *, scenario: Scenario, site: Site, crowd: Crowd | None) -> Plan:
    """The plan from the site's start to its goal by the method's planner, with the first guide by which there is a path.

    `crowd` is the crowd that the map was made of, None for a map of another source. The plan's timings [ms] are the sums over
    all guides that were tried.
    """
    spec, timings = method.planner(scenario.planner), Counter[str]()
    for guide in guides_for(crowd, site=site):
        plan = plan_path(grid, start=site.start, goal=site.goal, vehicle=scenario.vehicle, spec=spec, guide=guide)
        timings.update(plan.timings_ms)
        if plan.path is not None:
            break
    return replace(plan, timings_ms=dict(timings))


def guides_for(crowd: Crowd | None, *, site: Site) -> tuple[FloatArray, ...]:
    """The guides, each of lines (n, 2, 2) [m], in the order in which the planner tries them.

    Each holds the nominal lane centres outside the announced zone. For a map of a crowd the first guide adds the lines that
    the vehicles drove which left the zone in the goal's lane, the second the lines of all vehicles. The second is the only one
    where no vehicle left in the goal's lane, and it remains where the first leads nowhere because the map has a gap there.
    """
    nominal = nominal_guide(site)
    if crowd is None:
        return (nominal,)
    lines, road = driven_lines(crowd.mixture), crowd.road
    of_all = np.concatenate([nominal, *(_chords_along(line, road) for line in lines)])
    to_goal = traces_ending_in_lane_of(site.goal[:2], crowd.traces, road=site.layout.road)
    if not len(to_goal):
        return (of_all,)
    driven = _are_driven(lines, fixes=np.column_stack(road.to_sd(to_goal[["x_m", "y_m"]])))
    return np.concatenate([nominal, *(_chords_along(line, road) for line in lines[driven])]), of_all


def nominal_guide(site: Site) -> FloatArray:
    """Lines (n, 2, 2) [m] along the lane centres before and after the announced zone."""
    road, layout = site.layout.road, site.layout
    lines = []
    for start, end in ((0.0, layout.start), (layout.end, road.length)):
        stations = np.linspace(start, end, max(2, int(np.ceil((end - start) / NOMINAL_LINE_LENGTH_M)) + 1))
        for lane in range(road.own_lanes):
            points = road.to_xy(stations, np.full_like(stations, road.lane_centre(lane)))
            lines += [np.stack(pair) for pair in pairwise(points)]
    return np.stack(lines)


def traces_ending_in_lane_of(point: tuple[float, float], traces: pd.DataFrame, *, road: Road) -> pd.DataFrame:
    """The traces that end in the lane in which `point` (x, y) [m] lies."""
    station, offset = road.to_sd(traces[["x_m", "y_m"]])
    by_vehicle = traces["vehicle_id"]
    last = pd.Series(station, index=traces.index).groupby(by_vehicle).transform("max")
    final = traces.assign(offset_m=offset)[station > last - FINAL_STRETCH_M]
    final_offset = final.groupby("vehicle_id")["offset_m"].mean()
    (_,), (offset_of_point,) = road.to_sd(point)
    same = final_offset.index[_lane_at(final_offset.to_numpy(), road) == _lane_at(offset_of_point, road)]
    return traces[by_vehicle.isin(same)]


def _chords_along(line: FloatArray, road: Road) -> FloatArray:
    """Lines (n, 2, 2) [m] in the world that follow the road along one line (2, 2) of stations and offsets."""
    fine = shapely.get_coordinates(shapely.segmentize(LineString(line), BEND_POINT_SPACING_M))
    points = shapely.get_coordinates(LineString(road.to_xy(*fine.T)).simplify(MAX_CHORD_ERROR_M))
    return np.stack([points[:-1], points[1:]], axis=1)


def _are_driven(lines: FloatArray, *, fixes: FloatArray) -> BoolArray:
    """Which lines (n,) have fixes (m, 2) beside them whose first and last are MIN_DRIVEN_SHARE of the line apart, or more.

    A fix is beside a line that it is within MAX_DISTANCE_FROM_LINE_M of. Lines (n, 2, 2) and fixes are stations and offsets.
    """
    vector = lines[:, 1] - lines[:, 0]
    length = np.maximum(np.hypot(*vector.T), 1e-9)
    direction = vector / length[:, None]
    from_start = fixes[None] - lines[:, None, 0]
    along = np.einsum("nmk,nk->nm", from_start, direction)
    across = from_start[..., 1] * direction[:, None, 0] - from_start[..., 0] * direction[:, None, 1]
    beside = (np.abs(across) < MAX_DISTANCE_FROM_LINE_M) & (along >= 0) & (along <= length[:, None])
    first, last = np.where(beside, along, np.inf).min(axis=1), np.where(beside, along, -np.inf).max(axis=1)
    return np.asarray(last - first >= MIN_DRIVEN_SHARE * length)


def _lane_at(offset: npt.ArrayLike, road: Road) -> npt.NDArray[np.intp]:
    """The lanes whose centres are nearest to the offsets [m]."""
    centres = np.array([road.lane_centre(lane) for lane in range(road.own_lanes)])
    return np.argmin(np.abs(np.asarray(offset)[..., None] - centres), axis=-1)
