"""StudyCase: one row of a study's table, and the names of the simulation, map source and evaluation that it shares."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from wzsumo.case.map_method import MapMethod, Source
from wzsumo.case.methods import METHODS, ORIGINS
from wzsumo.scenario.facility import content_of
from wzsumo.scenario.scenario import Scenario, keys_that_decide, sections_that_decide
from wzsumo.scenario.sections import CrowdSpec, Decides
from wzsumo.sweep.version import code_version

# The sections of a scenario, beside those of the simulation, that decide what a map is made of.
SECTIONS_OF_SOURCE: dict[Source, tuple[Decides, ...]] = {
    Source.CROWD: (Decides.REPORTS,),
    Source.LIDAR: (Decides.SITE, Decides.LIDAR),
    Source.MAP_BEFORE: (Decides.SITE,),
    Source.LIVE: (Decides.REPORTS, Decides.COLLECTION),
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
        """Name of the case: a hash of everything that decides its result, the version of the code included."""
        return _digest(self.scenario.model_dump(mode="json", exclude={"name"}), self._files, self._method_code, self.drive)

    @cached_property
    def simulation(self) -> str:
        """Name of the simulation of the fleet. Many cases share one simulation."""
        return _digest(self._content(Decides.SIMULATION), self._files)

    @cached_property
    def source(self) -> str:
        """Name of what the map is made of: the crowd's traces with their mixture, or a LiDAR drive. Methods share it."""
        return _digest(self.simulation, self._content(*SECTIONS_OF_SOURCE[self.map_method.source]))

    @cached_property
    def site(self) -> str:
        """Name of the site: the cells of the map, the start and the goal."""
        return _digest(self.simulation, self._content(Decides.SITE))

    @cached_property
    def evaluation(self) -> str:
        """Name of map, plan and drive. Cases share them where they differ only in keys that their method does not use."""
        return _digest(self.source, self._content(Decides.SITE, Decides.DRIVE), self._method_code, self.drive)

    @property
    def _method_code(self) -> str:
        """The method's name, and the origin of one that `code_version` does not cover."""
        return " ".join(filter(None, (self.method, ORIGINS.get(self.method))))

    @cached_property
    def _files(self) -> str:
        """What the files of the scenario's network hold."""
        return content_of(self.scenario.network) if self.scenario.network else ""

    def _content(self, *decided: Decides) -> dict[str, Any]:
        """The content of the sections that decide these, without the keys that only decide when enough traces are collected."""
        left_out = {"crowd": keys_that_decide(CrowdSpec, Decides.COLLECTION)}
        return self.scenario.model_dump(mode="json", include=sections_that_decide(*decided), exclude=left_out)


def _digest(*parts: Any) -> str:
    text = json.dumps([code_version(), *parts], sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()
