"""Drawings of a live map: the lanes at its first and its present version, and evidence over space and time."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wzsumo.figures.zone_axes import GREY, VERMILION
from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap

MAX_ROWS = 600  # of the image: of more, the loudest of some are shown


def lanes_before_and_now(before: LaneMap, now: LaneMap) -> Figure:
    """Both maps in road coordinates, offsets stretched: P(open) as shade, lines in grey."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 1, sharex=True, sharey=True)
    for ax, lanes, title in zip(axes, (before, now), ("map that it began with", "map now"), strict=True):
        mesh = _draw_lanes(ax, lanes)
        ax.set_ylabel("offset [m]")
        ax.set_title(title, loc="left", fontsize=10)
    axes[1].set_xlabel("station [m]")
    figure.colorbar(mesh, ax=list(axes), label="P(open)")
    return figure


def evidence_over_time(
    cells: FloatArray, numbers: FloatArray, shares: FloatArray, alarms: Sequence[Mapping[str, Any]]
) -> Figure:
    """Evidence at cells (m,) after traces (k,) as shares (k, m) of the threshold; alarms as bars over their stretch."""
    figure = Figure(figsize=(11, 5), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    fold = max(1, -(-len(numbers) // MAX_ROWS))
    kept = len(numbers) // fold * fold
    image = shares[:kept].reshape(-1, fold, shares.shape[1]).max(axis=1)
    half = (cells[1] - cells[0]) / 2
    extent = (cells[0] - half, cells[-1] + half, numbers[0], numbers[-1])
    mesh = ax.imshow(
        image, origin="lower", aspect="auto", extent=extent, cmap="magma_r", vmin=0, vmax=1, interpolation="nearest"
    )
    for alarm in alarms:
        if alarm["start_m"] is not None:
            ax.plot(
                [alarm["start_m"], max(alarm["end_m"], alarm["start_m"] + 20)], [alarm["trace"]] * 2, color=VERMILION, lw=2.5
            )
            ax.plot([alarm["start_m"]] * 2, [alarm["trace"] - alarm["n_traces"], alarm["trace"]], color=GREY, lw=1)
        else:
            ax.axhline(alarm["trace"], color=VERMILION, lw=1, ls=":")
    ax.set_xlabel("station [m]")
    ax.set_ylabel("trace")
    figure.colorbar(mesh, ax=ax, label="evidence, share of the threshold")
    return figure


def _draw_lanes(ax: Axes, lanes: LaneMap) -> Any:
    mesh = None
    for lane in lanes.lanes:
        strips = lane.p_open.shape[1]
        share = np.linspace(0, 1, strips + 1)[:, None]
        offsets = lane.right + share * (lane.left - lane.right)
        shade = (lane.p_open[:-1] + lane.p_open[1:]).T / 2
        mesh = ax.pcolormesh(np.tile(lanes.stations, (strips + 1, 1)), offsets, shade, cmap="RdYlGn", vmin=0, vmax=1)
        ax.plot(lanes.stations, lane.right, color=GREY, lw=0.8)
        ax.plot(lanes.stations, lane.left, color=GREY, lw=0.8)
    for branch in lanes.branches:
        s, d = lanes.axis.to_sd(branch.line)
        ax.plot(s, d, color=GREY, lw=2, alpha=max(branch.p_open, 0.15))
    low = min(float(lane.right.min()) for lane in lanes.lanes) - 4
    high = max(float(lane.left.max()) for lane in lanes.lanes) + 4
    ax.set_ylim(low, high)
    return mesh
