"""The figures of a study. Points are means over seeds; bars are their 95 % intervals."""

from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from wzsumo.errors import count_of
from wzsumo.figures.figure_files import Drawing, ReportFigure, save_drawings
from wzsumo.figures.zone_axes import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY_BLUE, VERMILION, plain
from wzsumo.sweep.results import column_of
from wzsumo.sweep.summary import REQUIRED_SAFE_SHARE, TRACES_FACTOR, summarise, traces_needed

SERIES = ((BLUE, "o"), (VERMILION, "s"), (GREEN, "^"), (PURPLE, "D"), (ORANGE, "v"), (SKY_BLUE, "P"))  # Okabe & Ito 2008
NAMES = {
    "scenario": "scenario",
    "clean": "share of clean drives",
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
WIDTH_IN, HEAD_IN = 10.5, 0.55  # of a figure, and of what stands above its axes
MINUTES_FACTORS = ("crowd.penetration", "simulation.demand.flow_vph")


def factors_of(table: pd.DataFrame) -> list[str]:
    """What a study varies beside seed and method: its factors, and the scenario where there are several."""
    named = [name for name in table.attrs.get("factors", []) if name != "seed"]
    return ["scenario"] * (table["scenario"].nunique() > 1) + [name for name in named if table[name].nunique() > 1]


def write_sweep_figures(table: pd.DataFrame, folder: Path) -> list[ReportFigure]:
    """A figure for every factor, and those that suit several, written to `folder` as PNG and SVG."""
    folder.mkdir(parents=True, exist_ok=True)
    factors, seeds = factors_of(table), f"n = {count_of(table['seed'].nunique(), 'seed')}."
    numeric = [name for name in factors if pd.api.types.is_numeric_dtype(table[name])]
    in_order = sorted(factors, key=lambda name: name != TRACES_FACTOR)  # the study's question first
    drawings = [_factor_drawing(table, factor, factors, seeds=seeds) for factor in in_order]
    if TRACES_FACTOR in numeric and set(MINUTES_FACTORS) & set(numeric):
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
        caption = f"Means and 95 % intervals, pooled over {_names(factors) or 'nothing'}. {seeds}"
        draw = partial(draw_methods, table)
        drawings.append(Drawing(stem="methods", draw=draw, title="Methods side by side", caption=caption))
    along = TRACES_FACTOR if TRACES_FACTOR in numeric else next(iter(numeric), None)
    across = _series_of(along, factors) if along else None
    if along and across:
        rest = _names(name for name in factors if name not in {along, across})
        caption = f"Share of cases with a safe plan{f', pooled over {rest}' if rest else ''}; n counts seeds."
        draw = partial(draw_outcome, table, along=along, across=across)
        title = f"Safe plans over {name_of(along)} and {name_of(across)}"
        drawings.append(Drawing(stem="outcome", draw=draw, title=title, caption=caption))
    return save_drawings(drawings, folder)


def _factor_drawing(table: pd.DataFrame, factor: str, factors: Sequence[str], *, seeds: str) -> Drawing:
    series = _series_of(factor, factors)
    rest = _names(name for name in factors if name not in {factor, series})
    pooled = f" Pooled over {rest}." if rest else ""
    stem = "quality" if factor == TRACES_FACTOR else f"quality_{factor.replace('.', '_')}"
    return Drawing(
        stem=stem,
        draw=partial(draw_quality, table, along=factor, series=series),
        title=f"Map quality and outcome over {name_of(factor)}",
        caption="Means over seeds; bars are 95 % intervals: bootstrap for the IoU, Clopper and Pearson's for shares, with a "
        f"seed as one draw.{pooled} {seeds}",
    )


def _series_of(along: str, factors: Sequence[str]) -> str | None:
    """The factor that a line stands for: the GNSS error where there is one, else the traces, else any other."""
    others = [name for name in factors if name != along]
    return next((name for name in ("gnss.error_m", TRACES_FACTOR) if name in others), next(iter(others), None))


def draw_quality(table: pd.DataFrame, *, along: str, series: str | None) -> Figure:
    """IoU and shares over the factor `along`: one panel per method, one line per value of `series`."""
    methods = list(dict.fromkeys(table["method"]))
    measures = [name for name in ("iou", "safe_plan", "clean") if table[name].notna().any()]
    figure, axes = _panels(len(measures), len(methods))
    levels = _levels(table[along])
    for row, measure in enumerate(measures):
        for column, method in enumerate(methods):
            panel, rows = axes[row, column], table[table["method"] == method]
            if rows[measure].notna().any():
                lines = summarise(rows, measure, by=[*([series] if series else []), along])
                for number, (label, line) in enumerate(_lines_by(lines, series)):
                    _draw_line(panel, line, along, number, label=label, levels=levels)
            _show_levels(panel, levels)
            panel.set_ylim(-0.03, 1.03)
            panel.set_title(plain(method) if row == 0 else "", fontsize=10, loc="left")
            if measure != "iou":
                panel.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes[row, 0].set_ylabel(NAMES[measure])
    for bottom in axes[-1]:
        bottom.set_xlabel(plain(name_of(along)))
    _legend_above(figure, axes, title=series)
    return figure


def draw_minutes(table: pd.DataFrame) -> Figure:
    """Minutes until enough traces are collected over the penetration rate: one panel per method, one line per flow."""
    penetration, flow = MINUTES_FACTORS
    factors = factors_of(table)
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
    top, levels = 1.15 * np.nanmax([1.0, *needed["minutes"].dropna()]), _levels(needed[along])
    for panel, (title, part) in zip(axes[0], parts, strict=True):
        for number, (label, line) in enumerate(_lines_by(part, series)):
            colour, marker = SERIES[number % len(SERIES)]
            places = _places(line[along], number, levels=levels)
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
        _show_levels(panel, levels)
        panel.set(ylim=(0, top), xlabel=plain(name_of(along)))
        panel.set_title(plain(title), fontsize=10, loc="left")
    axes[0, 0].set_ylabel("minutes (figures: traces needed)")
    _legend_above(figure, axes, title=series)
    return figure


def draw_methods(table: pd.DataFrame) -> Figure:
    """Map quality and shares of safe plans and clean drives of every method, one method per row."""
    measures = [name for name in ("precision", "recall", "iou", "safe_plan", "clean") if table[name].notna().any()]
    figure, axes = _panels(1, len(measures), height=0.6 + 0.42 * table["method"].nunique())
    methods = list(dict.fromkeys(table["method"]))
    for panel, measure in zip(axes[0], measures, strict=True):
        summary = summarise(table, measure, by=["method"]).set_index("method").reindex(methods)
        places = np.arange(len(methods))[::-1]
        spread = np.abs(summary[["low", "high"]].to_numpy().T - summary["mean"].to_numpy())
        panel.errorbar(summary["mean"], places, xerr=spread, fmt="o", color=BLUE, ecolor=BLACK, capsize=3)
        panel.set(xlim=(-0.03, 1.03), ylim=(-0.6, len(methods) - 0.4), xlabel=NAMES[measure].replace(" of the map", ""))
        panel.set_yticks(places, [plain(name) for name in methods] if panel is axes[0, 0] else [""] * len(methods))
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
            text = f"{share:.0%}\nn = {counts[row, column]:.0f}" if np.isfinite(share) else "none"
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


def level_text(value: Any) -> str:
    """A value of a factor as text."""
    return f"{value:g}" if isinstance(value, int | float | np.number) and not isinstance(value, bool) else str(value)


def _names(factors: Iterable[str]) -> str:
    return ", ".join(name_of(factor) for factor in factors)


def _lines_by(frame: pd.DataFrame, series: str | None) -> list[tuple[str, pd.DataFrame]]:
    """The rows of each value of the factor `series`, with the value as text; all rows where there is no such factor."""
    if series is None:
        return [("", frame)]
    levels = _levels(frame[series])
    return [(text, frame[frame[series] == value]) for text, value in zip(_texts(levels), levels, strict=True)]


def _levels(values: pd.Series) -> np.ndarray:
    return np.sort(values.unique())


def _texts(levels: Iterable[Any]) -> list[str]:
    return [plain(level_text(value)) for value in levels]


def _panels(rows: int, columns: int, *, height: float = 2.4) -> tuple[Figure, np.ndarray]:
    figure = Figure(figsize=(WIDTH_IN, HEAD_IN + rows * height), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False)


def _legend_above(figure: Figure, axes: np.ndarray, *, title: str | None) -> None:
    """One legend for all panels, above them, where lines have names: it covers nothing."""
    handles, labels = axes[0, 0].get_legend_handles_labels()
    if title and handles:
        texts = [f"{plain(name_of(title))}: {labels[0]}", *labels[1:]]
        figure.legend(handles, texts, loc="outside upper right", ncols=len(texts), frameon=False, fontsize=9)


def _draw_line(panel: Axes, line: pd.DataFrame, along: str, number: int, *, label: str, levels: np.ndarray) -> None:
    colour, marker = SERIES[number % len(SERIES)]
    spread = np.abs(line[["low", "high"]].to_numpy().T - line["mean"].to_numpy())
    places, style = _places(line[along], number, levels=levels), "-" if pd.api.types.is_numeric_dtype(line[along]) else "none"
    panel.errorbar(
        places, line["mean"], yerr=spread, color=colour, marker=marker, markersize=5, capsize=3, label=label, linestyle=style
    )
    panel.grid(axis="y", color="#DDDDDD", linewidth=0.6)


def _places(values: pd.Series, number: int, *, levels: np.ndarray) -> np.ndarray:
    """Places of factor values: evenly spaced, since levels are often 1, 2, 5, 10, and shifted by line against overlap."""
    return np.searchsorted(levels, values.to_numpy()) + 0.07 * number


def _show_levels(panel: Axes, levels: np.ndarray) -> None:
    panel.set_xticks(range(len(levels)), _texts(levels))
    panel.set_xlim(-0.4, len(levels) - 0.4)
