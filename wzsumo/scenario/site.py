"""Site: layout, start, goal and cells of a scenario, which all its maps share."""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.frames import BoolArray
from wzsumo.grid import OccupancyGrid, blank_grid, cells_inside
from wzsumo.scenario.scenario import Pose, Scenario
from wzsumo.work_zone import WorkZoneLayout


@dataclass(frozen=True, kw_only=True, eq=False)
class Site:
    """The layout, the ego's start and goal, and the cells that all maps of a scenario share.

    `start` and `goal` are poses of the REAR AXLE; the masks are (rows, cols) on `cells`.
    """

    layout: WorkZoneLayout
    start: Pose
    goal: Pose
    open_goal: Pose | None  # in an open lane, where the scenario has one
    cells: OccupancyGrid  # all occupied
    nominal: BoolArray  # lanes outside the announced zone, where the road is as before
    counted: BoolArray  # the zone with its shoulders, in which map quality is measured
    drivable: BoolArray  # the truth in `counted`: between the line of devices and the right edge line


def prepare_site(scenario: Scenario) -> Site:
    """The site of a scenario, which its road, work zone, route, map and the vehicle's length decide."""
    layout = scenario.layout()
    road, margin = layout.road, scenario.map.margin_m
    start, goal = scenario.start_and_goal(layout)
    ends = scenario.mapped_ends(layout)
    cells = blank_grid(scenario.mapped_ground(layout).bounds, resolution=scenario.map.resolution_m, p_occupied=1.0)
    nominal = np.zeros(cells.shape, dtype=bool)
    for stretch in ((ends[0], layout.start), (layout.end, ends[1])):
        nominal |= cells_inside(cells, road.strip(*stretch, 0.0, road.own_width))
    counted = cells_inside(cells, road.strip(layout.start, layout.end, -road.right_shoulder - margin, road.left_edge + margin))
    drivable = cells_inside(cells, layout.drivable_between(layout.start, layout.end)) & counted
    return Site(
        layout=layout,
        start=start,
        goal=goal,
        open_goal=scenario.open_goal(layout),
        cells=cells,
        nominal=nominal,
        counted=counted,
        drivable=drivable,
    )


def site_with_open_goal(site: Site) -> Site | None:
    """The site with its goal in the open lane; None where the scenario has no such goal."""
    return None if site.open_goal is None else replace(site, goal=site.open_goal)
