"""The figure of a zone: its signs, its plan in road coordinates, a stretch to scale with lane widths, the road in the world."""

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wzsumo.figures.road_coordinates import area_in_road_coordinates
from wzsumo.figures.zone_axes import (
    AXES_IN,
    BLACK,
    MARGIN_M,
    ORANGE,
    SKY_BLUE,
    VERMILION,
    add_area,
    legend_above,
    plain,
    show_zone,
    stacked_figure,
)
from wzsumo.files.result_folder import ResultFolder
from wzsumo.frames import BoolArray
from wzsumo.units import feet_from_metres

TO_SCALE_LENGTH_M = 80.0  # of the road around the start of the activity area
LABEL_LEVELS = 3  # heights at which names of areas are written, so that the names of short areas do not overlap
MAX_RISE_OF_A_STRAIGHT_M = 5.0  # a road that leaves the chord between its ends by more is also drawn in the world


def draw_zone(run: ResultFolder) -> Figure:
    """The zone (paper: Figure 4): the signs ahead of it, its areas, a stretch to scale and, if the road bends, the road."""
    bends = _rise(run) > MAX_RISE_OF_A_STRAIGHT_M
    across = run.road.left_edge + run.road.right_shoulder + 2 * MARGIN_M[1]
    to_scale = (AXES_IN[1] - AXES_IN[0]) * across / TO_SCALE_LENGTH_M
    heights = [0.75, 2.3, to_scale, 2.6] if bends else [0.75, 2.3, to_scale]
    head = 1.1 if _faces_opposing_traffic(run).any() else 0.4
    figure, rows = stacked_figure(heights, gaps=[1.45, 0.75, 0.75][: len(heights) - 1], head=head)
    _draw_signs(rows[0], run)
    _draw_plan(rows[1], run)
    _draw_to_scale(rows[2], run)
    if bends:
        _draw_in_world(rows[3], run)
    legend_above(figure, rows[1])
    return figure


def _draw_signs(axes: Axes, run: ResultFolder) -> None:
    """The signs along the road, which is drawn as a line, with their texts."""
    signs, (start, end) = run.signs, run.span
    axes.axhline(0, color="#777777", linewidth=3, zorder=1)
    axes.plot([start, end], [0, 0], color=ORANGE, linewidth=6, solid_capstyle="butt", zorder=2)
    places = signs.assign(opposing=_faces_opposing_traffic(run))
    places = places.drop_duplicates(["text", "s_m", "opposing"])  # a freeway has each sign on both sides: show one
    for opposing, group in places.groupby("opposing"):
        side = 1 if opposing else -1
        axes.scatter(group["s_m"], [side * 0.28] * len(group), marker="D", s=26, color=VERMILION, zorder=3)
        for number, (s, text) in enumerate(zip(group["s_m"], group["text"], strict=True)):
            axes.annotate(
                f"{plain(text)}\n{_distance(s, (start, end))}",
                (s, side * (0.5 + 0.42 * (number % 2))), ha="center", fontsize=7,
                va="bottom" if opposing else "top", annotation_clip=False,
            )  # fmt: skip
    lowest, highest = min(start, signs["s_m"].min()), max(end, signs["s_m"].max())
    margin = 0.06 * (highest - lowest)
    axes.set(xlim=(lowest - margin, highest + margin), ylim=(-0.5, 0.5), yticks=[])
    axes.xaxis.set_visible(False)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _distance(station: float, span: tuple[float, float]) -> str:
    """How far a sign is before the zone, or after it."""
    start, end = span
    if station > end:
        return f"{station - end:.0f} m = {feet_from_metres(station - end):.0f} ft after"
    if station < start:
        return f"{start - station:.0f} m = {feet_from_metres(start - station):.0f} ft before"
    return f"{station - start:.0f} m = {feet_from_metres(station - start):.0f} ft into the zone"


def _faces_opposing_traffic(run: ResultFolder) -> BoolArray:
    """Whether signs (n,) are for the traffic that drives against the stations."""
    return np.asarray(np.cos(run.signs["heading_rad"] - run.road.heading_at(run.signs["s_m"])) < 0)


def _draw_plan(axes: Axes, run: ResultFolder) -> None:
    """The zone in road coordinates, with names and lengths of its areas."""
    show_zone(axes, run)
    name_work_space(axes, run)
    drivable = area_in_road_coordinates(run.polygons["drivable"], run.road)
    add_area(axes, drivable, label="drivable area", facecolor=SKY_BLUE, alpha=0.45, edgecolor="none")
    for number, (name, start, end) in enumerate(run.areas):
        for station in (start, end):
            axes.axvline(station, color="#777777", linewidth=0.6, linestyle=":")
        at_edge = {0: (start, "left"), len(run.areas) - 1: (end, "right")}
        station, side = at_edge.get(number, ((start + end) / 2, "center"))
        level = 1.03 + 0.11 * (number % LABEL_LEVELS)
        axes.plot(
            [start, end], [level - 0.015] * 2, transform=axes.get_xaxis_transform(), clip_on=False, color="#777777",
            linewidth=0.8, marker="|", markersize=5,
        )  # fmt: skip
        axes.annotate(
            f"{plain(name)}, {end - start:.0f} m = {feet_from_metres(end - start):.0f} ft",
            (station, level), xycoords=("data", "axes fraction"), ha=side, fontsize=8,
        )  # fmt: skip


def name_work_space(axes: Axes, run: ResultFolder) -> None:
    """Write "work space" on the closed ground beside the activity area."""
    closed = area_in_road_coordinates(run.polygons["closed_area"], run.road)
    for name, start, end in run.areas:
        if name == "activity area":
            part = closed.intersection(shapely.box(start, -100, end, 100))
            if not part.is_empty:
                place = part.centroid
                axes.annotate("work space", (place.x, place.y), ha="center", va="center", fontsize=9, annotation_clip=True)


def _draw_to_scale(axes: Axes, run: ResultFolder) -> None:
    """The start of the activity area with the same scale along and across the road, and the widths of the lanes."""
    middle = next((start for name, start, _ in run.areas if name == "activity area"), run.span[0])
    interval = (middle - TO_SCALE_LENGTH_M / 2, middle + TO_SCALE_LENGTH_M / 2)
    show_zone(axes, run, interval=interval)
    drivable = area_in_road_coordinates(run.polygons["drivable"], run.road)
    add_area(axes, drivable, facecolor=SKY_BLUE, alpha=0.45, edgecolor="none")
    for right, left in run.lanes_at(middle + 1.0):
        s = interval[1] - 12.0
        axes.annotate("", (s, left), (s, right), arrowprops={"arrowstyle": "<->", "color": BLACK, "shrinkA": 0, "shrinkB": 0})
        width = left - right
        axes.annotate(f"{width:.2f} m\n{feet_from_metres(width):.1f} ft", (s + 1, (left + right) / 2), va="center", fontsize=7)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="station [m]  (to scale)", ylabel="offset [m]")


def _draw_in_world(axes: Axes, run: ResultFolder) -> None:
    """Pavement and closed area in world coordinates."""
    for name, colour in (("pavement", "#CCCCCC"), ("closed_area", ORANGE)):
        add_area(axes, run.polygons[name], facecolor=colour, edgecolor=colour, linewidth=1)
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()
    axes.set(xlabel="x [m]  (to scale)", ylabel="y [m]")


def _rise(run: ResultFolder) -> float:
    """Largest distance [m] of the road from the chord between its ends."""
    line = run.road.reference_line
    return float(shapely.distance(shapely.points(line), shapely.LineString(line[[0, -1]])).max())
