"""What a zone changes in a network, with intervals over seeds, from a sweep of scenarios/studies/network.toml.

    wzsumo sweep scenarios/studies/network.toml --out results/network
    python analysis/placement/study_intervals.py results/network --out docs/results/network_study.csv

One row a measure: its mean over pairs of simulations and the 95 % interval of that mean (see `sweep.summary.summarise`).
"""

import argparse
from pathlib import Path

import pandas as pd

from wzsumo.sweep.results import column_of, read_results
from wzsumo.sweep.summary import summarise


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    table = read_results(args.folder)
    rows = []
    for name in [str(column) for column in table.columns]:
        if not (name.startswith("network_") and name.endswith("_change")):
            continue
        column = column_of(name)
        found = summarise(table, name, by=[]).iloc[0].to_dict()
        rows.append({"measure": name, "meaning": column.meaning, "unit": column.unit} | found)
    out = pd.DataFrame(rows).astype({"n": int})
    out.to_csv(args.out, index=False, float_format="%.5f")
    print(out.to_string(index=False))


if __name__ == "__main__":
    main()
