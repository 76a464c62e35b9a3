"""StudyCase: one row of a study's table, and the names under which its simulation and its results are kept."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import wzsumo
from wzsumo.case.baselines import BASELINE_METHODS, SLAM_METHODS
from wzsumo.scenario.scenario import Scenario

# Sections of a scenario that come after the simulation of the fleet; all others decide it. A section that is forgotten here
# costs a simulation too many, never a wrong result.
AFTER_SIMULATION = frozenset(
    {"name", "crowd", "gnss", "mixture", "map", "map_updates", "route", "slam", "vehicle", "planner", "control", "plant"}
)
# The first `used` of the equipped vehicles are the same whatever share is equipped (see `sensing.equipped`): these keys decide
# when the traces are there, and whether there are so many.
_ONLY_WHEN: dict[str, Any] = {"crowd": {"penetration", "collected"}}
# Modules that tell or draw what was measured: a change there leaves finished results as they are.
_TELLING = frozenset(
    {
        "__init__.py", "__main__.py", "cli.py", "study/verbs.py", "study/plan_verb.py", "study/interface.py",
        "study/sweep.py", "study/agenda.py", "study/workers.py",
        "study/cluster.py", "study/estimate.py", "study/sweep_verbs.py",
        "study/result_store.py", "study/results.py", "study/report.py", "study/figures.py",
        "study/drive_figure.py", "study/map_figures.py", "study/mixture_figures.py", "study/zone_axes.py",
        "study/result_folder.py", "study/sweep_report.py", "study/sweep_figures.py", "study/summary.py",
        "study/answers.py", "study/foreign_traces.py", "study/traffic_figures.py",
        "study/traffic_rows.py", "study/study_file.py",
    }
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyCase:
    """A scenario, the method that maps it, and whether the ego then drives; `factors` are the keys that the study varies."""

    scenario: Scenario
    method: str
    drive: bool
    factors: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def id(self) -> str:
        """Name of the result: a hash of all that decides it, the version of the code included."""
        return _digest(self.scenario.model_dump(mode="json", exclude={"name"}), self.method, self.drive)

    @cached_property
    def simulation(self) -> str:
        """Name of the simulation of the fleet, which many cases share."""
        return _digest(self.scenario.model_dump(mode="json", exclude=set(AFTER_SIMULATION)))

    @cached_property
    def source(self) -> str:
        """Name of what the map is made of, which methods share: the crowd's traces and their mixture, or a LiDAR drive."""
        if self.method in BASELINE_METHODS:
            seen = {"slam"} if self.method in SLAM_METHODS else set()
            return _digest(self.simulation, self.scenario.model_dump(mode="json", include={"map", "route", "vehicle", *seen}))
        sections = self.scenario.model_dump(mode="json", include={"crowd", "gnss", "mixture"}, exclude=_ONLY_WHEN)
        return _digest(self.simulation, sections)

    @cached_property
    def evaluation(self) -> str:
        """Name of map, plan and drive, which cases share that differ only in what their method does not look at."""
        unseen = {"crowd": True, "gnss": True, "mixture": True} if self.method in BASELINE_METHODS else _ONLY_WHEN
        if self.method not in SLAM_METHODS:
            unseen = unseen | {"slam": True}
        return _digest(self.scenario.model_dump(mode="json", exclude={"name": True, **unseen}), self.method, self.drive)


@cache
def code_version() -> str:
    """Version of the package and a hash of the modules that decide a result: an edited method makes new results."""
    package = Path(wzsumo.__file__).parent
    digest = hashlib.blake2b(digest_size=6)
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package).as_posix()
        if name not in _TELLING:
            digest.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return f"{wzsumo.__version__}+{digest.hexdigest()}"


def _digest(*parts: Any) -> str:
    text = json.dumps([code_version(), *parts], sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()
