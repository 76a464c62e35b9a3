"""The folder of a live map: versions, alarms, evidence over time, and the state from which it goes on after a kill.

What is appended between two states counts only once the next state is written. A run that begins again cuts the logs to what
its state knows, and repeats the rest to the same bytes; so no trace is lost and none counts twice.
"""

import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from wzsumo.errors import MapError, OutputError, reading
from wzsumo.feeds.publication import FeedDetails, published_zone
from wzsumo.files.lanes import LanesFile, lanes_geojson, read_lanes, time_text
from wzsumo.files.output import parquet_bytes, refuse_links, write_whole, writing_to
from wzsumo.files.work_folder import PREFIX, only_writer, remove_leftovers
from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap
from wzsumo.live.alarms import Alarm, Change
from wzsumo.live.live_map import LiveMap, live_map
from wzsumo.live.stream.state_file import read_state, state_bytes

STATE, ALARMS, VERSIONS, EVIDENCE, FOLDER = "state.zip", "alarms.jsonl", "versions.jsonl", "evidence.f4", "versions"
LOGS = (ALARMS, VERSIONS, EVIDENCE)
COUNTS = ("taken", "twice", "late", "off_map")
FIRST = f"{1:06d}"  # name of the first version's folder
LANES, VERSION = "lanes.parquet", "version.json"
OF_A_VERSION = (LANES, "lanes.geojson", "wzdx.geojson", VERSION)
DAY_S = 86_400.0


@dataclass(kw_only=True)
class Position:
    """How far the input was read: names and sizes of finished files, and of those being read how many traces were delivered."""

    done: list[str]
    reading: list[str]
    delivered: int


@dataclass(kw_only=True)
class LiveFolder:
    """An open folder: the live map as it stands, the position in its input, the last keys, counts, and the log's sizes."""

    path: Path
    live: LiveMap
    frame: Any
    utc: bool
    position: Position
    keys: dict[str, None]
    counts: dict[str, int]

    def write_version(self, change: Change | None, *, alarm: Alarm | None, lanes: LaneMap) -> dict[str, Any]:
        """Write the files of the live map's version, and its line in the log; that line."""
        number = self.live.version
        folder = self.path / FOLDER / f"{number:06d}"
        content = LanesFile(lanes=lanes, frame=self.frame, utc=self.utc)
        files = {
            LANES: parquet_bytes(lanes_table(lanes)),
            "lanes.geojson": (json.dumps(lanes_geojson(content)) + "\n").encode(),
        }
        feed = _feed(content)
        if feed is not None:
            files["wzdx.geojson"] = (json.dumps(feed, indent=1) + "\n").encode()
        for name, written in files.items():
            write_whole(folder / name, written)
        line = {
            "version": number, "trace": self.live.number, "at_s": self.live.now_s,
            "why": "the map that it began with" if change is None else change.words, "by_alarm": alarm is not None,
            "sha256": {name: hashlib.sha256(written).hexdigest() for name, written in files.items()},
        }  # fmt: skip
        write_whole(folder / VERSION, (json.dumps(line) + "\n").encode())
        self._append(VERSIONS, (json.dumps(line) + "\n").encode())
        return line

    def write_alarm(self, alarm: Alarm) -> dict[str, Any]:
        """Append an alarm to the log; its line."""
        line = alarm.as_json() | {"version": self.live.version}
        self._append(ALARMS, (json.dumps(line) + "\n").encode())
        return line

    def write_evidence(self, row: FloatArray) -> None:
        """Append the evidence by cell after a trace: its number, its time, and shares of the threshold (m,)."""
        head = np.array([self.live.number, self.live.now_s], dtype="<f8").view("<f4")
        self._append(EVIDENCE, np.concatenate([head, row.astype("<f4")]).tobytes())

    def commit(self) -> None:
        """Write the state: what was appended before counts from now on."""
        sizes = {}
        for name in LOGS:
            with writing_to(self.path), (self.path / name).open("ab") as log:
                log.flush()
                os.fsync(log.fileno())
                sizes[name] = log.tell()
        position = self.position
        about = {
            "sizes": sizes, "done": position.done, "reading": position.reading, "delivered": position.delivered,
            "keys": list(self.keys), "counts": self.counts, "utc": self.utc,
            "frame": None if self.frame is None else self.frame.as_json(),
        }  # fmt: skip
        write_whole(self.path / STATE, state_bytes(self.live, about))

    def _append(self, name: str, content: bytes) -> None:
        with writing_to(self.path), (self.path / name).open("ab") as log:
            log.write(content)


@contextmanager
def open_folder(path: Path, map_path: Path) -> Iterator[LiveFolder]:
    """The folder of a live map, as it was left, or new and begun with a map. Only one process at a time can open it.

    Raises OutputError where the folder cannot be written to, is in use, or holds files of others under the names that are
    written here; MapError where it holds another map's state, or a file of it is damaged.
    """
    content = read_lanes(map_path)
    first = parquet_bytes(lanes_table(content.lanes))
    with writing_to(path):
        path.mkdir(parents=True, exist_ok=True)
    refuse_links(path, (FOLDER,))
    for name in LOGS:
        if (path / name).is_symlink() or (path / name).is_dir():
            raise OutputError(f"--out {path / name}: is no plain file; name another folder")
    with only_writer(path):
        remove_leftovers(path)
        if (path / STATE).exists():
            with reading(path, error=MapError, remedy="restore it, or replay into a new folder"):
                folder = _as_it_was_left(path, content, started=hashlib.sha256(first).hexdigest(), map_path=map_path)
        else:
            folder = _begun(path, content)
        yield folder


