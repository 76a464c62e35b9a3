"""The figures of the maps: counterparts of Figures 8 and 9 of Chen et al. 2022."""

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from wzsumo.study.result_folder import ResultFolder
from wzsumo.study.zone_axes import (
    BLACK,
    GREY,
    SKY_BLUE,
    VERMILION,
    YELLOW,
    add_area,
    new_figure,
    plain,
    show_zone,
    state_stretch,
    thirds,
)  # fmt: skip


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
        add_area(axes, run.polygons["drivable"], label="drivable area", fill=False, edgecolor=SKY_BLUE, zorder=4)
        axes.set_title(plain(name), fontsize=9, loc="left")
        axes.set_autoscale_on(False)
    patches = [
        Patch(facecolor=c, edgecolor=BLACK, label=t) for c, t in (("white", "free"), (GREY, "unknown"), (BLACK, "occupied"))
    ]
    handles, _ = rows[0].get_legend_handles_labels()
    figure.legend(handles=[*patches, *handles[-2:]], loc="upper right", ncols=5, frameon=False, fontsize=8)
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
