"""Writes output files completely or not at all."""

import io
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from wzsumo.errors import OutputError

if TYPE_CHECKING:
    import pyarrow as pa

UNFINISHED = ".unfinished-"  # prefix of a file or folder until it is complete


@contextmanager
def staged_folder(out: Path) -> Iterator[Path]:
    """An empty folder to write to. At the end of the block its files move into `out` and replace files of the same name.

    If the block raises, its files are deleted and `out` stays as it is. Raises OutputError where `out` cannot be written to.
    """
    existed = out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=UNFINISHED, dir=out))
    except OSError as error:
        raise OutputError(
            f"--out {out}: cannot be written to ({error.strerror}); name a folder that you may write to"
        ) from None
    try:
        yield stage
        for path in sorted(stage.rglob("*")):
            target = out / path.relative_to(stage)
            if path.is_dir():
                target.mkdir(exist_ok=True)
            else:
                path.replace(target)
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        if not existed and not any(out.iterdir()):
            out.rmdir()


def write_whole(path: Path, content: bytes) -> None:
    """Write a file atomically: if writing fails or is interrupted, the file stays as it was. Raises OutputError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f"{UNFINISHED}{os.getpid()}-{path.name}")
    try:
        with unfinished.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())  # the content must be on the disk before the file gets its name
        unfinished.replace(path)
    except OSError as error:
        unfinished.unlink(missing_ok=True)
        raise OutputError(
            f"{path}: cannot be written ({error.strerror}); make room there, then run the command again"
        ) from None


def parquet_bytes(table: "pa.Table") -> bytes:
    """The content of a Parquet file of the table, with a checksum on every page."""
    import pyarrow.parquet as pq  # importing it takes longer than planning a path, which does not need it

    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd", write_page_checksum=True)
    return buffer.getvalue()
