"""The command `run`: one case of a scenario or of a study."""

import argparse
from pathlib import Path
from typing import Any

from wzsumo.api import run_case
from wzsumo.case.methods import METHODS, chosen_methods
from wzsumo.commands.terminal.arguments import add_out_folder, add_scenario, seed
from wzsumo.commands.terminal.progress import progress_of, say
from wzsumo.errors import InputError
from wzsumo.report.tables import outcome_code
from wzsumo.scenario.outlook import deciding_values, foreseen_lacks
from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.connection import refuse_without_display
from wzsumo.sweep.store import MANIFEST, read_study
from wzsumo.sweep.study_file import find_case


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    add_scenario(parser)
    add_out_folder(parser)
    parser.add_argument("--case", metavar="NAME", help="a case of a sweep, whose folder then stands for SCENARIO.toml")
    parser.add_argument("--seed", type=seed, help="instead of the scenario's own")
    parser.add_argument("--method", nargs="+", action="extend", metavar="NAME", help="map methods, by the names below")
    parser.add_argument("--gui", action="store_true", help="show each drive live in sumo-gui")
    methods = "\n".join(f"  {name:<16} {method.title}" for name, method in METHODS.items())
    default = "Without --method those of the crowd are run; all of them where the scenario has a section [slam]."
    parser.epilog = f"map methods:\n{methods}\n\n{default}"


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run a case into a folder, with its maps, paths, figures and report; its result."""
    _refuse_results(args.scenario, case=args.case)
    if args.case is None:
        scenario, methods = load_scenario(args.scenario, seed=args.seed), args.method
    else:
        if args.seed is not None or args.method:
            raise InputError(f"--case {args.case}: the case has a seed and a method of its own; leave --seed and --method out")
        found = find_case(read_study(args.scenario), args.case)
        scenario, methods = found.scenario, [found.method]
    if args.gui:
        refuse_without_display()
    chosen_methods(methods, scenario)  # refuses unknown names
    for line in (*deciding_values(scenario), *foreseen_lacks(scenario)):
        say(args, line)
    return run_case(scenario, args.out, methods=methods, progress=progress_of(args), in_window=args.gui)


def _refuse_results(path: Path, *, case: str | None) -> None:
    """Raise InputError with the right command where a folder of results is given for a scenario."""
    if case is None and (path / MANIFEST).is_file():
        raise InputError(
            f"{path}: holds the results of a study; add --case NAME to run one of its cases (results.parquet lists them), or "
            f"give `wzsumo report {path}`"
        )
    if case is None and (path / "result.json").is_file():
        raise InputError(f"{path}: holds the result of a run; give {path / 'scenario.toml'}, or `wzsumo report {path}`")


def next_step(_figures: dict[str, Any], args: argparse.Namespace) -> str:
    """What to look at."""
    return f"open {args.out / 'report.html'} in a browser"


def tell(figures: dict[str, Any], args: argparse.Namespace) -> None:
    """Print a line a method, and how much of the demand entered where not all did."""
    print(f"{'method':<14} {'outcome':<20} {'precision':>9} {'recall':>7} {'IoU':>6} {'devices m':>10} {'edge m':>7}")
    for name, row in figures["methods"].items():
        numbers = [row[key] for key in ("precision", "recall", "iou", "min_clearance_devices_m", "min_clearance_road_edge_m")]
        cells = ["-" if value is None else f"{value:.3f}" for value in numbers]
        widths = (9, 7, 6, 10, 7)
        told = " ".join(f"{c:>{w}}" for c, w in zip(cells, widths, strict=True))
        print(f"{name:<14} {outcome_code(row):<20} {told}")
    traffic = figures["traffic"]
    if traffic.get("n_waiting"):
        asked, waiting = traffic["n_vehicles"], traffic["n_waiting"]
        print(f"traffic: {asked} vehicles were to enter, {asked - waiting} did, {waiting} still wait at the end of the run")
    for warning in figures["warnings"]:
        print(f"warning: {warning}")
    print(f"report: {args.out / 'report.html'}")
