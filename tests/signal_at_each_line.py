"""A signal at each line of some code in turn, as chance would place it."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from types import FrameType
from typing import Any


class Ended(BaseException):
    """What the handler of the signal raises."""


def interrupted_at_each_line(act: Callable[[], None], *, files: tuple[str, ...]) -> Iterator[int]:
    """Runs `act` again and again; SIGTERM comes at its first line in one of the files, then at its second, and so on.

    Gives the number of the line after each run, until one ends before its signal.
    """

    def stop(_number: int, _frame: FrameType | None) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # as the command line does
        raise Ended

    for at in range(1, 10_000):
        lines = 0

        def trace(frame: FrameType, event: str, _arg: Any, at: int = at) -> Any:
            nonlocal lines
            if not frame.f_code.co_filename.endswith(files):
                return None
            if event == "line":
                lines += 1
                if lines == at:
                    signal.raise_signal(signal.SIGTERM)
            return trace

        before = signal.signal(signal.SIGTERM, stop)
        try:
            with suppress(Ended):
                sys.settrace(trace)
                try:
                    act()
                finally:
                    sys.settrace(None)
        finally:
            signal.signal(signal.SIGTERM, before)
        yield at
        if lines < at:
            return
