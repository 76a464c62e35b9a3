"""The command line. Exit codes: 0 done, 1 a fault of the toolkit, 2 bad input, 130 interrupted."""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any, NoReturn

from wzsumo import __version__
from wzsumo.errors import InputError

# One thread per library: matrices here are small, and more threads make the fits slower.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

ABOUT = """\
Can an automated vehicle learn from the traces of the cars ahead of it where it may drive through a work zone?

  wzsumo run scenarios/paper.toml --out results/paper     the whole case: SUMO traffic, maps, plans, drives, report.html
  wzsumo map traces.parquet --out out                     a ROS map from your own traces; no SUMO needed
  wzsumo plan out/map.yaml --start 10 0 0 --goal 500 0 0 --out path.csv
"""
# Name of each command, which is also that of its module in commands/, and its purpose.
COMMANDS = {
    "init": "write a scenario to start from: of the library, or of a work zone in a WZDx feed",
    "layout": "lay the zone out by the MUTCD: layout.geojson, lanes.geojson, devices.csv, layout.png",
    "net": "write the SUMO files: open zone.sumocfg in sumo-gui",
    "capacity": "what the zone can carry by the Highway Capacity Manual, 7th edition",
    "run": "run the whole case: result.json, maps, paths, drives, report.html",
    "map": "make a ROS map (map.pgm, map.yaml) from anybody's traces",
    "export": "write the lanes of a map as Lanelet2, OpenDRIVE, GeoParquet or a WZDx feed",
    "plan": "plan a path on any ROS map with Hybrid A*",
    "place": "set a zone up in an existing SUMO network, with its demand: open closed/run.sumocfg",
    "sweep": "run what is missing of a study: results.parquet, one row a case",
    "report": "write figures, tables and report.html of a run's or a sweep's folder",
    "ground": "label the ground points of a cloud by SMRF: 1 = ground",
    "register": "find the 4 x 4 transform that takes one cloud to another",
    "warm": "compile all kernels once (set-up does it)",
}


def main(argv: Sequence[str] | None = None) -> NoReturn:
    """Run one command and exit."""
    words = list(sys.argv[1:] if argv is None else argv)
    parser = _parser(words)
    if words and words[0] in COMMANDS:
        words = getattr(import_module(f"wzsumo.commands.{words[0]}"), "prepared", list)(words)
    args = parser.parse_args(words)
    command = import_module(f"wzsumo.commands.{args.command}")
    try:
        figures = command.run(args)
    except InputError as error:
        print(f"wzsumo: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("wzsumo: interrupted; what was finished is kept, nothing is half-written", file=sys.stderr)
        sys.exit(130)
    if args.json:
        print(json.dumps(figures))
    else:
        getattr(command, "tell", _tell)(figures, args)
    sys.exit(0)


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """The parser for these words. It imports only the commands among them, since some modules load slowly."""
    parser = argparse.ArgumentParser(prog="wzsumo", description=ABOUT, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--version", action="version", version=f"wzsumo {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, about in COMMANDS.items():
        sub = commands.add_parser(name, help=about, formatter_class=argparse.RawDescriptionHelpFormatter)
        sub.add_argument("--json", action="store_true", help="print the figures as one JSON object on stdout")
        if name in words:
            module = import_module(f"wzsumo.commands.{name}")
            sub.description = f"{about}\n\n{getattr(module, 'MORE', '')}"
            module.add_arguments(sub)
    return parser


def _tell(figures: dict[str, Any], _args: argparse.Namespace) -> None:
    for key, value in figures.items():
        print(f"{key}: {round(value, 3) if isinstance(value, float) else value}")
