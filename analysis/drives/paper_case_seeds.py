"""The paper's case over several seeds: map quality, clearance and outcome with 95 % intervals over seeds.

    python analysis/drives/paper_case_seeds.py --first 11 --seeds 10 --out results/paper_seeds

Writes into --out a result folder a seed (seed_N) and seeds.csv, one row a seed and method; prints means and intervals.
docs/results/paper_case.md has them.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import bootstrap

from wzsumo.api import run_case
from wzsumo.frames import FloatArray
from wzsumo.scenario.scenario import load_scenario

SCENARIO = Path(__file__).parents[2] / "scenarios" / "paper.toml"
FIGURES = ("precision", "recall", "iou", "min_clearance_devices_m", "min_clearance_road_edge_m", "closed_area_share", "plan_ms")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=11, help="first seed; 1-10 are development seeds")
    parser.add_argument("--seeds", type=int, default=10, help="number of seeds")
    parser.add_argument("--methods", nargs="+", default=["swept", "lanes"])
    parser.add_argument("--out", type=Path, default=Path("results/paper_seeds"))
    args = parser.parse_args()
    rows = []
    for seed in range(args.first, args.first + args.seeds):
        result = run_case(load_scenario(SCENARIO, seed=seed), args.out / f"seed_{seed}", methods=args.methods)
        for method, figures in result["methods"].items():
            row = {name: figures[name] for name in (*FIGURES, "outcome", "reason", "clean", "faults")}
            rows.append({"seed": seed, "method": method, "in_closed_area": result["fleet"]["n_in_closed_area"]} | row)
            print(rows[-1], file=sys.stderr)
    table = pd.DataFrame(rows)
    table.to_csv(args.out / "seeds.csv", index=False)
    for method in sorted(table["method"].unique()):
        part = table[table["method"] == method]
        print(f"\n{method}, n = {len(part)} seeds: {part['outcome'].value_counts().to_dict()}")
        for name in FIGURES:
            values = part[name].dropna().to_numpy(dtype=float)
            spread = f"min {values.min():.3f}  max {values.max():.3f}"
            print(f"  {name:<28} mean {values.mean():.3f}  95 % {_interval(values)}  {spread}")


def _interval(values: FloatArray) -> str:
    """95 % bootstrap interval of the mean."""
    if len(values) < 2 or np.ptp(values) == 0:
        return "-"
    low, high = bootstrap((values,), np.mean, rng=np.random.default_rng(0)).confidence_interval
    return f"[{low:.3f}, {high:.3f}]"


if __name__ == "__main__":
    main()
