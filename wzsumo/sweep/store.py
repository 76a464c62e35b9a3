"""ResultStore: what a study has finished, in its result folder, where it outlives whatever ends the study.

    study.json               the study and its scenarios in full
    batches/HASH.parquet     results as they came in
    simulations/NAME.HASH.parquet  traces of simulated fleets, to be used again; the oldest go when all are too large
    results.parquet          the table, written anew at each end of a sweep

A file appears whole, and HASH is that of its bytes: one that was cut short or changed is told of, put aside and made again.
"""

import fcntl
import hashlib
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from wzsumo.errors import OutputError
from wzsumo.files.output import UNFINISHED, parquet_bytes, write_whole
from wzsumo.sweep.results import BATCH_SCHEMA
from wzsumo.sweep.study_file import Study, study_of

FORMAT = 1  # of the folder
MANIFEST = "study.json"


class ResultStore:
    """The folder of one study. Made by `open_store`; `tell` is told of what was found damaged."""

    def __init__(self, folder: Path, *, tell: Callable[[str], None], cache_limit_mb: float) -> None:
        self._folder = folder
        self._tell = tell
        self._cache_limit_mb = cache_limit_mb

    def finished(self) -> dict[str, dict[str, Any]]:
        """The rows of all batches by the name of their case."""
        rows: dict[str, dict[str, Any]] = {}
        for path in sorted((self._folder / "batches").glob("*.parquet")):
            if (content := self._intact(path)) is not None:
                rows |= {row["case"]: row for row in pq.read_table(io.BytesIO(content)).to_pylist()}
        return rows

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Keep the rows of finished cases."""
        content = parquet_bytes(pa.Table.from_pylist(list(rows), schema=BATCH_SCHEMA))
        write_whole(self._folder / "batches" / f"{_hash(content)}.parquet", content)

    def simulated(self, simulation: str) -> bytes | None:
        """The file of a simulated fleet, None where it must be simulated."""
        for path in (self._folder / "simulations").glob(f"{simulation}.*.parquet"):
            if (content := self._intact(path)) is not None:
                path.touch()  # the cache drops what was used longest ago
                return content
        return None

    def add_simulated(self, simulation: str, content: bytes) -> None:
        """Keep a simulated fleet, as long as there is room."""
        write_whole(self._folder / "simulations" / f"{simulation}.{_hash(content)}.parquet", content)

    def trim(self, *, keep: set[str]) -> None:
        """Drop the fleets used longest ago, but those in `keep`, until all take no more than the limit."""
        files = sorted((self._folder / "simulations").glob("*.parquet"), key=lambda path: path.stat().st_mtime_ns, reverse=True)
        room = self._cache_limit_mb * 1e6
        for path in files:
            room -= path.stat().st_size
            if room < 0 and path.name.split(".")[0] not in keep:
                path.unlink()

    def _intact(self, path: Path) -> bytes | None:
        content = path.read_bytes()
        if path.name.endswith(f"{_hash(content)}.parquet"):
            return content
        aside = path.with_suffix(".damaged")
        path.replace(aside)
        self._tell(f"{path} is damaged; it is kept as {aside.name}, and what it held is done again")
        return None


@contextmanager
def open_store(folder: Path, study: Study, *, tell: Callable[[str], None], cache_limit_mb: float) -> Iterator[ResultStore]:
    """The store of a study in `folder`, which is made where it is not. One process at a time may have it.

    Raises OutputError where the folder cannot be written to, is in use, or holds something else than this study's results.
    """
    _refuse_foreign(folder, study)
    try:
        for name in ("batches", "simulations"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        lock = (folder / ".lock").open("w")
    except OSError as error:
        raise OutputError(f"--out {folder}: cannot be written to ({error.strerror}); name a folder you may write to") from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # the system opens it again however this process ends
        except BlockingIOError:
            raise OutputError(
                f"--out {folder}: another sweep is writing there; wait for its end or name another folder"
            ) from None
        for leftover in folder.rglob(f"{UNFINISHED}*"):
            leftover.unlink()
        manifest = {"format": FORMAT, "name": study.spec.name, **study.content}
        write_whole(folder / MANIFEST, json.dumps(manifest, indent=1).encode())
        yield ResultStore(folder, tell=tell, cache_limit_mb=cache_limit_mb)


def read_study(folder: Path) -> Study:
    """The study whose results a folder holds. Raises OutputError where it holds none."""
    path = folder / MANIFEST
    if not path.is_file():
        raise OutputError(f"{folder}: holds no {MANIFEST}; name the --out folder of a `wzsumo sweep`")
    return study_of(_manifest(path), source=str(path))


def _refuse_foreign(folder: Path, study: Study) -> None:
    path = folder / MANIFEST
    if not path.exists():
        if folder.is_dir() and (folder / "result.json").exists():
            raise OutputError(f"--out {folder}: holds the result of a `wzsumo run`; name another folder")
        return
    held = _manifest(path)
    if held["name"] != study.spec.name:
        raise OutputError(
            f"--out {folder}: holds the results of the study {held['name']!r}, not of {study.spec.name!r}; name another folder"
        )


def _manifest(path: Path) -> dict[str, Any]:
    try:
        manifest: dict[str, Any] = json.loads(path.read_bytes())
    except ValueError as error:
        raise OutputError(
            f"{path}: damaged ({error}); delete this file, then the sweep goes on with what is finished"
        ) from None
    if manifest.get("format") != FORMAT:
        raise OutputError(
            f"{path}: written by another version of wzsumo (format {manifest.get('format')}, this one reads {FORMAT}); "
            "name another folder, or use that version"
        )
    return manifest


def _hash(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=8).hexdigest()
