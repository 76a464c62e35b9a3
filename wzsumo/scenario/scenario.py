"""Scenario: the spec of one case, read from a file and checked."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator
from shapely import Polygon

from wzsumo.capacity import SiteSpec, ZoneCapacity, zone_capacity, zone_queue_discharge_pcphpl
from wzsumo.control.plant import PlantSpec
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec
from wzsumo.errors import SpecError
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.road import Road, RoadSpec
from wzsumo.scenario.facility import Facility, OwnRoad, check_demand_of_network, network_corridor
from wzsumo.scenario.library import scenario_file
from wzsumo.scenario.live_section import LiveSection
from wzsumo.scenario.network_section import NetworkSection, beside
from wzsumo.scenario.sections import ControlSection, CrowdSpec, Decides, MapSpec, RouteSpec, SlamSpec
from wzsumo.sensing.gnss import GnssSpec
from wzsumo.simulation.departures import check_departures
from wzsumo.simulation.drivers import BY_THE_HCM, UNCALIBRATED, hcm_drivers
from wzsumo.simulation.files import SimulationSpec, SumoFiles
from wzsumo.spec import MAX_SEED, Spec, parse_spec, read_toml
from wzsumo.units import feet_from_metres, mps_from_mph
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import DeviceKind, RoadType, WorkZone, WorkZoneLayout

Pose = tuple[float, float, float]
MAP_REACH_M = 20.0  # how far maps reach beyond the rear axle at start and goal; chosen by us


class Scenario(Spec):
    """The spec of one case: everything that decides its result, the seed included."""

    # names the case in tables and reports; letters, digits, _, . and -
    name: Annotated[str, Decides.NOTHING] = Field(min_length=1, pattern=r"^[\w.-]+$")
    # of all random numbers: the same scenario and seed give the same result
    seed: Annotated[int, Decides.SIMULATION] = Field(ge=0, le=MAX_SEED)
    road: Annotated[RoadSpec | None, Decides.SIMULATION] = None  # it or [network] must be given
    network: Annotated[NetworkSection | None, Decides.SIMULATION] = None  # a road in somebody's network, in the place of [road]
    work_zone: Annotated[WorkZone, Decides.SIMULATION]
    site: Annotated[SiteSpec, Decides.SIMULATION] = SiteSpec()
    simulation: Annotated[SimulationSpec, Decides.SIMULATION] = SimulationSpec()
    crowd: Annotated[CrowdSpec, Decides.REPORTS] = CrowdSpec()
    gnss: Annotated[GnssSpec, Decides.REPORTS] = GnssSpec(error_m=0.0)
    mixture: Annotated[MixtureSpec, Decides.REPORTS] = MixtureSpec()
    map: Annotated[MapSpec, Decides.SITE] = MapSpec()
    route: Annotated[RouteSpec, Decides.SITE]
    live: Annotated[LiveSection | None, Decides.SIMULATION] = None  # None: the zone stays as it is
    slam: Annotated[SlamSpec | None, Decides.LIDAR] = None  # where given, `wzsumo run` also makes the LiDAR maps
    vehicle: Annotated[VehicleGeometry, Decides.SITE] = VehicleGeometry()
    planner: Annotated[PlannerSpec, Decides.DRIVE] = PlannerSpec()
    control: Annotated[ControlSection, Decides.DRIVE] = ControlSection()
    plant: Annotated[PlantSpec, Decides.DRIVE] = PlantSpec()

    @model_validator(mode="before")
    @classmethod
    def _map_updates_are_live_now(cls, content: Any) -> Any:
        if isinstance(content, dict) and "map_updates" in content:
            raise ValueError("map_updates: a section [live] stands in its place; it says how the zone changes, and when")
        return content

    @model_validator(mode="before")
    @classmethod
    def _place_in_a_network_is_the_beginning(cls, content: Any) -> Any:
        """In a network the section [network] says where the zone begins, and not work_zone.start_ft."""
        zone = content.get("work_zone") if isinstance(content, dict) and content.get("network") else None
        if not isinstance(zone, dict):
            return content
        if zone.get("start_ft", 0.0) != 0.0:
            raise ValueError(
                f"work_zone.start_ft={zone['start_ft']!r}: the place in [network] is where the zone begins; leave it out"
            )
        return content | {"work_zone": zone | {"start_ft": 0.0}}

    @model_validator(mode="before")
    @classmethod
    def _drives_the_posted_speed(cls, content: Any) -> Any:
        """Where no speed is named the ego drives the posted one; its path is planned for the speed that it drives."""
        if not isinstance(content, dict):
            return content
        zone, control, planner = (content.get(name, {}) for name in ("work_zone", "control", "planner"))
        posted = zone.get("posted_speed_mph") if isinstance(zone, dict) else None
        if not (isinstance(posted, int | float) and isinstance(control, dict) and isinstance(planner, dict)):
            return content
        speed = control.get("target_speed_mps", mps_from_mph(posted))
        named = {"control": {"target_speed_mps": speed} | control, "planner": {"planned_speed_mps": speed} | planner}
        return content | named

    @model_validator(mode="after")
    def _has_one_place(self) -> Self:
        if (self.road is None) == (self.network is None):
            raise ValueError("road: give either a section [road] or a section [network]")
        if self.live is not None and self.road is None:
            raise ValueError("live: a zone that changes needs a section [road]; in a [network] closed_from_s sets one up")
        return self

    def facility(self) -> Facility:
        """The road of the case and the maker of its traffic. Raises SpecError where there is no such place."""
        if self.network is not None:
            return network_corridor(self.network, self.work_zone)
        assert self.road is not None  # noqa: S101 the rule above
        if self.live is None:
            return OwnRoad(road=self.road, work_zone=self.work_zone)
        standing = (self.live.changed_at_s, float("inf"))
        return OwnRoad(road=self.road, work_zone=self.work_zone, state=self.live.after, standing=standing)

    def before_the_change(self) -> "Scenario":
        """The scenario as it would go on without the change of its section [live]."""
        if self.live is None:
            return self
        state = self.live.before
        return self.model_copy(update={"live": self.live.model_copy(update={"after": state})})

    def layout(self) -> WorkZoneLayout:
        """The layout of the zone on its road."""
        return self.facility().layout

    def write_sumo_files(self, folder: Path) -> SumoFiles:
        """Write SUMO's files of the case into `folder`."""
        return self.facility().write_sumo_files(folder, simulation=self.zone_simulation(), seed=self.seed)

    def capacity(self) -> ZoneCapacity:
        """The zone's capacity by the HCM. Raises SpecError where its model does not hold."""
        posted_mph, truck_share = self.work_zone.posted_speed_mph, self.simulation.demand.truck_share
        return zone_capacity(**self._hcm_inputs(), posted_speed_mph=posted_mph, truck_share=truck_share)

    def zone_simulation(self) -> SimulationSpec:
        """`simulation` with the drivers that "hcm" stands for in this zone. Raises SpecError where the HCM has none."""
        if self.simulation.demand.drivers != BY_THE_HCM:
            return self.simulation
        try:
            if self.work_zone.road_type is not RoadType.FREEWAY:
                raise SpecError(f'road_type="{self.work_zone.road_type}": the HCM\'s work-zone model is of freeways')
            zone = self._hcm_inputs()
            rate = zone_queue_discharge_pcphpl(**zone)
            drivers = hcm_drivers(rate, open_lanes=zone["open_lanes"])
        except SpecError as error:
            raise SpecError(
                f'simulation.demand.drivers="{BY_THE_HCM.name}": {error}; give drivers = "{UNCALIBRATED.name}" or a table of '
                "your own"
            ) from None
        demand = self.simulation.demand.model_copy(update={"drivers": drivers})
        return self.simulation.model_copy(update={"demand": demand})

    def _hcm_inputs(self) -> dict[str, Any]:
        zone = self.work_zone
        if zone.one_lane_two_way:
            raise SpecError(
                f'one_lane_two_way="{zone.one_lane_two_way}": the HCM\'s work-zone model is of freeways with 2 or more lanes a '
                "direction; what one lane carries by turns depends on who times them"
            )
        walled = (zone.work_space_device or zone.device) is DeviceKind.BARRIER
        site = self.site if self.site.barrier else self.site.model_copy(update={"barrier": "hard" if walled else "soft"})
        layout = self.layout()
        total = layout.road.own_lanes + layout.road.opposing_lanes
        zone = layout.work_zone
        return {"total_lanes": total, "open_lanes": total - len(set(zone.closed_lanes)), "site": site}

    def start_and_goal(self, layout: WorkZoneLayout) -> tuple[Pose, Pose]:
        """Rear-axle poses (x, y, heading) of start and goal. Raises SpecError where they are not on the road."""
        route, road = self.route, layout.road
        stations = (layout.start - route.start_before_zone_m, layout.end + route.goal_after_zone_m)
        for key in ("start_lane", "goal_lane", "open_goal_lane"):
            lane = getattr(route, key)
            if lane is not None and lane >= road.own_lanes:
                raise SpecError(f"route.{key}={lane} must be a lane of the road, 0..{road.own_lanes - 1}")
        if not self.vehicle.length_m < stations[0] < stations[1] < road.length - self.vehicle.length_m:
            raise SpecError(
                f"route: start and goal at stations {stations[0]:.0f} and {stations[1]:.0f} m must lie on the road, "
                f"0..{road.length:.0f} m, a car's length from its ends; {self._remedy_for_ends(layout, stations)}"
            )
        start, goal = (
            _lane_pose(road, station, lane) for station, lane in zip(stations, (route.start_lane, route.goal_lane), strict=True)
        )
        return start, goal

    def _remedy_for_ends(self, layout: WorkZoneLayout, stations: tuple[float, float]) -> str:
        """What brings start and goal onto the road."""
        reach = layout.road.length - self.vehicle.length_m
        if stations[1] >= reach:
            feet = math.floor(feet_from_metres(stations[1] - reach)) + 1
            return f"lengthen the road by {feet} ft, or lower goal_after_zone_m"
        feet = math.floor(feet_from_metres(self.vehicle.length_m - stations[0])) + 1
        return f"raise work_zone.start_ft by {feet}, or lower start_before_zone_m"

    def mapped_ends(self, layout: WorkZoneLayout) -> tuple[float, float]:
        """Stations [m] between which the road is mapped: from before the start to beyond the goal."""
        start, goal = self.start_and_goal(layout)
        (first, last), _ = layout.road.to_sd([start[:2], goal[:2]])
        return float(first) - MAP_REACH_M, float(last) + MAP_REACH_M

    def mapped_ground(self, layout: WorkZoneLayout) -> Polygon:
        """The pavement between those stations, and a margin around it. Raises SpecError where that is too large."""
        road = layout.road
        pavement = road.strip(*self.mapped_ends(layout), -road.right_shoulder, road.left_edge)
        return self.map.checked(pavement.buffer(self.map.margin_m))

    def open_goal(self, layout: WorkZoneLayout) -> Pose | None:
        """Rear-axle pose of the second goal, None where the route has none."""
        if self.route.open_goal_lane is None:
            return None
        return _lane_pose(layout.road, layout.end + self.route.goal_after_zone_m, self.route.open_goal_lane)


