"""The tables of docs/results/lane_maps.md from their data files."""

from collections.abc import Callable
from pathlib import Path

import pandas as pd

RESULTS = Path(__file__).parents[2] / "docs" / "results"
REAL = ("i80", "us101")  # roads of NGSIM
MANY = 20  # traces, from which on drawn maps are counted apart
WORDS = {
    "early_100": "announced 100 m early", "early_300": "announced 300 m early", "late_100": "announced 100 m late",
    "late_300": "announced 300 m late", "offset_1": "all positions 1 m off", "offset_1.5": "all positions 1.5 m off",
    "offset_2": "all positions 2 m off", "road_5m_off": "road drawn 5 m off", "jump": "one trace jumps aside for 7 s",
    "stray": "one trace 1.5 lanes aside", "half_change": "one trace begins between lanes",
    "truck_1": "one work vehicle among them", "truck_2": "two work vehicles among them",
    "stated": "receivers state their error", "sampled_10Hz": "ten fixes a second", "sampled_3s": "a fix in 3 s",
    "sampled_10s": "a fix in 10 s", "sampled_30s": "a fix in 30 s",
}  # fmt: skip


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
    """Medians, the least precision and the number of maps; of files that were refused, how many."""
    if maps.empty:
        return ""
    made = maps[maps["iou"].notna()]
    refused = [f"{len(maps) - len(made)} refused"] if len(made) < len(maps) else []
    if made.empty:
        return refused[0]
    precision = made["precision"].fillna(1.0)  # without free ground nothing that is free is wrong
    counts = "; ".join([f"{precision.min():.3f}", str(len(made)), *refused])
    return f"{precision.median():.3f} / {made['iou'].median():.3f} ({counts})"


def variants() -> str:
    """Median precision / IoU (least precision; maps) of joined maps with something wrong, by what it is and kind."""
    rows = pd.read_csv(RESULTS / "lane_map_variants.csv", dtype={"receivers": str})
    kinds = list(rows["kind"].unique())
    lines = [f"| what differs | {' | '.join(kinds)} |", f"|---|{'---|' * len(kinds)}"]
    for variant, part in rows.groupby("variant", sort=False):
        cells = [_cell(part[part["kind"] == kind]) for kind in kinds]
        lines.append(f"| {WORDS[str(variant)]} | {' | '.join(cells)} |")
    return "\n".join(lines)


def drawn() -> str:
    """The table of lane_maps_drawn.csv."""
    return table_of_drawn(pd.read_csv(RESULTS / "lane_maps_drawn.csv"))


def table_of_drawn(rows: pd.DataFrame) -> str:
    """Maps of inputs that are drawn in every respect: median precision and IoU, and how many are poor, by mode and code."""
    many = rows["n"] >= MANY
    lines = [
        "| | traces | maps | precision | IoU | precision below 0.9 | IoU below 0.7 |",
        "|---|---|---|---|---|---|---|",
    ]
    for (code, mode, enough), part in rows.groupby(["code", "mode", many], sort=False):
        # A map without free ground has no precision: nothing that it frees is wrong.
        precision, iou = part["precision"].fillna(1.0), part["iou"].fillna(0.0)
        traces = f"{MANY} and more" if enough else f"fewer than {MANY}"
        lines.append(
            f"| {mode}, {code} | {traces} | {len(part)} | {precision.median():.3f} | {iou.median():.3f} | "
            f"{(precision < 0.9).sum()} | {(iou < 0.7).sum()} |"
        )
    return "\n".join(lines)
