"""Sources: what the maps of a case are made of. Each is made at its first use, and kept."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import pandas as pd

from wzsumo.case.change.stream import ChangingStream, changing_stream, known_before, section_of
from wzsumo.case.change.updates import Settled, Update, settled_map, updates_of
from wzsumo.case.crowd import TRACE_MARGIN_M, Crowd, reported_traces
from wzsumo.case.lidar_baseline import LidarBaseline, map_by_lidar
from wzsumo.case.watch import Tell, Watch
from wzsumo.case.zone import SimulatedZone
from wzsumo.errors import SpecError
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.sections import SlamSpec
from wzsumo.scenario.site import Site


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
        """The first `crowd.used` traces and what they teach.

        Raises SpecError where fewer equipped vehicles passed, or the zone changes.
        """
        if self.scenario.live is not None:
            raise SpecError("a map of one crowd does not go with the section [live]; take live, map_of_before or hd_map")
        return self.known_crowd or self._learn(self.scenario)

    @cached_property
    def collected(self) -> pd.DataFrame:
        """The reported traces: the first `crowd.collected`, or where the zone changes all from then on."""
        if self.scenario.live is not None:
            return self.stream.reported
        return reported_traces(self.zone.over_zone, self.scenario, which="collected")

    @cached_property
    def lidar(self) -> LidarBaseline:
        """The maps of one LiDAR mapping drive. Raises SpecError where no car of the fleet can make such a drive."""
        spec = self.scenario.slam or SlamSpec()
        with self.watch.timing("LiDAR mapping drive"), self.watch.progress("LiDAR mapping drive", 1.0) as tell:
            return map_by_lidar(self.zone.whole_fleet(), spec, scenario=self.scenario, site=self.site, on_share=tell)

    @cached_property
    def stream(self) -> ChangingStream:
        """The traces of the whole road before and after the zone changes. Raises SpecError where it does not change."""
        section_of(self.scenario)
        with self.watch.timing("fleet before the change"):
            before = self.zone.fleet_before()
        return changing_stream(before, self.zone.whole_fleet(), self.scenario)

    @cached_property
    def settled(self) -> Settled:
        """The live map that knows the zone as it was before the change."""
        live = section_of(self.scenario)
        with self.watch.timing("live map"):
            road = known_before(self.scenario)
            return settled_map(self.stream.before, road, mapped_traces=live.mapped_traces)

    @cached_property
    def updates(self) -> tuple[Update, ...]:
        """What the live map tells after the change of the zone, from the map of before it on."""
        live = section_of(self.scenario)
        with self.watch.timing("live map after the change"):
            return updates_of(self.settled.live, self.stream.after, doubtful_share=live.doubtful_share)

    def _learn(self, scenario: Scenario) -> Crowd:
        used = reported_traces(self.zone.over_zone, scenario, which="used")
        layout = self.site.layout
        return Crowd(
            traces=used, road=layout.road, spec=scenario.mixture, seed=scenario.seed, fitting=self._fitting,
            mixed_from_m=layout.start - TRACE_MARGIN_M,
        )  # fmt: skip

    @contextmanager
    def _fitting(self) -> Iterator[Tell]:
        with self.watch.timing("mixture"), self.watch.progress("mixtures", 1.0) as tell:
            yield tell