def sections_that_decide(*what: Decides) -> set[str]:
    """The names of the sections of a scenario that decide one of these."""
    return {name for name, section in Scenario.model_fields.items() if set(what) & set(section.metadata)}


def keys_that_decide(section: type[Spec], what: Decides) -> set[str]:
    """The keys of a section that decide `what`, where the section as a whole decides something else."""
    return {name for name, key in section.model_fields.items() if what in key.metadata}


def load_scenario(path: Path | str, *, seed: int | None = None) -> Scenario:
    """The scenario of a TOML file or of the library, with another seed where one is given.

    `path` is a file, or the name of a scenario of the library. Raises SpecError: file, key, value, rule, remedy.
    """
    path = scenario_file(path)
    content = read_toml(path)
    if {"scenarios", "methods"} & content.keys():
        raise SpecError(f"{path}: is a study, not a scenario; run it with `wzsumo sweep {path} --out DIR`")
    if isinstance(content.get("network"), dict):
        content |= {"network": beside(content["network"], path.parent)}
    if seed is not None:
        content = content | {"seed": seed}
    scenario = parse_spec(Scenario, content, source=str(path))
    if misfits := misfits_of(scenario):
        raise SpecError(*(f"{path}: {misfit}" for misfit in misfits))
    return scenario


# The sections that `misfits_of` reads.
FITTING_SECTIONS = frozenset({
    "road", "network", "work_zone", "site", "simulation", "route", "vehicle", "crowd", "map", "live",
})  # fmt: skip


