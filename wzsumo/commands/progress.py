"""The progress bar of a long step on a terminal."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tqdm import tqdm


@contextmanager
def progress_bar(name: str, total: float) -> Iterator[Any]:
    """A progress bar on stderr; it gives a function that is called with the amount done, of `total`."""
    with tqdm(total=total, desc=f"{name:<24}", bar_format="{desc}{percentage:3.0f} %|{bar:30}| {elapsed}<{remaining}") as bar:

        def tell(done: float) -> None:
            bar.update(min(done, total) - bar.n)

        yield tell
