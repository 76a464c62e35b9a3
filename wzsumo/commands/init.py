"""The command `init`: a scenario file to start from, of the library or of a road event in a WZDx feed."""

import argparse
import json
import os
import re
import sys
from pathlib import Path
from typing import Any

import tomli_w

from wzsumo.commands.terminal.words import lines_of
from wzsumo.errors import FeedError, OutputError, SpecError, one_line
from wzsumo.feeds.road_event import RoadEvent, read_feed, road_event, road_events, split_event
from wzsumo.files.output import staged_folder
from wzsumo.scenario.from_feed import scenario_of_event
from wzsumo.scenario.keys import json_schema
from wzsumo.scenario.library import NETWORKS, STUDIES, ZONES, library_file, library_files, purpose
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.scenario.starting_file import starting_text
from wzsumo.spec import Spec
from wzsumo.sweep.study_file import StudySpec

MORE = """\
Without a ZONE it lists the library: zones, zones in a network of their own, studies. `wzsumo run ZONE` runs one as it is.
--from writes a scenario of a work zone that a state publishes: its lanes, those that are closed, shift, speed, place and
length; what the feed leaves open is assumed, and listed in the file.
"""
SCHEMAS = ("scenario.schema.json", "study.schema.json")  # written where they are missing
LISTED = {"zones": ZONES, "networks": NETWORKS, "studies": STUDIES}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    source = parser.add_mutually_exclusive_group()
    source.add_argument("zone", nargs="?", metavar="ZONE", help="a scenario or study of the library")
    source.add_argument("--from", dest="feed", metavar="FEED.geojson#ID", help="a road event of a WZDx 4 feed")
    parser.add_argument("--out", type=Path, metavar="FILE.toml", help="the file to write (default: NAME.toml here)")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write a scenario file; its name and what it was made of. Raises InputError where the file is there already."""
    if args.feed is not None:
        return _from_feed(args.feed, args.out)
    if args.zone is None:
        return {listed: list(library_files(folder)) for listed, folder in LISTED.items()}
    source = library_file(args.zone)
    out = _free(args.out or Path(f"{args.zone}.toml"))
    is_study = source in library_files(STUDIES).values()
    files = _files_of_study(source, out) if is_study else _files_of_scenario(source, out)
    _write_new(out, files)
    kind = "study" if is_study else "scenario"
    return {"file": str(out), kind: args.zone, "beside": [str(path) for path in files if path != out]}


def _write_new(out: Path, files: dict[Path, bytes]) -> None:
    """Write `out` and the files beside it together; none may be there, but for a schema, which is kept. Raises OutputError."""
    for path in files:
        if path.name not in SCHEMAS or path == out:
            _free(path)
    new = {path.relative_to(out.parent): content for path, content in files.items() if not os.path.lexists(path)}
    with staged_folder(out.parent, files=[str(path) for path in new]) as stage:
        for path, content in new.items():
            (stage / path).parent.mkdir(exist_ok=True)
            (stage / path).write_bytes(content)


def tell(figures: dict[str, Any], args: argparse.Namespace) -> None:
    """Print the library, or what was written."""
    if args.feed is None and args.zone is None:
        for folder in LISTED.values():
            for name, path in library_files(folder).items():
                sys.stdout.write(f"{name:<22} {purpose(path)}\n")
        return
    for line in lines_of(figures):
        sys.stdout.write(f"{line}\n")


def next_step(figures: dict[str, Any], _args: argparse.Namespace) -> str:
    """The command that goes on from here."""
    if "file" not in figures:
        return "wzsumo init ZONE --out FILE.toml writes one to change; wzsumo run ZONE --out DIR runs it as it is"
    name = Path(figures["file"]).stem
    if "study" in figures:
        return f"wzsumo sweep {figures['file']} --out results/{name} --dry-run"
    return (
        f"wzsumo layout {figures['file']} --out results/{name}_layout, then wzsumo run {figures['file']} --out results/{name}"
    )


def _files_of_scenario(source: Path, out: Path) -> dict[Path, bytes]:
    """The files to write: a scenario, the schema that its first lines name, and the files of its network."""
    scenario = load_scenario(source)
    text = re.sub(r"(?m)^#:schema .*$", f"#:schema ./{SCHEMAS[0]}", source.read_text(encoding="utf-8"))
    beside = [] if scenario.network is None else scenario.network.files
    copies = {out.parent / path.relative_to(source.parent): path.read_bytes() for path in beside}
    return {out: starting_text(text, scenario).encode(), out.parent / SCHEMAS[0]: _schema_text(Scenario)} | copies


def _files_of_study(source: Path, out: Path) -> dict[Path, bytes]:
    return {out: source.read_bytes(), out.parent / SCHEMAS[1]: _schema_text(StudySpec)}


def _schema_text(kind: type[Spec]) -> bytes:
    return (json.dumps(json_schema(kind), indent=1) + "\n").encode()


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
    lines.append(f"#:schema ./{SCHEMAS[0]}")
    text = "\n".join(map(one_line, lines)) + "\n" + tomli_w.dumps(content)  # names of the feed may hold line ends
    _write_new(target, {target: text.encode(), target.parent / SCHEMAS[0]: _schema_text(Scenario)})
    return {"file": str(target), "event": event.id, "said": said, "assumed": assumed}


def _only_zone(events: list[RoadEvent], faults: list[str], path: Path) -> RoadEvent:
    zones = [event for event in events if event.kind == "work-zone"]
    if len(zones) != 1:
        shown = ", ".join(f"{path}#{event.id}" for event in zones[:4]) or "; ".join(faults[:1]) or "none"
        raise FeedError(f"{path}: has {len(zones)} work-zone events; name one of them: {shown}")
    return zones[0]


def _free(path: Path) -> Path:
    if path.name in {"", "..", *SCHEMAS}:
        raise OutputError(f"--out {path}: is no name of a scenario's file; name one, such as mine.toml")
    if os.path.lexists(path):  # of a name that cannot be, `staged_folder` says why
        raise OutputError(f"--out {path}: is there already; name another file, or move it")
    return path
