"""The map methods. One call of `register` makes a method appear wherever methods are named.

The processes of a sweep know those of this module and those of installed packages (see `method_packages`).
"""

from collections.abc import Iterable

import numpy as np
import pandas as pd
import shapely

from wzsumo.case.crowd import Crowd, free_witnessed_ground, linked_ground
from wzsumo.case.map_method import (
    LidarMethod,
    LiveMethod,
    MadeMap,
    MapBeforeMethod,
    MapMethod,
    MapTask,
    MixtureMethod,
    Source,
    TracesMethod,
    lines_of_lanes,
    lines_of_traces,
)
from wzsumo.case.method_packages import GROUP, packaged_methods
from wzsumo.crowd_mapping.lanes.lane_mapping import map_lanes
from wzsumo.crowd_mapping.lanes.raster import occupancy_grid
from wzsumo.crowd_mapping.mixture.maps import squares_map, swept_map
from wzsumo.errors import SpecError, did_you_mean, shown
from wzsumo.files.result_folder import METHOD_NAME
from wzsumo.grid import OccupancyGrid, cells_inside
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.site import Site
from wzsumo.tables import some_vehicles

LANES_SHARE = 0.8  # of the work on a map, that the lanes are
MOST_LINES = 400  # vehicles whose own lines guide a planner; more say nothing new. Chosen by us
DEFAULT_METHOD = "lanes"  # for a map of a trace file or table
PAPER_INFLATION_M = 0.7  # Chen et al. 2022, both mapping branches; the paper plans for a point on that map

METHODS: dict[str, MapMethod] = {}  # by name, in the order in which they are shown
ORIGINS: dict[str, str] = {}  # of the methods that every process knows: "" of this module, else package, version and hash


def register(method: MapMethod) -> MapMethod:
    """The method, known by its name from now on. Raises SpecError where another has that name, or no file can have it."""
    if not METHOD_NAME.fullmatch(method.name):
        raise SpecError(f"map method {shown(method.name)}: a name has letters, digits, _, . and -, for files are called by it")
    if METHODS.get(method.name, method) is not method:
        raise SpecError(f"map method {method.name}: there is one of that name; give this one another name")
    METHODS[method.name] = method
    return method


def method_named(name: str) -> MapMethod:
    """The method of that name. Raises SpecError with the known names where there is none."""
    if name not in METHODS:
        raise SpecError(f"method {name}: unknown{did_you_mean(name, METHODS)}; known methods: {', '.join(METHODS)}")
    return METHODS[name]


def refuse_unknown_to_workers(names: Iterable[str]) -> None:
    """Raise SpecError where a method was registered by the program that runs, which workers do not run."""
    if unknown := sorted(set(names) - ORIGINS.keys()):
        raise SpecError(
            f"method {', '.join(unknown)}: registered by this program, which workers do not run; name it as an entry "
            f"point of the group {GROUP} in an installed package (docs/guide/studies.md)"
        )


def methods_from(*sources: Source) -> dict[str, MapMethod]:
    """The methods whose maps are made of one of the sources, by name."""
    return {name: method for name, method in METHODS.items() if method.source in sources}


def _fitting(method: MapMethod, scenario: Scenario) -> MapMethod:
    """The method. Raises SpecError where it needs a zone that changes, or one that does not."""
    if scenario.live is None and method.source is Source.LIVE:
        raise SpecError(f"method {method.name}: needs a section [live] in the scenario, which says how the zone changes")
    if scenario.live is not None and method.source not in (Source.LIVE, Source.MAP_BEFORE):
        others = ", ".join(methods_from(Source.LIVE, Source.MAP_BEFORE))
        raise SpecError(f"method {method.name}: makes one map, and the section [live] changes the zone; take of {others}")
    return method


def is_baseline(name: str) -> bool:
    """Whether the method of that name is a baseline: its maps are not made of the crowd's traces."""
    return name in METHODS and METHODS[name].source is not Source.CROWD


def chosen_methods(names: Iterable[str] | None, scenario: Scenario) -> tuple[MapMethod, ...]:
    """The methods of these names. Without names they are those of the crowd, or live maps where the zone changes, or all
    where the scenario has a section `slam`.
    """
    if isinstance(names, str):
        raise SpecError(f"methods={names!r}: must be a list of names, such as [{names!r}]")
    if names is not None:
        names = list(names)
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise SpecError(f"method {', '.join(twice)}: named more than once; name each once")
        return tuple(_fitting(method_named(name), scenario) for name in names)
    if scenario.live is not None:
        return tuple(methods_from(Source.LIVE).values())
    fixed = (Source.CROWD, Source.LIDAR, Source.MAP_BEFORE)
    return tuple(methods_from(*(fixed if scenario.slam else fixed[:1])).values())


