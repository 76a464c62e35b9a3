"""The figures of a report: counterparts of Figures 4 to 9 and 11 of Chen et al. 2022. Each has one function."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Patch
from matplotlib.ticker import MaxNLocator

from wzsumo.study.drive_figure import draw_drive
from wzsumo.study.result_folder import ResultFolder
from wzsumo.study.zone_axes import (
    BLACK,
    BLUE,
    GREY,
    SKY_BLUE,
    VERMILION,
    YELLOW,
    add_area,
    legend_above,
    new_figure,
    plain,
    show_zone,
    state_stretch,
    thirds,
)

CHI2_95 = 5.991464547107979  # 95 % quantile of chi-squared with 2 degrees of freedom: -2 ln 0.05


@dataclass(frozen=True, kw_only=True)
class ReportFigure:
    """An image file, its title and what its caption says."""

    path: Path
    title: str
    caption: str


def write_figures(run: ResultFolder, folder: Path) -> list[ReportFigure]:
    """Every figure of the run, written to `folder` as PNG, in the order of the paper."""
    folder.mkdir(parents=True, exist_ok=True)
    seed, n, k = (run.result.get(key, "-") for key in ("seed", "n_traces", "n_components"))
    run_of = f"n = {n} traces, seed {seed}."
    truth = "Truth is the drivable area of the layout, device line to edge line, within the zone."
    mapped = [name for name in run.methods if run.map_of(name) is not None]
    driven = [name for name in run.methods if run.drive_of(name) is not None]
    plans: list[tuple[str, Callable[[], Figure], str, str]] = [
        ("fig04_zone", partial(draw_zone, run), "Work zone (paper: Fig. 4)",
         f"Plan view, n = {len(run.devices)} devices. Truth of all later figures: the drivable area."),
        ("fig05_criteria", partial(draw_criteria, run), "Number of components (paper: Fig. 5)",
         f"AIC and BIC over the number of components K of the mixture; K = {k} chosen. {run_of}"),
        ("fig06_components", partial(draw_components, run), "Components (paper: Fig. 6)",
         f"95 % ellipses of the {k} components over the {len(run.used_traces)} fixes they are fitted to. {run_of}"),
        ("fig07_samples", partial(draw_samples, run), "Samples (paper: Fig. 7)",
         f"n = {len(run.samples)} points drawn from the mixture inside its 95 % region. {run_of}"),
    ]  # fmt: skip
    if mapped:
        plans.append(
            ("fig08_maps", partial(draw_maps, run, mapped), "Maps (paper: Fig. 8)", f"What each method maps. {run_of}")
        )
    plans += [
        (f"fig09_truth_{_file_name(name)}", partial(draw_truth, run, name), f"Map and truth, {name} (paper: Fig. 9)",
         f"Cells within the zone, in three pieces, and the planned path of the rear axle. {run_of} {truth}")
        for name in mapped
    ]  # fmt: skip
    plans += [
        (f"fig11_drive_{_file_name(name)}", partial(draw_drive, run, name), f"Drive, {name} (paper: Fig. 11)",
         "The area that the vehicle's outline sweeps between devices and pavement edge, in three pieces; then its speed and "
         f"steering. n = 1 drive. {run_of} Truth: the layout's devices and edges; poses as simulated.")
        for name in driven
    ]  # fmt: skip
    figures = []
    for stem, draw, title, caption in plans:
        path = folder / f"{stem}.png"
        draw().savefig(path)
        figures.append(ReportFigure(path=path, title=title, caption=caption))
    return figures


def draw_zone(run: ResultFolder) -> Figure:
    """The zone from above, with the names of its areas (paper: Figure 4)."""
    figure, (axes,) = new_figure(1, row_height=2.3, head=1.25)
    show_zone(axes, run)
    add_area(axes, run.polygons["drivable"], label="drivable area", facecolor=SKY_BLUE, alpha=0.45, edgecolor="none")
    for number, (name, start, end) in enumerate(run.areas):
        for station in (start, end):
            axes.axvline(station, color="#777777", linewidth=0.6, linestyle=":")
        height = 1.03 + 0.11 * (number % 3)
        label = f"{plain(name)}\n" if len(name) > 60 else f"{plain(name)} {end - start:.0f} m"
        axes.annotate(label, ((start + end) / 2, height), xycoords=("data", "axes fraction"), ha="center", fontsize=8)
    legend_above(figure, axes)
    return figure


def draw_criteria(run: ResultFolder) -> Figure:
    """AIC and BIC over the number of components (paper: Figure 5)."""
    figure, (axes,) = new_figure(1, row_height=3.2, head=0.4)
    sweep, chosen = run.sweep, run.result.get("n_components")
    for column, colour, marker in (("aic", BLUE, "o"), ("bic", VERMILION, "s")):
        axes.plot(sweep["n_components"], sweep[column], color=colour, marker=marker, markersize=4, label=column.upper())
    if chosen is not None:
        rule = str(run.result.get("n_components_rule", "-")).upper()
        axes.axvline(chosen, color=BLACK, linestyle="--", linewidth=1, label=f"chosen K = {chosen} ({plain(rule)})")
    axes.set(xlabel="number of components K [-]", ylabel="criterion [-], lower is better")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(color="#E5E5E5")
    axes.legend(frameon=False)
    return figure


def draw_components(run: ResultFolder) -> Figure:
    """The components as 95 % ellipses over the used traces (paper: Figure 6)."""
    figure, (axes,) = new_figure(1, row_height=2.6)
    show_zone(axes, run)
    traces = run.used_traces
    axes.scatter(traces["x_m"], traces["y_m"], s=2, color=BLUE, alpha=0.5, linewidths=0, label="fix (vehicle centre)")
    _, means, covariances = run.mixture
    for number, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        variances, directions = np.linalg.eigh(covariance)
        minor, major = 2 * np.sqrt(CHI2_95 * variances)
        angle = np.rad2deg(np.arctan2(directions[1, 1], directions[0, 1]))
        label = None if number else "component, 95 %"
        axes.add_patch(
            Ellipse(mean, major, minor, angle=angle, fill=False, edgecolor=BLACK, linewidth=1, label=label, zorder=6)
        )
    legend_above(figure, axes)
    return figure


def draw_samples(run: ResultFolder) -> Figure:
    """The points drawn from the mixture (paper: Figure 7)."""
    figure, (axes,) = new_figure(1, row_height=2.6)
    show_zone(axes, run)
    samples = run.samples
    axes.scatter(samples["x_m"], samples["y_m"], s=2, color=BLUE, alpha=0.5, linewidths=0, label="sample")
    legend_above(figure, axes)
    return figure


def draw_maps(run: ResultFolder, methods: list[str]) -> Figure:
    """The map of every method (paper: Figure 8)."""
    figure, rows = new_figure(len(methods), row_height=1.6, head=0.6)
    for axes, name in zip(rows, methods, strict=True):
        show_zone(axes, run)
        grid = run.map_of(name)
        if grid is not None:
            x_0, y_0, x_1, y_1 = grid.bounds
            axes.imshow(
                grid.p_occupied,
                cmap="Greys",
                vmin=0,
                vmax=1,
                origin="lower",
                extent=(x_0, x_1, y_0, y_1),
                aspect="auto",
                zorder=3,
            )
        axes.set_title(plain(name), fontsize=9, loc="left")
        axes.set_autoscale_on(False)
    patches = [
        Patch(facecolor=c, edgecolor=BLACK, label=t) for c, t in (("white", "free"), (GREY, "unknown"), (BLACK, "occupied"))
    ]
    handles, _ = rows[0].get_legend_handles_labels()
    figure.legend(handles=[*patches, handles[-1]], loc="upper right", ncols=4, frameon=False, fontsize=8)
    return figure


def draw_truth(run: ResultFolder, method: str) -> Figure:
    """Cells that a map has right, wrongly free and wrongly occupied, with the planned path (paper: Figure 9)."""
    figure, rows = new_figure(3, row_height=1.6)
    grid, path = run.map_of(method), run.path_of(method)
    if grid is None:
        return figure
    zone, truth = run.truth_on(grid)
    classes = np.ma.masked_equal(np.select([truth & grid.free, zone & grid.free, truth], [1, 2, 3], default=0), 0)
    colours = {"true positive": SKY_BLUE, "false positive": VERMILION, "false negative": YELLOW}
    x_0, y_0, x_1, y_1 = grid.bounds
    for axes, stretch_of in zip(rows, thirds(run), strict=True):
        show_zone(axes, run, stretch_of=stretch_of)
        limits = axes.get_xlim(), axes.get_ylim()
        axes.imshow(
            classes, cmap=ListedColormap(list(colours.values())), vmin=0.5, vmax=3.5, origin="lower", aspect="auto",
            extent=(x_0, x_1, y_0, y_1), interpolation="nearest", zorder=3,
        )  # fmt: skip
        axes.set(xlim=limits[0], ylim=limits[1])
        state_stretch(axes)
        if path is not None:
            axes.plot(path["x_m"], path["y_m"], color=BLACK, linewidth=1.2, label="planned path", zorder=6)
    handles, _ = rows[0].get_legend_handles_labels()
    patches = [Patch(color=colour, label=label) for label, colour in colours.items()]
    figure.legend(handles=[*patches, *handles], loc="upper right", ncols=7, frameon=False, fontsize=8, borderaxespad=0.3)
    return figure


def _file_name(method: str) -> str:
    return re.sub(r"[^A-Za-z0-9-]", "_", method)
