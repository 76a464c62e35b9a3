"""Figures, tables and ages between the markers of a page, and what they should be.

    <!-- from FILE.json: KEY.KEY FORMAT -->0.904<!-- end -->
    <!-- from FILE.csv: WHAT COLUMN FORMAT COLUMN=VALUE ... -->0.59<!-- end -->        (csv_figures.py)
    <!-- from FILE.txt: text -->                                                       its text, as a block of code
    <!-- from analysis/TOPIC/TOPIC_tables.py: FUNCTION WORD ... -->                          the text that the function returns
    <!-- measured TOPIC.NAME -->                                                       command, seeds, interval, age and data
    <!-- age TOPIC.NAME ... -->**Older than the code.**<!-- end -->                    nothing where the code is the same

A marker that ends its line holds whole lines. Files without a folder are those of docs/results/.
"""

import importlib.util
import json
import re
import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from code_parts import ROOT
from csv_figures import csv_figure, spaced
from records import RESULTS, Record

MARKER = re.compile(r"<!-- (from|measured|age) ([^>]+?) -->(.*?)<!-- end -->", flags=re.DOTALL)
PAGES = ("README.md", "docs/**/*.md")


def pages() -> list[Path]:
    """README and every page of docs/."""
    return sorted(path for pattern in PAGES for path in ROOT.glob(pattern))


def filled(text: str, records: Mapping[str, Record]) -> str:
    """The page's text with what its files say between its markers.

    Raises ValueError with the marker where a file, key or measurement is not there, or a marker has no end.
    """

    def fill(match: re.Match[str]) -> str:
        kind, said, old = match.groups()
        if "<!-- from " in old or "<!-- measured " in old or "<!-- age " in old:
            raise ValueError(f"<!-- {kind} {said} -->: has no <!-- end -->")
        try:
            new = _age(said, records) if kind == "age" else _from(said) if kind == "from" else _header(said, records)
        except (LookupError, TypeError, OSError) as error:
            raise ValueError(f"<!-- {kind} {said} -->: {error!r}") from error
        inside = f"\n{new}\n" if old.startswith("\n") or kind == "measured" else new
        return f"<!-- {kind} {said} -->{inside}<!-- end -->"

    new_text = MARKER.sub(fill, text)
    if unended := re.search(r"<!-- (?:from|measured|age) [^>]*-->(?!.*<!-- end -->)", new_text, flags=re.DOTALL):
        raise ValueError(f"{unended.group()}: has no <!-- end -->")
    return new_text


def _from(said: str) -> str:
    name, _, words = said.partition(": ")
    path = ROOT / name if "/" in name else RESULTS / name
    if path.suffix == ".csv":
        return csv_figure(path, words)
    if path.suffix == ".json":
        key, form, *_ = [*words.split(), ""]
        return spaced(format(_at(json.loads(path.read_text(encoding="utf-8")), key), form))
    if path.suffix == ".txt":
        return f"```text\n{path.read_text(encoding='utf-8').strip()}\n```"
    function, *arguments = words.split()
    return str(_functions(path)[function](*arguments)).strip("\n")


def _at(value: Any, key: str) -> Any:
    for step in key.split("."):
        value = value[int(step)] if isinstance(value, list) else value[step]
    return value


@cache
def _functions(path: Path) -> Mapping[str, Callable[..., str]]:
    """The functions of a script, which finds the modules beside it."""
    spec = importlib.util.spec_from_file_location("_".join(path.relative_to(ROOT).with_suffix("").parts), path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{path}: no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return vars(module)


def _header(name: str, records: Mapping[str, Record]) -> str:
    record = records[name]
    rows = [("command", f"`{record.command}`" if record.command else "none is kept"), ("seeds, n", record.seeds)]
    rows += [("interval", record.interval)] if record.interval else []
    rows += [("code", f"**Older than the code**: {', '.join(record.changed)}" if record.changed else "the present one")]
    rows += [("measured on", record.note)] if record.note else []
    rows += [("data", ", ".join(f"[{file}]({file})" for file in record.data) or "in this page alone")]
    return "\n".join(["| | |", "|---|---|", *(f"| {key} | {value} |" for key, value in rows)])


def _age(names: str, records: Mapping[str, Record]) -> str:
    return "**Older than the code.**" if any(records[name].changed for name in names.split()) else ""
