"""The command `export`: the lanes of a map for other people's tools."""

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from wzsumo.commands.terminal.arguments import add_origin, number
from wzsumo.errors import FeedError, SpecError
from wzsumo.feeds.check import rule_faults, schema_faults
from wzsumo.feeds.publication import FeedDetails, published_zone
from wzsumo.files.export.geoparquet import geoparquet_bytes
from wzsumo.files.export.lanelet2 import lanelet2_osm
from wzsumo.files.export.opendrive import opendrive_xml
from wzsumo.files.lanes import LanesFile, read_lanes, time_text
from wzsumo.files.output import write_whole
from wzsumo.geography import local_frame
from wzsumo.units import mps_from_mph

MORE = """\
LANES is the lanes.geojson that `wzsumo map` writes, or its folder. Only ground that the map calls free becomes a lane.

  lanelet2     OSM XML: lanelets with shared lines, one-way; needs a place on earth (--origin gives one)
  opendrive    OpenDRIVE 1.7: one road, its frame as geoReference
  geoparquet   one row a stretch of a lane, with state, width and standard deviation
  wzdx         a WZDx 4.2 feed: where lanes are closed or shifted, verified where that is known within 15 m; --about says
               what a map does not know: publisher, road_name, direction, start_date, end_date
"""
ABOUT = ("publisher", "road_name", "direction", "start_date", "end_date")
DAY_S = 86_400.0
Written = tuple[bytes, list[str]]  # the file, and what was assumed for it


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("lanes", type=Path, metavar="LANES.geojson", help="lanes.geojson, or the folder that holds it")
    parser.add_argument("--to", required=True, choices=list(WRITERS), help="one of the formats above")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the file to write")
    parser.add_argument("--speed-limit-mph", type=number, help="posted in the zone; left out where it is not given")
    parser.add_argument("--about", nargs="+", default=[], metavar="KEY=VALUE", help="of a feed, as in road_name='I-94'")
    add_origin(parser)


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write the lanes of a map in another format; the file and its frame. Raises InputError where it cannot hold them."""
    content = read_lanes(args.lanes)
    if args.origin is not None:
        if content.frame is not None:
            raise SpecError(f"--origin: {args.lanes} has a place on earth already ({content.frame.crs}); leave --origin out")
        lat, lon = args.origin
        if not (-90 <= lat <= 90 and -180 <= lon <= 180):
            raise SpecError(f"--origin {lat:g} {lon:g}: give a latitude of -90..90, then a longitude of -180..180")
        content = replace(content, frame=local_frame([[lon, lat]], step_deg=1e-9))
    if args.speed_limit_mph is not None and not 0 < args.speed_limit_mph <= 100:
        raise SpecError(f"--speed-limit-mph {args.speed_limit_mph:g} must be above 0 and at most 100")
    data, assumed = WRITERS[args.to](content, args)
    write_whole(args.out, data)
    return {
        "file": str(args.out),
        "format": args.to,
        "n_lanes": len(content.lanes.lanes),
        "frame": content.frame.as_json() if content.frame else None,
        "assumed": assumed,
        "warnings": list(content.lanes.warnings),
    }


def _lanelet2(content: LanesFile, args: argparse.Namespace) -> Written:
    return lanelet2_osm(content, speed_limit_mps=_limit_mps(args)), []


def _opendrive(content: LanesFile, args: argparse.Namespace) -> Written:
    return opendrive_xml(content, speed_limit_mps=_limit_mps(args), name="work zone"), []


def _geoparquet(content: LanesFile, _args: argparse.Namespace) -> Written:
    return geoparquet_bytes(content), []


def _wzdx(content: LanesFile, args: argparse.Namespace) -> Written:
    if content.frame is None:
        raise SpecError(f"{args.lanes}: a feed is in degrees, and these lanes have no place on earth; say where by --origin")
    about, assumed = _about(args.about), []
    lanes = content.lanes
    if content.utc:
        known = {"start_date": time_text(lanes.first_time_s), "end_date": time_text(lanes.last_time_s + DAY_S)}
    elif not {"start_date", "end_date"} <= set(about):
        raise SpecError(
            f"{args.lanes}: the traces' times are no dates; give --about start_date=2026-06-01T00:00:00Z end_date=..."
        )
    else:
        known = {}
    defaults = {"publisher": "unknown", "road_name": "unknown", **known}
    assumed = [f"{key}: {value}" for key, value in defaults.items() if key not in about]
    words = defaults | about
    details = FeedDetails(
        publisher=words["publisher"], road_name=words["road_name"], direction=about.get("direction"),
        start_date=words["start_date"], end_date=words["end_date"],
    )  # fmt: skip
    feed = published_zone(lanes, content.frame, details, speed_limit_mps=_limit_mps(args))
    if faults := [*schema_faults(feed), *rule_faults(feed)]:
        raise FeedError(f"--about: the feed would break WZDx 4.2: {faults[0]}")
    return (json.dumps(feed, indent=1) + "\n").encode(), assumed


def _about(words: list[str]) -> dict[str, str]:
    for word in words:
        key, equals, value = word.partition("=")
        if key not in ABOUT or not equals or not value:
            raise SpecError(f"--about {word}: must be KEY=VALUE with a key of {', '.join(ABOUT)}")
    return dict(word.split("=", 1) for word in words)


def _limit_mps(args: argparse.Namespace) -> float | None:
    return None if args.speed_limit_mph is None else mps_from_mph(args.speed_limit_mph)


WRITERS: dict[str, Callable[[LanesFile, argparse.Namespace], Written]] = {
    "lanelet2": _lanelet2,
    "opendrive": _opendrive,
    "geoparquet": _geoparquet,
    "wzdx": _wzdx,
}
