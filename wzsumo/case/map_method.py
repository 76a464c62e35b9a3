"""MapMethod: one way to make a map of the zone. Its subclasses differ in what they make the map of."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pandas as pd

from wzsumo.case.change.stream import section_of
from wzsumo.case.change.updates import Update
from wzsumo.case.crowd import Crowd, witness_reach_m
from wzsumo.case.sources import Sources
from wzsumo.case.watch import Tell
from wzsumo.crowd_mapping.lanes.raster import occupancy_grid
from wzsumo.crowd_mapping.map_before import MapBefore
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec, driven_lines
from wzsumo.crowd_mapping.mixture.mixture import Mixture
from wzsumo.crowd_mapping.reference_line import reference_line_from_traces
from wzsumo.frames import BoolArray
from wzsumo.grid import OccupancyGrid, cells_inside
from wzsumo.lane_map import LaneMap
from wzsumo.lidar_mapping.slam_map import SlamMaps
from wzsumo.planning.lane_route import STATION_STEP_M, LaneLine
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.road import Road
from wzsumo.scenario.road_before import map_before_of
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.site import Site

MIDDLE_SD_M = 0.3  # of where vehicles drive from the middle of a mapped lane: one lane beside it that is 1 ft narrower
PLACE_SD_M = 0.25  # of a driver's place in the lane: the lateral position's, Brookhuis et al. 2003
MAX_MIXTURE_FIXES = 100_000  # of a longer file every n-th fix is taken; 300 traces of 33 s at 10 Hz; chosen by us


WAY_S = 600.0  # after it set out, for which maps are made for the ego: longer than any drive (`evaluation.DRIVE_LIMIT_S`)


class Source(StrEnum):
    """What a map is made of."""

    CROWD = "crowd"  # traces of equipped vehicles
    LIDAR = "lidar"  # scans of one mapping drive
    MAP_BEFORE = "map_before"  # the road from before the zone
    LIVE = "live"  # traces from before and after a change of the zone


@dataclass(frozen=True, kw_only=True, eq=False)
class MapTask:
    """What a method needs, beside the traces, to make a map of them."""

    cells: OccupancyGrid  # the cells to fill; their values do not matter
    half_width_m: float  # of the vehicles, whose centres the traces are
    seed: int
    before: MapBefore | None = None  # the road from before the zone, where it is known
    witness_reach_m: float = 0.0  # how far to either side of a reported centre the vehicle surely drove over the ground
    tell: Tell = lambda _share: None  # called with the share of the work that is done


class MadeMap(NamedTuple):
    """A map, figures of what its method learned, and what it knows of lanes.

    `lanes` are those that the grid is a raster of, where the method knows lanes. `lines` are the lines along which vehicles
    drive, in stations and offsets of the road, and `lane_width_m` is the width of most lanes where that is known.
    """

    grid: OccupancyGrid
    figures: dict[str, Any]
    lanes: LaneMap | None = None
    lines: tuple[LaneLine, ...] = ()
    lane_width_m: float | None = None
    mapped: tuple[float, float] | None = None  # stations [m] between which the lines hold; None: in the announced zone


@dataclass(frozen=True, kw_only=True, eq=False)
class ArrivingMap:
    """A map that reaches the ego on its way; `made` is None where only the doubts about the one before are others."""

    time_s: float  # of the simulation
    made: MadeMap | None
    doubtful: tuple[tuple[float, float], ...] = ()  # from and to [m], stations at which the map may be wrong


@dataclass(frozen=True, kw_only=True, eq=False)
class MapMethod(ABC):
    """One way to make a map of the zone. Command line, study files, results and reports know it by its name."""

    name: str
    title: str  # in figures and in the command line's help
    cpu_s: float = 0.5  # processor time of map and plan on one core of 2020 (analysis/benchmarks/sweep.py), for estimates
    planner: Callable[[PlannerSpec], PlannerSpec] = lambda planner: planner  # the scenario's planner, adapted to its maps
    source: ClassVar[Source]
    joins_road: ClassVar[bool] = False  # whether it joins what traces say to the road from before the zone

    @abstractmethod
    def map_of_zone(self, sources: Sources) -> MadeMap:
        """The map over the site's cells."""

    def arriving(self, sources: Sources) -> tuple[ArrivingMap, ...]:  # noqa: ARG002 - live maps look at the sources
        """The maps that reach the ego on its way, in their order."""
        return ()

    def crowd_of(self, sources: Sources) -> Crowd | None:  # noqa: ARG002 - methods of the crowd look at the sources
        """The crowd that the map is made of, None where it is made of something else."""
        return None


