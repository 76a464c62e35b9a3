"""The tables of docs/results/placement.md and docs/guide/place.md from their CSV files."""

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import t as student

DOCS = Path(__file__).parents[2] / "docs"
NETWORKS = {
    "i24b": "Interstate 24 (yanb514/CorridorCalibration)",
    "alicante": "Alicante-Murcia freeway (jjgonde/Alicante-Murcia-SUMO-Scenario)",
    "i210": "Interstate 210 and its streets (flow-project/flow, test2.net.xml)",
    "drawn": "freeways that are drawn, lanes end and open (drawn_networks.py)",
    "ingolstadt21": "Ingolstadt, city (Pi-Star-Lab/RESCO)",
    "cologne8": "Cologne, city (Pi-Star-Lab/RESCO)",
    "bologna": "Bologna, city (DLR-TS/sumo-scenarios)",
    "kctnky": "highway of sharp bends (kctnky/sumo-traffic)",
    "hamburg": "Hamburg, city (DLR-TS/sumo-scenarios)",
}


def places_table(*names: str) -> str:
    """What became of the places that were drawn in these networks."""
    rows = pd.read_csv(DOCS / "results" / "placement.csv")
    lines = ["| network | placed | work | refused by rule | failed | over closed ground |", "|---|---|---|---|---|---|"]
    for name in names:
        part = rows[rows["network"] == name]
        counts = [int((part["outcome"] == outcome).sum()) for outcome in ("works", "refused", "failed")]
        over = int(part["over_devices"].clip(lower=0).sum())
        lines.append(f"| {NETWORKS[name]} | {len(part)} | {counts[0]} | {counts[1]} | {counts[2]} | {over} |")
    return "\n".join(lines)


def open_table() -> str:
    rows = pd.read_csv(DOCS / "results" / "placement_open.csv")
    titles = {
        "i24b": "Interstate 24, light traffic", "ramps": "freeway with ramps, 5,400 veh/h",
        "ingolstadt21": "Ingolstadt, ahead of a signal, 30 min",
    }  # fmt: skip
    lines = ["| network | seeds | mean duration [s] | difference [%] with 95 % interval | teleports | emergency stops |",
             "|---|---|---|---|---|---|"]  # fmt: skip
    for name, title in titles.items():
        part = rows[rows["name"] == name].drop(columns="name").pivot_table(index="seed", columns="configuration")
        before, after = (part["mean_duration_s"][c] for c in ("original", "open"))
        share = 100 * (after - before) / before
        half = student.ppf(0.975, len(share) - 1) * share.std(ddof=1) / np.sqrt(len(share))
        pairs = [
            " → ".join(f"{part[key][c].sum():.0f}" for c in ("original", "open")) for key in ("teleports", "emergency_stops")
        ]
        lines.append(
            f"| {title} | {len(share)} | {before.mean():.1f} | {share.mean():+.2f} ± {half:.2f} | {pairs[0]} | {pairs[1]} |"
        )
    return "\n".join(lines)


def ways_table() -> str:
    rows = pd.read_csv(DOCS / "results" / "todays_ways.csv")
    lines = ["| way | demand [veh/h] | past the work [veh/h] (range over seeds) | over the closed ground | of vehicles |",
             "|---|---|---|---|---|"]  # fmt: skip
    for (way, demand), part in rows.groupby(["way", "demand_vph"], sort=False):
        flow = part["past_work_vph"]
        told = f"{flow.mean():,.0f} ({flow.min():,.0f} to {flow.max():,.0f})"
        over, all_ = part["over_closed_ground"].sum(), part["vehicles_on_edge"].sum()
        lines.append(f"| {way} | {demand:,} | {told} | {over:.0f} | {all_:,.0f} |")
    return "\n".join(lines)


def study_table() -> str:
    rows = pd.read_csv(DOCS / "results" / "network_study.csv")
    lines = ["| measure | change | 95 % interval | seeds |", "|---|---|---|---|"]
    for row in rows.itertuples(index=False):
        what = str(row.meaning).partition(", with the zone")[0]
        lines += [f"| {what} [{row.unit}] | {row.mean:+.2f} | {row.low:+.2f} to {row.high:+.2f} | {row.n} |"]
    return "\n".join(lines)


def discharge_table() -> str:
    rows = pd.read_csv(DOCS / "results" / "placed_discharge.csv")
    lines = ["| lanes | seed | discharge [veh/h] | of the HCM | difference [%] | over the closed ground | half had merged |",
             "|---|---|---|---|---|---|---|"]  # fmt: skip
    for row in rows.to_dict("records"):
        share = 100 * (row["queue_discharge_vph"] / row["hcm_queue_discharge_vph"] - 1)
        lines.append(
            f"| {row['zone']} | {row['seed']} | {row['queue_discharge_vph']:,.0f} | {row['hcm_queue_discharge_vph']:,.0f} | "
            f"{share:+.1f} | {row['n_over_closed_ground']:.0f} of {row['n_passed']:.0f} | {-row['merge_q50_m']:.0f} m before "
            "the taper |"
        )
    return "\n".join(lines)


def map_sentence() -> str:
    row = pd.read_csv(DOCS / "results" / "network_map.csv").iloc[0]
    return f"{row['iou']:.2f} (seed {row['seed']}, {row['n_traces']} traces)"


def example_table() -> str:
    rows = pd.read_csv(DOCS / "guide" / "place_example" / "runs.csv").groupby("configuration").mean(numeric_only=True)
    names = {
        "duration_s": "mean duration [s]", "time_loss_s": "mean time loss [s]", "route_length_m": "mean route length [m]",
        "over_closed_ground": "vehicles over the ground that `closed` closes",
    }  # fmt: skip
    lines = ["| | `original` | `open` | `closed` |", "|---|---|---|---|"]
    for key, title in names.items():
        cells = [f"{float(rows[key][name]):.1f}" for name in ("original", "open", "closed")]
        lines.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(lines)
