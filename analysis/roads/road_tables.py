"""The tables of docs/results/roads.md and docs/results/exports.md from their CSV files."""

from pathlib import Path

import pandas as pd

RESULTS = Path(__file__).parents[2] / "docs" / "results"
NETWORKS = {
    "alicante.net.xml": "Alicante-Murcia freeway (jjgonde/Alicante-Murcia-SUMO-Scenario)",
    "badhersfeld.net.xml": "Bad Hersfeld, town (DLR-TS/sumo-scenarios)",
    "i24b.net.xml": "Interstate 24 (yanb514/CorridorCalibration)",
    "ingolstadt21.net.xml": "Ingolstadt, city (Pi-Star-Lab/RESCO)",
    "joined_buslanes.net.xml": "Bologna, city (DLR-TS/sumo-scenarios)",
    "most.net.xml": "Monaco, from OpenStreetMap (lcodeca/MoSTScenario)",
    "euclid.net.xml": "Los Angeles, from OpenStreetMap (flow-project/flow)",
}


def networks() -> str:
    """How well stretches of public networks were found and became roads, a row a network."""
    rows = pd.read_csv(RESULTS / "roads.csv")
    lines = [
        "| network | stretches | edges exactly as driven | mean Jaccard index of edges | became a road "
        "| line within 0.15 m everywhere | median of the 95th percentile [m] | lane counts right |",
        "|---" * 8 + "|",
    ]
    for name, title in NETWORKS.items():
        part = rows[rows["net"] == name]
        made = part[part["refused"].isna()]
        cells = [str(len(part)), str(part["same_edges"].eq(True).sum()), f"{part['jaccard'].mean():.2f}", str(len(made))]
        cells += [str((made["line_max_m"] < 0.15).sum()), f"{made['line_p95_m'].median():.3f}"]
        lines.append(f"| {title} | {' | '.join(cells)} | {made['counts_right'].eq(True).sum()} |")
    return "\n".join(lines)


def summary() -> str:
    """How many stretches became a road, and how many of these lie within 0.15 m."""
    rows = pd.read_csv(RESULTS / "roads.csv")
    made = rows[rows["refused"].isna()]
    near = int((made["line_max_m"] < 0.15).sum())
    return f"{len(made)} of {len(rows)} stretches became a road, {near} with the reference line within 0.15 m"


def exports() -> str:
    """What other people's readers found in the exports of every zone, a row a zone."""
    lines = [
        "| zone | lanelets | lanes at the start | with a way through | netconvert reads | ASAM errors | ASAM warnings |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in pd.read_csv(RESULTS / "exports.csv").itertuples():
        read = "yes" if row.netconvert_reads else "no"
        cells = [row.lanelets, row.lanes_at_start, row.with_a_way_through, read, row.qc_errors, row.qc_warnings]
        lines.append(f"| `{row.zone}` | {' | '.join(map(str, cells))} |")
    return "\n".join(lines)
