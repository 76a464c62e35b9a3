"""The figures of the maps: counterparts of Figures 8 and 9 of Chen et al. 2022."""

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from wzsumo.study.result_folder import ResultFolder
from wzsumo.study.unrolled import unrolled_area, unrolled_points
from wzsumo.study.zone_axes import (
    BLACK,
    GREY,
    SKY_BLUE,
    VERMILION,
    YELLOW,
    add_area,
    new_figure,
    plain,
    show_cells,
    show_zone,
    thirds,
)  # fmt: skip


def draw_maps(run: ResultFolder, methods: list[str]) -> Figure:
    """The map of every method (paper: Figure 8)."""
    figure, rows = new_figure(len(methods), row_height=1.6, head=0.6)
    drivable = unrolled_area(run.polygons["drivable"], run.road)
    for axes, name in zip(rows, methods, strict=True):
        show_zone(axes, run)
        grid = run.map_of(name)
        if grid is not None:
            show_cells(axes, run, grid.p_occupied, grid, cmap="Greys", vmin=0, vmax=1)
        add_area(axes, drivable, label="drivable area", fill=False, edgecolor=SKY_BLUE, zorder=4)
        axes.set_title(plain(name), fontsize=9, loc="left")
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
    classes = np.select([truth & grid.free, zone & grid.free, truth], [1, 2, 3], default=0)
    colours = {"true positive": SKY_BLUE, "false positive": VERMILION, "false negative": YELLOW}
    for axes, stretch_of in zip(rows, thirds(run), strict=True):
        show_zone(axes, run, stretch_of=stretch_of)
        show_cells(axes, run, classes, grid, cmap=ListedColormap(["none", *colours.values()]), vmin=-0.5, vmax=3.5)
        if path is not None:
            axes.plot(
                *unrolled_points(path[["x_m", "y_m"]], run.road).T, color=BLACK, linewidth=1.2, label="planned path", zorder=6
            )
    handles, _ = rows[0].get_legend_handles_labels()
    patches = [Patch(color=colour, label=label) for label, colour in colours.items()]
    figure.legend(handles=[*patches, *handles], loc="upper right", ncols=7, frameon=False, fontsize=8, borderaxespad=0.3)
    return figure
