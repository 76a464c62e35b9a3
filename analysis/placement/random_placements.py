"""Zones at random places of one network: each works for ten minutes of its traffic, or is refused by a rule.

    python analysis/placement/random_placements.py NET.net.xml --sumocfg FILE --name i24 --out placement.csv

Adds a row a place to the CSV file --out; a place that the file has is not tried again.
Edges of two or more lanes are drawn by their length, then position, side and one or two lanes. A place works where SUMO loads
the closed network, no vehicle's outline, of its type's length and width, reaches over the closed ground, and no more vehicles
teleport than in `open`, which differs from `closed` by the zone alone: so none stands for more than five minutes because of the
zone (SUMO teleports it then). Of a vehicle with a trailer the part is looked at whose place and heading SUMO writes, the first.

In a network that locks by itself the number for `original` says little about the zone: there drivers do not look ahead as far,
and another vehicle teleports with every change. What the cuts alone do is `open_against_original.py`'s.
"""

import argparse
import csv
import random
import subprocess
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import shapely
from closed_ground import closed_ground, entered

from wzsumo.errors import InputError
from wzsumo.placement.configuration import Configuration
from wzsumo.placement.demand_files.vehicle_sizes import vehicle_sizes, vehicle_types
from wzsumo.placement.net import Net, NetEdge
from wzsumo.placement.placement import Placed, place_zone, write_placement
from wzsumo.placement.xml_file import XmlFile
from wzsumo.placement.zone_file import ZoneToPlace
from wzsumo.simulation.connection import sumo_binary

COLUMNS = (
    "network", "number", "edge", "position_m", "side", "lanes", "outcome", "why", "zone_m", "edges", "cut_edges",
    "elements_changed_beside", "over_devices", "teleports", "teleports_open", "teleports_original", "arrived",
    "arrived_original", "cpu_place_s",
)  # fmt: skip
WATCHED_M = 20.0  # around the closed ground: farther than a vehicle is long


def main() -> None:
    args = _arguments()
    net, configuration = Net.read(args.net), _configuration(args)
    rng = random.Random(args.seed)
    edges = [edge for edge in net.edges.values() if can_be_drawn(edge, args.min_speed)]
    new = not args.out.exists()
    known = set() if new else _numbers(args.out, args.name)
    original: dict[str, int] = {}
    with args.out.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, restval="")
        if new:
            writer.writeheader()
        for number in range(args.n):
            place = draw_place(edges, rng)
            if number in known:
                continue
            row = {"network": args.name, "number": number, "edge": place[0].id, "position_m": round(place[1], 1),
                   "side": place[2], "lanes": place[3]}  # fmt: skip
            with tempfile.TemporaryDirectory() as folder:
                row |= try_place(net, configuration, place, args, Path(folder), original)
            writer.writerow(row)
            file.flush()
            print(row, flush=True)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("net", type=Path)
    parser.add_argument("--sumocfg", type=Path)
    parser.add_argument("--routes", type=Path, nargs="*", default=[])
    parser.add_argument("--name", required=True)
    parser.add_argument("--n", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--begin", type=float, default=0.0)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--work-ft", type=float, default=300.0)
    parser.add_argument("--speed-mph", type=float, help="posted; default: the network's")
    parser.add_argument("--min-speed", type=float, default=0.0, help="of the edges [m/s]")
    parser.add_argument("--out", type=Path, required=True)
    return parser.parse_args()


def _numbers(path: Path, name: str) -> set[int]:
    """The numbers of the places of a network that a file has."""
    with path.open(newline="") as file:
        return {int(row["number"]) for row in csv.DictReader(file) if row["network"] == name}


def _configuration(args: argparse.Namespace) -> Configuration:
    if args.sumocfg:
        return Configuration.read(args.sumocfg, net=args.net)
    return Configuration.of_files(args.net, args.routes, [])


def can_be_drawn(edge: NetEdge, min_speed: float) -> bool:
    """Whether an edge has two lanes or more for motor vehicles, as fast as `min_speed` [m/s]."""
    roadway = [lane for lane in edge.lanes if lane.is_roadway]
    return not edge.is_internal and len(roadway) > 1 and float(roadway[-1].element.get("speed")) >= min_speed


def draw_place(edges: list[NetEdge], rng: random.Random) -> tuple[NetEdge, float, Any, int]:
    """An edge by its length, a position [m] on it, a side and how many lanes to close."""
    (edge,) = rng.choices(edges, [edge.length for edge in edges])
    n_lanes = sum(lane.is_roadway for lane in edge.lanes)
    return edge, rng.uniform(0, edge.length), rng.choice(["left", "right"]), rng.choice([1, 2] if n_lanes > 2 else [1])


