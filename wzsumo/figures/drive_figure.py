"""The figure of a drive: swept area, speed and what held it back, and steering, as in Figure 11 of Chen et al. 2022."""

import numpy as np
import pandas as pd
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from shapely.geometry.base import BaseGeometry

from wzsumo.figures.drive_reasons import slowings_of
from wzsumo.figures.road_coordinates import area_in_road_coordinates, points_in_road_coordinates
from wzsumo.figures.slowing import Slowing, Why
from wzsumo.figures.zone_axes import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY_BLUE,
    VERMILION,
    add_area,
    legend_above,
    new_figure,
    show_zone,
    thirds,
)
from wzsumo.files.result_folder import ResultFolder
from wzsumo.frames import FloatArray, advance
from wzsumo.units import mph_from_mps

LEAST_STEERING_DEG = 1.0  # shown to each side, so that a drive along a straight is a straight line
WHY_STYLES = {Why.AHEAD: (SKY_BLUE, ""), Why.BEND: (ORANGE, "//"), Why.BESIDE: (PURPLE, "\\\\"), Why.TURN: ("#999999", "..")}


def draw_drive(run: ResultFolder, method: str) -> Figure:
    """The area that the ego's outline sweeps between devices and pavement edge; speed and steering over the station."""
    log = run.drive_of(method)
    figure, rows = new_figure(5, row_height=1.5)
    if log is None:
        return figure
    swept, centre, stations = swept_area(run, log), centre_line(run, log), run.road.to_sd(log[["x_m", "y_m"]])[0]
    for axes, interval in zip(rows[:3], thirds(run), strict=True):
        show_zone(axes, run, interval=interval)
        add_area(
            axes, swept, label="swept by the vehicle", facecolor=SKY_BLUE, edgecolor=BLUE, linewidth=0.8, alpha=0.8, zorder=5
        )
        axes.plot(centre[:, 0], centre[:, 1], color=BLACK, linewidth=1, label="vehicle centre", zorder=6)
    _draw_speed(rows[3], stations, log["speed_mps"].to_numpy(dtype=float), slowings_of(run, method))
    rows[4].plot(stations, np.rad2deg(log["steering_rad"]), color=VERMILION, linewidth=1)
    largest = max(1.15 * float(np.rad2deg(log["steering_rad"].abs().max())), LEAST_STEERING_DEG)
    rows[4].set(ylabel="steering [°]\nleft up", ylim=(-largest, largest))
    for axes in rows[3:]:
        axes.set(xlabel="station of the rear axle [m]", xlim=(float(stations.min()), float(stations.max())))
        axes.grid(color="#E5E5E5")
        for end in run.span:
            axes.axvline(end, color="#777777", linewidth=0.8, linestyle=":")
    for axes in rows:
        axes.yaxis.set_label_coords(-0.042, 0.5)
    legend_above(figure, rows[0])
    return figure


def swept_area(run: ResultFolder, log: pd.DataFrame) -> BaseGeometry:
    """The area that the ego's outline swept, stations as x and offsets as y."""
    outlines = np.array([run.vehicle.outline(pose) for pose in _poses(log)])
    return area_in_road_coordinates(shapely.union_all(shapely.polygons(outlines)), run.road)


def centre_line(run: ResultFolder, log: pd.DataFrame) -> FloatArray:
    """Stations and offsets (n, 2) [m] of the vehicle's centre."""
    return points_in_road_coordinates(advance(_poses(log), run.vehicle.axle_to_centre_m)[:, :2], run.road)


def _poses(log: pd.DataFrame) -> FloatArray:
    return log[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float)


def _draw_speed(axes: Axes, stations: FloatArray, speed: FloatArray, slowed: list[Slowing]) -> None:
    """The speed, and as coloured bands what held the ego back where it was slower than it wished."""
    told: set[Why] = set()
    for each in slowed:
        colour, hatch = WHY_STYLES[each.why]
        label = None if each.why in told else f"held back by {each.why}"
        axes.axvspan(
            each.start_m, each.end_m, facecolor=colour, alpha=0.35, hatch=hatch, edgecolor="white", linewidth=0, label=label
        )
        told.add(each.why)
    axes.plot(stations, speed, color=GREEN, linewidth=1.4)
    highest = float(speed.max())
    axes.axhline(highest, color=BLACK, linewidth=0.7, linestyle=":")
    axes.annotate(
        f"{highest:.1f} m/s = {mph_from_mps(highest):.0f} mph", (1, highest), xycoords=("axes fraction", "data"),
        xytext=(-4, 2), textcoords="offset points", ha="right", fontsize=8,
    )  # fmt: skip
    axes.set(ylabel="speed [m/s]", ylim=(0, max(1.22 * highest, 1.0)))
    if told:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False, fontsize=8, borderaxespad=0.1)
