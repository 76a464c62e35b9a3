"""StudyCase: one row of a study's table, and the names under which its simulation and its results are kept."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from wzsumo.case.map_method import MapMethod, Source
from wzsumo.case.methods import METHODS
from wzsumo.scenario.scenario import Scenario, keys_that_decide, sections_that_decide
from wzsumo.scenario.sections import CrowdSpec, Decides
from wzsumo.sweep.version import code_version

# Beside the simulation, what a map's source depends on, and so what all that follows from it depends on.
DECIDES_SOURCE: dict[Source, tuple[Decides, ...]] = {
    Source.CROWD: (Decides.REPORTS,),
    Source.LIDAR: (Decides.SITE, Decides.LIDAR),
    Source.MAP_BEFORE: (Decides.SITE,),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyCase:
    """A scenario, the method that maps it, and whether the ego then drives; `factors` are the keys that the study varies."""

    scenario: Scenario
    method: str
    drive: bool
    factors: Mapping[str, Any] = field(default_factory=dict)

    @property
    def map_method(self) -> MapMethod:
        """The method by its name."""
        return METHODS[self.method]

    @cached_property
    def id(self) -> str:
        """Name of the result: a hash of all that decides it, the version of the code included."""
        return _digest(self.scenario.model_dump(mode="json", exclude={"name"}), self.method, self.drive)

    @cached_property
    def simulation(self) -> str:
        """Name of the simulation of the fleet, which many cases share."""
        return _digest(self._content(Decides.SIMULATION))

    @cached_property
    def source(self) -> str:
        """Name of what the map is made of, which methods share: the crowd's traces and their mixture, or a LiDAR drive."""
        return _digest(self.simulation, self._content(*DECIDES_SOURCE[self.map_method.source]))

    @cached_property
    def site(self) -> str:
        """Name of the cells of the map, start and goal."""
        return _digest(self.simulation, self._content(Decides.SITE))

    @cached_property
    def evaluation(self) -> str:
        """Name of map, plan and drive, which cases share that differ only in what their method does not look at."""
        return _digest(self.source, self._content(Decides.SITE, Decides.DRIVE), self.method, self.drive)

    def _content(self, *what: Decides) -> dict[str, Any]:
        """The sections that decide one of these; keys that only decide when the traces are there do not count."""
        unseen = {"crowd": keys_that_decide(CrowdSpec, Decides.COLLECTION)}
        return self.scenario.model_dump(mode="json", include=sections_that_decide(*what), exclude=unseen)


def _digest(*parts: Any) -> str:
    text = json.dumps([code_version(), *parts], sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()
