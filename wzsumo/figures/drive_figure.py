"""The figure of a drive: swept area, speed and steering, as in Figure 11 of Chen et al. 2022."""

import numpy as np
import shapely
from matplotlib.figure import Figure

from wzsumo.figures.road_coordinates import area_in_road_coordinates, points_in_road_coordinates
from wzsumo.figures.zone_axes import (
    BLACK,
    BLUE,
    GREEN,
    SKY_BLUE,
    VERMILION,
    add_area,
    legend_above,
    new_figure,
    show_zone,
    thirds,
)
from wzsumo.files.result_folder import ResultFolder
from wzsumo.frames import advance


def draw_drive(run: ResultFolder, method: str) -> Figure:
    """The area that the ego's outline sweeps between devices and pavement edge; speed and steering over the station."""
    vehicle, log = run.vehicle, run.drive_of(method)
    figure, rows = new_figure(5, row_height=1.5)
    if log is None:
        return figure
    poses = log[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float)
    swept = shapely.union_all(shapely.polygons(np.array([vehicle.outline(pose) for pose in poses])))
    swept = area_in_road_coordinates(swept, run.road)
    centre = points_in_road_coordinates(advance(poses, vehicle.axle_to_centre_m)[:, :2], run.road)
    stations, _ = run.road.to_sd(poses[:, :2])
    for axes, interval in zip(rows[:3], thirds(run), strict=True):
        show_zone(axes, run, interval=interval)
        add_area(axes, swept, label="swept by the outline", facecolor=SKY_BLUE, edgecolor=BLUE, linewidth=0.8, alpha=0.8)
        axes.plot(centre[:, 0], centre[:, 1], color=BLACK, linewidth=1, label="vehicle centre")
    for axes, values, label, colour in (
        (rows[3], log["speed_mps"], "speed [m/s]", GREEN),
        (rows[4], np.rad2deg(log["steering_rad"]), "steering [°]", VERMILION),
    ):
        axes.plot(stations, values, color=colour, linewidth=1)
        axes.set(xlabel="station of the rear axle [m]", ylabel=label, xlim=(thirds(run)[0][0], thirds(run)[-1][1]))
        axes.grid(color="#E5E5E5")
    legend_above(figure, rows[0])
    return figure
