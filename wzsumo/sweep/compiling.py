"""Telling that kernels are compiled, which takes a minute and happens once on a machine."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

WORDS = "compiling the kernels that this takes; they are kept for later runs (`wzsumo warm` compiles all, in a minute or two)"


@contextmanager
def compiling_told(tell: Callable[[str], None]) -> Iterator[None]:
    """Call `tell` once where a kernel of the package is compiled in the block, which numba's cache does not hold yet."""
    from numba.core import event  # slow to load, and not every command has kernels

    class Listener(event.Listener):  # type: ignore[misc]  # numba has no types
        told = False

        def on_start(self, event: Any) -> None:
            module = event.data["dispatcher"].py_func.__module__
            if not self.told and module.startswith("wzsumo."):
                self.told = True
                tell(WORDS)

        def on_end(self, event: Any) -> None:
            """Nothing is told at the end."""

    with event.install_listener("numba:compile", Listener()):
        yield
