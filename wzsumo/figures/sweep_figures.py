"""The figures of a study. Points are means over seeds; bars are their 95 % bootstrap intervals."""

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wzsumo.figures.figure_files import Drawing, ReportFigure, save_drawings
from wzsumo.figures.zone_axes import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY_BLUE, VERMILION, plain
from wzsumo.sweep.results import column_of
from wzsumo.sweep.summary import REQUIRED_SAFE_SHARE, TRACES_FACTOR, summarise, traces_needed

SERIES = ((BLUE, "o"), (VERMILION, "s"), (GREEN, "^"), (PURPLE, "D"), (ORANGE, "v"), (SKY_BLUE, "P"))  # Okabe & Ito 2008
NAMES = {
    "safe_plan": "share of safe plans",
    "iou": "IoU of the map",
    "precision": "precision of the map",
    "recall": "recall of the map",
    TRACES_FACTOR: "traces used",
    "gnss.error_m": "GNSS error [m]",
    "crowd.penetration": "share of equipped vehicles",
    "simulation.demand.flow_vph": "flow [veh/h]",
    "simulation.demand.truck_share": "share of trucks",
    "gnss.sampling_interval_s": "time between fixes [s]",
    "slam.scene.faults.missing_share": "share of devices missing",
    "slam.scene.faults.tilted_share": "share of devices tilted",
    "slam.scene.faults.lying_share": "share of devices lying",
}
WIDTH_IN = 10.5


def write_sweep_figures(table: pd.DataFrame, folder: Path) -> list[ReportFigure]:
    """The figures that suit the factors of the study, written to `folder` as PNG."""
    folder.mkdir(parents=True, exist_ok=True)
    numeric = [name for name in table.attrs["factors"] if name != "seed" and pd.api.types.is_numeric_dtype(table[name])]
    seeds = f"n = {table['seed'].nunique()} seeds."
    drawings: list[Drawing] = []
    along = TRACES_FACTOR if TRACES_FACTOR in numeric else next(iter(numeric), None)
    others = [name for name in numeric if name != along]
    series = "gnss.error_m" if "gnss.error_m" in others else next(iter(others), None)
    if along:
        drawings.append(
            Drawing(
                stem="quality",
                draw=partial(draw_quality, table, along=along, series=series),
                title=f"Map quality and safe plans over {name_of(along)}",
                caption=f"Mean and 95 % interval. {seeds}",
            )
        )
    if TRACES_FACTOR in numeric and {"crowd.penetration", "simulation.demand.flow_vph"} & set(numeric):
        caption = (
            "Mean time from the first vehicle that leaves the zone to the one whose trace completes the number needed. "
            "A number of traces is enough where it and every larger one in the study give a safe plan in "
            f"{REQUIRED_SAFE_SHARE:.0%} of the cases. A cross at the top: no number is enough, or its traces come after "
            f"the end of the simulation. {seeds}"
        )
        drawings.append(
            Drawing(stem="minutes", draw=partial(draw_minutes, table), title="Minutes until enough traces", caption=caption)
        )
    if table["method"].nunique() > 1:
        caption = f"Over all factors. {seeds}"
        draw = partial(draw_methods, table)
        drawings.append(Drawing(stem="methods", draw=draw, title="Methods side by side", caption=caption))
    if along and series:
        caption = (
            "Share of cases with a safe plan: the outline on the planned path touches no device, no pavement edge and not the "
            f"closed area. {seeds}"
        )
        draw = partial(draw_outcome, table, along=along, across=series)
        drawings.append(Drawing(stem="outcome", draw=draw, title="Safe plans over two factors", caption=caption))
    return save_drawings(drawings, folder)


def draw_quality(table: pd.DataFrame, *, along: str, series: str | None) -> Figure:
    """IoU and share of safe plans over the factor `along`: one panel per method, one line per value of `series`."""
    methods = list(dict.fromkeys(table["method"]))
    measures = ("iou", "safe_plan")
    figure, axes = _panels(len(measures), len(methods))
    for row, measure in enumerate(measures):
        for column, method in enumerate(methods):
            lines = summarise(table[table["method"] == method], measure, by=[*([series] if series else []), along])
            for number, (label, line) in enumerate(_lines_by(lines, series)):
                _draw_line(axes[row, column], line, along, number, label=label, levels=lines[along])
            axes[row, column].set_ylim(0, 1.03)
            axes[row, column].set_title(plain(method), fontsize=10, loc="left")
        axes[row, 0].set_ylabel(NAMES[measure])
    for bottom in axes[-1]:
        bottom.set_xlabel(plain(name_of(along)))
    axes[0, -1].legend(title=plain(name_of(series)) if series else None, frameon=False, fontsize=9, loc="lower right")
    return figure


