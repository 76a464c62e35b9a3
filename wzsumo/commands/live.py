"""The command `live`: traces in order of time through a map that notices what changed."""

import argparse
import json
import sys
from io import TextIOWrapper
from pathlib import Path
from typing import Any, TextIO

from wzsumo.commands.terminal.arguments import add_out_folder, add_reading, column_names, number
from wzsumo.commands.terminal.streams import printing
from wzsumo.commands.terminal.words import lines_of
from wzsumo.errors import SpecError, count_of
from wzsumo.files.fixes.tables import table_files
from wzsumo.files.lanes import LANES_FILE, LanesFile, read_lanes, write_lanes
from wzsumo.files.output import staged_folder
from wzsumo.live.stream.arrivals import Reading
from wzsumo.live.stream.log_folder import LiveFolder, open_folder
from wzsumo.live.stream.replay import follow_folder, follow_stream, replay_files
from wzsumo.report.live_page import PAGE, write_live_page

MORE = """\
TRACES are files or folders as `wzsumo map` takes them, or - for lines of .csv on standard input. They are replayed in order of
time against the map, a lanes.geojson of `wzsumo map` or its folder. Written to --out: alarms.jsonl (what changed, where, since
when, how sure, on how many traces), versions/ (the map after each change: GeoJSON, Parquet, WZDx where it has a place and
dates), lanes.geojson (as it is known now), live.html. A run that was stopped goes on where it was; further files are taken
after those that were taken before.

  wzsumo live day1.parquet day2.parquet --map out --out live
  wzsumo live incoming/ --follow --map out --out live --json      waits for further files
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("traces", type=Path, nargs="+", metavar="TRACES", help="files or folders, or - for standard input")
    parser.add_argument("--map", type=Path, required=True, metavar="DIR", help="the map to begin with")
    add_out_folder(parser)
    add_reading(parser)
    parser.add_argument("--follow", action="store_true", help="wait for further files in the folder TRACES")
    parser.add_argument("--idle-s", type=number, metavar="S", help="with --follow: end after S seconds without a new file")
    parser.add_argument(
        "--half-life-h", type=number, default=24.0, metavar="H",
        help="time after which the evidence of ground that nobody drove since counts half (default 24)",
    )  # fmt: skip


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write versions, alarms and the page; counts. Raises InputError where traces and map do not belong together."""
    if args.half_life_h <= 0:
        raise SpecError(f"--half-life-h {args.half_life_h:g} must be above 0")
    if args.idle_s is not None and not args.follow:
        raise SpecError("--idle-s: says when to stop waiting; give it with --follow")
    if args.follow and not (len(args.traces) == 1 and args.traces[0].is_dir()):
        raise SpecError("--follow: waits for files in one folder; name that folder alone")
    if args.out.resolve() in {args.map.resolve(), args.map.resolve().parent}:
        raise SpecError(f"--out {args.out}: is the folder of --map, whose lanes would be overwritten; name another folder")
    content = read_lanes(args.map)
    reading = Reading(columns=column_names(args.columns), crs=args.crs, frame=content.frame)
    stream = [str(path) for path in args.traces] == ["-"]
    files = [] if stream or args.follow else [file for path in args.traces for file in table_files(path)]
    half_life_s = 3600 * args.half_life_h
    with open_folder(args.out, args.map) as folder:
        try:
            if stream:
                follow_stream(folder, _standard_input(), reading, half_life_s=half_life_s, tell=_teller(args))
            elif args.follow:
                follow_folder(folder, args.traces[0], reading, idle_s=args.idle_s, half_life_s=half_life_s, tell=_teller(args))
            else:
                replay_files(folder, files, reading, half_life_s=half_life_s, tell=_teller(args))
        except KeyboardInterrupt:
            folder.commit()
            _write_now(folder, half_life_s)
            raise
        _write_now(folder, half_life_s)
    alarms = (args.out / "alarms.jsonl").read_text(encoding="utf-8").splitlines()
    return {
        "out": str(args.out), "traces": folder.counts["taken"], "versions": folder.live.version, "alarms": len(alarms),
        "twice": folder.counts["twice"], "late": folder.counts["late"], "off_map": folder.counts["off_map"],
        "warnings": _warnings(folder.counts),
    }  # fmt: skip


def tell(figures: dict[str, Any], _args: argparse.Namespace) -> None:
    """Print the counts; of traces that were left out only where there are some, which the warnings then explain."""
    left_out = ("twice", "late", "off_map")
    for line in lines_of({key: value for key, value in figures.items() if key not in left_out}):
        sys.stdout.write(f"{line}\n")


def next_step(_figures: dict[str, Any], args: argparse.Namespace) -> str:
    """What to do with what was written."""
    return f"open {args.out / 'live.html'} in a browser"


def _standard_input() -> TextIO:
    if isinstance(sys.stdin, TextIOWrapper):
        sys.stdin.reconfigure(encoding="utf-8-sig", errors="strict", newline="")  # whatever the terminal's own is
    return sys.stdin


def _write_now(folder: LiveFolder, half_life_s: float) -> None:
    lanes = folder.live.lanes_now(half_life_s=half_life_s)
    with staged_folder(folder.path, files=(LANES_FILE, PAGE)) as stage:
        write_lanes(LanesFile(lanes=lanes, frame=folder.frame, utc=folder.utc), stage)
    write_live_page(folder.path, folder.live)


def _teller(args: argparse.Namespace) -> Any:
    def tell(line: dict[str, Any]) -> None:
        with printing():
            if args.json:
                sys.stdout.write(json.dumps(line) + "\n")
            elif "alarm" in line:
                alarm = line["alarm"]
                sys.stdout.write(f"trace {alarm['trace']}: {alarm['words']} ({count_of(alarm['n_traces'], 'trace')})\n")
            sys.stdout.flush()

    return tell


def _warnings(counts: dict[str, int]) -> list[str]:
    words = {
        "twice": "came twice and counted once",
        "late": "ended before one that was taken already: files overlap in time, or clocks are apart",
        "off_map": "not used: not on the map's road, or along fewer than four of its cells",
    }
    return [f"{count_of(counts[name], 'trace')} {said}" for name, said in words.items() if counts[name]]