@dataclass(frozen=True, kw_only=True, eq=False)
class CrowdMethod(MapMethod):
    """A map of the crowd's traces. Outside the announced zone the work changes nothing: there the nominal lanes are free."""

    source: ClassVar[Source] = Source.CROWD

    def map_of_zone(self, sources: Sources) -> MadeMap:
        """The map over the site's cells, of the traces that the scenario uses."""
        return self.map_of_crowd(sources.crowd, scenario=sources.scenario, site=sources.site)

    def crowd_of(self, sources: Sources) -> Crowd:
        """The crowd that the map is made of."""
        return sources.crowd

    def map_of_crowd(self, crowd: Crowd, *, scenario: Scenario, site: Site) -> MadeMap:
        """The map over the site's cells, of any crowd."""
        layout = site.layout
        task = MapTask(
            cells=site.cells,
            half_width_m=scenario.vehicle.width_m / 2,
            seed=scenario.seed,
            before=map_before_of(layout),
            witness_reach_m=witness_reach_m(scenario),
        )
        made = self.make_of(crowd, task)
        return made._replace(grid=made.grid.with_p_occupied(np.where(site.nominal, 0.0, made.grid.p_occupied)))

    @abstractmethod
    def make_of(self, crowd: Crowd, task: MapTask) -> MadeMap:
        """The map of a crowd over the task's cells."""

    @abstractmethod
    def map_of_traces(self, traces: pd.DataFrame, task: MapTask) -> MadeMap:
        """The map of a trace table over the task's cells, and what was learned of it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TracesMethod(CrowdMethod):
    """A map that is made of the traces themselves."""

    make: Callable[[pd.DataFrame, MapTask], MadeMap]
    joins_road: ClassVar[bool] = True

    def make_of(self, crowd: Crowd, task: MapTask) -> MadeMap:
        """The map of the crowd's traces."""
        return self.make(crowd.traces, task)

    def map_of_traces(self, traces: pd.DataFrame, task: MapTask) -> MadeMap:
        """The map of the traces, joined to the road before where that is known."""
        return self.make(traces, task)