def _begun(path: Path, content: LanesFile) -> LiveFolder:
    _remove_unbegun(path)
    folder = LiveFolder(
        path=path, live=live_map(content.lanes), frame=content.frame, utc=content.utc,
        position=Position(done=[], reading=[], delivered=0), keys={}, counts=dict.fromkeys(COUNTS, 0),
    )  # fmt: skip
    folder.write_version(None, alarm=None, lanes=content.lanes)
    folder.commit()
    return folder


def _remove_unbegun(path: Path) -> None:
    """Remove what a command left that was killed before its first state. Raises OutputError where there is anything else."""
    versions = sorted(path.glob(f"{FOLDER}/*"))
    names = {file.name for folder in versions for file in folder.glob("*") if not file.name.startswith(PREFIX)}
    held = (path / VERSIONS).read_bytes() if (path / VERSIONS).is_file() else b""
    others = [name for name in (ALARMS, EVIDENCE) if (path / name).is_file() and (path / name).stat().st_size]
    others += [VERSIONS] if held.count(b"\n") > 1 or (held and b'"sha256"' not in held) else []
    others += [FOLDER] if [each.name for each in versions] not in ([], [FIRST]) or not names <= set(OF_A_VERSION) else []
    if others:
        raise OutputError(
            f"--out {path}: holds {others[0]}, but no {STATE} of a live map; name another folder, or move {others[0]} away"
        )
    for name in LOGS:
        (path / name).unlink(missing_ok=True)
    shutil.rmtree(path / FOLDER, ignore_errors=True)


def _as_it_was_left(path: Path, content: LanesFile, *, started: str, map_path: Path) -> LiveFolder:
    live, about = read_state((path / STATE).read_bytes(), source=str(path / STATE))
    for name in LOGS:
        _cut(path / name, int(about["sizes"][name]))
    _check_versions(path, started=started, map_path=map_path, last=live.version)
    position = Position(done=list(about["done"]), reading=list(about["reading"]), delivered=int(about["delivered"]))
    counts = {name: int(about["counts"][name]) for name in COUNTS}
    return LiveFolder(
        path=path, live=live, frame=content.frame, utc=content.utc, position=position, keys=dict.fromkeys(about["keys"]),
        counts=counts,
    )  # fmt: skip


def lanes_table(lanes: LaneMap) -> pa.Table:
    """One row a lane and station: its lines, their deviations, and P(open) at its middle."""
    n = len(lanes.stations)
    columns: dict[str, Any] = {
        "lane": np.repeat(np.arange(len(lanes.lanes)), n), "station_m": np.tile(lanes.stations, len(lanes.lanes))
    }  # fmt: skip
    for name in ("right", "left", "right_sd", "left_sd"):
        columns[f"{name}_m"] = np.concatenate([getattr(lane, name) for lane in lanes.lanes])
    columns["p_open"] = np.concatenate([lane.p_open_middle for lane in lanes.lanes])
    return pa.table(columns)


def read_evidence(path: Path, n_cells: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(trace numbers (k,), times (k,) [s], shares of the threshold (k, m)) of a folder's log."""
    rows = np.fromfile(path / EVIDENCE, dtype="<f4").reshape(-1, n_cells + 4)
    head = np.ascontiguousarray(rows[:, :4]).view("<f8")
    return head[:, 0], head[:, 1], rows[:, 4:].astype(float)


def _feed(content: LanesFile) -> dict[str, Any] | None:
    """The WZDx feed of a version; None where the map has no place on earth, no dates, or no zone."""
    if content.frame is None or not content.utc:
        return None
    lanes = content.lanes
    details = FeedDetails(
        publisher="unknown", road_name="unknown", direction=None, start_date=time_text(lanes.first_time_s),
        end_date=time_text(lanes.last_time_s + DAY_S),
    )  # fmt: skip
    try:
        return published_zone(lanes, content.frame, details)
    except MapError:
        return None


def _cut(path: Path, size: int) -> None:
    held = path.stat().st_size if path.exists() else 0
    if held < size or size < 0:
        raise MapError(f"{path}: is cut off ({held} of {size} bytes); restore it, or replay into a new folder")
    if held > size:
        with path.open("r+b") as log:
            log.truncate(size)


def _check_versions(path: Path, *, started: str, map_path: Path, last: int) -> None:
    lines = (path / VERSIONS).read_text(encoding="utf-8").splitlines()
    if json.loads(lines[0])["sha256"][LANES] != started:
        raise MapError(f"{path}: was begun with another map than {map_path}; name that map, or another folder")
    for line in lines:
        of_line = json.loads(line)
        folder = path / FOLDER / f"{of_line['version']:06d}"
        hashes = of_line["sha256"] | {VERSION: hashlib.sha256(f"{line}\n".encode()).hexdigest()}
        for file in (folder / name for name in hashes):
            if not file.is_file() or hashlib.sha256(file.read_bytes()).hexdigest() != hashes[file.name]:
                raise MapError(f"{file}: is missing or cut off; restore it, or replay into a new folder")
    for number in range(last + 1, last + 1 + len(list((path / FOLDER).iterdir()))):
        shutil.rmtree(path / FOLDER / f"{number:06d}", ignore_errors=True)
