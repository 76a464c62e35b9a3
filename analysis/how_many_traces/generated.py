"""How good crowd maps are of zones and traces that share nothing with SUMO: quality over number of traces and GNSS error.

    python analysis/how_many_traces/generated.py --out results/how_many_generated [--first 81] [--seeds 10] [--zones NAME ...]

Maps are made of the traces alone. Writes into --out: rows.csv, one row a map, as they come (a study that was stopped goes on
where it was); table.csv, medians over all zones with 95 % intervals; zones.csv, the medians of each zone. docs/results/ has the
latter two as how_many_generated.csv and how_many_generated_zones.csv.
"""

import argparse
import itertools
import sys
from pathlib import Path

import pandas as pd
from generator import GENERATED, generated_traces
from scores import truth_of_generated
from study import AIMED_CASES, table_of

from wzsumo.crowd_mapping.lanes.lane_mapping import map_lanes

OTHER_CASES = ((3, 0.0), (5, 1.0), (10, 1.0), (10, 2.0), (30, 2.0))
INTERVAL_S = 1.0
KEYS = ["zone", "seed", "n_traces", "error_m"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/how_many_generated"))
    parser.add_argument("--first", type=int, default=81, help="first seed; 1-80 are development seeds")
    parser.add_argument("--seeds", type=int, default=10, help="number of seeds")
    parser.add_argument("--zones", nargs="+", default=list(GENERATED), choices=list(GENERATED))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    path = args.out / "rows.csv"
    known = {tuple(row) for row in pd.read_csv(path)[KEYS].itertuples(index=False)} if path.exists() else set()
    seeds = range(args.first, args.first + args.seeds)
    for cases, seed, name in itertools.product((AIMED_CASES, OTHER_CASES), seeds, args.zones):
        truth = truth_of_generated(GENERATED[name])
        for n, error_m in cases:
            if (name, seed, n, error_m) not in known:
                traces = generated_traces(GENERATED[name], n, error_m=error_m, interval_s=INTERVAL_S, seed=seed)
                figures = truth.row(map_lanes(traces).lanes)
                row = (
                    dict(zip(KEYS, (name, seed, n, error_m), strict=True))
                    | {"interval_s": INTERVAL_S, "map": "alone"}
                    | figures
                )
                pd.DataFrame([row]).to_csv(path, mode="a", header=not path.exists(), index=False)
        print(f"{name} {seed}", file=sys.stderr)
    rows = pd.read_csv(path)
    table_of(rows).to_csv(args.out / "table.csv", index=False)
    of_zone = rows.groupby(["zone", "n_traces", "error_m"])[["precision", "recall", "iou"]].median()
    of_zone.round(3).to_csv(args.out / "zones.csv")


if __name__ == "__main__":
    main()
