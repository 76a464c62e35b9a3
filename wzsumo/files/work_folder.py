"""Folders for work in progress. Each is locked while its process lives; what a killed process left behind, the next removes."""

import fcntl
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from wzsumo.errors import OutputError, uninterrupted
from wzsumo.files.placing import holding, settle

PREFIX = ".wzsumo-unfinished-"
_NAME = re.compile(re.escape(PREFIX) + "[0-9a-f]{16}")


@contextmanager
def work_folder(parent: Path) -> Iterator[Path]:
    """A new folder in `parent`, deleted at the end of the block. Folders that killed processes left there are deleted first.

    What such a process had finished, and was moving to its place, is moved there.

    Raises OSError where none can be made.
    """
    settle(parent)
    remove_leftovers(parent)
    with uninterrupted() as interruptible:
        folder, lock = _locked_folder(parent)
        try:
            with holding(folder), interruptible():
                yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(lock)


@contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """Hold a folder's lock in the block. Raises OutputError where another process of `wzsumo` holds it."""
    lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        take_lock(lock, folder)
        with holding(folder):
            yield
    finally:
        os.close(lock)


def take_lock(lock: int, folder: Path) -> None:
    """Lock an open file or folder, until it is closed, for the writing into `folder`.

    The system releases it however this process ends. Raises OutputError where another process holds it.
    """
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise OutputError(
            f"--out {folder}: another command is writing there; wait for its end or name another folder"
        ) from None
    except OSError:
        pass  # a file system without locks


def remove_leftovers(parent: Path) -> None:
    """Delete the work folders in `parent` whose process has ended, of this user and by their exact name; nothing else."""
    with suppress(OSError), os.scandir(parent) as entries:
        for name in [entry.name for entry in entries if _NAME.fullmatch(entry.name)]:
            _remove_if_left(parent / name)


def _remove_if_left(folder: Path) -> None:
    with suppress(OSError):  # it has just been removed, is locked, or belongs to somebody else
        status = folder.lstat()
        if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.geteuid():
            return
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # the system released it when the process ended
            shutil.rmtree(folder, ignore_errors=True)
        finally:
            os.close(lock)


def _locked_folder(parent: Path) -> tuple[Path, int]:
    """(a new folder, the descriptor that holds its lock). Made again where another process removed it before it was locked."""
    while True:
        folder = parent / f"{PREFIX}{secrets.token_hex(8)}"
        folder.mkdir()
        try:
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        except FileNotFoundError:
            continue
        with suppress(OSError):  # a file system without locks: nobody removes the folder then
            fcntl.flock(lock, fcntl.LOCK_EX)
        if folder.is_dir():
            return folder, lock
        os.close(lock)
