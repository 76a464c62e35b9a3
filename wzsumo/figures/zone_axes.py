"""Axes that show a work zone in road coordinates. A zone is long and narrow, so the offset is drawn to a larger scale."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from shapely.geometry.base import BaseGeometry

from wzsumo.figures.lane_lines import lane_lines
from wzsumo.figures.road_coordinates import area_in_road_coordinates, cells_in_road_coordinates
from wzsumo.files.result_folder import ResultFolder
from wzsumo.grid import OccupancyGrid

# Okabe and Ito 2008, "Color universal design": eight colours that the colour-blind can tell apart.
BLACK, ORANGE, SKY_BLUE, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
GREY = "#D9D9D9"
WIDTH_IN, AXES_IN = 10.5, (0.7875, 10.29)  # width of a figure, left and right end of its axes
MAP_PIXELS = (1500, 400)  # of a map's image, along and across the road: at least the figure's own resolution
MARGIN_M = (25.0, 1.0)  # shown around the zone, along and across the road
# Colour, width and dashes of the lines on the pavement. They lie above maps, so that a map is seen lane by lane.
LINE_STYLES = {"edge": ("#666666", 0.8, "-"), "lane": ("#666666", 0.8, (0, (7, 5))), "centre": ("#9A7400", 1.6, "-")}
LINES_ABOVE = 4
LEAST_DRIVEN_M = 2.4  # a narrower rest of a lane in a taper has no arrow; 8 ft, the narrowest of MUTCD 6N.05


def new_figure(rows: int, *, row_height: float, head: float = 0.55) -> tuple[Figure, list[Axes]]:
    """A figure of `rows` axes, each `row_height` inches high, below a head of `head` inches for title and legend."""
    return stacked_figure([row_height] * rows, gaps=[0.72] * (rows - 1), head=head)


def stacked_figure(heights: list[float], *, gaps: list[float], head: float) -> tuple[Figure, list[Axes]]:
    """A figure of axes with these heights and gaps between them [inches], below a head of `head` inches for the legend."""
    foot = 0.55
    height = head + sum(heights) + sum(gaps) + foot
    figure = Figure(figsize=(WIDTH_IN, height), dpi=150)
    FigureCanvasAgg(figure)
    tops = height - head - np.cumsum([0.0, *(a + gap for a, gap in zip(heights[:-1], gaps, strict=True))])
    left, width = AXES_IN[0] / WIDTH_IN, (AXES_IN[1] - AXES_IN[0]) / WIDTH_IN
    axes = [
        figure.add_axes((left, float(top - own) / height, width, own / height)) for top, own in zip(tops, heights, strict=True)
    ]
    return figure, axes


def show_zone(axes: Axes, run: ResultFolder, *, interval: tuple[float, float] | None = None) -> None:
    """Draw pavement, closed area and devices within an interval of stations [m]; without one the whole zone."""
    start, end = interval or (run.span[0] - MARGIN_M[0], run.span[1] + MARGIN_M[0])
    road = run.road
    pavement, closed = (area_in_road_coordinates(run.polygons[name], road) for name in ("pavement", "closed_area"))
    add_area(axes, pavement, label="open pavement", facecolor="#EDEDED", edgecolor="#777777", linewidth=0.7)
    show_lane_lines(axes, run)
    add_area(axes, closed, label="closed area", facecolor=ORANGE, alpha=0.3, edgecolor="none")
    show_devices(axes, run.devices)
    axes.set(xlim=(start, end), ylim=(-road.right_shoulder - MARGIN_M[1], road.left_edge + MARGIN_M[1]))
    state_stretch(axes)
    show_directions(axes, run)


def show_lane_lines(axes: Axes, run: ResultFolder) -> None:
    """Draw edge lines, broken lane lines and double centre lines, as drivers see them."""
    found = lane_lines(run)
    for kind, (colour, width, style) in LINE_STYLES.items():
        lines = [np.column_stack([line.stations, line.offsets]) for line in found if line.kind == kind]
        label = f"{kind} line" if lines and kind != "edge" else None
        drawn = LineCollection(lines, colors=colour, linewidths=width, linestyles=[style], label=label, zorder=LINES_ABOVE)
        axes.add_collection(drawn, autolim=False)
    for each in run.stop_lines:
        ends = [each["right_m"], each["left_m"]]
        axes.add_line(Line2D([each["s_m"]] * 2, ends, color="#222222", linewidth=2.5, zorder=LINES_ABOVE))


def show_directions(axes: Axes, run: ResultFolder) -> None:
    """Draw an arrow in every lane at the left end of the axes, which points the way that the lane is driven."""
    start, end = axes.get_xlim()
    at, half = start + 0.022 * (end - start), 0.011 * (end - start)
    for lane in run.lanes:
        if lane.start <= at < lane.end and lane.left(at) - lane.right(at) > LEAST_DRIVEN_M:
            middle = float(lane.right(at) + lane.left(at)) / 2
            tail, head = (at + half, at - half) if lane.opposing else (at - half, at + half)
            axes.annotate(
                "", (head, middle), (tail, middle), zorder=6, annotation_clip=False,
                arrowprops={"arrowstyle": "-|>", "color": "#333333", "linewidth": 1, "shrinkA": 0, "shrinkB": 0},
            )  # fmt: skip


def show_devices(axes: Axes, devices: pd.DataFrame) -> None:
    """Draw each device as a dot, and each piece of barrier as a line along it."""
    pieces = devices["length_m"].to_numpy(dtype=float) > 0
    dots, walls = devices[~pieces], devices[pieces]
    axes.scatter(dots["s_m"], dots["d_m"], s=5, color=VERMILION, label="device", zorder=5, linewidths=0)
    if len(walls):
        ends = [(s - length / 2, s + length / 2) for s, length in walls[["s_m", "length_m"]].to_numpy()]
        lines = [[(a, d), (b, d)] for (a, b), d in zip(ends, walls["d_m"], strict=True)]
        axes.add_collection(LineCollection(lines, colors=VERMILION, linewidths=2, label="barrier", zorder=5), autolim=False)


def show_cells(axes: Axes, run: ResultFolder, values: npt.NDArray[Any], grid: OccupancyGrid, **style: Any) -> None:
    """Draw the values of a grid's cells within the limits of the axes; each pixel shows the cell in which it lies."""
    limits = axes.get_xlim(), axes.get_ylim()
    edges = [np.linspace(*limit, n + 1) for limit, n in zip(limits, MAP_PIXELS, strict=True)]
    stations, offsets = ((edge[1:] + edge[:-1]) / 2 for edge in edges)
    image = cells_in_road_coordinates(values, grid, run.road, stations=stations, offsets=offsets)
    axes.imshow(
        image, origin="lower", extent=(*limits[0], *limits[1]), aspect="auto", interpolation="nearest", zorder=3, **style
    )
    axes.set(xlim=limits[0], ylim=limits[1])


