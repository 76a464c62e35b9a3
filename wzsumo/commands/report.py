"""The command `report`: figures, tables and page of a run's or a study's folder."""

import argparse
from pathlib import Path
from typing import Any

import pyarrow as pa

from wzsumo.errors import InputError, reading
from wzsumo.files.result_folder import RESULT
from wzsumo.report.report import write_report
from wzsumo.report.sweep_report import write_sweep_report
from wzsumo.sweep.store import MANIFEST


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="the folder of a run or of a sweep")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """The path of the report, after writing it again from a run's or a study's folder."""
    folder = args.folder
    remedy = "its files do not fit together: run the scenario or the sweep again"
    with reading(folder, error=InputError, remedy=remedy, also=(pa.ArrowException,)):
        if (folder / MANIFEST).exists():
            return {"report": str(write_sweep_report(folder))}
        if (folder / RESULT).exists():
            return {"report": str(write_report(folder))}
    raise InputError(f"{folder}: holds no result.json; name the --out folder of a finished `wzsumo run` or `wzsumo sweep`")


def next_step(figures: dict[str, Any], _args: argparse.Namespace) -> str:
    """What to do with what was written."""
    return f"open {figures['report']} in a browser"
