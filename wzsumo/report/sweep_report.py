"""report.html of a study: answers, figures, tables, and every case with the command that runs it alone."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from wzsumo.case.methods import is_baseline
from wzsumo.files.output import staged_folder
from wzsumo.report.page import embedded, page_template
from wzsumo.sweep.results import column_of, read_results
from wzsumo.sweep.store import read_study
from wzsumo.sweep.study_file import Study
from wzsumo.sweep.summary import (
    REQUIRED_SAFE_SHARE,
    TRACES_FACTOR,
    clean_drives,
    compare,
    summarise,
    traces_needed,
    write_table,
)
from wzsumo.sweep.version import code_version

PAGE = "report.html"
MAX_CASE_ROWS = 2000  # cases on the page; results.parquet holds all
MEASURES = ("safe_plan", "iou", "precision", "recall", "planned_min_clearance_devices_m")
CASE_COLUMNS_SHOWN = (
    "status", "plan_status", "safe_plan", "precision", "recall", "iou", "planned_min_clearance_devices_m",
    "planned_min_clearance_road_edge_m", "planned_closed_area_share", "n_components", "minutes_to_collect", "outcome",
)  # fmt: skip


def write_sweep_report(folder: Path) -> Path:
    """The path of report.html, written to a study's result folder together with figures/*.png and tables/*.

    Raises InputError where the folder holds no study or none of its cases is finished.
    """
    from wzsumo.figures.sweep_figures import write_sweep_figures  # matplotlib loads slowly, and only a report needs it

    study, table = read_study(folder), read_results(folder)
    factors = [name for name in table.attrs["factors"] if name != "seed"]
    with staged_folder(folder, files=(PAGE,)) as stage:
        figures = embedded(write_sweep_figures(table, stage / "figures"))
        tables = _tables(table, factors)
        for part in tables:
            write_table(part["frame"], stage / "tables", part["stem"])
        (stage / PAGE).write_text(_page(study, table, folder, figures=figures, tables=tables), encoding="utf-8")
    return folder / PAGE


def _page(
    study: Study, table: pd.DataFrame, folder: Path, *, figures: list[dict[str, str]], tables: list[dict[str, Any]]
) -> str:
    factors = [name for name in table.attrs["factors"] if name != "seed"]
    seeds, simulations = table["seed"].nunique(), table["simulation"].nunique()
    place = shlex.quote(str(folder))  # the command is to be copied to a shell
    return page_template("sweep.html.j2").render(
        name=study.spec.name,
        command=f"wzsumo run {place} --case CASE --out {shlex.quote(str(folder / 'cases'))}/CASE",
        facts=f"{len(table)} of {len(study.cases)} cases · {simulations} simulations · {seeds} seeds · wzsumo {code_version()}",
        answers=_answers(table, factors),
        not_done=table.loc[table["status"] != "DONE", "reason"].value_counts().items(),
        figures=figures,
        tables=[_template_table(part) for part in [*tables, _cases(table, factors)]],
        rerun={path.parent.name for path in folder.glob("cases/*/report.html")},
    )


def _answers(table: pd.DataFrame, factors: list[str]) -> list[str]:
    """Sentences that answer the study's question, one per method."""
    return _traces_and_plans(table, factors) + _clean_answers(table)


def _clean_answers(table: pd.DataFrame) -> list[str]:
    """One sentence per method on its drives; none where the study does not drive."""
    return [
        f"{row.method}: {row.n_clean} of {row.n} drives are clean, {row.n_reached} reached the goal ({row.n_seeds} seeds). "
        f"At 95 % confidence {row.low:.1%} or more are clean, if drives were independent."
        for row in (clean_drives(table, by=["method"]).itertuples() if table["clean"].notna().any() else ())
    ]


def _traces_and_plans(table: pd.DataFrame, factors: list[str]) -> list[str]:
    takes_traces = ~table["method"].map(is_baseline).astype(bool) & (TRACES_FACTOR in factors)
    lines = _traces_answers(table, factors) if takes_traces.any() else []
    if takes_traces.all():
        return lines
    shares = summarise(table[~takes_traces], "safe_plan", by=["method"])
    return lines + [
        f"{row.method}: a safe plan in {row.mean:.0%} of the cases, n = {row.n} seeds." for row in shares.itertuples()
    ]