def state_stretch(axes: Axes) -> None:
    """Label the axes with their units and with the ratio of the scale across the road to the scale along it."""
    (x_0, x_1), (y_0, y_1) = axes.get_xlim(), axes.get_ylim()
    stretch = (axes.bbox.height / (y_1 - y_0)) / (axes.bbox.width / (x_1 - x_0))
    axes.set(xlabel=f"station [m]  (the offset is stretched {stretch:.1f} : 1)", ylabel="offset [m]")


def add_area(axes: Axes, area: BaseGeometry, *, label: str | None = None, **style: Any) -> None:
    """Draw a polygon or several, with their holes."""
    rings = [
        Outline(np.asarray(ring.coords), closed=True)
        for part in getattr(area, "geoms", [area])
        if part.geom_type == "Polygon" and not part.is_empty
        for ring in (part.exterior, *part.interiors)
    ]
    if rings:
        axes.add_patch(PathPatch(Outline.make_compound_path(*rings), label=label, **style))


def legend_above(figure: Figure, axes: Axes, *, columns: int = 8) -> None:
    """Put the legend of `axes` at the top of the figure, above the data."""
    handles, labels = axes.get_legend_handles_labels()
    place_legend(figure, handles, labels, columns=columns)


def place_legend(figure: Figure, handles: Sequence[Artist], labels: Sequence[str], *, columns: int = 8) -> None:
    """Put a legend at the top of the figure, above the data, in rows of `columns`."""
    figure.legend(
        handles, labels, loc="upper right", ncols=columns, frameon=False, fontsize=8, borderaxespad=0.3, markerscale=2.5,
        columnspacing=1.3, handlelength=1.8,
    )  # fmt: skip


def thirds(run: ResultFolder) -> list[tuple[float, float]]:
    """Three intervals of stations [m] that cover the zone, short enough that a decimetre across the road is visible."""
    edges = np.linspace(run.span[0] - MARGIN_M[0], run.span[1] + MARGIN_M[0], 4)
    return [(float(a), float(b)) for a, b in pairwise(edges)]


def plain(text: str) -> str:
    """The text with its dollar signs escaped, which matplotlib would read as mathematics."""
    return text.replace("$", r"\$")
