"""The commands of the command line, one module per command, and the progress bar of their long steps."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def progress_bar(name: str, total: float) -> Iterator[Any]:
    """A progress bar on stderr; it gives a function that is called with the amount done, of `total`."""
    from tqdm import tqdm  # slow to load, and most commands show none

    with tqdm(total=total, desc=f"{name:<24}", bar_format="{desc}{percentage:3.0f} %|{bar:30}| {elapsed}<{remaining}") as bar:

        def tell(done: float) -> None:
            bar.update(min(done, total) - bar.n)

        yield tell
