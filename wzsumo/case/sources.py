"""Sources: what the maps of a case are made of. Each is made at its first use, and kept."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

from wzsumo.case.crowd import Crowd, reported_traces
from wzsumo.case.lidar_baseline import LidarBaseline, map_by_lidar
from wzsumo.case.watch import Tell, Watch
from wzsumo.case.zone import SimulatedZone
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.sections import MapArrivalSpec, SlamSpec
from wzsumo.scenario.site import Site


@dataclass(frozen=True, kw_only=True, eq=False)
class ArrivingCrowd:
    """The crowd of a map that reaches the ego on its way, and when."""

    after_s: float  # since the ego entered the road
    crowd: Crowd


@dataclass(frozen=True, kw_only=True, eq=False)
class Sources:
    """The crowd's traces and one LiDAR mapping drive through a simulated zone.

    They depend only on the sections of the scenario that decide simulation, site, reports and LiDAR. `known_crowd` is the crowd
    where another case has learned from the same traces already.
    """

    zone: SimulatedZone
    scenario: Scenario
    site: Site
    watch: Watch
    known_crowd: Crowd | None = None

    @cached_property
    def crowd(self) -> Crowd:
        """The first `crowd.used` traces and what they teach. Raises SpecError where fewer equipped vehicles passed."""
        return self.known_crowd or self._learn(self.scenario)

    @cached_property
    def lidar(self) -> LidarBaseline:
        """The maps of one LiDAR mapping drive. Raises SpecError where no car of the fleet can make such a drive."""
        spec = self.scenario.slam or SlamSpec()
        with self.watch.timing("LiDAR mapping drive"), self.watch.progress("LiDAR mapping drive", 1.0) as tell:
            return map_by_lidar(self.zone.whole_fleet(), spec, scenario=self.scenario, site=self.site, on_share=tell)

    def arriving(self, arrivals: tuple[MapArrivalSpec, ...]) -> tuple[ArrivingCrowd, ...]:
        """The crowds of the maps that arrive on the way. Raises SpecError where fewer vehicles passed than a map asks for."""
        found = []
        for arrival in arrivals:
            crowd = self.scenario.crowd.model_copy(update={"used": arrival.used})
            learned = self._learn(self.scenario.model_copy(update={"crowd": crowd}))
            found.append(ArrivingCrowd(after_s=arrival.after_s, crowd=learned))
        return tuple(found)

    def _learn(self, scenario: Scenario) -> Crowd:
        used = reported_traces(self.zone.over_zone, scenario, which="used")
        road = self.site.layout.road
        return Crowd(traces=used, road=road, spec=scenario.mixture, seed=scenario.seed, fitting=self._fitting)

    @contextmanager
    def _fitting(self) -> Iterator[Tell]:
        with self.watch.timing("mixture"), self.watch.progress("mixtures", 1.0) as tell:
            yield tell
