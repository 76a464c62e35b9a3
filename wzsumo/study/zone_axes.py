"""Axes that show a work zone, a kilometre long and twenty metres wide, with the stretch of its width stated."""

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from shapely.geometry.base import BaseGeometry

from wzsumo.study.result_folder import ResultFolder

# Okabe and Ito 2008, "Color universal design": eight colours that the colour-blind tell apart.
BLACK, ORANGE, SKY_BLUE, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
GREY = "#D9D9D9"
WIDTH_IN = 10.5
MARGIN_M = (25.0, 1.0)  # shown beyond the zone along and across the road


def new_figure(rows: int, *, row_height: float, head: float = 0.55) -> tuple[Figure, list[Axes]]:
    """A figure of `rows` axes, one below the other, each `row_height` inches high, under a head for titles and legend."""
    gap, foot = 0.72, 0.55
    height = head + rows * row_height + (rows - 1) * gap + foot
    figure = Figure(figsize=(WIDTH_IN, height), dpi=150)
    FigureCanvasAgg(figure)
    bottoms = [foot + (rows - 1 - row) * (row_height + gap) for row in range(rows)]
    axes = [figure.add_axes((0.075, bottom / height, 0.905, row_height / height)) for bottom in bottoms]
    return figure, axes


def show_zone(axes: Axes, run: ResultFolder, *, stretch_of: tuple[float, float] | None = None) -> None:
    """Draw pavement, closed area and devices from the first station to the last [m], by default the whole zone."""
    start, end = stretch_of or (run.span[0] - MARGIN_M[0], run.span[1] + MARGIN_M[0])
    add_area(axes, run.polygons["pavement"], label="open pavement", facecolor="#EDEDED", edgecolor="#777777", linewidth=0.7)
    add_area(axes, run.polygons["closed_area"], label="closed area", facecolor=ORANGE, alpha=0.3, edgecolor="none")
    devices = run.devices
    axes.scatter(devices["x_m"], devices["y_m"], s=5, color=VERMILION, label="device", zorder=5, linewidths=0)
    _, low, _, high = run.polygons["pavement"].union(run.polygons["closed_area"]).bounds
    axes.set(xlim=(start, end), ylim=(low - MARGIN_M[1], high + MARGIN_M[1]))
    state_stretch(axes)


def state_stretch(axes: Axes) -> None:
    """Label the axes with their unit and with how much longer a metre across the road is drawn than one along it."""
    (x_0, x_1), (y_0, y_1) = axes.get_xlim(), axes.get_ylim()
    stretch = (axes.bbox.height / (y_1 - y_0)) / (axes.bbox.width / (x_1 - x_0))
    axes.set(xlabel=f"x [m]  (y is stretched {stretch:.1f} : 1)", ylabel="y [m]")


def add_area(axes: Axes, area: BaseGeometry, *, label: str | None = None, **style: Any) -> None:
    """Fill a polygon or several."""
    rings = [
        Outline(np.asarray(ring.coords), closed=True)
        for part in getattr(area, "geoms", [area])
        if part.geom_type == "Polygon" and not part.is_empty
        for ring in (part.exterior, *part.interiors)
    ]
    if rings:
        axes.add_patch(PathPatch(Outline.make_compound_path(*rings), label=label, **style))


def legend_above(figure: Figure, axes: Axes, *, columns: int = 7) -> None:
    """Put the legend of `axes` at the top of the figure, out of the way of the data."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="upper right", ncols=columns, frameon=False, fontsize=8, borderaxespad=0.3, markerscale=2.5
    )


def thirds(run: ResultFolder) -> list[tuple[float, float]]:
    """Three stretches [m] that cover the zone, so that a decimetre across the road can be seen."""
    edges = np.linspace(run.span[0] - MARGIN_M[0], run.span[1] + MARGIN_M[0], 4)
    return [(float(a), float(b)) for a, b in pairwise(edges)]


def plain(text: str) -> str:
    """The text with the sign escaped that matplotlib takes for mathematics."""
    return text.replace("$", r"\$")
