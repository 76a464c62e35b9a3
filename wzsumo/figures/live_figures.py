"""Drawings of a live map: the lanes at its first and its present version, and evidence over space and time."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from wzsumo.figures.zone_axes import BLACK, BLUE, GREY, LINE_STYLES, VERMILION
from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap

MAX_ROWS = 600  # of the image: of more, the loudest of some are shown
LEAST_ALARM_M = 20.0  # length at which an alarm at a point is drawn
# Closed, not known, open: two hues that the colour-blind can tell apart, and grey between them.
P_OPEN = LinearSegmentedColormap.from_list("p_open", [VERMILION, GREY, BLUE])


def lanes_before_and_now(before: LaneMap, now: LaneMap) -> Figure:
    """Both maps in road coordinates, offsets stretched: P(open) as colour, lane lines as drivers see them."""
    figure = Figure(figsize=(10.5, 4.6), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 1, sharex=True, sharey=True)
    for ax, lanes, title in zip(axes, (before, now), ("map that it began with", "map now"), strict=True):
        mesh = _draw_lanes(ax, lanes)
        ax.set_ylabel("offset [m]")
        ax.set_title(title, loc="left", fontsize=10)
    axes[1].set_xlabel("station [m], traffic moves to the right")
    bar = figure.colorbar(mesh, ax=list(axes), ticks=[0, 0.5, 1], pad=0.01)
    bar.ax.set_yticklabels(["0\nclosed", "0.5\nnot known", "1\nopen"])
    bar.set_label("P(open)")
    return figure


def evidence_over_time(
    cells: FloatArray, numbers: FloatArray, shares: FloatArray, alarms: Sequence[Mapping[str, Any]]
) -> Figure:
    """Evidence at cells (m,) after traces (k,) as shares (k, m) of the threshold; alarms as bars over their stretch."""
    figure = Figure(figsize=(10.5, 5), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    fold = max(1, -(-len(numbers) // MAX_ROWS))
    kept = len(numbers) // fold * fold
    image = shares[:kept].reshape(-1, fold, shares.shape[1]).max(axis=1)
    half = (cells[1] - cells[0]) / 2
    extent = (cells[0] - half, cells[-1] + half, numbers[0], numbers[-1])
    # One hue from light to dark, on which the alarms are seen.
    mesh = ax.imshow(image, origin="lower", aspect="auto", extent=extent, cmap="Blues", vmin=0, vmax=1, interpolation="nearest")
    for alarm in alarms:
        if alarm["start_m"] is not None:
            end = max(alarm["end_m"], alarm["start_m"] + LEAST_ALARM_M)
            ax.plot([alarm["start_m"], end], [alarm["trace"]] * 2, color=VERMILION, lw=3)
            ax.plot([alarm["start_m"]] * 2, [alarm["trace"] - alarm["n_traces"], alarm["trace"]], color=BLACK, lw=1)
        else:
            ax.axhline(alarm["trace"], color=VERMILION, lw=1, ls=":")
    ax.set_xlabel("station [m], traffic moves to the right")
    ax.set_ylabel("traces so far")
    if alarms:
        words = ((VERMILION, 3, "-", "alarm, over its stretch"), (VERMILION, 1, ":", "alarm without a place"),
                 (BLACK, 1, "-", "traces that spoke for it"))  # fmt: skip
        handles = [Line2D([], [], color=colour, lw=width, ls=style, label=text) for colour, width, style, text in words]
        figure.legend(handles=handles, loc="outside upper right", ncols=3, frameon=False, fontsize=9)
    figure.colorbar(mesh, ax=ax, label="evidence for a change, share of the threshold", pad=0.01)
    return figure


def _draw_lanes(ax: Axes, lanes: LaneMap) -> Any:
    mesh = None
    for index, lane in enumerate(lanes.lanes):
        strips = lane.p_open.shape[1]
        share = np.linspace(0, 1, strips + 1)[:, None]
        offsets = lane.right + share * (lane.left - lane.right)
        shade = (lane.p_open[:-1] + lane.p_open[1:]).T / 2
        mesh = ax.pcolormesh(
            np.tile(lanes.stations, (strips + 1, 1)), offsets, shade, cmap=P_OPEN, vmin=0, vmax=1, rasterized=True
        )
        for offset, kind in ((lane.right, "lane" if index else "edge"), (lane.left, "edge")):
            if kind == "lane" or offset is lane.right or index == len(lanes.lanes) - 1:
                _, width, style = LINE_STYLES[kind]
                ax.plot(lanes.stations, offset, color=BLACK, linewidth=width, linestyle=style)
    for branch in lanes.branches:
        s, d = lanes.axis.to_sd(branch.line)
        ax.plot(s, d, color=BLACK, lw=2, alpha=max(branch.p_open, 0.15))
    low = min(float(lane.right.min()) for lane in lanes.lanes) - 1.5
    high = max(float(lane.left.max()) for lane in lanes.lanes) + 1.5
    ax.set_ylim(low, high)
    ax.set_xlim(float(lanes.stations[0]), float(lanes.stations[-1]))
    return mesh