def plan_for_a_point(planner: PlannerSpec) -> PlannerSpec:
    """The planner of the paper: it inflates the map and searches a path for a point on it, without a guide."""
    return planner.model_copy(update={"body": "point", "inflation_radius_m": PAPER_INFLATION_M, "guide_cost": 0.0})


def _literal_squares(crowd: Crowd, task: MapTask) -> OccupancyGrid:
    return squares_map(crowd.samples, side_m=crowd.spec.literal_square_m, grid=task.cells)


def _joined_squares(crowd: Crowd, task: MapTask) -> OccupancyGrid:
    return squares_map(crowd.samples, side_m=crowd.spec.square_m, grid=task.cells)


def _swept(crowd: Crowd, task: MapTask) -> OccupancyGrid:
    grid = swept_map(crowd.mixture, road=crowd.road, half_width_m=task.half_width_m, spec=crowd.spec, grid=task.cells)
    linked = linked_ground(task.cells, crowd, half_width_m=task.half_width_m)
    grid = grid.with_p_occupied(np.where(linked, 0.0, grid.p_occupied))
    return free_witnessed_ground(grid, crowd.traces, reach_m=task.witness_reach_m)


def _lanes(traces: pd.DataFrame, task: MapTask) -> MadeMap:
    made = map_lanes(traces, before=task.before, tell=lambda share: task.tell(LANES_SHARE * share))
    grid = occupancy_grid(
        made.lanes, task.cells, progress=lambda done, total: task.tell(LANES_SHARE + (1 - LANES_SHARE) * done / total)
    )
    grid = free_witnessed_ground(grid, traces, reach_m=task.witness_reach_m)
    width = float(np.median([lane.left - lane.right for lane in made.lanes.lanes]))
    driven = lines_of_traces(
        some_vehicles(traces, MOST_LINES), axis=made.lanes.axis, shift_m=made.removed_shift_m,
        error_m=made.figures["receiver_error_m"],
    )  # fmt: skip
    lines = (*lines_of_lanes(made.lanes), *driven)
    return MadeMap(grid, made.figures, made.lanes, lines=lines, lane_width_m=width)


def map_of_before(site: Site) -> OccupancyGrid:
    """The map with all lanes of the road free, also those that are closed now, and everything else occupied."""
    road = site.layout.road
    lanes = cells_inside(site.cells, road.strip(0.0, road.length, 0.0, road.travelled_width))
    return site.cells.with_p_occupied(np.where(lanes, 0.0, 1.0))


def map_of_before_with_devices(site: Site) -> OccupancyGrid:
    """The map of before with the outline of every device occupied, as if the road crew reported each device's place.

    Outlines are half a cell wider, so that each device fills the cell that it stands in.
    """
    outlines = shapely.buffer(site.layout.device_outlines, site.cells.resolution / 2)
    marked = cells_inside(site.cells, shapely.union_all(outlines))
    return site.cells.with_p_occupied(np.where(marked, 1.0, map_of_before(site).p_occupied))


for _method in (
    MixtureMethod(
        name="paper_literal", title="crowd: the paper's squares of 5 in", make=_literal_squares, planner=plan_for_a_point
    ),
    MixtureMethod(
        name="paper", title="crowd: squares so large that the samples join", make=_joined_squares, planner=plan_for_a_point
    ),
    MixtureMethod(name="swept", title="crowd: 95 % region of the mixture, swept by the vehicle", make=_swept),
    TracesMethod(name="lanes", title="crowd: lanes inferred from the traces", make=_lanes, cpu_s=2.0),
    LidarMethod(name="slam_raw", title="(a) LiDAR SLAM, raw bird's-eye view", form=lambda maps: maps.birds_eye),
    LidarMethod(name="slam_log_odds", title="(b) LiDAR SLAM, log-odds with carved free space", form=lambda maps: maps.log_odds),
    LidarMethod(name="slam_barrier", title="(c) LiDAR SLAM, devices joined into a barrier", form=lambda maps: maps.barrier),
    LiveMethod(name="live", title="live map of the traces", cpu_s=60.0),
    LiveMethod(name="map_of_before", title="map of the traces before the change", cpu_s=60.0, goes_on=False),
    MapBeforeMethod(name="hd_map", title="HD map of before", make=map_of_before),
    MapBeforeMethod(name="hd_map_devices", title="HD map of before, devices marked", make=map_of_before_with_devices),
):
    ORIGINS[register(_method).name] = ""
for _of_package, _origin in packaged_methods():
    ORIGINS[register(_of_package).name] = _origin
