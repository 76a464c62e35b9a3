"""What the cuts alone do: the traffic of `open` against that of `original`, paired over seeds.

    python analysis/placement/open_against_original.py PLACED --seeds 1 2 3 4 5 --out open_against_original.csv

PLACED is a folder that `wzsumo place` wrote. One row a seed and configuration, with what SUMO itself counted; printed are the
paired differences of the mean duration with their 95 % interval (Student's t over seeds), and the greatest difference of the
length that a vehicle drove.
"""

import argparse
import csv
import subprocess
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from scipy.stats import t as student

from wzsumo.simulation.connection import sumo_binary

COLUMNS = (
    "name", "configuration", "seed", "vehicles", "mean_duration_s", "mean_time_loss_s", "mean_depart_delay_s", "teleports",
    "emergency_stops", "collisions",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("placed", type=Path)
    parser.add_argument("--name", required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--options", default="", help="more options of SUMO's, in one word")
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    rows, lengths = [], []
    for seed in args.seeds:
        driven = {}
        for configuration in ("original", "open"):
            row, driven[configuration] = _run(args.placed / configuration, seed, args.options.split())
            rows.append({"name": args.name, "configuration": configuration, "seed": seed} | row)
        both = driven["original"].keys() & driven["open"].keys()
        lengths.append(max(abs(driven["original"][id_] - driven["open"][id_]) for id_ in both))
    new = not args.out.exists()
    with args.out.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if new:
            writer.writeheader()
        writer.writerows(rows)
    original, opened = (
        np.array([float(r["mean_duration_s"]) for r in rows if r["configuration"] == c]) for c in ("original", "open")
    )
    share = 100 * (opened - original) / original
    half = student.ppf(0.975, len(share) - 1) * share.std(ddof=1) / np.sqrt(len(share))
    told = f"paired difference {share.mean():+.2f} % +- {half:.2f} (n={len(share)})"
    print(f"{args.name}: mean duration {original.mean():.2f} s, {told}")
    for key in ("teleports", "emergency_stops"):
        print(f"{key}: {[sum(int(r[key]) for r in rows if r['configuration'] == c) for c in ('original', 'open')]}")
    print(f"route lengths differ by at most {max(lengths):.3f} m")


def _run(folder: Path, seed: int, options: list[str]) -> tuple[dict[str, str], dict[str, float]]:
    statistics, trips = folder / "statistics.xml", folder / "trips_of_all.xml"
    command = [
        str(sumo_binary("sumo")), "-c", str(folder / "run.sumocfg"), "--seed", str(seed), "--statistic-output", str(statistics),
        "--tripinfo-output", str(trips), "--no-step-log", "--no-warnings", "--xml-validation", "never",
        "--duration-log.statistics", *options,
    ]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True)
    root = ET.parse(statistics).getroot()
    found = {tag: element.attrib for element in root for tag in [element.tag]}
    driven = {trip.get("id", ""): float(trip.get("routeLength", 0)) for trip in ET.parse(trips).iter("tripinfo")}
    mean = found["vehicleTripStatistics"]
    return {
        "vehicles": mean["count"], "mean_duration_s": mean["duration"], "mean_time_loss_s": mean["timeLoss"],
        "mean_depart_delay_s": mean["departDelay"], "teleports": found["teleports"]["total"],
        "emergency_stops": found["safety"]["emergencyStops"], "collisions": found["safety"]["collisions"],
    }, driven  # fmt: skip


if __name__ == "__main__":
    main()