def try_place(
    net: Net, configuration: Configuration, place: tuple[NetEdge, float, Any, int], args: argparse.Namespace, folder: Path,
    original: dict[str, int],
) -> dict[str, Any]:  # fmt: skip
    """The columns that say what became of a place; `original` keeps what SUMO counts without a zone, where that is known.

    Of `args` the work's length, the posted speed and the seconds that are simulated are read.
    """
    edge, position, side, lanes = place
    keys = {"closed_lanes": list(range(lanes)), "work_length_ft": args.work_ft}
    keys |= {"posted_speed_mph": args.speed_mph} if args.speed_mph else {}
    began = time.process_time()
    try:
        placed = place_zone(
            net, ZoneToPlace(work_zone=keys), edge_id=edge.id, position=position, side=side, sizes=configuration.vehicle_sizes
        )
        write_placement(placed, configuration, folder)
    except InputError as error:
        return {"outcome": "refused", "why": str(error), "cpu_place_s": round(time.process_time() - began, 2)}
    row = {
        "zone_m": round(placed.layout.end - placed.layout.start), "edges": len(placed.corridor.links),
        "cut_edges": len(placed.plan.cuts), "cpu_place_s": round(time.process_time() - began, 2),
        "elements_changed_beside": _changed_beside(placed, configuration.net, folder),
    }  # fmt: skip
    if not original:
        original |= _run(folder / "original", args, None)
    ran, over = _run(folder / "closed", args, folder), -1
    if "why" not in ran:
        sizes = _sizes(configuration)
        over = len(entered(folder / "closed" / "fcd.xml", folder, sizes=sizes, edges=_edges_around(placed)))
    # Where nobody teleports, nobody does so because of the zone.
    without = _run(folder / "open", args, None)["teleports"] if ran["teleports"] > 0 else 0
    row |= {"over_devices": over, "teleports_open": without, "teleports_original": original.get("teleports", 0),
            "arrived_original": original.get("arrived", 0)} | ran  # fmt: skip
    works = not over and not row["elements_changed_beside"] and "why" not in ran and ran["teleports"] <= without
    return row | {"outcome": "works" if works else "failed"}


def _run(folder: Path, args: argparse.Namespace, placed: Path | None) -> dict[str, Any]:
    """What SUMO counted, or the reason where it stopped; around the ground that `placed` closes, where vehicles were."""
    statistics, fcd = folder / "statistics.xml", folder / "fcd.xml"
    end = str(args.begin + args.seconds)
    options = [
        "-c", str(folder / "run.sumocfg"), "--end", end, "--statistic-output", str(statistics), "--no-step-log",
        "--no-warnings", "--xml-validation", "never", "--duration-log.statistics",
    ]  # fmt: skip
    if placed:
        watched = closed_ground(placed).envelope.buffer(WATCHED_M)
        shape = " ".join(f"{x:.1f},{y:.1f}" for x, y in shapely.get_coordinates(watched))
        (folder / "watched.add.xml").write_text(f'<additional><poly id="watched" shape="{shape}" color="red"/></additional>')
        config = folder / "run.sumocfg"
        config.write_text(config.read_text().replace("wzsumo.zone.add.xml", "wzsumo.zone.add.xml,watched.add.xml"))
        options += [
            "--fcd-output",
            str(fcd),
            "--fcd-output.filter-shapes",
            "watched",
            "--fcd-output.attributes",
            "x,y,angle,type,lane",
        ]
    done = subprocess.run([str(sumo_binary("sumo")), *options], capture_output=True, text=True, check=False)
    if done.returncode:
        return {"why": " ".join(done.stderr.split())[:300], "teleports": -1, "arrived": -1}
    root = ET.parse(statistics).getroot()
    teleports, vehicles = root.find("teleports"), root.find("vehicles")
    assert teleports is not None
    assert vehicles is not None
    return {"teleports": int(teleports.get("total", 0)),
            "arrived": int(vehicles.get("inserted", 0)) - int(vehicles.get("running", 0))}  # fmt: skip


def _sizes(configuration: Configuration) -> dict[str, tuple[float, float]]:
    """(length, width) [m] of what SUMO's heading holds for, by vehicle type."""
    files = [XmlFile.read(path, role="the demand") for path in configuration.demand]
    return vehicle_sizes(files) | {id_: (size.first_part, size.width) for id_, size in vehicle_types(files).items()}


def _edges_around(placed: Placed) -> set[str]:
    """Ids of the corridor's edges, their pieces, and all that share a junction with them, those within junctions included."""
    nodes = {node for link in placed.corridor.links for node in (link.edge.from_node, link.edge.to_node)}
    around = {edge.id for edge in placed.corridor.net.edges.values() if nodes & {edge.from_node, edge.to_node}}
    within = {
        edge.id for edge in placed.corridor.net.edges.values() if edge.is_internal and edge.id[1:].rpartition("_")[0] in nodes
    }
    return around | within | {piece.id for piece in placed.closed.pieces}


def _changed_beside(placed: Placed, net: Path, folder: Path) -> int:
    """Elements of the network that `open` has not as they were, though they name no edge that was cut."""
    gone = _elements(net) - _elements(folder / "open" / net.name)
    cut = {cut.edge.id for cut in placed.plan.cuts}
    return sum(n for key, n in gone.items() if not cut & {part for word in key[1:] for part in _names(word)})


def _elements(path: Path) -> Counter[tuple[str, ...]]:
    root = ET.parse(path).getroot()
    return Counter((e.tag, *(f"{k}={v}" for k, v in sorted(e.attrib.items()))) for e in root.iter() if e is not root)


def _names(word: str) -> set[str]:
    """Ids of edges that an attribute may name: as they are, or as those of lanes."""
    ids = word.partition("=")[2].split()
    return {*ids, *(id_.rpartition("_")[0] for id_ in ids)}


if __name__ == "__main__":
    main()
