"""The command line. Exit codes: 0 done, 1 a fault of ours, 2 bad input."""

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from wzsumo import __version__
from wzsumo.errors import InputError

# One thread a library: the same scikit-learn fit took 19 s with default threads and 0.7 s with one.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

_ABOUT = """\
Can an automated vehicle learn from the traces of the cars ahead of it where it may drive through a work zone?

  wzsumo run scenarios/paper.toml --out results/paper     the whole case: SUMO traffic, maps, plans, drives, report.html
  wzsumo map traces.parquet --out out                     a ROS map from your own traces; no SUMO needed
  wzsumo plan out/map.yaml --start 10 0 0 --goal 500 0 0 --out path.csv
"""
_TRACES = """\
A trace file (.parquet or .csv) has one row a fix: vehicle_id, time_s, x_m, y_m (the vehicle's centre, metres of a local
frame), and may have heading_rad, speed_mps, length_m, width_m. Free cells have p_occupied below 0.196; where nobody drove
is unknown, not free.

Traces alone leave open which lanes the road has and where they lie exactly; --road says how it was before the zone, in the
frame of the traces. It names a scenario (its road and where its zone begins and ends count), or a file such as

  [road]                       # lanes from right to left, widths in feet
  lane_count = 2
  left_shoulder_ft = 10
  right_shoulder_ft = 10
  reference_points_m = [[0.0, 3.66], [1500.0, 3.66]]     # the middle of all lanes, in the direction of travel
  [announced]                  # first and last device, along the road
  start_ft = 1000
  end_ft = 3400
"""
_STUDIES = """\
A study file (see scenarios/studies) names base scenarios, methods, and factors: any keys of the scenario, as a grid. Cases that
share a simulation run it once. Stop it whenever you like; the same command goes on with what is missing.
"""
_POSES = "Poses are of the centre of the REAR AXLE: X Y in metres of the map's frame, DEG counter-clockwise from +x."
_METHODS = """paper_literal, paper, swept, lanes (from the crowd); slam_raw, slam_log_odds, slam_barrier (from one LiDAR mapping
drive); hd_map, hd_map_devices (the map of before). Default: those of the crowd; with a section [slam] in the scenario, all"""
_CLOUDS = """\
A cloud holds x, y, z in metres: an .npy array (n, 3), a .csv table (columns x, y, z, or three unnamed ones) or a .ply file.
Labels are an array (n,) of uint8 in the order of the points. A transform says in "status" what it is worth: converged,
degenerate (some directions are not determined by the clouds), not_converged, poor_overlap.
"""
SMRF_OPTIONS = {
    ("--cell-m",): "edge of a cell of the surface (default 1)",
    ("--slope",): "steepest ground, rise over run (default 0.15)",
    ("--window-m",): "radius of the widest opening: half the width of the largest building (default 18)",
    ("--elevation-threshold-m",): "how far a ground point may lie off the surface (default 0.5; 0.2 keeps cones)",
    ("--elevation-scalar", "--scalar"): "metres added to the threshold per unit of slope (default 1.25)",
}  # Pingel, Clarke & McBride 2013, one set for all terrain


