"""Drawings with their captions, saved as image files."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from wzsumo.figures.narrow import narrow_png
from wzsumo.files.output import save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure  # slow to load, and not every report is written with figures


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """A figure that a report is to have: the name of its file without the suffix, what draws it, its title and caption.

    `section` is that of the page in which it stands. `draw_narrow` draws it for a narrow screen, where its words need
    another layout there.
    """

    stem: str
    draw: "Callable[[], Figure]"
    title: str
    caption: str
    section: str = ""
    draw_narrow: "Callable[[], Figure] | None" = None


@dataclass(frozen=True, kw_only=True)
class ReportFigure:
    """An image file with its title and caption, and the section of the page in which it stands.

    `narrow` is the PNG of the same figure for a narrow screen; None where it is shown as it is there too.
    """

    path: Path
    title: str
    caption: str
    section: str
    narrow: bytes | None = None


def save_drawings(drawings: Iterable[Drawing], folder: Path) -> list[ReportFigure]:
    """The figures of the drawings, drawn and saved to a folder as PNG and SVG."""
    saved = []
    for drawing in drawings:
        path = folder / f"{drawing.stem}.png"
        figure = drawing.draw()
        save_figure(figure, path)
        narrow = narrow_png(drawing.draw_narrow() if drawing.draw_narrow else figure)
        words = {"title": drawing.title, "caption": drawing.caption, "section": drawing.section}
        saved.append(ReportFigure(path=path, narrow=narrow, **words))
    return saved
