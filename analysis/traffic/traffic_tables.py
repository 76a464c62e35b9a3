"""The tables of docs/results/traffic_calibration.md and docs/results/library_traffic.md from their CSV files."""

from pathlib import Path

import calibrate_traffic
import discharge_runs
import library_traffic
import pandas as pd

RESULTS = Path(__file__).parents[2] / "docs" / "results"


def discharge() -> str:
    """Queue discharge, capacity and drop beside the HCM's, a row a class of zones and share of trucks."""
    return calibrate_traffic.discharge_table(pd.read_csv(RESULTS / "traffic_calibration.csv"))


def discharge_summary() -> str:
    """How far off the HCM's discharge the runs are, and how many locked, in a sentence."""
    rows = pd.read_csv(RESULTS / "traffic_calibration.csv")
    locked = rows["locked_min"].notna()
    columns = ["zone_class", "trucks", "counts", "speeds_mps"]
    flows = [
        discharge_runs.flows_of(zone, trucks=trucks, counts=counts, speeds_mps=speeds)
        for zone, trucks, counts, speeds in rows.loc[~locked, columns].to_numpy()
    ]
    off = pd.Series([100 * flow["off"] for flow in flows]).dropna()
    return (
        f"discharge {abs(off.mean()):.1f} % {'less' if off.mean() < 0 else 'more'} than it gives,\n  on the average of "
        f"{len(off)} runs (single runs {off.min():+.0f} to {off.max():+.0f} %); {locked.sum()} of {len(rows)} runs locked."
    )


def library() -> str:
    """Contacts, conflicts, flow, delay and places of merges, a row a zone and demand."""
    return library_traffic.table_of(pd.read_csv(RESULTS / "library_traffic.csv"))
