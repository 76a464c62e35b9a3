"""wzsumo: can an automated vehicle learn from the traces of the cars ahead where to drive through a work zone?

The nouns and the verbs, loaded when they are first used:

>>> import wzsumo
>>> layout = wzsumo.load_scenario("scenarios/paper.toml").layout()
>>> round(layout.area("activity area").length / 0.3048)  # feet
650
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wzsumo.ego import EgoRun, Outcome
    from wzsumo.errors import InputError
    from wzsumo.grid import OccupancyGrid, blank_grid, read_map, write_map
    from wzsumo.path import ReferencePath
    from wzsumo.road import Road, RoadSpec
    from wzsumo.study.interface import build_map, plan, run_case
    from wzsumo.study.results import read_results
    from wzsumo.study.scenario import Scenario, load_scenario
    from wzsumo.study.summary import compare, summarise
    from wzsumo.traces_file import read_traces
    from wzsumo.vehicle import VehicleGeometry
    from wzsumo.work_zone import WorkZone, WorkZoneLayout

__version__ = "0.1.0"
__all__ = [
    "EgoRun",
    "InputError",
    "OccupancyGrid",
    "Outcome",
    "ReferencePath",
    "Road",
    "RoadSpec",
    "Scenario",
    "VehicleGeometry",
    "WorkZone",
    "WorkZoneLayout",
    "blank_grid",
    "build_map",
    "compare",
    "load_scenario",
    "plan",
    "read_map",
    "read_results",
    "read_traces",
    "run_case",
    "summarise",
    "write_map",
]
_HOMES = {
    "ego": ("EgoRun", "Outcome"),
    "errors": ("InputError",),
    "grid": ("OccupancyGrid", "blank_grid", "read_map", "write_map"),
    "path": ("ReferencePath",),
    "road": ("Road", "RoadSpec"),
    "study.interface": ("build_map", "plan", "run_case"),
    "study.results": ("read_results",),
    "study.scenario": ("Scenario", "load_scenario"),
    "study.summary": ("compare", "summarise"),
    "traces_file": ("read_traces",),
    "vehicle": ("VehicleGeometry",),
    "work_zone": ("WorkZone", "WorkZoneLayout"),
}


def __getattr__(name: str) -> Any:
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
