"""ResultStore: the result folder of a study. It keeps what is finished, even where the sweep is killed.

    study.json               the study and its scenarios in full
    batches/HASH.parquet     rows of finished cases, one file per task
    simulations/NAME.HASH.parquet  traces of simulated fleets, which later cases use; the oldest are deleted above a size limit
    results.parquet          the table, written again at the end of each sweep

Every file is written completely or not at all. HASH is the hash of its bytes: a file that does not match it is reported,
renamed, and what it held is computed again.
"""

import hashlib
import io
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from wzsumo.errors import OutputError, reading
from wzsumo.files.output import parquet_bytes, refuse_links, write_whole
from wzsumo.files.work_folder import remove_leftovers, take_lock
from wzsumo.sweep.results import BATCH_SCHEMA
from wzsumo.sweep.study_file import Study, study_of

DAMAGED_MANIFEST = "delete this file, then the sweep goes on with what is finished"
FORMAT = 1  # version of the folder's layout
MANIFEST = "study.json"
OWN_HASH = "[0-9a-f]" * 16  # in the names of files, as `_hash` makes it
FOLDERS = ("batches", "simulations")


class ResultStore:
    """The folder of one study. `open_store` makes it; `tell` is called with a message for each damaged file."""

    def __init__(self, folder: Path, *, tell: Callable[[str], None], cache_limit_mb: float) -> None:
        self._folder = folder
        self._tell = tell
        self._cache_limit_mb = cache_limit_mb

    def finished(self) -> dict[str, dict[str, Any]]:
        """The rows of all finished cases, by the name of the case."""
        rows: dict[str, dict[str, Any]] = {}
        for path in sorted((self._folder / "batches").glob(f"{OWN_HASH}.parquet")):
            if (content := self._read_intact(path)) is not None:
                rows |= {row["case"]: row for row in pq.read_table(io.BytesIO(content)).to_pylist()}
        return rows

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Keep the rows of finished cases."""
        content = parquet_bytes(pa.Table.from_pylist(list(rows), schema=BATCH_SCHEMA))
        write_whole(self._folder / "batches" / f"{_hash(content)}.parquet", content)

    def simulated(self, simulation: str) -> bytes | None:
        """The content of a simulated fleet's file, None where the fleet must be simulated."""
        for path in (self._folder / "simulations").glob(f"{simulation}.{OWN_HASH}.parquet"):
            if (content := self._read_intact(path)) is not None:
                path.touch()  # `trim` deletes the files that were used longest ago
                return content
        return None

    def add_simulated(self, simulation: str, content: bytes) -> None:
        """Keep a simulated fleet until `trim` needs its room."""
        write_whole(self._folder / "simulations" / f"{simulation}.{_hash(content)}.parquet", content)

    def trim(self, *, keep: set[str]) -> None:
        """Delete fleets that are not in `keep`, those used longest ago first, until all together are within the size limit."""
        own = (self._folder / "simulations").glob(f"*.{OWN_HASH}.parquet")  # and nobody else's
        files = sorted(own, key=lambda path: path.stat().st_mtime_ns, reverse=True)
        room = self._cache_limit_mb * 1e6
        for path in files:
            room -= path.stat().st_size
            if room < 0 and path.name.split(".")[0] not in keep:
                path.unlink()

    def _read_intact(self, path: Path) -> bytes | None:
        """The content of a file; None, after renaming it, where it does not match the hash in its name."""
        content = path.read_bytes() if path.is_file() else b""
        if path.name.endswith(f"{_hash(content)}.parquet"):
            return content
        renamed = path.with_suffix(".damaged")
        path.replace(renamed)
        self._tell(f"{path} is damaged; it is kept as {renamed.name}, and what it held is done again")
        return None


@contextmanager
def open_store(folder: Path, study: Study, *, tell: Callable[[str], None], cache_limit_mb: float) -> Iterator[ResultStore]:
    """The store of a study in `folder`, which is made if it does not exist. Only one process at a time can open it.

    Raises OutputError where the folder cannot be written to, is in use, or holds anything but this study's results.
    """
    _refuse_foreign(folder, study)
    try:
        refuse_links(folder, FOLDERS)
        for name in FOLDERS:
            (folder / name).mkdir(parents=True, exist_ok=True)
        lock = os.fdopen(os.open(folder / ".lock", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666), "w")
    except OSError as error:
        raise OutputError(f"--out {folder}: cannot be written to ({error.strerror}); name a folder you may write to") from None
    with lock:
        take_lock(lock.fileno(), folder)
        for place in (folder, *(folder / name for name in FOLDERS)):
            remove_leftovers(place)
        manifest = {"format": FORMAT, "name": study.spec.name, **study.content}
        write_whole(folder / MANIFEST, json.dumps(manifest, indent=1).encode())
        yield ResultStore(folder, tell=tell, cache_limit_mb=cache_limit_mb)


def read_study(folder: Path) -> Study:
    """The study whose results a folder holds. Raises OutputError where it holds none."""
    path = folder / MANIFEST
    if not path.is_file():
        raise OutputError(f"{folder}: holds no {MANIFEST}; name the --out folder of a `wzsumo sweep`")
    manifest = _manifest(path)
    with reading(path, error=OutputError, remedy=DAMAGED_MANIFEST):
        return study_of(manifest, source=str(path))


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
    with reading(path, error=OutputError, remedy=DAMAGED_MANIFEST):
        manifest: dict[str, Any] = json.loads(path.read_bytes())
    if not isinstance(manifest, dict) or not {"name", "study", "scenarios"} <= manifest.keys():
        raise OutputError(f"{path}: damaged (no study in it); {DAMAGED_MANIFEST}")
    if manifest.get("format") != FORMAT:
        raise OutputError(
            f"{path}: written by another version of wzsumo (format {manifest.get('format')}, this one reads {FORMAT}); "
            "name another folder, or use that version"
        )
    return manifest


def _hash(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=8).hexdigest()