def main(argv: Sequence[str] | None = None) -> NoReturn:
    """Run one command and exit."""
    args = _parser().parse_args(argv)
    try:
        figures = _run(args)
    except InputError as error:
        print(f"wzsumo: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("wzsumo: interrupted; what was finished is kept, nothing is half-written", file=sys.stderr)
        sys.exit(130)
    if args.json:
        print(json.dumps(figures))
    else:
        _tell(figures, args)
    sys.exit(0)


def _run(args: argparse.Namespace) -> dict[str, Any]:
    if args.command == "plan":
        from wzsumo.commands.plan import plan_on_map

        return plan_on_map(args.map, args.out, start=args.start, goal=args.goal, speed_mps=args.speed_mps)
    from wzsumo.commands import clouds as cloud_verbs
    from wzsumo.commands import scenario as verbs
    from wzsumo.commands import sweep as sweep_verbs
    from wzsumo.commands import warm

    carry_out: dict[str, Callable[[], dict[str, Any]]] = {
        "layout": lambda: verbs.lay_out_scenario(args.scenario, args.out),
        "capacity": lambda: verbs.capacity_of_scenario(args.scenario),
        "net": lambda: verbs.write_net(args.scenario, args.out),
        "run": lambda: _run_scenario_or_case(args),
        "map": lambda: verbs.map_traces(
            args.traces, args.out, method=args.method, seed=args.seed, resolution_m=args.resolution_m, road=args.road
        ),
        "sweep": lambda: sweep_verbs.sweep_study(
            args.study, args.out, workers=args.workers, scheduler=args.scheduler, dry_run=args.dry_run
        ),
        "report": lambda: verbs.report_again(args.folder),
        "ground": lambda: cloud_verbs.label_ground(args.cloud, args.out, parameters=_given(args, SMRF_OPTIONS)),
        "register": lambda: cloud_verbs.register_clouds(args.source, args.target, args.out),
        "warm": warm.warm_up,
    }
    return carry_out[args.command]()


def _run_scenario_or_case(args: argparse.Namespace) -> dict[str, Any]:
    from wzsumo.commands import scenario as verbs

    if args.case is None:
        return verbs.run_scenario(args.scenario, args.out, seed=args.seed, methods=args.method, in_window=args.gui)
    if args.seed is not None or args.method:
        raise InputError(f"--case {args.case}: the case has a seed and a method of its own; leave --seed and --method out")
    return verbs.run_case_again(args.scenario, args.out, case=args.case, in_window=args.gui)


def _parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog="wzsumo", description=_ABOUT, formatter_class=raw)
    parser.add_argument("--version", action="version", version=f"wzsumo {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def command(name: str, about: str, more: str = "") -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=about, description=f"{about}\n\n{more}", formatter_class=raw)
        sub.add_argument("--json", action="store_true", help="print the figures as one JSON object on stdout")
        return sub

    for name, about in (
        ("layout", "lay the zone out by the MUTCD: layout.geojson, devices.csv, layout.png"),
        ("net", "write the SUMO files: open zone.sumocfg in sumo-gui"),
        ("run", "run the whole case: result.json, maps, paths, drives, report.html"),
    ):
        sub = command(name, about)
        sub.add_argument("scenario", type=Path, metavar="SCENARIO.toml")
        sub.add_argument("--out", type=Path, required=True, metavar="DIR")
        if name == "run":
            sub.add_argument("--case", metavar="NAME", help="a case of a sweep, whose folder then stands for SCENARIO.toml")
            sub.add_argument("--seed", type=_seed, help="instead of the scenario's own")
            sub.add_argument("--method", nargs="+", action="extend", metavar="NAME", help=_METHODS)
            sub.add_argument("--gui", action="store_true", help="show each drive live in sumo-gui")
    sub = command("capacity", "what the zone can carry by the Highway Capacity Manual, 7th edition")
    sub.add_argument("scenario", type=Path, metavar="SCENARIO.toml")
    sub = command("map", "make a ROS map (map.pgm, map.yaml) from anybody's traces", _TRACES)
    sub.add_argument("traces", type=Path, metavar="TRACES.(parquet|csv)")
    sub.add_argument("--out", type=Path, required=True, metavar="DIR")
    sub.add_argument("--method", choices=["paper_literal", "paper", "swept", "lanes"], default="lanes")
    sub.add_argument("--road", type=Path, metavar="ROAD.toml", help="the road before the zone, to which the map is joined")
    sub.add_argument("--resolution-m", type=_positive, default=0.127, help="edge of a cell (default 0.127 m, 5 in)")
    sub.add_argument("--seed", type=_seed, default=1)
    sub = command("plan", "plan a path on any ROS map with Hybrid A*", _POSES)
    sub.add_argument("map", type=Path, metavar="MAP.yaml")
    sub.add_argument("--start", type=float, nargs=3, required=True, metavar=("X", "Y", "DEG"))
    sub.add_argument("--goal", type=float, nargs=3, required=True, metavar=("X", "Y", "DEG"))
    sub.add_argument("--out", type=Path, required=True, metavar="PATH.csv")
    sub.add_argument("--speed-mps", type=_speed, default=10.0, help="limits the curvature: v^2 k <= 2 m/s2 (default 10)")
    sub = command("sweep", "run what is missing of a study: results.parquet, one row a case", _STUDIES)
    sub.add_argument("study", type=Path, metavar="STUDY.toml")
    sub.add_argument("--out", type=Path, required=True, metavar="DIR")
    sub.add_argument("--workers", type=_count, metavar="N", help="processes (default: one a core)")
    sub.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster that runs already, such as tcp://10.0.0.1:8786")
    sub.add_argument("--dry-run", action="store_true", help="say how many cases and simulations, and about how long")
    sub = command("report", "write figures, tables and report.html of a run's or a sweep's folder")
    sub.add_argument("folder", type=Path, metavar="DIR")
    sub = command("ground", "label the ground points of a cloud by SMRF: 1 = ground", _CLOUDS)
    sub.add_argument("cloud", type=Path, metavar="IN.(npy|csv|ply)")
    sub.add_argument("--out", type=Path, required=True, metavar="OUT.npy")
    for names, about in SMRF_OPTIONS.items():
        sub.add_argument(*names, type=_number, metavar="NUMBER", help=about)
    sub = command("register", "find the 4 x 4 transform that takes one cloud to another", _CLOUDS)
    sub.add_argument("source", type=Path, metavar="SOURCE")
    sub.add_argument("target", type=Path, metavar="TARGET")
    sub.add_argument("--out", type=Path, required=True, metavar="T.txt")
    command("warm", "compile all kernels once (set-up does it)")
    return parser


def _given(args: argparse.Namespace, options: Iterable[tuple[str, ...]]) -> dict[str, float]:
    """The options that were given, by their name in a spec."""
    keys = [names[0].removeprefix("--").replace("-", "_") for names in options]
    return {key: getattr(args, key) for key in keys if getattr(args, key) is not None}


def _seed(text: str) -> int:
    if not text.isdigit():
        raise argparse.ArgumentTypeError(f"{text!r} must be a whole number of 0 or more")
    return int(text)


def _count(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} must be a whole number of 1 or more")
    return int(text)


def _positive(text: str) -> float:
    value = _number(text)
    if not 0 < value <= 10:
        raise argparse.ArgumentTypeError(f"{text!r} must be above 0 and at most 10")
    return value


def _speed(text: str) -> float:
    value = _number(text)
    if not 0 <= value <= 60:
        raise argparse.ArgumentTypeError(f"{text!r} must be 0 to 60 m/s")
    return value


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def _tell(figures: dict[str, Any], args: argparse.Namespace) -> None:
    if args.command != "run":
        for key, value in figures.items():
            print(f"{key}: {round(value, 3) if isinstance(value, float) else value}")
        return
    print(f"{'method':<14} {'outcome':<20} {'precision':>9} {'recall':>7} {'IoU':>6} {'devices m':>10} {'edge m':>7}")
    for name, row in figures["methods"].items():
        numbers = [row[key] for key in ("precision", "recall", "iou", "min_clearance_devices_m", "min_clearance_road_edge_m")]
        cells = ["-" if value is None else f"{value:.3f}" for value in numbers]
        widths = (9, 7, 6, 10, 7)
        print(f"{name:<14} {row['outcome']:<20} " + " ".join(f"{c:>{w}}" for c, w in zip(cells, widths, strict=True)))
    print(f"report: {args.out / 'report.html'}")