def draw_minutes(table: pd.DataFrame) -> Figure:
    """Minutes until enough traces are collected over the penetration rate: one panel per method, one line per flow."""
    flow, penetration = "simulation.demand.flow_vph", "crowd.penetration"
    factors = table.attrs["factors"]
    along, series = (penetration, flow if flow in factors else None) if penetration in factors else (flow, None)
    errors = "gnss.error_m" if "gnss.error_m" in factors else None
    by = ["method", *([errors] if errors else []), *([series] if series else []), along]
    needed = traces_needed(table, by=by)
    parts = [
        (method if errors is None else f"{method}, GNSS error {label} m", part)
        for method in dict.fromkeys(needed["method"])
        for label, part in _lines_by(needed[needed["method"] == method], errors)
    ]
    figure, axes = _panels(1, len(parts), height=3.2)
    top = 1.15 * np.nanmax([1.0, *needed["minutes"].dropna()])
    for panel, (title, part) in zip(axes[0], parts, strict=True):
        for number, (label, line) in enumerate(_lines_by(part, series)):
            colour, marker = SERIES[number % len(SERIES)]
            places = _places(line[along], number, levels=needed[along])
            panel.plot(places, line["minutes"], color=colour, marker=marker, label=label)
            never = line["minutes"].isna().to_numpy()
            panel.plot(
                places[never], np.full(never.sum(), 0.95 * top), color=colour, marker="x", linestyle="none", markersize=9
            )
            for x, (_, point) in zip(places, line.iterrows(), strict=True):
                if np.isfinite(point["minutes"]):
                    panel.annotate(
                        f"{point['traces']:g}", (x, point["minutes"]), (4, 4), textcoords="offset points", fontsize=8
                    )
        _show_levels(panel, needed[along])
        panel.set(ylim=(0, top), xlabel=plain(name_of(along)))
        panel.set_title(plain(title), fontsize=10, loc="left")
    axes[0, 0].set_ylabel("minutes (figures: traces needed)")
    axes[0, -1].legend(title=plain(name_of(series)) if series else None, frameon=False, fontsize=9, loc="center right")
    return figure


def draw_methods(table: pd.DataFrame) -> Figure:
    """Map quality and share of safe plans of every method, one method per row."""
    measures = ("precision", "recall", "iou", "safe_plan")
    figure, axes = _panels(1, len(measures), height=0.6 + 0.42 * table["method"].nunique())
    for panel, measure in zip(axes[0], measures, strict=True):
        summary = summarise(table, measure, by=["method"])
        places = np.arange(len(summary))[::-1]
        spread = np.abs(summary[["low", "high"]].to_numpy().T - summary["mean"].to_numpy())
        panel.errorbar(summary["mean"], places, xerr=spread, fmt="o", color=BLUE, ecolor=BLACK, capsize=3)
        panel.set(xlim=(-0.03, 1.03), ylim=(-0.6, len(summary) - 0.4), xlabel=NAMES[measure].replace(" of the map", ""))
        panel.set_yticks(places, [plain(name) for name in summary["method"]] if panel is axes[0, 0] else [""] * len(summary))
        panel.grid(axis="x", color="#DDDDDD", linewidth=0.6)
    return figure


def draw_outcome(table: pd.DataFrame, *, along: str, across: str) -> Figure:
    """Share of safe plans over two factors: one panel per method, with the share and n in every cell."""
    methods = list(dict.fromkeys(table["method"]))
    figure, axes = _panels(1, len(methods), height=0.9 + 0.55 * table[across].nunique())
    for panel, method in zip(axes[0], methods, strict=True):
        cells = summarise(table[table["method"] == method], "safe_plan", by=[across, along])
        shares = cells.pivot(index=across, columns=along, values="mean")
        counts = cells.pivot(index=across, columns=along, values="n").fillna(0).to_numpy()
        panel.imshow(shares, cmap="cividis", vmin=0, vmax=1, origin="lower", aspect="auto")
        for (row, column), share in np.ndenumerate(shares.to_numpy()):
            text = f"{share:.2f}\nn = {counts[row, column]:.0f}" if np.isfinite(share) else "none"
            panel.annotate(text, (column, row), ha="center", va="center", fontsize=8, color="white" if share < 0.6 else BLACK)
        panel.set_xticks(range(shares.shape[1]), _texts(shares.columns))
        panel.set_yticks(range(shares.shape[0]), _texts(shares.index))
        panel.set(xlabel=plain(name_of(along)))
        panel.set_title(plain(method), fontsize=10, loc="left")
    axes[0, 0].set_ylabel(plain(name_of(across)))
    return figure


def name_of(factor: str) -> str:
    """The name of a factor in a figure, with its unit."""
    unit = column_of(factor).unit
    return NAMES.get(factor, f"{factor} [{unit}]" if unit not in {"", "1"} else factor)


def _lines_by(frame: pd.DataFrame, series: str | None) -> list[tuple[str, pd.DataFrame]]:
    """The rows of each value of the factor `series`, with the value as text; all rows where there is no such factor."""
    if series is None:
        return [("all cases", frame)]
    levels = np.sort(frame[series].unique())
    return [(text, frame[frame[series] == value]) for text, value in zip(_texts(levels), levels, strict=True)]


def _texts(levels: Iterable[Any]) -> list[str]:
    return [f"{value:g}" for value in levels]


def _panels(rows: int, columns: int, *, height: float = 2.6) -> tuple[Figure, np.ndarray]:
    figure = Figure(figsize=(WIDTH_IN, 0.5 + rows * height), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False)


def _draw_line(panel: Axes, line: pd.DataFrame, along: str, number: int, *, label: str, levels: pd.Series) -> None:
    colour, marker = SERIES[number % len(SERIES)]
    spread = np.abs(line[["low", "high"]].to_numpy().T - line["mean"].to_numpy())
    places = _places(line[along], number, levels=levels)
    panel.errorbar(places, line["mean"], yerr=spread, color=colour, marker=marker, markersize=5, capsize=3, label=label)
    _show_levels(panel, levels)
    panel.grid(axis="y", color="#DDDDDD", linewidth=0.6)


def _places(values: pd.Series, number: int, *, levels: pd.Series) -> np.ndarray:
    """Places of factor values: evenly spaced, since levels are often 1, 2, 5, 10, and shifted by line against overlap."""
    order = np.sort(levels.unique())
    return np.searchsorted(order, values.to_numpy()) + 0.06 * number


def _show_levels(panel: Axes, levels: pd.Series) -> None:
    order = np.sort(levels.unique())
    panel.set_xticks(range(len(order)), _texts(order))
    panel.set_xlim(-0.4, len(order) - 0.4)
