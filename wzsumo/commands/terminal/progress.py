"""What a command says on stderr while it works: bars on a terminal, plain lines in a log, nothing where it is to be quiet."""

import argparse
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from wzsumo.case.watch import Progress, Tell, quiet_progress
from wzsumo.commands.terminal.streams import write_to_stderr
from wzsumo.errors import one_line
from wzsumo.sweep.compiling import compiling_told

LINE_DELAY_S, LINE_INTERVAL_S = 2.0, 10.0  # a log tells of a step from so long on, and so often


def say(args: argparse.Namespace, line: str) -> None:
    """Print a line, unless the command is to be quiet."""
    if not args.quiet:
        write_to_stderr(f"{one_line(line)}\n")


def progress_of(args: argparse.Namespace) -> Progress:
    """How the command shows the progress of its steps."""
    if args.quiet:
        return quiet_progress
    return _bar if sys.stderr.isatty() else _lines


@contextmanager
def _bar(name: str, total: float) -> Iterator[Tell]:
    from tqdm import tqdm  # slow to load, and most commands show none

    with tqdm(total=total, desc=f"{name:<24}", bar_format="{desc}{percentage:3.0f} %|{bar:30}| {elapsed}<{remaining}") as bar:

        def tell(done: float) -> None:
            bar.update(min(done, total) - bar.n)

        yield tell


@contextmanager
def _lines(name: str, total: float) -> Iterator[Tell]:
    began = time.monotonic()
    next_line = began + LINE_DELAY_S

    def tell(done: float) -> None:
        nonlocal next_line
        now, share = time.monotonic(), done / total if total else 1.0
        if now >= next_line and 0.01 <= share < 1:
            next_line = now + LINE_INTERVAL_S
            write_to_stderr(f"{name}: {100 * share:.0f} %\n")

    yield tell
    took = time.monotonic() - began
    if took > LINE_DELAY_S:
        write_to_stderr(f"{name}: done in {took:.0f} s\n")


@contextmanager
def telling_of_compiling(args: argparse.Namespace) -> Iterator[None]:
    """Say once that kernels are compiled, where numba's cache does not hold them yet."""
    if args.quiet or "numba" not in sys.modules:  # a command without kernels
        yield
        return
    with compiling_told(lambda line: say(args, line)):
        yield
