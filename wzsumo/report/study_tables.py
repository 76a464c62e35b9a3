"""The tables of a study's report."""

from collections.abc import Sequence
from typing import Any

import pandas as pd

from wzsumo.figures.sweep_figures import factors_of, level_text, name_of
from wzsumo.report.study_answers import MEANING, WORDS, measure_of
from wzsumo.sweep.results import column_of
from wzsumo.sweep.summary import TRACES_FACTOR, clean_drives, compare, summarise, whole_seeds

MAX_CASE_ROWS = 2000  # cases on the page; results.parquet holds all
MEASURES = ("safe_plan", "iou", "precision", "recall", "planned_min_clearance_devices_m")
CASE_COLUMNS_SHOWN = (
    "status", "plan_status", "safe_plan", "clean", "precision", "recall", "iou", "planned_min_clearance_devices_m",
    "planned_min_clearance_road_edge_m", "planned_closed_area_share", "n_components", "minutes_to_collect", "outcome",
)  # fmt: skip


def study_tables(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Stem, title, note and frame of each table, in the order of the page."""
    factors = factors_of(table)
    by = ["method", *factors]
    tables = [*_matrix(table, factors), _means(table, by)]
    if table["clean"].notna().any():
        tables += _drives(table, by)
    methods = list(dict.fromkeys(table["method"]))
    if len(methods) > 1:
        tables.append(_paired(table, methods[0], factors))
    return tables


def cases_table(table: pd.DataFrame) -> dict[str, Any]:
    """The table of the cases, of which the page holds the first MAX_CASE_ROWS."""
    few = table.head(MAX_CASE_ROWS)
    shown = [name for name in CASE_COLUMNS_SHOWN if few[name].notna().any()]
    rest = "" if len(few) == len(table) else f" The first {MAX_CASE_ROWS} of {len(table)}; all are in results.parquet."
    factors = [name for name in table.attrs["factors"] if name != "seed"]
    scenario = ["scenario"] if table["scenario"].nunique() > 1 else []
    return {
        "stem": "",
        "title": "Cases",
        "note": f"Press a case for the command that runs it alone.{rest}",
        "frame": few[["case", "method", "seed", *scenario, *factors, *shown]],
    }


def for_template(part: dict[str, Any]) -> dict[str, Any]:
    """A table as the page's template takes it."""
    frame: pd.DataFrame = part["frame"]
    columns = [
        {
            "name": name,
            "unit": "" if column_of(name).unit == "1" else column_of(name).unit,
            "text": not pd.api.types.is_numeric_dtype(frame[name]),
        }
        for name in map(str, frame.columns)
    ]
    rows = _cells(frame.itertuples(index=False))
    return {"stem": part["stem"], "title": part["title"], "note": part["note"], "columns": columns, "rows": rows}


def _matrix(table: pd.DataFrame, factors: Sequence[str]) -> list[dict[str, Any]]:
    """The study's measure, methods by numbers of traces, or by the first factor of a study that does not vary them."""
    along = TRACES_FACTOR if TRACES_FACTOR in factors else next(iter(factors), None)
    if along is None:
        return []
    measure = measure_of(table)
    counts = whole_seeds(table, measure, by=["method", along])
    if counts.empty:
        return []
    cells = counts.assign(
        cell=[
            f"{100 * row['n_true'] / row['n']:.0f} % ({row['n_true']} of {row['n']}, "
            f"{row['n_whole']} of {row['n_seeds']} seeds)"
            for row in counts.to_dict("records")
        ],
        column=[f"{name_of(along)}: {level_text(value)}" for value in counts[along]],
    )
    order = [f"{name_of(along)}: {level_text(value)}" for value in sorted(counts[along].unique())]
    frame = cells.pivot(index="method", columns="column", values="cell")[order].reset_index()
    rest = ", ".join(name_of(name) for name in factors if name != along)
    pooled = f" Pooled over {rest}." if rest else ""
    note = f"Share of cases; in brackets cases, and seeds of which all cases did.{pooled} {MEANING[measure]}"
    return [
        {
            "stem": "methods",
            "title": f"{WORDS[measure].capitalize()}: methods by {name_of(along)}",
            "note": note,
            "frame": frame,
        }
    ]


def _means(table: pd.DataFrame, by: Sequence[str]) -> dict[str, Any]:
    long = pd.concat(
        [summarise(table, name, by=by).assign(measure=name, unit=column_of(name).unit) for name in MEASURES], ignore_index=True
    )
    return {
        "stem": "summary",
        "title": "Means over seeds",
        "note": "n counts seeds; low and high are the ends of the mean's 95 % interval: bootstrap, and of shares Clopper and "
        "Pearson's with a seed as one draw.",
        "frame": long[[*by, "measure", "unit", "n", "mean", "median", "low", "high"]],
    }


def _drives(table: pd.DataFrame, by: Sequence[str]) -> list[dict[str, Any]]:
    scenario = [] if "scenario" in by else ["scenario"]
    return [
        {
            "stem": "clean_drives",
            "title": "Clean drives",
            "note": "A clean drive reaches its goal within all limits of conduct. low: one-sided 95 % bound of the share, "
            "if drives were independent; unclean_seeds: the bound above the share of seeds with a drive that is not clean.",
            "frame": clean_drives(table, by=by),
        },
        {
            "stem": "unclean_drives",
            "title": "What the others did",
            "note": "Each drive that is not clean, with its figures and the limits.",
            "frame": table.loc[table["clean"].eq(False), ["case", *scenario, *by, "seed", "outcome", "faults"]],
        },
    ]


def _paired(table: pd.DataFrame, against: str, factors: Sequence[str]) -> dict[str, Any]:
    paired = [compare(table, name, between="method", against=against, by=factors).assign(measure=name) for name in MEASURES]
    frame = pd.concat(paired, ignore_index=True)
    return {
        "stem": "paired",
        "title": f"Differences from “{against}” in the same traffic",
        "note": "Mean of the differences of pairs that share seed, simulation and every other factor, with its 95 % "
        "bootstrap interval over seeds; share_above: pairs in which the method has the larger value.",
        "frame": frame[["method", *factors, "measure", "n", "difference", "low", "high", "share_above"]],
    }


def _cells(rows: Any) -> list[Sequence[str]]:
    return [["" if pd.isna(v) else f"{v:.4g}" if isinstance(v, float) else str(v) for v in row] for row in rows]