def misfits_of(scenario: Scenario) -> list[str]:
    """What does not fit together in a scenario: zone and road, start and goal, flow and lanes, traces collected and used."""
    crowd, demand = scenario.crowd, scenario.simulation.demand
    misfits = _messages_of_failed(
        scenario.layout
    ) or _messages_of_failed(  # where there is no layout, the other checks cannot be made
        lambda: scenario.mapped_ground(scenario.layout()),
        lambda: _check_demand(scenario),
        lambda: _check_change(scenario),
    )
    if demand.warm_up_s >= demand.duration_s:
        misfits.append(
            f"simulation.demand.warm_up_s={demand.warm_up_s:g} must be shorter than duration_s={demand.duration_s:g}; flows "
            "are counted, and the ego departs, between the two"
        )
    if crowd.used > crowd.collected:
        misfits.append(f"crowd.used={crowd.used} must be at most crowd.collected={crowd.collected}; collect more or use fewer")
    return misfits


def _check_change(scenario: Scenario) -> None:
    """Raise SpecError where the zone cannot have stood as it did before the change, or the times do not fit."""
    if scenario.live is not None:
        scenario.before_the_change().layout()
        demand = scenario.simulation.demand
        scenario.live.check_times(warm_up_s=demand.warm_up_s, duration_s=demand.duration_s)


def _check_demand(scenario: Scenario) -> None:
    """Raise SpecError where the road cannot take the demand, has one of its own, or the ego departs before the zone stands."""
    demand, road = scenario.simulation.demand, scenario.road
    if road is None:
        check_demand_of_network(demand, scenario.facility())
        return
    if demand.opposing_flow_vph and not road.opposing_lane_count:
        raise SpecError(
            f"simulation.demand.opposing_flow_vph={demand.opposing_flow_vph:g} needs an opposing lane; "
            "set road.opposing_lane_count or leave the flow out"
        )
    check_departures(
        scenario.zone_simulation().demand,
        n_lanes=road.lane_count,
        n_opposing=road.opposing_lane_count,
        speed=mps_from_mph(scenario.work_zone.posted_speed_mph),
    )


def _lane_pose(road: Road, station: float, lane: int) -> Pose:
    x, y = road.to_xy(station, road.lane_centre(lane))
    return float(x), float(y), float(road.heading_at(station))


def _messages_of_failed(*checks: Callable[[], object]) -> list[str]:
    """The message of each check that raises SpecError."""
    found = []
    for check in checks:
        try:
            check()
        except SpecError as error:
            found.append(str(error))
    return found
