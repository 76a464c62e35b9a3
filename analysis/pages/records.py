"""What was measured: one table a measurement in docs/results/TOPIC.toml, with the code that decided it.

[seeds]                                   # named TOPIC.seeds: paper_case.seeds
command = "python analysis/drives/paper_case_seeds.py --first 121"         # left out where none is kept
seeds = "121 to 130, n = 10, fresh"
interval = "95 %, bootstrap over seeds"   # may be left out, as may be `note`: what else it was measured on
data = ["paper_case_seeds.csv"]           # beside the TOML file; [] where the figures are in the page alone
code = ["zone", "traffic", "lane map"]    # parts of the code, or paths, that decide the figures
measured = { zone = "3f2a9c1b77" }        # their fingerprints then, written by `make numbers MEASURED=paper_case.seeds`
"""

import contextlib
import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from code_parts import ROOT, fingerprint

RESULTS = ROOT / "docs" / "results"
REQUIRED, KNOWN = {"seeds", "data", "code"}, {"command", "seeds", "interval", "note", "data", "code", "measured"}


@dataclass(frozen=True, kw_only=True)
class Record:
    """One measurement: `name` is TOPIC.MEASUREMENT, `measured` the fingerprint of each part of `code` at that time."""

    name: str
    seeds: str
    data: tuple[str, ...]
    code: tuple[str, ...]
    measured: dict[str, str]
    command: str | None = None
    interval: str | None = None
    note: str | None = None

    @property
    def changed(self) -> tuple[str, ...]:
        """The parts of the code that have changed since, in the record's order; a part without a fingerprint counts."""
        return tuple(part for part in self.code if self.measured.get(part) != _now(part))


@cache
def _now(part: str) -> str:
    return fingerprint(part)


def read_records(folder: Path = RESULTS) -> dict[str, Record]:
    """All measurements by name. Raises ValueError with file and key where a file says something else than the above."""
    records = {}
    for path in sorted(folder.glob("*.toml")):
        for name, said in tomllib.loads(path.read_text(encoding="utf-8")).items():
            records[f"{path.stem}.{name}"] = _record(f"{path.stem}.{name}", said, folder=folder)
    return records


def _record(name: str, said: dict[str, Any], *, folder: Path) -> Record:
    missing, unknown = REQUIRED - set(said), set(said) - KNOWN
    if missing or unknown:
        raise ValueError(f"{name}: keys missing: {sorted(missing)}, unknown: {sorted(unknown)}; known are {sorted(KNOWN)}")
    absent = [file for file in said["data"] if not (folder / file).exists()]
    if absent:
        raise ValueError(f"{name}: data {absent}: no such file in {folder.name}/")
    lists = {key: tuple(said[key]) for key in ("data", "code")}
    return Record(name=name, **(said | lists | {"measured": said.get("measured", {})}))


def stamp(names: Iterable[str], *, commit: str | None = None, folder: Path = RESULTS) -> None:
    """Write into the files that these measurements were made with the code as it is, or as it was in a commit.

    A name is that of a measurement, or a topic: all of its measurements. Raises ValueError for an unknown one.
    """
    records = read_records(folder)
    for name in names:
        meant = [record for record in records.values() if name in {record.name, record.name.partition(".")[0]}]
        if not meant:
            raise ValueError(f"{name}: no such measurement; known are {', '.join(records)}")
        for record in meant:
            _write(record, _fingerprints(record.code, commit=commit), folder=folder)


def _fingerprints(parts: Iterable[str], *, commit: str | None) -> dict[str, str]:
    """Of the parts that the commit had."""
    found = {}
    for part in parts:
        with contextlib.suppress(LookupError):
            found[part] = fingerprint(part, commit=commit)
    return found


def _write(record: Record, measured: dict[str, str], *, folder: Path) -> None:
    topic, _, name = record.name.partition(".")
    path = folder / f"{topic}.toml"
    before, header, rest = path.read_text(encoding="utf-8").partition(f"[{name}]\n")
    table, gap, after = rest.partition("\n[")
    kept = re.sub(r"^measured = .*\n?", "", table, flags=re.MULTILINE).rstrip("\n")
    said = ", ".join(f'"{part}" = "{digits}"' for part, digits in measured.items())
    end = "\n" if gap else ""
    path.write_text(f"{before}{header}{kept}\nmeasured = {{ {said} }}\n{end and gap}{after}", encoding="utf-8")
