"""Queue discharge of simulated work zones beside the Highway Capacity Manual's, class by class of zones.

    python analysis/traffic/calibrate_traffic.py measure --first 301 --seeds 10
    python analysis/traffic/calibrate_traffic.py measure 2_to_1_urban --trucks 0 --first 101 --drivers tau_s=1.6 accel_mps2=1.2
    python analysis/traffic/calibrate_traffic.py measure --first 921 --seeds 1 --constant 1.25
    python analysis/traffic/calibrate_traffic.py table

`measure` adds a row a run to the CSV file --out, seed after seed over all classes; a run that the file has is not repeated. It
takes the drivers of `drivers = "hcm"`, with the keys of --drivers changed. `table` prints the table of
docs/results/traffic_calibration.md. `discharge_runs.py` says what a run is.
"""

import argparse
import csv
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from discharge_runs import APPROACH_FT, DEMAND_RAMP, ZONE_CLASSES, flows_of, measure
from scipy.stats import t as student

from wzsumo.capacity import QUEUE_DISCHARGE_DROP
from wzsumo.simulation.drivers import DRIVER_PRESETS, DriverSpec

TRUCK_SHARES = (0.0, 0.1)
DRIVER_KEYS = (
    "tau_s", "accel_mps2", "truck_tau_s", "truck_accel_mps2", "min_gap_m", "sigma", "lc_assertive", "lc_lookahead_left",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/calibration/discharge.csv"), help="the CSV file of runs")
    commands = parser.add_subparsers(dest="command", required=True)
    measuring = commands.add_parser("measure", help="run what the CSV file does not have")
    measuring.add_argument("classes", nargs="*", default=ZONE_CLASSES, help=", ".join(ZONE_CLASSES))
    measuring.add_argument("--trucks", type=float, nargs="+", default=list(TRUCK_SHARES), help="shares of trucks")
    measuring.add_argument("--first", type=int, default=301, help="first seed")
    measuring.add_argument("--seeds", type=int, default=10, help="number of seeds")
    measuring.add_argument("--drivers", nargs="+", default=[], metavar="KEY=VALUE", help="keys of the drivers that are changed")
    measuring.add_argument("--approach-ft", type=float, help="length of road ahead of the first device")
    measuring.add_argument(
        "--constant", type=float, help="a constant demand, as a share of the HCM's capacity: queue discharge alone, sooner"
    )
    commands.add_parser("table", help="print the table of the CSV file")
    args = parser.parse_args()
    if args.command == "table":
        print(discharge_table(pd.read_csv(args.out)))
        return
    changes = dict(item.split("=", 1) for item in args.drivers)
    for seed in range(args.first, args.first + args.seeds):
        for zone_class in args.classes:
            drivers = DriverSpec.model_validate(DRIVER_PRESETS[f"hcm_{zone_class}"].model_dump() | changes)
            approach_ft = args.approach_ft or APPROACH_FT[zone_class[:6]]
            for trucks in args.trucks:
                case = {"zone_class": zone_class, "trucks": trucks, "seed": seed, "approach_ft": approach_ft}
                measure_once(case, drivers=drivers, constant=args.constant, out=args.out)


def measure_once(case: dict[str, Any], *, drivers: DriverSpec, constant: float | None, out: Path) -> None:
    """Run one case and append its row to `out`, unless the file has it."""
    known = case | {"constant": constant} | {key: getattr(drivers, key) for key in DRIVER_KEYS}
    if is_done(known, out):
        return
    row = known | measure(**case, drivers=drivers, ramp=((0.0, constant),) if constant else DEMAND_RAMP)
    append_row(row, out)
    zone = {"zone_class": case["zone_class"], "trucks": case["trucks"]}
    flows = flows_of(**zone, counts=row["counts"], speeds_mps=row["speeds_mps"])
    print(zone, case["seed"], {key: round(value, 3) for key, value in flows.items()}, row["cpu_s"], file=sys.stderr)


def is_done(case: dict[str, Any], path: Path) -> bool:
    """Whether the file has a row of this case."""
    if not path.exists():
        return False
    with path.open(newline="") as file:
        return any(
            all(row[key] == ("" if value is None else str(value)) for key, value in case.items())
            for row in csv.DictReader(file)
        )


def append_row(row: dict[str, Any], path: Path) -> None:
    """Append a row, with a header where the file is new."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(row))
        if new:
            writer.writeheader()
        writer.writerow(row)


def discharge_table(rows: pd.DataFrame) -> str:
    """Markdown, a line a zone class and truck share: target, mean [95 %, Student], per cent off, capacity, drop."""
    n_locked = int(rows["locked_min"].notna().sum())
    rows = rows[rows["locked_min"].isna()].sort_values(["zone_class", "trucks", "seed"], key=_by_class, ignore_index=True)
    columns = ["zone_class", "trucks", "counts", "speeds_mps"]
    flows = pd.DataFrame([flows_of(zone, trucks=p, counts=n, speeds_mps=v) for zone, p, n, v in rows[columns].to_numpy()])
    lines = [
        "| zone | trucks | n | HCM, pc/h/lane | simulated, mean [95 %] | off | capacity (n) | drop | emergency stops |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    table = pd.concat([rows[["zone_class", "trucks", "emergency_stops"]], flows], axis="columns")
    for zone_class, trucks in table[["zone_class", "trucks"]].drop_duplicates().itertuples(index=False):
        part = table[(table["zone_class"] == zone_class) & (table["trucks"] == trucks)]
        both = part.dropna(subset=["discharge", "capacity"])
        capacity = both["capacity"].mean()
        drop = f"{1 - both['discharge'].mean() / capacity:.1%}" if len(both) else "-"
        lines.append(
            f"| {zone_class.replace('_', ' ')} | {trucks:.0%} | {part['discharge'].count()} | {part['target'].iloc[0]:.0f} | "
            f"{_mean_with_interval(part['discharge'].dropna())} | {part['off'].mean():+.1%} | "
            f"{f'{capacity:.0f} ({len(both)})' if len(both) else '-'} | {drop} | {part['emergency_stops'].sum()} |"
        )
    off = table["off"].dropna()
    return "\n".join([
        *lines, "", f"n: runs of one seed each that broke down. HCM: drop {QUEUE_DISCHARGE_DROP:.1%}.",
        f"Runs that locked, left out: {n_locked} of {n_locked + len(rows)}.",
        f"All {len(off)} runs: {off.mean():+.1%} off, standard deviation {off.std():.1%}.",
    ])  # fmt: skip


def _by_class(column: pd.Series) -> pd.Series:
    return column.map(ZONE_CLASSES.index) if column.name == "zone_class" else column


def _mean_with_interval(values: pd.Series) -> str:
    """The mean and its 95 % interval of three values or more, else the values themselves."""
    if len(values) < 3:
        return " and ".join(f"{value:.0f}" for value in values)
    half = student.ppf(0.975, len(values) - 1) * values.std() / np.sqrt(len(values))
    return f"{values.mean():.0f} [{values.mean() - half:.0f}, {values.mean() + half:.0f}]"


if __name__ == "__main__":
    main()
