"""Site: a zone made ready for its maps, once for all that is mapped in it."""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.frames import BoolArray
from wzsumo.grid import OccupancyGrid, blank_grid, cells_inside
from wzsumo.scenario.scenario import Pose, Scenario
from wzsumo.work_zone import WorkZoneLayout


@dataclass(frozen=True, kw_only=True, eq=False)
class Site:
    """The layout, where the ego starts and where it wants to go, and the cells that all maps of the zone share.

    `start` and `goal` are poses of the REAR AXLE; the masks are (rows, cols) on `cells`.
    """

    layout: WorkZoneLayout
    start: Pose
    goal: Pose
    open_goal: Pose | None  # in a lane that stays open, where the scenario names one
    cells: OccupancyGrid  # all occupied
    nominal: BoolArray  # outside the announced zone, where the road is as it was
    counted: BoolArray  # the zone with its shoulders: where the quality of a map is counted
    drivable: BoolArray  # the truth there: between the line of devices and the right edge line


def prepare_site(scenario: Scenario) -> Site:
    """The site of a scenario: its road, work zone, route and map decide it, and the vehicle's length."""
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
    """The site with the goal in the open lane; None where the scenario names none."""
    return None if site.open_goal is None else replace(site, goal=site.open_goal)
