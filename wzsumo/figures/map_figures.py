"""The figures of the maps: counterparts of Figures 8, 9 and 10 of Chen et al. 2022."""

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from wzsumo.case.methods import METHODS
from wzsumo.figures.road_coordinates import area_in_road_coordinates, points_in_road_coordinates
from wzsumo.figures.zone_axes import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    PURPLE,
    SKY_BLUE,
    VERMILION,
    YELLOW,
    add_area,
    new_figure,
    place_legend,
    plain,
    show_cells,
    show_zone,
    thirds,
)
from wzsumo.files.result_folder import ResultFolder


def draw_maps(run: ResultFolder, methods: list[str]) -> Figure:
    """The map of every method (paper: Figure 8)."""
    figure, rows = new_figure(len(methods), row_height=1.6, head=0.6)
    drivable = area_in_road_coordinates(run.polygons["drivable"], run.road)
    for axes, name in zip(rows, methods, strict=True):
        show_zone(axes, run)
        grid = run.map_of(name)
        if grid is not None:
            show_cells(axes, run, grid.p_occupied, grid, cmap="Greys", vmin=0, vmax=1)
        add_area(axes, drivable, label="drivable area", fill=False, edgecolor=SKY_BLUE, zorder=4)
        axes.set_title(plain(name), fontsize=9, loc="left")
    shades = colormaps["Greys"]
    states = ((0.0, "free"), (0.5, "not known"), (1.0, "occupied"))
    patches = [Patch(facecolor=shades(p), edgecolor=BLACK, label=f"{text}, p = {p:g}") for p, text in states]
    handles, labels = rows[0].get_legend_handles_labels()
    shown = [handle for handle, label in zip(handles, labels, strict=True) if label not in {"open pavement", "closed area"}]
    _legend(figure, [*patches, *shown])
    return figure


def draw_truth(run: ResultFolder, method: str) -> Figure:
    """Cells that are free and drivable, free though closed, drivable but missed; the planned path (paper: Figure 9)."""
    figure, rows = new_figure(3, row_height=1.6)
    grid, path = run.map_of(method), run.path_of(method)
    if grid is None:
        return figure
    zone, truth = run.truth_on(grid)
    classes = np.select([truth & grid.free, zone & grid.free, truth], [1, 2, 3], default=0)
    colours = {"free and right": SKY_BLUE, "free but closed": VERMILION, "missed": YELLOW}
    for axes, interval in zip(rows, thirds(run), strict=True):
        show_zone(axes, run, interval=interval)
        show_cells(axes, run, classes, grid, cmap=ListedColormap(["none", *colours.values()]), vmin=-0.5, vmax=3.5)
        if path is not None:
            axes.plot(
                *points_in_road_coordinates(path[["x_m", "y_m"]], run.road).T,
                color=BLACK,
                linewidth=1.2,
                label="planned path",
                zorder=6,
            )
    handles, _ = rows[0].get_legend_handles_labels()
    patches = [Patch(color=colour, label=label) for label, colour in colours.items()]
    _legend(figure, [*patches, *handles])
    return figure


def draw_baseline_paths(run: ResultFolder, methods: list[str]) -> Figure:
    """The map of every baseline with the paths to the ego's own lane and to the open lane (paper: Figures 8 and 10)."""
    figure, rows = new_figure(len(methods), row_height=1.5, head=0.6)
    shades, drivable = ListedColormap(["white", GREY, BLACK]), area_in_road_coordinates(run.polygons["drivable"], run.road)
    for axes, name in zip(rows, methods, strict=True):
        grid = run.map_of(name)
        show_zone(axes, run)
        if grid is not None:
            state = np.where(grid.free, 0, np.where(grid.p_occupied < 0.65, 1, 2))
            show_cells(axes, run, state, grid, cmap=shades, vmin=0, vmax=2)
        add_area(axes, drivable, label="drivable area", fill=False, edgecolor=GREEN, linestyle="--", zorder=4)
        for suffix, colour, style in (("", BLUE, "-"), ("_to_open_lane", PURPLE, "--")):
            path = run.path_of(name + suffix)
            if path is not None:
                label = "path to the open lane" if suffix else "path to the ego's own lane"
                stations, offsets = run.road.to_sd(path[["x_m", "y_m"]])
                axes.plot(stations, offsets, color=colour, linestyle=style, linewidth=1.4, label=label, zorder=6)
        axes.set_title(plain(METHODS[name].title if name in METHODS else name), fontsize=9, loc="left")
    labelled = {label: handle for axes in rows for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    states = (("white", "free"), (GREY, "neither"), (BLACK, "occupied"))
    patches = [Patch(facecolor=colour, edgecolor=BLACK, label=label) for colour, label in states]
    shown = [labelled[label] for label in labelled if label not in {"open pavement", "closed area"}]
    _legend(figure, [*patches, *shown])
    return figure


def draw_crowd_and_slam(run: ResultFolder, crowd: str, slam: str) -> Figure:
    """Free cells of the crowd's map, occupied cells of the SLAM map, the truth and the crowd's path (paper: Figure 9)."""
    figure, rows = new_figure(3, row_height=1.6)
    crowd_map, slam_map, path = run.map_of(crowd), run.map_of(slam), run.path_of(crowd)
    if crowd_map is None or slam_map is None:
        return figure
    drivable = area_in_road_coordinates(run.polygons["drivable"], run.road)
    for axes, interval in zip(rows, thirds(run), strict=True):
        show_zone(axes, run, interval=interval)
        for grid, mask, colour in ((crowd_map, crowd_map.free, "#F4B6A0"), (slam_map, slam_map.p_occupied > 0.5, BLUE)):
            show_cells(axes, run, mask.astype(int), grid, cmap=ListedColormap(["none", colour]), vmin=0, vmax=1)
        add_area(axes, drivable, label="drivable area (truth)", fill=False, edgecolor=GREEN, linestyle="--",
                 linewidth=1.4, zorder=4)  # fmt: skip
        if path is not None:
            stations, offsets = run.road.to_sd(path[["x_m", "y_m"]])
            axes.plot(stations, offsets, color=BLACK, linewidth=1.2, label=f"path on {plain(crowd)}", zorder=6)
    handles, _ = rows[0].get_legend_handles_labels()
    patches = [
        Patch(color="#F4B6A0", label=f"free by the crowd ({plain(crowd)})"),
        Patch(color=BLUE, label=f"occupied by {plain(slam)}"),
    ]
    _legend(figure, [*patches, *handles[1:]])
    return figure


def _legend(figure: Figure, handles: Sequence[Artist]) -> None:
    place_legend(figure, handles, [str(handle.get_label()) for handle in handles])
