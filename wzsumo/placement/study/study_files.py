"""The SUMO files of a case in a network: the configurations with and without the zone, run as a scenario says."""

from pathlib import Path

from wzsumo.placement.configuration import CONFIG, Configuration
from wzsumo.placement.demand_files.vehicle_sizes import vehicle_sizes
from wzsumo.placement.net import NetEdge
from wzsumo.placement.placement import Placed, write_placement
from wzsumo.placement.study.corridor_edges import road_edges
from wzsumo.placement.study.zone_times import ZoneTimes
from wzsumo.placement.xml_file import Edits, Element, XmlFile, escaped
from wzsumo.simulation.files import SimulationSpec, SumoFiles, Surroundings

STUDY_CONFIG = "study.sumocfg"
# Options of a network's own configuration that a case sets itself (sumo --help), by all their names.
OWN_OPTIONS = frozenset({
    "begin", "b", "end", "e", "step-length", "lateral-resolution", "seed", "random", "collision.action",
    "collision.check-junctions", "xml-validation", "xml-validation.net", "no-step-log", "duration-log.disable",
    "duration-log.statistics", "verbose", "v", "step-log.period", "no-warnings", "W", "start", "S", "quit-on-end", "Q", "log",
    "log-file", "l", "message-log", "error-log",
    "tripinfo-output.write-unfinished", "tripinfo-output.write-undeparted",
})  # fmt: skip


def write_study_files(
    placed: Placed,
    configuration: Configuration,
    folder: Path,
    *,
    simulation: SimulationSpec,
    seed: int,
    times: ZoneTimes | None,
) -> SumoFiles:
    """Write `open` and `closed` with a study.sumocfg each, which open in sumo-gui; what a case needs of them."""
    report = write_placement(placed, configuration, folder, names=("open", "closed"), times=times)
    begin = configuration.begin
    options = {
        "begin": f"{begin:g}",
        "end": f"{begin + simulation.demand.duration_s:g}",
        "step-length": f"{simulation.step_length_s:g}",
        "lateral-resolution": f"{simulation.lateral_resolution_m:g}",
        "seed": str(seed),
        "collision.action": "warn",  # SUMO's collisions count minGap: contact is computed from outlines
        "xml-validation": "never",
        "no-step-log": "true",
        "duration-log.disable": "true",
    }
    configs = {name: _write_study_config(folder / name, options) for name in ("open", "closed")}
    own = Configuration.read(folder / "closed" / CONFIG, net=folder / "closed" / configuration.net.name)
    road = road_edges(placed.closed, straight=times is not None)
    surroundings = Surroundings(
        along=road.along,
        around=road.around,
        vehicle_sizes=vehicle_sizes(XmlFile.read(path, role="the demand") for path in (*own.routes, *own.additionals)),
        whole_edges={piece: edge for edge, cut in report["cuts"].items() for piece in cut["pieces"]},
        shapes={edge.id: _middle_shape(edge) for edge in placed.corridor.net.edges.values() if not edge.is_internal},
        additionals=own.additionals,
        without_zone=configs["open"],
    )
    return SumoFiles(
        config=configs["closed"], edges=road.edges, step_length=simulation.step_length_s,
        duration=simulation.demand.duration_s, begin=begin, surroundings=surroundings,
    )  # fmt: skip


def _middle_shape(edge: NetEdge) -> str:
    return edge.lanes[len(edge.lanes) // 2].element.get("shape")


def _write_study_config(folder: Path, options: dict[str, str]) -> Path:
    """The path of a configuration like run.sumocfg, but with these options, and without outputs of its own."""
    file = XmlFile.read(folder / CONFIG, role="the configuration")
    edits, found = Edits(file), list[Element]()
    root = file.root_and_children(found.append)
    for section in found:
        own = [item for item in section.children or [section] if item.tag in OWN_OPTIONS or "output" in item.tag]
        # A section that is left without options would itself be taken for one.
        for item in [section] if len(own) == len(section.children or [section]) else own:
            edits.replace(item.begin, item.end, "")
    rows = "".join(f'        <{key} value="{escaped(value)}"/>\n' for key, value in options.items())
    edits.insert(file.data.rindex(b"</", root.begin, root.end), f"    <study>\n{rows}    </study>\n")
    path = folder / STUDY_CONFIG
    path.write_bytes(edits.apply())
    return path
