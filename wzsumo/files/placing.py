"""Puts the files of a finished result in their place, all or none: the next command mends what a kill left.

A finished stage gets another name first, in one step. From then on its files are the result: who is killed while they move
leaves that name, and the next command that reads the folder or writes to it moves the rest.
"""

import fcntl
import filecmp
import os
import re
import shutil
import stat
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from wzsumo.errors import OutputError

FINISHED = ".wzsumo-finished-"
_NAME = re.compile(re.escape(FINISHED) + "[0-9a-f]{16}")
_PATIENCE_S = 5.0  # for another process that moves files at the moment
_kept: ContextVar[frozenset[Path]] = ContextVar("kept", default=frozenset())
_held: set[Path] = set()  # folders whose lock this process has


@contextmanager
def keeping(paths: Iterable[Path]) -> Iterator[None]:
    """In the block no other content is written over these files: they are what a command reads."""
    token = _kept.set(frozenset(path.resolve() for path in paths if path.is_file()))
    try:
        yield
    finally:
        _kept.reset(token)


def refuse_kept(path: Path) -> None:
    """Raise OutputError where the path is that of a file to be kept."""
    if _kept.get() and path.resolve() in _kept.get():
        raise OutputError(f"{path}: is an input of this command; name another file or folder to write to")


def place(stage: Path, out: Path) -> None:
    """Move everything in `stage` to its place in `out`. Raises OutputError, and moves nothing, where a place is taken."""
    found = _content(stage)
    refuse_in_the_way(out, [(name, is_folder) for _, name, is_folder in found])
    for path, name, is_folder in found:
        if not is_folder and not ((out / name).is_file() and filecmp.cmp(path, out / name, shallow=False)):
            refuse_kept(out / name)
    finished = out.absolute() / f"{FINISHED}{stage.name[-16:]}"
    with _only_mover(out):  # files of two results that move at once would mix
        stage.rename(finished)
        _move(finished, out)


def settle(folder: Path) -> None:
    """Move what a killed command left of a finished result in `folder` to its place. Raises OutputError where it cannot be."""
    with suppress(OSError), os.scandir(folder) as entries:
        for name in sorted(entry.name for entry in entries if _NAME.fullmatch(entry.name)):
            _settle_one(folder / name, folder)


def refuse_in_the_way(out: Path, places: Iterable[tuple[Path, bool]]) -> None:
    """Raise OutputError where a folder is where a file goes, or a file or a link where a folder goes; (place, is a folder)."""
    for place, is_folder in places:
        folders = [*reversed(place.parents)][1:] + [place] * is_folder
        for folder in folders:
            target = out / folder
            if target.is_symlink() or (target.exists() and not target.is_dir()):
                what = "a link" if target.is_symlink() else "a file"
                raise OutputError(f"{target}: is {what} where a folder goes; move it away or name another folder")
        target = out / place
        if not is_folder and target.is_dir() and not target.is_symlink():
            raise OutputError(f"{target}: is a folder where a file goes; move it away or name another folder")


@contextmanager
def holding(folder: Path) -> Iterator[None]:
    """In the block this process, which has the folder's lock, may move files there."""
    held = folder.resolve()
    _held.add(held)
    try:
        yield
    finally:
        _held.discard(held)


@contextmanager
def _only_mover(out: Path) -> Iterator[None]:
    """Hold the folder's lock in the block. Raises OutputError where another command keeps it."""
    if out.resolve() in _held:
        yield
        return
    lock = os.open(out, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            _wait_for(lock)
        except BlockingIOError:
            raise OutputError(f"{out}: another command is writing there; wait for its end or name another folder") from None
        yield
    finally:
        os.close(lock)


def _content(stage: Path) -> list[tuple[Path, Path, bool]]:
    """(path, path within the stage, whether it is a folder) of everything in it, folders before what is in them."""
    return [(path, path.relative_to(stage), path.is_dir() and not path.is_symlink()) for path in sorted(stage.rglob("*"))]


def _move(finished: Path, out: Path) -> None:
    for path, name, is_folder in _content(finished):
        if is_folder:
            (out / name).mkdir(exist_ok=True)
        else:
            with suppress(FileNotFoundError):  # where there are no locks another process may have moved it
                path.replace(out / name)
    shutil.rmtree(finished, ignore_errors=True)


def _settle_one(finished: Path, out: Path) -> None:
    try:
        status = finished.lstat()
        if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.geteuid():
            return
        lock = os.open(finished, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except FileNotFoundError:  # its process has just moved the last of it
        return
    try:
        _wait_for(lock)
        refuse_in_the_way(out, [(name, is_folder) for _, name, is_folder in _content(finished)])
        _move(finished, out)
    except OSError as failed:
        raise OutputError(
            f"{out}: a command was killed while it put its result there, and the rest cannot be moved ({failed.strerror}); "
            "run it again"
        ) from None
    finally:
        os.close(lock)


def _wait_for(lock: int) -> None:
    """Take the lock of a finished stage. Raises BlockingIOError where its process holds it for long."""
    until = time.monotonic() + _PATIENCE_S
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > until:
                raise
            time.sleep(0.01)
        except OSError:  # a file system without locks
            return
        else:
            return
