"""The standard streams of a command: closed ones, and those that lie on a full disk."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from wzsumo.errors import OutputError


def open_standard_streams() -> None:
    """Open what the caller has closed of standard input, output and errors, to nowhere.

    Else a file of the command would get the number of one of them, and what a library prints would go into it.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if number == 0 else os.O_WRONLY)  # the least number that is free
    for name, number, mode in (("stdin", 0, "r"), ("stdout", 1, "w"), ("stderr", 2, "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, closefd=False))


@contextmanager
def printing() -> Iterator[None]:
    """Raise OutputError where what the block prints cannot be written; a pipe that nobody reads is told by itself."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as failed:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is still to be flushed at the end
        why = failed.strerror or failed
        raise OutputError(
            f"standard output: cannot be written to ({why}); what was to be printed is lost, files are whole"
        ) from None


def write_to_stderr(line: str) -> None:
    """Write a line on the way; a full disk that stderr goes to does not end the command."""
    try:
        sys.stderr.write(line)
        sys.stderr.flush()
    except BrokenPipeError:
        raise
    except OSError:
        pass
