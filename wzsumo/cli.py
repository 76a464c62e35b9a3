"""The command line.

Exit codes: 0 done; 1 a fault of the toolkit; 2 bad input; 128 + the number of the signal that ended it, as other programs have
it: 130 interrupted (SIGINT), 143 terminated (SIGTERM), 129 (SIGHUP), 141 where nobody reads what it prints (SIGPIPE).
"""

import argparse
import json
import os
import re
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

from wzsumo import __version__
from wzsumo.commands.terminal.completion import SHELLS, completion_option
from wzsumo.commands.terminal.progress import telling_of_compiling
from wzsumo.commands.terminal.streams import open_standard_streams, printing
from wzsumo.commands.terminal.words import lines_of
from wzsumo.errors import ENDING_SIGNALS, InputError, check_name, did_you_mean, one_line
from wzsumo.files.placing import keeping

# One thread per library: matrices here are small, and more threads make the fits slower.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

ABOUT = """\
Can an automated vehicle learn from the traces of the cars ahead of it where it may drive through a work zone?

  wzsumo run right_lane --out results/right_lane          a zone of the library: SUMO traffic, maps, plans, drives, report.html
  wzsumo init right_lane --out mine.toml                  the same zone as a file of your own, to change and run
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
    "live": "replay traces against a map that notices what changed: versions, alarms, live.html",
    "export": "write the lanes of a map as Lanelet2, OpenDRIVE, GeoParquet or a WZDx feed",
    "plan": "plan a path on any ROS map with Hybrid A*",
    "place": "set a zone up in an existing SUMO network, with its demand: open closed/run.sumocfg",
    "sweep": "run what is missing of a study: results.parquet, one row a case",
    "report": "write figures, tables and report.html of a run's or a sweep's folder",
    "ground": "label the ground points of a cloud by SMRF: 1 = ground",
    "register": "find the 4 x 4 transform that takes one cloud to another",
    "schema": "print the JSON Schema of scenario or study files, for editors",
    "warm": "compile all kernels once (set-up does it)",
}


class Stopped(KeyboardInterrupt):
    """A signal that ends the command, so that what is half-written is deleted as at Ctrl-C."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


class OneLineParser(argparse.ArgumentParser):
    """A parser that tells a mistake in one line, as all bad input is told."""

    def error(self, message: str) -> NoReturn:
        """Exit with 2."""
        if wrong := re.search(r"argument COMMAND: invalid choice: '([^']*)'", message):
            known = ", ".join(COMMANDS)
            message = f"{wrong[1]}: no such command{did_you_mean(wrong[1], COMMANDS, cutoff=0.6)}; there are {known}"
        self.exit(2, f"wzsumo: {one_line(message, limit=1000)}; see {self.prog} --help\n")


def main(argv: Sequence[str] | None = None) -> NoReturn:
    """Run one command and exit."""
    words = list(sys.argv[1:] if argv is None else argv)
    if argv is None:  # a program of its own
        os.environ.pop("MPLBACKEND", None)  # figures go to files; one that is not installed would end every command
    open_standard_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal may know ASCII alone, and names of files may be no UTF-8
    try:
        with _ended_by_signals():
            try:
                _run(words)
            finally:
                with printing():
                    sys.stdout.flush()  # here, and not as Python ends, where a closed pipe could no longer be told
    except InputError as error:
        with suppress(OSError):  # stderr may lie on a full disk
            for mistake in error.args:
                print(f"wzsumo: {one_line(str(mistake))}", file=sys.stderr)
        sys.exit(2)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is still to be flushed at the end
        sys.exit(128 + signal.SIGPIPE)
    except KeyboardInterrupt as stop:
        number = stop.number if isinstance(stop, Stopped) else signal.SIGINT
        print("wzsumo: interrupted; what was finished is kept, nothing is half-written", file=sys.stderr)
        sys.exit(128 + number)
    sys.exit(0)


def _run(words: list[str]) -> None:
    """Run the command that the words name, and print its figures."""
    parser = _parser(words)
    if words and words[0] in COMMANDS:
        words = getattr(import_module(f"wzsumo.commands.{words[0]}"), "prepared", list)(words)
    with printing():
        args = parser.parse_args(words)
    for name, value in vars(args).items():
        setattr(args, name, [_path(each) for each in value] if isinstance(value, list) else _path(value))
    command = import_module(f"wzsumo.commands.{args.command}")
    with telling_of_compiling(args), keeping(_inputs(args)):
        figures = command.run(args)
    with printing():
        if args.json:
            print(json.dumps(figures))
        else:
            getattr(command, "tell", _tell)(figures, args)
            if not args.quiet and (step := getattr(command, "next_step", _nothing)(figures, args)):
                print(f"next: {step}")
    if reason := getattr(command, "failure", _nothing)(figures, args):
        print(f"wzsumo: {one_line(reason)}", file=sys.stderr)
        sys.exit(1)


def _path(value: Any) -> Any:
    """The value; where it is a path, one that no library takes for another. Raises InputError where its name cannot be one.

    The shell has put the home folder in the place of a `~` that means it; pandas would do so with any other.
    """
    if not isinstance(value, Path):
        return value
    check_name(value)
    return Path.cwd() / value if str(value).startswith("~") else value


def _inputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command is to read."""
    values = [value for name, value in vars(args).items() if name != "out"]
    return [path for value in values for path in (value if isinstance(value, list) else [value]) if isinstance(path, Path)]


def _nothing(_figures: dict[str, Any], _args: argparse.Namespace) -> str:
    return ""


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Raise Stopped in the block at the first signal that ends a program; later ones do not disturb the cleaning up."""

    def stop(number: int, _frame: FrameType | None) -> None:
        for each in handled:
            signal.signal(each, signal.SIG_IGN)
        raise Stopped(number)

    before = {each: signal.getsignal(each) for each in ENDING_SIGNALS}
    handled = [each for each, handler in before.items() if handler != signal.SIG_IGN]  # nohup has SIGHUP ignored
    for each in handled:
        signal.signal(each, stop)
    try:
        yield
    finally:
        for each in handled:
            signal.signal(each, before[each])


def _parser(words: Sequence[str]) -> OneLineParser:
    """The parser for these words. It imports only the commands among them, since some modules load slowly."""
    parser = OneLineParser(prog="wzsumo", description=ABOUT, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--version", action="version", version=f"wzsumo {__version__}")
    parser.add_argument(
        "--completion", choices=SHELLS, action=completion_option(whole_parser),
        help='print the script for a shell: eval "$(wzsumo --completion bash)" in ~/.bashrc',
    )  # fmt: skip
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, about in COMMANDS.items():
        sub = commands.add_parser(name, help=about, formatter_class=argparse.RawDescriptionHelpFormatter)
        sub.add_argument("--json", action="store_true", help="print the figures as one JSON object on stdout")
        sub.add_argument("--quiet", action="store_true", help="say nothing on the way: no progress, no advice; errors are told")
        if name in words:
            module = import_module(f"wzsumo.commands.{name}")
            sub.description = f"{about}\n\n{getattr(module, 'MORE', '')}"
            module.add_arguments(sub)
    return parser


def whole_parser() -> argparse.ArgumentParser:
    """The parser with the arguments of every command."""
    return _parser(list(COMMANDS))


def _tell(figures: dict[str, Any], _args: argparse.Namespace) -> None:
    for line in lines_of(figures):
        print(line)
