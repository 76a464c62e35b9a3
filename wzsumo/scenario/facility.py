"""Facility: the road that a case takes place on and SUMO's files of its traffic, whoever made them.

A case needs a layout, the frame of its metres, the times at which the zone stands, and files to simulate. There are two
makers: a road of the scenario's own with its own demand, and a corridor in somebody's network with the network's demand.
"""

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Protocol

from wzsumo.errors import SpecError
from wzsumo.geography import LocalFrame
from wzsumo.placement.configuration import Configuration
from wzsumo.placement.net import Net
from wzsumo.placement.place_on_net import edge_near, known_frame
from wzsumo.placement.placement import Placed, place_zone
from wzsumo.placement.study.study_files import write_study_files
from wzsumo.placement.study.zone_times import ZoneTimes, zone_times
from wzsumo.placement.zone_file import Shoulders, ZoneToPlace
from wzsumo.road import RoadSpec
from wzsumo.scenario.live_section import ZoneState
from wzsumo.scenario.network_section import NetworkSection
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.files import SimulationSpec, SumoFiles, write_sumo_files
from wzsumo.units import METRES_PER_FOOT
from wzsumo.work_zone import WorkZone, WorkZoneLayout

TIMES_OF_DEMAND = ("duration_s", "warm_up_s")  # keys that hold for a network's demand, too
ALWAYS = (0.0, float("inf"))
AS_SAID = ZoneState()  # the zone as [work_zone] has it


class Facility(Protocol):
    """What a case needs of the place that it takes place in."""

    @property
    def layout(self) -> WorkZoneLayout:
        """The zone as laid out on its road."""
        ...

    @property
    def frame(self) -> LocalFrame | None:
        """The frame of the road's metres; None without a place on earth."""
        ...

    @property
    def standing(self) -> tuple[float, float]:
        """Times [s] from the simulation's beginning between which the zone stands whole."""
        ...

    def write_sumo_files(self, folder: Path, *, simulation: SimulationSpec, seed: int) -> SumoFiles:
        """Write the files of the traffic into `folder`."""
        ...


@dataclass(frozen=True, kw_only=True)
class OwnRoad:
    """A road of the scenario's own."""

    road: RoadSpec
    work_zone: WorkZone
    state: ZoneState = AS_SAID
    standing: tuple[float, float] = ALWAYS

    @property
    def layout(self) -> WorkZoneLayout:
        """The zone on the road."""
        return self.state.layout_on(self.road.build(), self.work_zone)

    @property
    def frame(self) -> LocalFrame | None:
        """The frame that the road's section names."""
        return self.road.frame

    def write_sumo_files(self, folder: Path, *, simulation: SimulationSpec, seed: int) -> SumoFiles:
        """Write a network of the road alone, and a demand drawn from the seed."""
        closed_ft = self.state.road_closed_ft
        closed_at = None if closed_ft is None else METRES_PER_FOOT * closed_ft
        return write_sumo_files(self.layout, folder, spec=simulation, seed=seed, closed_at=closed_at)


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkCorridor:
    """A road in a network that is there already."""

    placed: Placed
    configuration: Configuration
    times: ZoneTimes | None  # None: the zone stands from the beginning to the end

    @property
    def layout(self) -> WorkZoneLayout:
        """The zone on the corridor's road, in the network's metres."""
        return self.placed.layout

    @property
    def frame(self) -> LocalFrame | None:
        """The network's frame."""
        return known_frame(self.placed.corridor.net)

    @property
    def standing(self) -> tuple[float, float]:
        """From the end of the set-up to the moment when the lanes open again."""
        return ALWAYS if self.times is None else self.times.standing(self.placed.closed)

    def write_sumo_files(self, folder: Path, *, simulation: SimulationSpec, seed: int) -> SumoFiles:
        """Write the network with the zone and without it, and the demand that it has."""
        if self.times is not None:
            self.times.check(self.placed.closed, duration=simulation.demand.duration_s)
        return write_study_files(
            self.placed, self.configuration, folder, simulation=simulation, seed=seed, times=self.times
        )  # fmt: skip


def network_corridor(section: NetworkSection, work_zone: WorkZone) -> NetworkCorridor:
    """The corridor of a scenario's network, with its zone placed. Raises PlacementError where it cannot stand there."""
    return _placed(section, work_zone, tuple((path, path.stat().st_mtime_ns) for path in section.files if path.exists()))


def check_demand_of_network(demand: DemandSpec, facility: Facility) -> None:
    """Raise SpecError where keys ask for a demand of our own, or the ego would depart while the zone does not stand."""
    usual = DemandSpec()
    ours = DemandSpec.model_fields.keys() - set(TIMES_OF_DEMAND)
    own = [key for key in sorted(ours) if getattr(demand, key) != getattr(usual, key)]
    if own:
        raise SpecError(
            f"simulation.demand.{own[0]}: the demand of a network is that of its routes; leave this key out, and change the "
            "routes instead"
        )
    begin, end = facility.standing
    if not begin <= demand.warm_up_s < end:
        raise SpecError(
            f"simulation.demand.warm_up_s={demand.warm_up_s:g}: the ego departs then, and the zone stands from {begin:.0f} s "
            f"to {end:.0f} s; let it depart within"
        )


def content_of(section: NetworkSection) -> str:
    """A name of what the network's files hold, which changes with them."""
    digest = hashlib.blake2b(digest_size=8)
    configuration = _configuration(section)
    for path in (configuration.net, *configuration.demand):
        digest.update(path.read_bytes())
    return digest.hexdigest()


@lru_cache(maxsize=1)  # a network of 20 MB takes seconds to read
def _net(path: Path, _stamp: int) -> Net:
    return Net.read(path)


@lru_cache(maxsize=2)
def _placed(section: NetworkSection, work_zone: WorkZone, _stamps: tuple[tuple[Path, int], ...]) -> NetworkCorridor:
    configuration = _configuration(section)
    net = _net(section.net, section.net.stat().st_mtime_ns) if section.net.exists() else Net.read(section.net)
    place = (section.edge, section.position_m or 0.0) if section.edge else edge_near(net, *section.latlon)
    shoulders = Shoulders(left_shoulder_ft=section.left_shoulder_ft, right_shoulder_ft=section.right_shoulder_ft)
    zone = ZoneToPlace(work_zone=work_zone.model_dump(exclude={"start_ft"}), road=shoulders)
    sizes = configuration.vehicle_sizes
    placed = place_zone(net, zone, edge_id=place[0], position=place[1], side=section.lane_side, sizes=sizes)
    times = zone_times(section.closed_from_s, section.closed_for_s)
    return NetworkCorridor(placed=placed, configuration=configuration, times=times)


def _configuration(section: NetworkSection) -> Configuration:
    if section.sumocfg:
        return Configuration.read(section.sumocfg, net=section.net)
    return Configuration.of_files(section.net, section.routes, section.additionals)
