"""Traces in the order in which vehicles leave the road: of files, of a growing folder, of standard input."""

import csv
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
import pandas as pd

from wzsumo.errors import TraceError
from wzsumo.files.fixes.tables import table_files
from wzsumo.files.traces import NO_COLUMNS, fixes_from, read_fixes
from wzsumo.frames import FloatArray
from wzsumo.geography import LocalFrame
from wzsumo.tables import check_traces

NEW_TRACE_S = 300.0  # without a fix: a vehicle that comes again is another trace
LEFT_AFTER_S = 60.0  # without a fix while others report: a vehicle of a running stream has left
POLL_S = 1.0
LINES = 2000  # of standard input that are looked at together


@dataclass(frozen=True, kw_only=True, eq=False)
class Arrival:
    """One trace: points (n, 2) [m], times (n,) [s] ascending, length [m] where known; `key` tells it from all others."""

    key: str
    points: FloatArray
    times: FloatArray
    length: float | None

    @property
    def end_s(self) -> float:
        """Time of the last fix."""
        return float(self.times[-1])


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How files are read: names of columns, CRS, and the frame of the map."""

    columns: Mapping[str, str]
    crs: str | None
    frame: LocalFrame | None


AS_THEY_ARE = Reading(columns=NO_COLUMNS, crs=None, frame=None)


def arrivals_of(table: pd.DataFrame, *, source: str) -> list[Arrival]:
    """The traces of a table of fixes by the time of their last fix, then by name. Raises TraceError at a faulty row."""
    traces = check_traces(table, source=source)
    times = traces["time_s"].to_numpy(dtype=float)
    ids = traces["vehicle_id"].to_numpy()
    points = traces[["x_m", "y_m"]].to_numpy(dtype=float)
    lengths = traces["length_m"].to_numpy(dtype=float) if "length_m" in traces else None
    starts = np.flatnonzero(np.r_[True, (ids[1:] != ids[:-1]) | (np.diff(times) > NEW_TRACE_S)])
    ends = np.r_[starts[1:], len(traces)]
    found = [
        Arrival(
            key=f"{ids[a]} {times[a]:.3f}", points=points[a:b], times=times[a:b],
            length=None if lengths is None else float(lengths[a]),
        )
        for a, b in zip(starts, ends, strict=True)
    ]  # fmt: skip
    return sorted(found, key=lambda arrival: (arrival.end_s, arrival.key))


def replayed(files: Sequence[Path], reading: Reading) -> Iterator[Arrival]:
    """The traces of files in order of time. A file is held in memory until no trace of a later one can come before its own."""
    spans = sorted((_first_end(file, reading), str(file), file) for file in files) if len(files) > 1 else [(0.0, "", files[0])]
    held: list[Arrival] = []
    for number, (_, _, file) in enumerate(spans):
        held = sorted([*held, *_of_file(file, reading)], key=lambda arrival: (arrival.end_s, arrival.key))
        until = spans[number + 1][0] if number + 1 < len(spans) else np.inf
        ready = int(np.searchsorted([arrival.end_s for arrival in held], until))
        yield from held[:ready]
        held = held[ready:]


def followed(
    folder: Path, reading: Reading, *, done: Sequence[str], idle_s: float | None, clock: Callable[[], float] = time.monotonic,
    wait: Callable[[float], None] = time.sleep,
) -> Iterator[tuple[str, list[Arrival]]]:  # fmt: skip
    """(name, traces) of each further file of a folder, by name, as soon as its size stays the same from poll to poll.

    Ends where nothing new has come for `idle_s` seconds; None: never.
    """
    seen, sizes, last_news = set(done), dict[str, int](), clock()
    while True:
        try:
            files = table_files(folder)
        except TraceError:
            if not folder.is_dir():
                raise
            files = []
        for file in files:
            name = str(file.relative_to(folder))
            size = file.stat().st_size
            if name in seen:
                continue
            if sizes.get(name) == size:
                yield name, _of_file(file, reading)
                seen.add(name)
                last_news = clock()
            sizes[name] = size
        if idle_s is not None and clock() - last_news > idle_s:
            return
        wait(POLL_S if idle_s is None else min(POLL_S, idle_s / 2))


def streamed(lines: TextIO, reading: Reading) -> Iterator[Arrival]:
    """The traces of separated text with a header, each as soon as its vehicle has left; lines in any order within a minute."""
    waiting: dict[str, list[pd.DataFrame]] = {}
    for raw in _tables(lines):
        table = check_traces(_fixes(raw, reading), source="standard input")
        now = float(table["time_s"].max())
        for vehicle, part in table.groupby("vehicle_id", sort=True):
            waiting.setdefault(str(vehicle), []).append(part)
        gone = [name for name, parts in waiting.items() if now - max(part["time_s"].max() for part in parts) > LEFT_AFTER_S]
        if gone:
            yield from arrivals_of(pd.concat([part for name in gone for part in waiting.pop(name)]), source="standard input")
    if waiting:
        yield from arrivals_of(pd.concat([part for parts in waiting.values() for part in parts]), source="standard input")


def _tables(lines: TextIO) -> Iterator[pd.DataFrame]:
    """Tables of the lines that have come; of text in each column. Raises TraceError at a line that is none."""
    number = 1
    try:
        header = next(csv.reader([lines.readline()]), [])
        if not header:
            raise TraceError("standard input: is empty; give separated text whose first line names the columns")
        while some := [line for _, line in zip(range(LINES), lines, strict=False)]:
            rows = [row for row in csv.reader(some) if row]
            if wrong := next((row for row in rows if len(row) != len(header)), None):
                where = f"one of the lines {number + 1} to {number + len(some)} has {len(wrong)}"
                raise TraceError(f"standard input: {where} columns, the first line {len(header)}; give lines of one table")
            number += len(some)
            if rows:
                yield pd.DataFrame(rows, columns=header)
    except UnicodeDecodeError:
        raise TraceError("standard input: is no text in UTF-8; give separated text") from None
    except csv.Error as error:
        raise TraceError(f"standard input: after line {number}: cannot be read ({error}); give separated text") from None


def _fixes(raw: pd.DataFrame, reading: Reading) -> pd.DataFrame:
    plain = pd.DataFrame({name: _numbers(raw[name]) for name in raw.columns})
    return fixes_from(plain, columns=reading.columns, crs=reading.crs, frame=reading.frame, source="standard input").table


def _numbers(column: pd.Series) -> pd.Series:
    """A column of text as numbers, if all of it is."""
    numbers = pd.to_numeric(column, errors="coerce")
    return column if numbers.isna().any() else numbers


def _of_file(file: Path, reading: Reading) -> list[Arrival]:
    fixes = read_fixes([file], columns=reading.columns, crs=reading.crs, frame=reading.frame)
    if (fixes.frame is None) != (reading.frame is None):
        given = ("metres of no known place", "a place on earth")
        raise TraceError(
            f"{file}: has {given[fixes.frame is not None]}, the map has {given[reading.frame is not None]}: give its kind"
        )
    return arrivals_of(fixes.table, source=str(file))


def _first_end(file: Path, reading: Reading) -> float:
    return min(arrival.end_s for arrival in _of_file(file, reading))