def _traces_answers(table: pd.DataFrame, factors: list[str]) -> list[str]:
    errors = ["gnss.error_m"] if "gnss.error_m" in factors else []
    required = f"{REQUIRED_SAFE_SHARE:.0%}"
    lines = []
    for row in traces_needed(table, by=["method", *errors]).to_dict("records"):
        at = f" at a GNSS error of {row['gnss.error_m']:g} m" if errors else ""
        n, best, share = f"n = {row['n_seeds']:.0f} seeds", f"{row['best_traces']:.0f} trace(s)", f"{row['best_share']:.0%}"
        if not pd.isna(row["traces"]):
            text = (
                f"{row['traces']:.0f} trace(s) give a safe plan in {required} of the cases, {n}; "
                f"they are collected after {row['minutes']:.1f} min on average."
            )
        elif row["best_share"] >= REQUIRED_SAFE_SHARE:
            text = f"{best} give a safe plan in {share} of the cases, {n}, but some larger number in fewer than {required}."
        else:
            text = f"no number of traces gives a safe plan in {required} of the cases; {share} with {best} is the most, {n}."
        lines.append(f"{row['method']}{at}: {text}")
    return lines


def _tables(table: pd.DataFrame, factors: list[str]) -> list[dict[str, Any]]:
    by = ["method", *factors]
    long = pd.concat(
        [summarise(table, name, by=by).assign(measure=name, unit=column_of(name).unit) for name in MEASURES], ignore_index=True
    )
    tables = [
        {
            "stem": "summary",
            "title": "Means over seeds",
            "note": "n counts seeds; low and high are the ends of the mean's 95 % bootstrap interval. Click a name to sort.",
            "frame": long[[*by, "measure", "unit", "n", "mean", "median", "low", "high"]],
        }
    ]
    if table["clean"].notna().any():
        tables += [
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
                "frame": table.loc[table["clean"].eq(False), ["case", "scenario", *by, "seed", "outcome", "faults"]],
            },
        ]
    methods = list(dict.fromkeys(table["method"]))
    if len(methods) > 1:
        paired = [
            compare(table, name, between="method", against=methods[0], by=factors).assign(measure=name) for name in MEASURES
        ]
        frame = pd.concat(paired, ignore_index=True)
        tables.append(
            {
                "stem": "paired",
                "title": f"Differences from “{methods[0]}” in the same traffic",
                "note": "Mean of the differences of pairs that share seed, simulation and every other factor, with its 95 % "
                "bootstrap interval over seeds; share_above: pairs in which the method has the larger value.",
                "frame": frame[["method", *factors, "measure", "n", "difference", "low", "high", "share_above"]],
            }
        )
    return tables


def _cases(table: pd.DataFrame, factors: list[str]) -> dict[str, Any]:
    few = table.head(MAX_CASE_ROWS)
    shown = [name for name in CASE_COLUMNS_SHOWN if few[name].notna().any()]
    rest = "" if len(few) == len(table) else f" The first {MAX_CASE_ROWS} of {len(table)}; all are in results.parquet."
    return {
        "title": "Cases",
        "note": f"Click a case for the command that runs it alone.{rest}",
        "frame": few[["case", "method", "seed", *factors, *shown]],
    }


def _template_table(part: dict[str, Any]) -> dict[str, Any]:
    frame: pd.DataFrame = part["frame"]
    columns = [
        {
            "name": name,
            "unit": "" if column_of(name).unit == "1" else column_of(name).unit,
            "text": not pd.api.types.is_numeric_dtype(frame[name]),
        }
        for name in map(str, frame.columns)
    ]
    return {"title": part["title"], "note": part["note"], "columns": columns, "rows": _cells(frame.itertuples(index=False))}


def _cells(rows: Any) -> list[Sequence[str]]:
    return [["" if pd.isna(v) else f"{v:.4g}" if isinstance(v, float) else str(v) for v in row] for row in rows]
