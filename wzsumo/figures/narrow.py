"""The same figure for a narrow screen: as wide as a telephone, its text as large as before, its legend in two columns."""

import io
import math
from typing import Any

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Annotation

from wzsumo.figures.zone_axes import AXES_IN, WIDTH_IN, state_stretch

NARROW_IN, NARROW_AXES_IN = 4.4, (0.72, 4.22)  # width of a figure, left and right end of its axes
DPI = 130
COLUMNS, LEGEND_ROW_IN = 2, 0.19
MAX_TICKS = 4


def narrow_png(figure: Figure) -> bytes:
    """The PNG of a figure, which is narrowed for it. Axes keep their heights; what a legend needs is added above them."""
    width, height = figure.get_size_inches()
    legends = [(legend, _parts(legend)) for legend in figure.legends]
    more_rows = sum(math.ceil(len(names) / COLUMNS) - 1 for _, (_, names) in legends)
    new_height = height + LEGEND_ROW_IN * max(more_rows, 0)
    scale = (NARROW_AXES_IN[1] - NARROW_AXES_IN[0]) / (AXES_IN[1] - AXES_IN[0])
    is_laid_out = figure.get_layout_engine() is not None
    places = [axes.get_position(original=True) for axes in figure.axes]
    figure.set_size_inches(NARROW_IN, new_height)
    for axes, place in zip(figure.axes, places, strict=True):
        if not is_laid_out:
            left = NARROW_AXES_IN[0] + scale * (place.x0 * width - AXES_IN[0] * width / WIDTH_IN)
            bounds = (left, place.y0 * height, scale * place.width * width, place.height * height)
            axes.yaxis.set_label_coords(-0.15, 0.5)
            axes.set_position(tuple(b / size for b, size in zip(bounds, (NARROW_IN, new_height) * 2, strict=True)))
        if "stretched" in axes.get_xlabel():
            state_stretch(axes)
        if axes.get_xscale() == "linear" and not axes.get_xaxis().get_major_formatter().__class__.__name__.startswith("Fixed"):
            axes.locator_params(axis="x", nbins=MAX_TICKS)
        for text in axes.texts:
            if isinstance(text, Annotation) and text.xycoords == ("axes fraction", "data") and text.xy[0] > 1:
                _move_inside(text)  # a name beside the axes
        if (legend := axes.get_legend()) is not None and len(legend.get_texts()) > COLUMNS:
            axes.legend(*_parts(legend), loc="best", ncols=1, fontsize=7, framealpha=0.8)
    for legend, (handles, names) in legends:
        legend.remove()
        corner: Any = "outside upper left" if is_laid_out else "upper left"
        figure.legend(
            handles, names, loc=corner, ncols=COLUMNS, frameon=False, fontsize=8, borderaxespad=0.3, columnspacing=1.0
        )
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def _move_inside(text: Annotation) -> None:
    text.xy = text.xyann = (0.985, text.xy[1])
    text.set(horizontalalignment="right", bbox={"facecolor": "white", "alpha": 0.7, "pad": 0.5, "linewidth": 0})


def _parts(legend: Legend) -> tuple[list[Artist], list[str]]:
    return [handle for handle in legend.legend_handles if handle is not None], [text.get_text() for text in legend.get_texts()]
