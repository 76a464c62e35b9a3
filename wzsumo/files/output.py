"""Writes output files completely or not at all: everything is written to a folder of its own, then moved to its place."""

import errno
import io
import os
from collections.abc import Container, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from wzsumo.errors import OutputError, uninterrupted
from wzsumo.files.placing import place, refuse_in_the_way, refuse_kept
from wzsumo.files.work_folder import work_folder

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure

NO_ROOM = {errno.ENOSPC: "the disk is full", errno.EDQUOT: "the quota is used up", errno.EFBIG: "a file would be too large"}


@contextmanager
def staged_folder(out: Path, *, files: Sequence[str] = ()) -> Iterator[Path]:
    """An empty folder to write to. At the end of the block its files move into `out` and replace files of the same name.

    If the block raises or is interrupted, its files are deleted and `out` stays as it is; killed while the files move, the
    next command moves the rest (see `placing`). A link in `out` is replaced, never written through. Raises OutputError where
    `out` cannot be written to, at once where one of `files`, the names that the block will write, cannot be a file there.
    """
    with ExitStack() as at_end:
        at_end.callback(_remove_if_empty, _missing_folders(out))
        with writing_to(out):
            out.mkdir(parents=True, exist_ok=True)
            refuse_in_the_way(out, [(Path(name), False) for name in files])
            stage = at_end.enter_context(work_folder(out.absolute()))  # pandas expands a path that begins with ~
        with writing_to(out, only=NO_ROOM):
            yield stage
        with writing_to(out), uninterrupted():
            place(stage, out)


@contextmanager
def staged_file(path: Path) -> Iterator[Path]:
    """A path to write a file to, which moves to `path` at the end of the block.

    Where the block writes nothing, or raises, `path` stays as it is. Raises OutputError as `staged_folder` does, and where
    `path` is a folder.
    """
    if path.name in {"", ".."} or "\0" in str(path):
        raise OutputError(f"{path}: is no name of a file; name one")
    with writing_to(path):
        refuse_kept(path)
    with staged_folder(path.parent, files=(path.name,)) as stage:
        yield stage / path.name


def write_whole(path: Path, content: bytes) -> None:
    """Write a file atomically: if writing fails or is interrupted, the file stays as it was. Raises OutputError."""
    with staged_file(path) as staged, staged.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())  # the content must be on the disk before the file gets its name


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a drawing as PNG, and beside it as SVG. Pillow's own writing to a file does not say why it fails.

    Text of the SVG stays text, so that it can be searched and set in another font. Both files are the same each time.
    """
    from matplotlib import rc_context

    with rc_context({"svg.fonttype": "none", "svg.hashsalt": path.stem}):
        for suffix, metadata in ((".png", {}), (".svg", {"Date": None})):
            buffer = io.BytesIO()
            figure.savefig(buffer, format=suffix[1:], metadata=metadata)
            path.with_suffix(suffix).write_bytes(buffer.getvalue())


def remove_stamps(folder: Path) -> None:
    """Remove from SUMO's files the comment that says when and with which paths it wrote them: same case, same bytes."""
    for path in folder.glob("*.xml"):
        content = path.read_bytes()
        began, ended = content.find(b"<!-- generated on "), content.find(b"-->") + 3
        if 0 <= began < ended:
            path.write_bytes(content[:began] + content[ended:].lstrip())


def parquet_bytes(table: "pa.Table") -> bytes:
    """The content of a Parquet file of the table, with a checksum on every page."""
    import pyarrow.parquet as pq  # importing it takes longer than planning a path, which does not need it

    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd", write_page_checksum=True)
    return buffer.getvalue()


@contextmanager
def writing_to(out: Path, *, only: Container[int] | None = None) -> Iterator[None]:
    """Raise OutputError where the block cannot write to `out`: at every OSError, or at those with an errno in `only`."""
    try:
        yield
    except (OSError, ValueError) as failed:  # ValueError: a NUL in the name
        number = (failed.errno if isinstance(failed, OSError) else None) or 0
        if only is not None and number not in only:
            raise
        if number in NO_ROOM:
            raise OutputError(f"{out}: {NO_ROOM[number]}; what was there stays: make room and run it again") from None
        reason = failed.strerror if isinstance(failed, OSError) else failed
        raise OutputError(f"{out}: cannot be written to ({reason}); name a folder that you may write to") from None


def refuse_links(out: Path, folders: Iterable[str]) -> None:
    """Raise OutputError where one of the folders in `out` is a link or a file."""
    refuse_in_the_way(out, [(Path(name), True) for name in folders])


def _missing_folders(out: Path) -> list[Path]:
    """The folders that making `out` makes, the innermost first."""
    missing = []
    with suppress(OSError, ValueError):
        for folder in (out, *out.parents):
            if folder.exists():
                break
            missing.append(folder)
    return missing


def _remove_if_empty(folders: list[Path]) -> None:
    with suppress(OSError):  # one holds what was written
        for folder in folders:
            folder.rmdir()
