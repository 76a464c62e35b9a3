"""The command `export`: the lanes of a map for other people's tools."""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from wzsumo.commands.arguments import add_origin, number
from wzsumo.errors import SpecError
from wzsumo.files.export.geoparquet import geoparquet_bytes
from wzsumo.files.export.lanelet2 import lanelet2_osm
from wzsumo.files.export.opendrive import opendrive_xml
from wzsumo.files.lanes import LanesFile, read_lanes
from wzsumo.files.output import write_whole
from wzsumo.geography import local_frame
from wzsumo.units import mps_from_mph

MORE = """\
LANES is the lanes.geojson that `wzsumo map` writes, or its folder. Only ground that the map calls free becomes a lane.

  lanelet2     OSM XML: lanelets with shared lines, one-way; needs a place on earth (--origin gives one)
  opendrive    OpenDRIVE 1.7: one road, its frame as geoReference
  geoparquet   one row a stretch of a lane, with state, width and standard deviation
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("lanes", type=Path, metavar="LANES.geojson")
    parser.add_argument("--to", required=True, choices=list(WRITERS))
    parser.add_argument("--out", type=Path, required=True, metavar="FILE")
    parser.add_argument("--speed-limit-mph", type=number, help="posted in the zone; left out where it is not given")
    add_origin(parser)


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write the lanes of a map in another format; the file and its frame. Raises InputError where it cannot hold them."""
    content = read_lanes(args.lanes)
    if args.origin is not None:
        if content.frame is not None:
            raise SpecError(f"--origin: {args.lanes} has a place on earth already ({content.frame.crs}); leave --origin out")
        lat, lon = args.origin
        content = replace(content, frame=local_frame([[lon, lat]], step_deg=1e-9))
    limit = args.speed_limit_mph
    if limit is not None and not 0 < limit <= 100:
        raise SpecError(f"--speed-limit-mph {limit:g} must be above 0 and at most 100")
    data = WRITERS[args.to](content, None if limit is None else mps_from_mph(limit))
    write_whole(args.out, data)
    return {
        "file": str(args.out),
        "format": args.to,
        "n_lanes": len(content.lanes.lanes),
        "frame": content.frame.as_json() if content.frame else None,
        "warnings": list(content.lanes.warnings),
    }


WRITERS: dict[str, Callable[[LanesFile, float | None], bytes]] = {
    "lanelet2": lambda content, limit: lanelet2_osm(content, speed_limit_mps=limit),
    "opendrive": lambda content, limit: opendrive_xml(content, speed_limit_mps=limit, name="work zone"),
    "geoparquet": lambda content, _: geoparquet_bytes(content),
}
