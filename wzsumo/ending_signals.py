"""Signals that end a program, and blocks that they do not cut in two."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from types import FrameType
from typing import Any

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def uninterrupted() -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Hold back what signals that end a program do until the end of the block.

    The block gets a function: in `with interruptible():` signals act as before, those that were held back at once. So what
    was made before it is known to whoever cleans up after it, and cleaning up is not cut short.
    """
    if threading.current_thread() is not threading.main_thread():  # signals act in the main thread alone
        yield nullcontext
        return
    came: list[int] = []
    before: dict[int, Any] = {}

    def note(number: int, _frame: FrameType | None) -> None:
        came.append(number)

    def hold() -> None:
        for number in ENDING_SIGNALS:
            before[number] = signal.signal(number, note)

    def release() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)
        first = came[:1]
        came.clear()
        for number in first:
            signal.raise_signal(number)

    @contextmanager
    def interruptible() -> Iterator[None]:
        release()
        try:
            yield
        finally:
            hold()

    hold()
    try:
        yield interruptible
    finally:
        release()