@dataclass(frozen=True, kw_only=True, eq=False)
class MixtureMethod(CrowdMethod):
    """A map that is made of the mixture fitted to the traces."""

    make: Callable[[Crowd, MapTask], OccupancyGrid]

    def make_of(self, crowd: Crowd, task: MapTask) -> MadeMap:
        """The map of the crowd's mixture."""
        grid, mixture = self.make(crowd, task), crowd.mixture
        return MadeMap(grid, {"n_components": mixture.n_components}, lines=lines_of_mixture(mixture))

    def map_of_traces(self, traces: pd.DataFrame, task: MapTask) -> MadeMap:
        """The map of the mixture of the traces, of which at most MAX_MIXTURE_FIXES are taken."""
        fixes = traces.iloc[:: -(-len(traces) // MAX_MIXTURE_FIXES)]
        road = reference_line_from_traces(fixes)
        return self.make_of(
            Crowd(traces=fixes, road=road, spec=MixtureSpec(), seed=task.seed, fitting=lambda: nullcontext(task.tell)), task
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class LidarMethod(MapMethod):
    """A map of one LiDAR mapping drive.

    The scans do not say where the pavement ends: beyond the edges of the road before the zone the map is occupied. Outside the
    announced zone the nominal lanes are free, as on the crowd's maps.
    """

    form: Callable[[SlamMaps], OccupancyGrid]
    source: ClassVar[Source] = Source.LIDAR

    def map_of_zone(self, sources: Sources) -> MadeMap:
        """The map over the site's cells."""
        seen, site = self.form(sources.lidar.maps), sources.site
        known = np.where(site.nominal, 0.0, np.where(_pavement_before(site), seen.p_occupied, 1.0))
        return MadeMap(seen.with_p_occupied(known), {})


@dataclass(frozen=True, kw_only=True, eq=False)
class MapBeforeMethod(MapMethod):
    """A map that was there before the zone."""

    make: Callable[[Site], OccupancyGrid]
    source: ClassVar[Source] = Source.MAP_BEFORE

    def map_of_zone(self, sources: Sources) -> MadeMap:
        """The map over the site's cells."""
        return MadeMap(self.make(sources.site), {})


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveMethod(MapMethod):
    """A live map of the traces of the whole road. It knows no announcement, and not when or where the zone changes."""

    goes_on: bool = True  # false: it stays as it was before the change
    source: ClassVar[Source] = Source.LIVE

    def map_of_zone(self, sources: Sources) -> MadeMap:
        """The map over the site's cells when the ego sets out."""
        section = section_of(sources.scenario)
        known = [update for update in self._updates(sources) if update.time_s <= section.ego_sets_out_s]
        alarms = [update.alarm.as_json() for update in sources.updates if update.alarm]
        figures = {"alarms": alarms, "false_alarms": [alarm.as_json() for alarm in sources.settled.false_alarms]}
        return _map_of_lanes(known[-1].lanes, sources.site, figures)

    def arriving(self, sources: Sources) -> tuple[ArrivingMap, ...]:
        """The doubts that the ego sets out with, and the maps and doubts that come later."""
        sets_out_s, updates = section_of(sources.scenario).ego_sets_out_s, self._updates(sources)
        last = max(number for number, update in enumerate(updates) if update.time_s <= sets_out_s)
        first = ArrivingMap(time_s=sets_out_s, made=None, doubtful=updates[last].doubtful)
        later = tuple(
            ArrivingMap(
                time_s=update.time_s, made=_map_of_lanes(update.lanes, sources.site, {}) if update.redrawn else None,
                doubtful=update.doubtful,
            )
            for update in updates[last + 1 :]
            if update.time_s < sets_out_s + WAY_S
        )  # fmt: skip
        return (first, *later)

    def _updates(self, sources: Sources) -> tuple[Update, ...]:
        if self.goes_on:
            return sources.updates
        settled = sources.settled.live
        lanes = settled.ground.lanes
        return (Update(time_s=-np.inf, lanes=lanes, redrawn=False, doubtful=(), alarm=None, n_traces=0),)


def _map_of_lanes(lanes: LaneMap, site: Site, figures: dict[str, Any]) -> MadeMap:
    low, high = (float(station) for station in lanes.stations[[0, -1]])
    width = float(np.median([lane.left - lane.right for lane in lanes.lanes]))
    return MadeMap(
        occupancy_grid(lanes, site.cells), figures, lanes, lines=lines_of_lanes(lanes), lane_width_m=width, mapped=(low, high)
    )


def lines_of_lanes(lanes: LaneMap) -> tuple[LaneLine, ...]:
    """The middles of the lanes where they are open."""
    return tuple(
        line
        for number, lane in enumerate(lanes.lanes)
        for first, last in lanes.open_intervals(number)
        if (line := LaneLine(stations=lanes.stations, offsets=lane.middle).between(first, last)) is not None
    )


def lines_of_traces(traces: pd.DataFrame, *, axis: Road, shift_m: float, error_m: float) -> tuple[LaneLine, ...]:
    """The lines of the traces themselves, which show where in a lane vehicles drive; a lane's middle has the weight of 1.

    A lane map has one width for all lanes and stations: where work narrows or moves lanes, vehicles drive beside its middles.
    `shift_m` is the common error of all positions, `error_m` the standard deviation of a receiver's.
    """
    weight = MIDDLE_SD_M**2 / (PLACE_SD_M**2 + error_m**2)
    lines = []
    for _, trace in traces.groupby("vehicle_id"):
        station, offset = axis.to_sd(trace[["x_m", "y_m"]].to_numpy())
        _, cell, count = np.unique(np.floor(station / STATION_STEP_M), return_inverse=True, return_counts=True)
        at, aside = (np.bincount(cell, weights=of) / count for of in (station, offset - shift_m))
        if len(at) > 1:
            lines.append(LaneLine(stations=at, offsets=aside, weight=weight))
    return tuple(lines)


def lines_of_mixture(mixture: Mixture) -> tuple[LaneLine, ...]:
    """The middle lines of the stretches that the components stand for."""
    lines, weights = driven_lines(mixture)
    return tuple(
        LaneLine(stations=line[order, 0], offsets=line[order, 1], weight=weight / np.ptp(line[:, 0]))
        for line, weight in zip(lines, weights, strict=True)
        if np.ptp(line[:, 0]) > 0 and len(order := np.argsort(line[:, 0]))
    )


def _pavement_before(site: Site) -> BoolArray:
    """Cells (rows, cols) of the pavement from before the zone, shoulders and what is closed now included."""
    road = site.layout.road
    return cells_inside(site.cells, road.strip(0.0, road.length, -road.right_shoulder, road.left_edge))
