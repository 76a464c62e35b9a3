"""Figures with their captions as files."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure  # slow to load, and not every report is written with figures


@dataclass(frozen=True, kw_only=True)
class ReportFigure:
    """An image file, its title and what its caption says."""

    path: Path
    title: str
    caption: str


def write_planned(figures: "Iterable[tuple[str, Callable[[], Figure], str, str]]", folder: Path) -> list[ReportFigure]:
    """Figures, given as (name of the file, what draws it, title, caption), drawn and written to a folder as PNG."""
    written = []
    for stem, draw, title, caption in figures:
        path = folder / f"{stem}.png"
        draw().savefig(path)
        written.append(ReportFigure(path=path, title=title, caption=caption))
    return written
