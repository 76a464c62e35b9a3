"""Runs commands with other hash seeds, locales, time zones and folders, and counts the files that differ.

    .venv/bin/python analysis/fuzz/same_bytes.py --out results/same_bytes

What a clock measures is left out: of result.json the times, of pages numbers with " s" or " ms" behind them, of a study its
batches and simulations, which hold how long each took (results.parquet, which is made of them, is compared); and the name of
the result's own folder, which the page of a study says. Surroundings are Python's hash seed, locale, time zone, folder for
temporary files and working folder.
"""

import argparse
import csv
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from kills import COMMANDS

SURROUNDINGS = (
    {"PYTHONHASHSEED": "0", "LC_ALL": "C", "TZ": "UTC"},
    {"PYTHONHASHSEED": "1", "LC_ALL": "C.UTF-8", "TZ": "Pacific/Auckland"},
    {"PYTHONHASHSEED": "4711", "LC_ALL": "de_DE.UTF-8", "TZ": "America/Detroit", "LANG": "tr_TR.UTF-8", "COLUMNS": "40"},
)
CLOCKED = ("batches", "simulations")  # folders
DURATION = re.compile(rb"[0-9.]+ m?s<")
TIMES = ("timings_s", "timings_ms", "plan_ms", "time_s_of_run")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--commands", nargs="+", default=[name for name in COMMANDS if name != "report"])
    parser.add_argument("--out", type=Path, default=Path("results/same_bytes"))
    args = parser.parse_args()
    base = (args.out / "work").resolve()
    shutil.rmtree(base, ignore_errors=True)
    base.mkdir(parents=True)
    table: list[tuple[Any, ...]] = [("command", "surroundings", "files", "differ")]
    for name in args.commands:
        found = [_made(name, base, number) for number in range(len(SURROUNDINGS))]
        names = set().union(*found)
        differ = sorted(path for path in names if len({each.get(path) for each in found}) > 1)
        table.append((name, len(found), len(names), " ".join(differ) or 0))
        with (args.out / "same_bytes.csv").open("w", newline="") as file:
            csv.writer(file).writerows(table)
    print(*(",".join(map(str, row)) for row in table), sep="\n")
    sys.exit(any(row[3] for row in table[1:]))


def _made(name: str, base: Path, number: int) -> dict[str, bytes]:
    """Content by name of the files that a command writes, called from a folder of its own."""
    out, cwd = base / f"{name}_{number}" / "out", base / f"{name}_{number}" / "ß folder"
    cwd.mkdir(parents=True)
    words = COMMANDS[name](base, out, "1")
    (tmp := base / f"{name}_{number}" / "tmp").mkdir()
    environment = os.environ | SURROUNDINGS[number] | {"TMPDIR": str(tmp)}
    for each in (words, *([["report", str(out)]] if name == "sweep" else [])):
        subprocess.run([sys.executable, "-m", "wzsumo", *each], cwd=cwd, env=environment, check=True, capture_output=True)
    files = [path for path in out.rglob("*") if path.is_file() and not set(path.parts) & set(CLOCKED)]
    return {str(path.relative_to(out)): _content(path).replace(bytes(out), b"OUT") for path in files}


def _content(path: Path) -> bytes:
    if path.suffix == ".html":
        return DURATION.sub(b"<", path.read_bytes())
    if path.name == "result.json":
        return json.dumps(_without_times(json.loads(path.read_text())), sort_keys=True).encode()
    return path.read_bytes()


def _without_times(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_times(part) for key, part in value.items() if key not in TIMES}
    return [_without_times(part) for part in value] if isinstance(value, list) else value


if __name__ == "__main__":
    main()
