"""The command `place`: a zone in an existing SUMO network, with its demand."""

import argparse
from pathlib import Path
from typing import Any

from wzsumo import api
from wzsumo.commands.terminal.arguments import add_out_folder, number
from wzsumo.errors import PlacementError

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
    parser.add_argument("net", type=Path, metavar="NET.net.xml", help="your network; it is read, not changed")
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
    parser.add_argument(
        "--closed-from",
        "--closed-from-s",
        type=number,
        default=0.0,
        metavar="S",
        help="when the set-up begins, from the beginning",
    )
    parser.add_argument(
        "--closed-for", "--closed-for-s", type=number, metavar="S", help="from then on, until all lanes are open again"
    )
    add_out_folder(parser)


def prepared(words: list[str]) -> list[str]:
    """The words of the command line, with a space before an edge's id that begins with a minus, as OSM's do.

    With the space argparse does not take it for an option.
    """
    ids = {number + 1 for number, word in enumerate(words) if word == "--at"}
    return [f" {word}" if number in ids and word.startswith("-") else word for number, word in enumerate(words)]


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write the three configurations; where the zone lies, what is cut, how many elements were changed."""
    report = api.place(
        args.net,
        zone=args.zone,
        out=args.out,
        at=_at(*args.at) if args.at else None,
        at_latlon=tuple(args.at_latlon) if args.at_latlon else None,
        lane_side=args.lane_side,
        sumocfg=args.sumocfg,
        routes=args.routes,
        additionals=args.additionals,
        closed_from_s=args.closed_from,
        closed_for_s=args.closed_for,
    )
    configs = {name: str(args.out / name / "run.sumocfg") for name in ("original", "open", "closed")}
    return report["zone"] | {
        "configurations": configs,
        "cuts": report["cuts"],
        "n_changes": len(report["changes"]),
        "warnings": report["warnings"],
    }


def next_step(figures: dict[str, Any], _args: argparse.Namespace) -> str:
    """What to do with what was written."""
    return f"sumo-gui -c {figures['configurations']['closed']}"


def _at(edge: str, position: str) -> tuple[str, float]:
    try:
        return edge.strip(), float(position)
    except ValueError:
        raise PlacementError(f"--at {edge} {position}: the position is not a number; give metres along the edge") from None
