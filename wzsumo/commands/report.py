"""The command `report`: figures, tables and page of a run's or a study's folder."""

import argparse
import json
from pathlib import Path
from typing import Any

from wzsumo.errors import InputError
from wzsumo.report.report import write_report
from wzsumo.report.sweep_report import write_sweep_report
from wzsumo.sweep.store import MANIFEST


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("folder", type=Path, metavar="DIR")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """The path of the report, after writing it again from a run's or a study's folder."""
    folder = args.folder
    if (folder / MANIFEST).is_file():
        return {"report": str(write_sweep_report(folder))}
    if not (folder / "result.json").is_file():
        raise InputError(f"{folder}: holds no result.json; name the --out folder of a finished `wzsumo run` or `wzsumo sweep`")
    try:
        json.loads((folder / "result.json").read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{folder / 'result.json'}: not JSON ({error}); run the scenario again") from None
    return {"report": str(write_report(folder))}
