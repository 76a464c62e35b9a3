"""The tables of docs/results/how_many_traces.md from their CSV files."""

from pathlib import Path

import pandas as pd

RESULTS = Path(__file__).parents[2] / "docs" / "results"
# Traces and error [m] for which an aim of precision / IoU was set beforehand.
AIMS = {(5, 0): "0.98 / 0.90", (10, 0): "- / 0.94", (30, 1): "0.96 / 0.90", (100, 2): "0.95 / 0.88"}


def quality() -> str:
    """Precision / IoU [interval of the IoU] by number of traces and error, joined and alone, on SUMO's and other traces."""
    sumo, generated = pd.read_csv(RESULTS / "how_many_traces.csv"), pd.read_csv(RESULTS / "how_many_generated.csv")
    lines = [
        "| traces, error | aim | joined, SUMO | alone, SUMO | alone, generator | alone, cut at 0.5: SUMO | generator |",
        "|---|---|---|---|---|---|---|",
    ]
    for (n, error), aim in AIMS.items():
        joined, alone = (_row(sumo, n_traces=n, error_m=error, interval_s=1.0, map=which) for which in ("joined", "alone"))
        other = _row(generated, n_traces=n, error_m=error)
        cells = [
            f"{row['precision']:.2f} / {row['iou']:.2f} [{row['iou_low']:.2f}, {row['iou_high']:.2f}]"
            for row in (joined, alone, other)
        ]
        cells += [f"{row['precision_even']:.2f} / {row['iou_even']:.2f}" for row in (alone, other)]
        lines.append(f"| {n}, {error} m | {aim} | {' | '.join(cells)} |")
    return "\n".join(lines)


def summary() -> str:
    """What five and ten traces come to, in sentences."""
    rows = pd.read_csv(RESULTS / "how_many_traces.csv")

    def iou(n: int, error: int, which: str = "joined") -> str:
        return f"{_row(rows, n_traces=n, error_m=error, interval_s=1.0, map=which)['iou']:.2f}"

    return (
        f"Five joined to the road from before the zone overlap the truth by a median IoU of {iou(5, 0)}\n  without positioning "
        f"error, {iou(5, 1)} at 1 m and {iou(5, 2)} at 2 m; ten by {iou(10, 0)}, {iou(10, 1)} and {iou(10, 2)}. From traces "
        f"alone, five\n  give {iou(5, 0, 'alone')} and ten {iou(10, 0, 'alone')}: in most such files no trace "
        f"shows the closing lane."
    )


def waiting() -> str:
    """Median minutes (95 of 100 waits stay below) until so many equipped vehicles have passed."""
    rows = pd.read_csv(RESULTS / "how_many_waiting.csv")
    flows = (200, 500, 1000, 2000)
    lines = ["| traces | penetration | 200 veh/h | 500 | 1,000 | 2,000 |", "|---|---|---|---|---|---|"]
    for n, shares in {5: (0.01, 0.02, 0.05, 0.1), 10: (0.01, 0.02, 0.05, 0.1), 30: (0.05, 0.1)}.items():
        for share in shares:
            found = [_row(rows, n_traces=n, penetration=share, flow_vph=flow) for flow in flows]
            cells = [f"{_minutes(row['median_min'])} ({row['late_min']:.0f})" for row in found]
            lines.append(f"| {n} | {100 * share:.0f} % | {' | '.join(cells)} |")
    return "\n".join(lines)


def _minutes(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}"


def _row(rows: pd.DataFrame, **wanted: float | str) -> "pd.Series[float]":
    """The only row with these values."""
    for name, value in wanted.items():
        rows = rows[rows[name] == value]
    if len(rows) != 1:
        raise ValueError(f"{wanted}: {len(rows)} rows")
    return rows.iloc[0]
