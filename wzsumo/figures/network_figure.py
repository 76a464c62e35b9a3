"""The network around a zone as a plain map: by how much the zone changes the time lost on each edge."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, SymLogNorm
from matplotlib.figure import Figure

from wzsumo.figures.zone_axes import BLACK, BLUE, GREY, VERMILION, WIDTH_IN
from wzsumo.files.result_folder import ResultFolder
from wzsumo.frames import FloatArray

MINUTE_S = 60.0
LEAST_CHANGE_MIN = 1.0  # veh min; a smaller change is drawn in grey, on a scale that is linear up to there
HEIGHTS_IN = (2.4, 8.0)  # of the figure, least and greatest
_COLOURS = LinearSegmentedColormap.from_list("delay", [BLUE, GREY, VERMILION])


def draw_network(run: ResultFolder) -> Figure:
    """Every edge of the network by its change of delay [veh min], with the zone less without it; the zone is marked."""
    edges = run.network_edges
    if edges is None:
        raise ValueError(f"{run.folder}: the run was not made in a network")
    lines = [_points(shape) for shape in edges["shape"]]
    change = edges["delay_change_s"].to_numpy() / MINUTE_S
    largest = max(float(np.abs(change).max(initial=0.0)), 2 * LEAST_CHANGE_MIN)
    norm = SymLogNorm(LEAST_CHANGE_MIN, vmin=-largest, vmax=largest)
    widths = 1.0 + 4.0 * np.abs(np.ma.getdata(norm(change)) - 0.5)
    order = np.argsort(np.abs(change), kind="stable")  # the largest changes on top
    low, high = np.vstack(lines).min(axis=0), np.vstack(lines).max(axis=0)
    height = float(np.clip(1.4 + (WIDTH_IN - 2.2) * (high[1] - low[1]) / max(high[0] - low[0], 1.0), *HEIGHTS_IN))
    figure = Figure(figsize=(WIDTH_IN, height), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    drawn = LineCollection(
        [lines[n] for n in order], colors=_COLOURS(norm(change[order])), linewidths=widths[order], capstyle="round"
    )
    axes.add_collection(drawn)
    start, end = run.span
    zone = run.road.to_xy(np.linspace(start, end, 50), 0.0)
    axes.plot(*zone[[0, -1]].T, linestyle="none", marker="|", color=BLACK, markersize=12, label="ends of the zone")
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.autoscale_view()
    axes.margins(0.03, 0.15)
    figure.legend(loc="outside upper right", frameon=False)
    ticks = _ticks(largest)
    bar = figure.colorbar(ScalarMappable(norm=norm, cmap=_COLOURS), ax=axes, shrink=0.9, pad=0.01, ticks=ticks)
    bar.ax.set_yticklabels([f"{tick:+.2g}" if tick else "0" for tick in ticks])
    bar.ax.minorticks_off()
    bar.set_label("change of delay [veh min]")
    return figure


def _ticks(largest: float) -> list[float]:
    """0, the powers of ten to both sides, and the largest change where it is well above them."""
    powers = [10.0**n for n in range(int(np.floor(np.log10(largest))) + 1)]
    marks = [*powers, largest] if largest > 2 * powers[-1] else powers
    return [*(-mark for mark in reversed(marks)), 0.0, *marks]


def _points(shape: str) -> FloatArray:
    """Points (n, 2) [m] of a line that is written as x,y x,y ..."""
    return np.array([[float(value) for value in point.split(",")[:2]] for point in shape.split()])
