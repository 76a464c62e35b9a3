"""Traces one after the other through a live map, into its folder."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from wzsumo.errors import TraceError, uninterrupted
from wzsumo.frames import FloatArray
from wzsumo.live.ageing import HALF_LIFE_S
from wzsumo.live.charts.findings import Family
from wzsumo.live.charts.thresholds import calibrated_thresholds
from wzsumo.live.live_map import LiveMap, with_trace
from wzsumo.live.stream.arrivals import Arrival, Reading, followed, replayed, streamed
from wzsumo.live.stream.log_folder import LiveFolder, Position
from wzsumo.live.trace.reading import read_trace

COMMIT_EVERY = 1000  # traces of files, which are read again from the last commit on
STREAM_COMMIT_EVERY = 200  # traces of lines, which do not come again
TOGETHER = 50  # traces of files, taken while signals wait: a twentieth of a second
EVIDENCE_EVERY = 10
KEYS_KEPT = 5000  # of the last traces, among which one that comes twice is known
MAX_OFF_MAP_SHARE = 0.5
OFF_MAP_JUDGED = 20  # traces: from so many on, a stream whose most traces are elsewhere is refused

Tell = Callable[[dict[str, Any]], None]


def replay_files(folder: LiveFolder, files: Sequence[Path], reading: Reading, *, half_life_s: float, tell: Tell) -> None:
    """Take the traces of files that were not read before, in order of time.

    Raises TraceError where the files that the folder was reading when it was stopped are not among them.
    """
    names = {_name(file): file for file in files}
    while True:
        position = folder.position
        if not position.reading:
            position.reading = sorted(name for name in names if name not in position.done)
            position.delivered = 0
        if not position.reading:
            return
        if missing := [name for name in position.reading if name not in names]:
            raise TraceError(
                f"{folder.path}: was stopped while it read {missing[0]}, which is not given or has another size; give it again"
            )
        arrivals = replayed([names[name] for name in position.reading], reading)
        _take_all(folder, _after(arrivals, position.delivered), half_life_s=half_life_s, tell=tell)
        folder.position = Position(done=[*position.done, *position.reading], reading=[], delivered=0)
        folder.commit()


def follow_folder(
    folder: LiveFolder, source: Path, reading: Reading, *, idle_s: float | None, half_life_s: float, tell: Tell
) -> None:
    """Take the traces of a growing folder's files, each as it comes to be whole."""
    for name, arrivals in followed(source, reading, done=folder.position.done, idle_s=idle_s):
        position = folder.position
        delivered = position.delivered if position.reading == [name] else 0
        folder.position = Position(done=position.done, reading=[name], delivered=delivered)
        _take_all(folder, _after(arrivals, delivered), half_life_s=half_life_s, tell=tell)
        folder.position = Position(done=[*position.done, name], reading=[], delivered=0)
        folder.commit()


def follow_stream(folder: LiveFolder, lines: TextIO, reading: Reading, *, half_life_s: float, tell: Tell) -> None:
    """Take the traces of lines as they come; what was taken before is known by its name and time."""
    folder.position = Position(done=folder.position.done, reading=[], delivered=0)
    try:
        arrivals = streamed(lines, reading)
        _take_all(folder, arrivals, half_life_s=half_life_s, tell=tell, commit_every=STREAM_COMMIT_EVERY, together=1)
    finally:
        folder.commit()  # lines do not come again


def evidence_by_cell(live: LiveMap) -> FloatArray:
    """Evidence (m,) at each cell as a share of its threshold."""
    thresholds, error = calibrated_thresholds(), live.error_m
    shape = live.shape.evidence.max(axis=(0, 1, 2)) / thresholds.at(Family.STEP, error)
    closing = live.lanes.closing.max(axis=(0, 1)) / thresholds.at(Family.CLOSING, error)
    ended = live.passing.ended / thresholds.at(Family.ROAD_CLOSED, error)
    row = np.maximum(np.maximum(shape, closing), ended)
    for lane, (start, end) in enumerate(live.ground.closures):
        if start >= 0:
            inside = slice(int(start), int(end) + 1)
            row[inside] = np.maximum(row[inside], live.lanes.opening[lane].max() / thresholds.at(Family.OPENING, error))
            for side, cell in ((0, int(start)), (1, int(end))):
                moved = live.lanes.ends[side, lane].max() / thresholds.at(Family.END_MOVED, error)
                near = slice(max(cell - 4, 0), cell + 5)
                row[near] = np.maximum(row[near], moved)
    return np.asarray(row)


def _after(arrivals: Iterable[Arrival], delivered: int) -> Iterator[Arrival]:
    for number, arrival in enumerate(arrivals):
        if number >= delivered:
            yield arrival


def _take_all(
    folder: LiveFolder, arrivals: Iterable[Arrival], *, half_life_s: float, tell: Tell, commit_every: int = COMMIT_EVERY,
    together: int = TOGETHER,
) -> None:  # fmt: skip
    """Take the traces, so many `together` while signals wait: a trace is taken whole, or not at all."""
    traces = iter(arrivals)
    while some := list(islice(traces, together)):
        with uninterrupted():
            for arrival in some:
                _take(folder, arrival, half_life_s=half_life_s, tell=tell)
                folder.position.delivered += 1
                if folder.position.delivered % commit_every == 0:
                    folder.commit()


def _take(folder: LiveFolder, arrival: Arrival, *, half_life_s: float, tell: Tell) -> None:
    counts, live = folder.counts, folder.live
    if arrival.key in folder.keys:
        counts["twice"] += 1
        return
    folder.keys[arrival.key] = None
    if len(folder.keys) > KEYS_KEPT:
        del folder.keys[next(iter(folder.keys))]
    stations, offsets = live.ground.lanes.axis.to_sd(arrival.points)
    reading = read_trace(live.ground, stations, offsets, arrival.times, length=arrival.length)
    if reading is None:
        counts["off_map"] += 1
        judged = counts["off_map"] + counts["taken"]
        if judged >= OFF_MAP_JUDGED and counts["off_map"] > MAX_OFF_MAP_SHARE * judged:
            raise TraceError(
                f"{counts['off_map']} of {judged} traces are not on the map's road; give the map of this road, and traces that "
                "drive its way"
            )
        return
    counts["late"] += arrival.end_s < live.now_s and live.number > 0
    counts["taken"] += 1
    step = with_trace(live, reading)
    folder.live = step.live
    if step.alarm is not None:
        tell({"alarm": folder.write_alarm(step.alarm)})
    if step.redrawn is not None and step.live.version > live.version:
        lanes = step.live.lanes_now(half_life_s=half_life_s)
        tell({"version": folder.write_version(step.redrawn, alarm=step.alarm, lanes=lanes)})
    if folder.live.number % EVIDENCE_EVERY == 0:
        folder.write_evidence(evidence_by_cell(folder.live))


def _name(file: Path) -> str:
    """A file by its name and size: one that grew is another."""
    return f"{file.name} {file.stat().st_size}"


__all__ = ["HALF_LIFE_S", "evidence_by_cell", "follow_folder", "follow_stream", "replay_files"]
