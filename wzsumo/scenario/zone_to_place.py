"""The zone that is to be placed in a network, from a file of its own or from a whole scenario."""

from pathlib import Path

from wzsumo.placement.zone_file import Shoulders, ZoneToPlace
from wzsumo.scenario.library import scenario_file
from wzsumo.scenario.scenario import Scenario
from wzsumo.spec import read_toml


def read_zone_to_place(path: Path) -> ZoneToPlace:
    """The zone of a TOML file or of the library; a scenario's road gives way to that of the network.

    Raises SpecError: file, key, value, rule.
    """
    path = scenario_file(path)
    content = read_toml(path)
    if "name" in content and "route" in content:  # a scenario
        shoulders = {key: value for key, value in content.get("road", {}).items() if key in Shoulders.model_fields}
        unknown = {key: value for key, value in content.items() if key not in Scenario.model_fields}
        content = {"work_zone": content.get("work_zone", {}), "road": shoulders} | unknown
    return ZoneToPlace.of_content(content, source=str(path))
