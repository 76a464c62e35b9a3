"""The command `init`: a scenario file to start from, of the library or of a road event in a WZDx feed."""

import argparse
import os
import re
from pathlib import Path
from typing import Any

import tomli_w

from wzsumo.errors import FeedError, OutputError, SpecError
from wzsumo.feeds.road_event import RoadEvent, read_feed, road_event, road_events, split_event
from wzsumo.files.output import write_whole
from wzsumo.scenario.from_feed import scenario_of_event
from wzsumo.scenario.library import library_zone, library_zones

MORE = """\
Without a ZONE it lists the library. --from writes a scenario of a work zone that a state publishes: its lanes, those that are
closed, shift, speed, place and length; what the feed leaves open is assumed, and listed in the file.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    source = parser.add_mutually_exclusive_group()
    source.add_argument("zone", nargs="?", metavar="ZONE", help="a scenario of the library")
    source.add_argument("--from", dest="feed", metavar="FEED.geojson#ID", help="a road event of a WZDx 4 feed")
    parser.add_argument("--out", type=Path, metavar="FILE.toml", help="the file to write (default: NAME.toml here)")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write a scenario file; its name and what it was made of. Raises InputError where the file is there already."""
    if args.feed is not None:
        return _from_feed(args.feed, args.out)
    if args.zone is None:
        return {"zones": list(library_zones())}
    source = library_zone(args.zone)
    out = _free(args.out or Path(f"{args.zone}.toml"))
    write_whole(out, source.read_bytes())
    return {"file": str(out), "zone": args.zone}


def _from_feed(name: str, out: Path | None) -> dict[str, Any]:
    path, event_id = split_event(name)
    feed = read_feed(path)
    source = str(path)
    event = road_event(feed, event_id, source=source) if event_id else _only_zone(*road_events(feed, source=source), path)
    title = re.sub(r"[^\w.-]+", "_", f"wzdx_{event.id}")
    content, said, assumed = scenario_of_event(event, name=title, source=source)
    target = _free(out or Path(f"{title}.toml"))
    if not re.fullmatch(r"[\w.-]+", target.stem):
        raise SpecError(f"--out {target}: a scenario's file has a name of letters, digits, _, . and -")
    road = ", ".join(event.road_names) or "an unnamed road"
    lines = [f"# Work zone on {road}, {event.direction}: event {event.id} of a WZDx feed."]
    for title_of, words in (("The feed says:", said), ("It leaves open, and this was assumed:", assumed)):
        lines += [f"# {title_of}", *(f"#   {word}" for word in words)]
    write_whole(target, ("\n".join(lines) + "\n" + tomli_w.dumps(content)).encode())
    return {"file": str(target), "event": event.id, "said": said, "assumed": assumed}


def _only_zone(events: list[RoadEvent], faults: list[str], path: Path) -> RoadEvent:
    zones = [event for event in events if event.kind == "work-zone"]
    if len(zones) != 1:
        shown = ", ".join(f"{path}#{event.id}" for event in zones[:4]) or "; ".join(faults[:1]) or "none"
        raise FeedError(f"{path}: has {len(zones)} work-zone events; name one of them: {shown}")
    return zones[0]


def _free(path: Path) -> Path:
    if os.path.lexists(path):  # of a name that cannot be, `write_whole` says why
        raise OutputError(f"--out {path}: is there already; name another file, or move it")
    return path
