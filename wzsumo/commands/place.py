"""The command `place`: a zone in an existing SUMO network, with its demand."""

import argparse
from pathlib import Path
from typing import Any

from wzsumo.commands.arguments import add_out_folder, number
from wzsumo.errors import PlacementError
from wzsumo.figures.layout_figure import draw_zone
from wzsumo.files.layout import layout_geojson
from wzsumo.files.output import staged_folder
from wzsumo.files.result_folder import ResultFolder
from wzsumo.placement.configuration import Configuration
from wzsumo.placement.net import Net
from wzsumo.placement.place_on_net import edge_near
from wzsumo.placement.placement import place_zone, write_placement
from wzsumo.placement.zone_file import ZoneToPlace

MORE = """\
Writes three configurations, each complete: `original` as it was, `open` with its edges cut and nothing closed, `closed` with
the zone. Routes, detectors, stops and signals are kept: what names a cut edge is rewritten, the rest stays byte for byte;
changes.json lists every change.

The zone's file has a section [work_zone] with the keys of a scenario; the place says where it begins, and the posted speed is
that of the network unless the file gives one. A network has no shoulders: [road] may give left_shoulder_ft and
right_shoulder_ft.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What it takes."""
    parser.add_argument("net", type=Path, metavar="NET.net.xml")
    parser.add_argument("--zone", type=Path, required=True, metavar="ZONE.toml", help="a zone, or a whole scenario")
    place = parser.add_mutually_exclusive_group(required=True)
    place.add_argument(
        "--at",
        nargs=2,
        metavar=("EDGE", "POS"),
        help="edge and position [m] of the first device; negative: from the edge's end",
    )
    place.add_argument("--at-latlon", nargs=2, type=number, metavar=("LAT", "LON"), help="the same in degrees, WGS 84")
    parser.add_argument(
        "--lane-side", choices=["left", "right"], help="close as many lanes as the zone says, but on this side of the road"
    )
    parser.add_argument("--sumocfg", type=Path, metavar="FILE", help="a configuration of the network: all its files are kept")
    parser.add_argument("--routes", type=Path, nargs="+", default=[], metavar="FILE", help="demand, where there is no sumocfg")
    parser.add_argument("--additionals", type=Path, nargs="+", default=[], metavar="FILE", help="detectors, stops, ...")
    add_out_folder(parser)


def prepared(words: list[str]) -> list[str]:
    """The words of the command line, with a space before an edge's id that begins with a minus, as OSM's do.

    With the space argparse does not take it for an option.
    """
    ids = {number + 1 for number, word in enumerate(words) if word == "--at"}
    return [f" {word}" if number in ids and word.startswith("-") else word for number, word in enumerate(words)]


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write the three configurations; where the zone lies, what is cut, how many elements were changed."""
    if args.sumocfg and (args.routes or args.additionals):
        raise PlacementError("--sumocfg names its routes and additionals itself; leave --routes and --additionals out")
    zone = ZoneToPlace.read(args.zone)
    net = Net.read(args.net)
    if args.sumocfg:
        configuration = Configuration.read(args.sumocfg, net=args.net)
    else:
        configuration = Configuration.of_files(args.net, args.routes, args.additionals)
    edge, position = _place(args, net)
    placed = place_zone(net, zone, edge_id=edge, position=position, side=args.lane_side)
    with staged_folder(args.out) as stage:
        report = write_placement(placed, configuration, stage)
        drawing = ResultFolder(folder=stage, result={}, layout=layout_geojson(placed.layout))
        draw_zone(drawing).savefig(stage / "layout.png")
    configs = {name: str(args.out / name / "run.sumocfg") for name in ("original", "open", "closed")}
    return report["zone"] | {
        "configurations": configs,
        "cuts": report["cuts"],
        "n_changes": len(report["changes"]),
        "warnings": report["warnings"],
    }


def _place(args: argparse.Namespace, net: Net) -> tuple[str, float]:
    if args.at_latlon:
        return edge_near(net, *args.at_latlon)
    edge, position = args.at[0].strip(), args.at[1]
    try:
        return edge, float(position)
    except ValueError:
        raise PlacementError(f"--at {edge} {position}: the position is not a number; give metres along the edge") from None
