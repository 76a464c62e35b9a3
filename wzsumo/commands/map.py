"""The command `map`: a map from anybody's traces, what was learned of them and what was left out."""

import argparse
import sys
from pathlib import Path
from typing import Any

import pandas as pd

from wzsumo.case.map_method import Source
from wzsumo.case.methods import DEFAULT_METHOD, methods_from
from wzsumo.case.traces_map import crowd_method, map_of_traces, read_road
from wzsumo.commands.arguments import add_out_folder, cell_edge_m, seed
from wzsumo.commands.progress import progress_bar
from wzsumo.crowd_mapping.cleaning.usable_traces import usable_traces
from wzsumo.files.output import staged_folder
from wzsumo.files.ros_map import write_map
from wzsumo.files.traces import read_fixes

MORE = """\
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
MAX_DROPS_PRINTED = 8  # on stderr; --json lists all


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("traces", type=Path, metavar="TRACES.(parquet|csv)")
    add_out_folder(parser)
    parser.add_argument("--method", choices=list(methods_from(Source.CROWD)), default=DEFAULT_METHOD)
    parser.add_argument("--road", type=Path, metavar="ROAD.toml", help="the road before the zone, to which the map is joined")
    parser.add_argument("--resolution-m", type=cell_edge_m, default=0.127, help="edge of a cell (default 0.127 m, 5 in)")
    parser.add_argument("--seed", type=seed, default=1)


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write map.pgm and map.yaml of the traces in a file; what they are made of and what was left out.

    Raises InputError where the file makes no map of one zone, and where the traces are not on the road.
    """
    method, source = crowd_method(args.method, road=args.road), str(args.traces)
    table = read_fixes(args.traces)
    usable = usable_traces(table, source=source)
    n_fixes, traces = len(table), usable.traces
    del table  # it may hold millions of fixes
    _print_dropped(usable.dropped)
    before = read_road(args.road, traces, source=source)
    grid, learned = map_of_traces(
        traces, method, source=source, seed=args.seed, resolution_m=args.resolution_m, before=before, progress=progress_bar
    )
    with staged_folder(args.out) as stage:
        write_map(grid, stage)
    return {
        "map": str(args.out / "map.yaml"),
        "method": method.name,
        "n_traces": int(traces["vehicle_id"].nunique()),
        "n_fixes": n_fixes,
        "n_fixes_used": len(traces),
        "dropped": usable.dropped.astype({"n_fixes": int}).to_dict("records"),
        "free_m2": float(grid.free.sum() * args.resolution_m**2),
        **learned,
    }


def _print_dropped(dropped: pd.DataFrame) -> None:
    for vehicle_id, n_fixes, reason in dropped.head(MAX_DROPS_PRINTED).itertuples(index=False):
        sys.stderr.write(f"left out: {vehicle_id}, {n_fixes} fix(es): {reason}\n")
    if len(dropped) > MAX_DROPS_PRINTED:
        sys.stderr.write(f"left out: {len(dropped) - MAX_DROPS_PRINTED} more; --json lists them all\n")
