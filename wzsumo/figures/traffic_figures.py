"""The space-time diagram of the traffic: mean speed over time and station."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wzsumo.figures.zone_axes import BLACK, VERMILION, new_figure, plain
from wzsumo.files.result_folder import ResultFolder


def draw_space_time(run: ResultFolder, cells: pd.DataFrame) -> Figure:
    """Space-mean speed of `cells` over time and station, all lanes together, with the names of the zone's areas.

    A cross marks where the traffic locked.
    """
    figure, (axes,) = new_figure(1, row_height=4.2, head=0.3)
    speed = cells.pivot_table(index="station_m", columns="time_s", values="speed_mps", dropna=False)
    times, stations = _edges(speed.columns.to_numpy(dtype=float)), _edges(speed.index.to_numpy(dtype=float))
    # cividis: uniform in lightness, and the colour-blind see it alike (Nunez, Anderton and Renslow 2018).
    mesh = axes.pcolormesh(times, stations, np.ma.masked_invalid(speed.to_numpy()), cmap="cividis", vmin=0, rasterized=True)
    axes.set_facecolor("white")
    bottom, height = axes.get_position().y0, axes.get_position().height
    axes.set_position((0.075, bottom, 0.715, height))  # leaves room for the names of areas and the scale of speeds
    figure.colorbar(mesh, cax=figure.add_axes((0.925, bottom, 0.015, height)), label="speed [m/s]")
    for name, start, end in run.areas:
        axes.axhline(start, color=BLACK, linewidth=0.6, linestyle=":")
        axes.annotate(
            plain(name),
            (1.01, (start + end) / 2),
            xycoords=("axes fraction", "data"),
            va="center",
            fontsize=8,
            annotation_clip=False,
        )
    axes.axhline(run.span[1], color=BLACK, linewidth=0.6, linestyle=":")
    traffic = run.result.get("traffic") or {}
    if traffic.get("locked_s") is not None:
        axes.plot(traffic["locked_s"], traffic["locked_station_m"], "x", color=VERMILION, markersize=10, markeredgewidth=2.5)
        axes.annotate(
            "locked", (traffic["locked_s"], traffic["locked_station_m"]), xytext=(8, -4), textcoords="offset points",
            color=VERMILION, weight="bold",
        )  # fmt: skip
    axes.set(xlabel="time [s]", ylabel="station [m], traffic moves up", xlim=times[[0, -1]], ylim=stations[[0, -1]])
    return figure


def _edges(starts: np.ndarray) -> np.ndarray:
    """Edges (n + 1,) of cells of one size from their starts (n,)."""
    return np.append(starts, 2 * starts[-1] - starts[-2])
