"""The tables of docs/results/lane_maps.md from lane_maps.csv."""

from collections.abc import Callable
from pathlib import Path

import pandas as pd

RESULTS = Path(__file__).parents[2] / "docs" / "results"
REAL = ("i80", "us101")  # roads of NGSIM


def generated(mode: str) -> str:
    """Median precision / IoU (least precision; maps) by kind, receivers and number of traces, "joined" or "alone"."""
    rows = _rows()
    rows = rows[(rows["mode"] == mode) & ~rows["kind"].isin(REAL)]
    return _table(
        rows, ["kind", "receivers"], header="| kind | receivers |", title=lambda kind, receivers: f"{kind} | {receivers}"
    )


def real() -> str:
    """The same for vehicles of NGSIM, joined and then alone, by the error that was added."""
    rows = _rows()
    rows = rows[rows["kind"].isin(REAL)]
    rows = rows.assign(mode=pd.Categorical(rows["mode"], ["joined", "alone"], ordered=True)).sort_values("mode", kind="stable")
    return _table(
        rows,
        ["mode", "kind", "receivers"],
        header="| road | error added [m] |",
        title=lambda mode, kind, error: f"{kind}, {mode} | {error}",
    )


def _rows() -> pd.DataFrame:
    return pd.read_csv(RESULTS / "lane_maps.csv", dtype={"receivers": str})


def _table(rows: pd.DataFrame, keys: list[str], *, header: str, title: Callable[..., str]) -> str:
    counts = sorted(rows["n"].unique())
    lines = [f"{header} {' | '.join([f'n = {counts[0]}', *map(str, counts[1:])])} |", f"|---|---|{'---|' * len(counts)}"]
    for names, part in rows.groupby(keys, sort=False, observed=True):
        cells = [_cell(part[part["n"] == n]) for n in counts]
        lines.append(f"| {title(*names)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(maps: pd.DataFrame) -> str:
    if maps.empty:
        return ""
    least = maps["precision"].min()
    return f"{maps['precision'].median():.3f} / {maps['iou'].median():.3f} ({least:.3f}; {len(maps)})"
