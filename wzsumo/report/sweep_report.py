"""report.html of a study: answers, figures, tables, and every case with the command that runs it alone."""

import shlex
from pathlib import Path
from typing import Any

import pandas as pd

from wzsumo.errors import InputError, count_of
from wzsumo.files.output import staged_folder
from wzsumo.report.page import embedded, page_template
from wzsumo.report.study_answers import MEANING, factor_sentences, headline, measure_of, method_sentences
from wzsumo.report.study_tables import cases_table, for_template, study_tables
from wzsumo.sweep.results import read_results
from wzsumo.sweep.store import read_study
from wzsumo.sweep.study_file import Study
from wzsumo.sweep.summary import write_table
from wzsumo.sweep.version import code_version

PAGE = "report.html"


def write_sweep_report(folder: Path) -> Path:
    """The path of report.html, written to a study's result folder together with figures/* and tables/*.

    Raises InputError where the folder holds no study or none of its cases is finished.
    """
    from wzsumo.figures.sweep_figures import write_sweep_figures  # matplotlib loads slowly, and only a report needs it

    study, table = read_study(folder), read_results(folder)
    if not (table["status"] == "DONE").any():
        reason = f", the first because: {table['reason'].iloc[0]}" if len(table) else ""
        raise InputError(f"{folder}: none of its {len(study.cases)} cases has a result{reason}; run the sweep again")
    with staged_folder(folder, files=(PAGE,)) as stage:
        figures = embedded(write_sweep_figures(table, stage / "figures"))
        tables = study_tables(table)
        for part in tables:
            write_table(part["frame"], stage / "tables", part["stem"])
        (stage / PAGE).write_text(_page(study, table, folder, figures=figures, tables=tables), encoding="utf-8")
    return folder / PAGE


def _page(
    study: Study, table: pd.DataFrame, folder: Path, *, figures: list[dict[str, str]], tables: list[dict[str, Any]]
) -> str:
    seeds, simulations = (count_of(table[name].nunique(), name) for name in ("seed", "simulation"))
    place = shlex.quote(str(folder))  # the command is to be copied to a shell
    return page_template("sweep.html.j2").render(
        name=study.spec.name,
        command=f"wzsumo run {place} --case CASE --out {shlex.quote(str(folder / 'cases'))}/CASE",
        facts=f"{len(table)} of {len(study.cases)} cases · {simulations} · {seeds} · wzsumo {code_version()}",
        headline=headline(table),
        meaning=MEANING[measure_of(table)],
        methods=method_sentences(table),
        factors=factor_sentences(table),
        not_done=table.loc[table["status"] != "DONE", "reason"].value_counts().items(),
        figures=figures,
        tables=[for_template(part) for part in [*tables, cases_table(table)]],
        rerun={path.parent.name for path in folder.glob("cases/*/report.html")},
    )
