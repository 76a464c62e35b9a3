"""Watch: how a case shows its progress while it runs, and the time that its steps took."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from typing import Protocol

Tell = Callable[[float], None]  # called with how far a step has come


class Progress(Protocol):
    """Shows how far a long step has come."""

    def __call__(self, name: str, total: float) -> AbstractContextManager[Tell]:
        """A context manager that gives a function; the step calls it with how far it has come, in the unit of `total`."""


@contextmanager
def quiet_progress(name: str, total: float) -> Iterator[Tell]:  # noqa: ARG001 - the names of a Progress
    """A Progress that shows nothing."""
    yield lambda _done: None


@dataclass(frozen=True, kw_only=True, eq=False)
class Watch:
    """How a case shows its progress. `seconds` holds the wall-clock time of each timed step, in the order of the steps."""

    progress: Progress = quiet_progress
    in_window: bool = False  # whether each drive is shown in sumo-gui
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def timing(self, name: str) -> Iterator[None]:
        """Time the block as the step `name`."""
        began = time.perf_counter()
        yield
        self.seconds[name] = round(time.perf_counter() - began, 3)
