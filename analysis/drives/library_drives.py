"""Is the drive safe in every zone of the library? Outcome, clearance and conflicts over scenarios, seeds, methods and speeds.

    python analysis/drives/library_drives.py --first 61 --seeds 5 --traces 10 --speeds 10 zone --out results/library_drives

The speed "zone" is the posted one. Appends rows to rows.csv in --out as they come, first all scenarios at one seed: a study
that was stopped has a whole table, and goes on where it was. Simulated fleets are kept in OUT/fleets. `--table` prints tables
by method and speed; docs/results/library_drives.md sums them up, and library_drives.csv there has the rows.
"""

import argparse
import sys
import tomllib
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from wzsumo.errors import InputError
from wzsumo.files.output import write_whole
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.sweep.evaluation.study_case import StudyCase
from wzsumo.sweep.evaluation.tasks import evaluate_cases, simulate
from wzsumo.units import mps_from_mph

LIBRARY = Path(__file__).parents[2] / "scenarios"
PAPER_SPEED_MPS = 10.0
KEPT_FIGURES = (
    "outcome", "reason", "clean", "faults", "plan_status", "plan_speed_mps", "precision", "recall", "iou", "plan_ms",
    "n_expansions",
    "path_length_m", "waited_s", "drive_time_s", "max_cross_track_m", "case_cpu_s",
)  # fmt: skip
# Outcomes that a column of the printed tables counts.
COUNTED_OUTCOMES = {
    "reached": ("REACHED_GOAL",),
    "struck a device": ("STRUCK_DEVICE",),
    "in closed area": ("ENTERED_CLOSED_AREA",),
    "collided": ("COLLIDED",),
    "other": ("LEFT_PAVEMENT", "NO_PATH", "TIMED_OUT", "REFUSED"),
}
# Column of rows.csv that a column of the printed tables shows, and which drive of several: the worst or the median.
SHOWN_FIGURES = {
    "clean": ("clean", "sum"),
    "clearance m": ("driven_min_clearance_devices_m", "min"),
    "over a line": ("driven_over_line_share", "max"),
    "behind m/s2": ("driven_braking_behind_mps2", "max"),
    "TTC s": ("driven_min_ttc_s", "min"),
    "DRAC m/s2": ("driven_max_drac_mps2", "max"),
    "lateral m/s2": ("driven_max_lateral_acceleration_mps2", "max"),
    "braking m/s2": ("driven_max_braking_mps2", "max"),
    "jerk m/s3": ("driven_max_jerk_mps3", "max"),
    "off path m": ("max_cross_track_m", "max"),
    "delay behind s": ("driven_delay_behind_per_vehicle_s", "median"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", nargs="+", default=zones_that_stay())
    parser.add_argument("--first", type=int, default=21, help="first seed")
    parser.add_argument("--seeds", type=int, default=1, help="number of seeds")
    parser.add_argument("--methods", nargs="+", default=["lanes", "swept"])
    parser.add_argument("--speeds", nargs="+", choices=["10", "zone"], default=["10"])
    parser.add_argument("--traces", type=int, help="number of traces used, instead of what each scenario says")
    parser.add_argument("--out", type=Path, default=Path("results/library_drives"))
    parser.add_argument(
        "--table", action="store_true", help="print the tables of the rows that there are, without further drives"
    )
    args = parser.parse_args()
    if not args.table:
        for rows in missing_drives(args):
            append_rows(args.out / "rows.csv", rows)
            print(rows[["scenario", "seed", "speed", "method", "outcome"]].to_string(header=False), file=sys.stderr)
    print_tables(pd.read_csv(args.out / "rows.csv", dtype={"speed": str}))


def zones_that_stay() -> list[str]:
    """Names of the library's scenarios whose zone does not change: one map shows such a zone."""
    return sorted(path.stem for path in LIBRARY.glob("*.toml") if "live" not in tomllib.loads(path.read_text(encoding="utf-8")))


def append_rows(path: Path, rows: pd.DataFrame) -> None:
    """Add rows to a table; those of drives that did not begin have fewer columns than the others."""
    there = [pd.read_csv(path, dtype={"speed": str})] if path.exists() else []
    write_whole(path, pd.concat([*there, rows], ignore_index=True).to_csv(index=False).encode())


def missing_drives(args: argparse.Namespace) -> Iterator[pd.DataFrame]:
    """The rows that rows.csv does not have, by seed, scenario and method: all speeds of these share fleet and map."""
    args.out.mkdir(parents=True, exist_ok=True)
    rows_file, done = args.out / "rows.csv", set()
    if rows_file.exists():
        table = pd.read_csv(rows_file, dtype={"speed": str})
        done = set(table[["method", "seed", "scenario", "speed"]].itertuples(index=False, name=None))
    seeds = range(args.first, args.first + args.seeds)
    for seed, name, method in product(seeds, args.scenarios, args.methods):
        speeds = [speed for speed in args.speeds if (method, seed, name, speed) not in done]
        if not speeds:
            continue
        scenario = load_scenario(LIBRARY / f"{name}.toml", seed=seed)
        cases = [
            StudyCase(scenario=at_speed(scenario, speed, traces=args.traces), method=method, drive=True) for speed in speeds
        ]
        yield pd.DataFrame([
            {"scenario": name, "seed": seed, "speed": speed, "method": method} | row
            for speed, row in zip(speeds, drives(cases, args.out / "fleets"), strict=True)
        ])  # fmt: skip


def at_speed(scenario: Scenario, speed: str, *, traces: int | None) -> Scenario:
    """The scenario with the ego at a speed ("10" or "zone") and its map made of `traces` traces, None: as it says."""
    crowd = scenario.crowd if traces is None else scenario.crowd.model_copy(update={"used": traces})
    wanted = PAPER_SPEED_MPS if speed == "10" else mps_from_mph(scenario.work_zone.posted_speed_mph)
    # The paper's control laws know one speed, 10 m/s.
    laws = {} if speed == "10" else {"lateral": "regulated", "longitudinal": "tuned"}
    return scenario.model_copy(update={
        "crowd": crowd,
        "control": scenario.control.model_copy(update={"target_speed_mps": wanted} | laws),
        "planner": scenario.planner.model_copy(update={"planned_speed_mps": wanted}),
    })  # fmt: skip


def drives(cases: list[StudyCase], fleets: Path) -> list[dict[str, Any]]:
    """The kept figures of each case; the simulated fleet, which methods and speeds share, is kept in the folder `fleets`."""
    fleet = fleets / f"{cases[0].simulation}.parquet"
    if not fleet.exists():
        write_whole(fleet, simulate(cases[0].scenario))
    try:
        rows = evaluate_cases(fleet.read_bytes(), cases)
    except InputError as error:
        rows = [{"status": "REFUSED", "reason": str(error)} for _ in cases]
    return [
        {name: row.get(name) for name in KEPT_FIGURES}
        | {name: value for name, value in row.items() if name.startswith(("planned_", "driven_"))}
        | ({} if row["status"] == "DONE" else {"outcome": row["status"]})
        for row in rows
    ]


def print_tables(table: pd.DataFrame) -> None:
    """Print Markdown: a table of each method and speed, a line a scenario, then the drives that are not clean."""
    for (method, speed), part in table.groupby(["method", "speed"]):
        print(f"\n**{method}, {'10 m/s' if speed == '10' else 'posted speed'}**\n")
        columns = [*COUNTED_OUTCOMES, *SHOWN_FIGURES]
        print(f"| scenario | n | {' | '.join(columns)} |\n|---|{'---:|' * (1 + len(columns))}")
        for name, drives in [*part.groupby("scenario"), ("all", part)]:
            counts = [str(drives["outcome"].isin(outcomes).sum()) for outcomes in COUNTED_OUTCOMES.values()]
            shown = [f"{drives[column].agg(which):.2f}" for column, which in SHOWN_FIGURES.values()]
            print(f"| {name} | {' | '.join([str(len(drives)), *counts, *shown])} |")
    for row in table[~table["clean"].astype(bool)].itertuples():
        print(f"\n- {row.scenario}, {row.method}, {row.speed}, seed {row.seed}: {row.faults}")


if __name__ == "__main__":
    main()
