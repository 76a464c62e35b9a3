"""wzsumo: can an automated vehicle learn from the traces of the cars ahead where to drive through a work zone?

The nouns and the verbs. Each is loaded when it is first used:

>>> import wzsumo
>>> layout = wzsumo.load_scenario("paper").layout()
>>> round(layout.area("activity area").length / 0.3048)  # feet
650
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wzsumo.announced_zone import AnnouncedZone
    from wzsumo.api import build_map, plan, run_case
    from wzsumo.ego import EgoRun, Outcome
    from wzsumo.errors import InputError
    from wzsumo.files.lanes import LanesFile, read_lanes
    from wzsumo.files.ros_map import read_map, write_map
    from wzsumo.files.traces import fixes_from, read_fixes, read_traces
    from wzsumo.geography import LocalFrame
    from wzsumo.grid import OccupancyGrid, blank_grid
    from wzsumo.lane_map import LaneMap
    from wzsumo.path import ReferencePath
    from wzsumo.planning.plan import Plan, PlanStatus
    from wzsumo.planning.planner_spec import PlannerSpec
    from wzsumo.road import Road, RoadSpec
    from wzsumo.scenario.scenario import Scenario, load_scenario
    from wzsumo.sweep.results import read_results
    from wzsumo.sweep.summary import compare, summarise
    from wzsumo.vehicle import VehicleGeometry
    from wzsumo.work_zone import WorkZone, WorkZoneLayout

    __version__: str

__all__ = [
    "AnnouncedZone",
    "EgoRun",
    "InputError",
    "LaneMap",
    "LanesFile",
    "LocalFrame",
    "OccupancyGrid",
    "Outcome",
    "Plan",
    "PlanStatus",
    "PlannerSpec",
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
    "fixes_from",
    "load_scenario",
    "place",
    "plan",
    "read_fixes",
    "read_lanes",
    "read_map",
    "read_results",
    "read_traces",
    "run_case",
    "summarise",
    "write_map",
]
_HOMES = {
    "announced_zone": ("AnnouncedZone",),
    "api": ("build_map", "place", "plan", "run_case"),
    "ego": ("EgoRun", "Outcome"),
    "errors": ("InputError",),
    "files.lanes": ("LanesFile", "read_lanes"),
    "files.ros_map": ("read_map", "write_map"),
    "files.traces": ("fixes_from", "read_fixes", "read_traces"),
    "geography": ("LocalFrame",),
    "grid": ("OccupancyGrid", "blank_grid"),
    "lane_map": ("LaneMap",),
    "path": ("ReferencePath",),
    "planning.plan": ("Plan", "PlanStatus"),
    "planning.planner_spec": ("PlannerSpec",),
    "road": ("Road", "RoadSpec"),
    "scenario.scenario": ("Scenario", "load_scenario"),
    "sweep.results": ("read_results",),
    "sweep.summary": ("compare", "summarise"),
    "vehicle": ("VehicleGeometry",),
    "work_zone": ("WorkZone", "WorkZoneLayout"),
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
