"""The figure of a zone: its signs, its plan in road coordinates, a stretch to scale with lane widths, the road in the world."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
# Heights of a sign's text and of an area's name; one that would cover another moves by as much.
SIGN_LEVEL_IN, AREA_LEVEL_IN = 0.315, 0.253
SIGN_TEXT_PT, AREA_TEXT_PT = 7, 8
LETTER_WIDTH = 0.66  # of the size of the text, of DejaVu Sans in capitals
BESIDE_IN = (0.7, 0.15)  # of the figure beside its axes, left and right, in which text may stand
MAX_RISE_OF_A_STRAIGHT_M = 5.0  # a road that leaves the chord between its ends by more is also drawn in the world


def draw_zone(run: ResultFolder, *, axes_width_in: float = AXES_IN[1] - AXES_IN[0]) -> Figure:
    """The zone (paper: Figure 4): the signs ahead of it, its areas, a stretch to scale and, if the road bends, the road.

    Texts are laid out for axes of this width [inches], to which the figure may still be narrowed.
    """
    signs, areas = _placed_signs(run, axes_width_in), _placed_areas(run, axes_width_in)
    bends = _rise(run) > MAX_RISE_OF_A_STRAIGHT_M
    across = run.road.left_edge + run.road.right_shoulder + 2 * MARGIN_M[1]
    to_scale = (AXES_IN[1] - AXES_IN[0]) * across / TO_SCALE_LENGTH_M
    heights = [0.75, 2.3, to_scale, 2.6] if bends else [0.75, 2.3, to_scale]
    above, below = (max((sign.level + 1 for sign in signs if sign.opposing == side), default=0) for side in (True, False))
    below_signs = 0.06 + SIGN_LEVEL_IN * below + AREA_LEVEL_IN * max((area.level + 1 for area in areas), default=0)
    figure, rows = stacked_figure(
        heights, gaps=[below_signs, 0.75, 0.75][: len(heights) - 1], head=0.4 + (SIGN_LEVEL_IN + 0.04) * above
    )
    _draw_signs(rows[0], run, signs, height_in=heights[0])
    _draw_plan(rows[1], run, areas, height_in=heights[1])
    _draw_to_scale(rows[2], run, length_m=TO_SCALE_LENGTH_M * axes_width_in / (AXES_IN[1] - AXES_IN[0]))
    if bends:
        _draw_in_world(rows[3], run)
    legend_above(figure, rows[1])
    return figure


@dataclass(frozen=True, kw_only=True)
class Label:
    """A text beside the road: the station [m] that it is of, that of its middle, and the level on which it stands."""

    text: str
    station: float
    centre: float
    level: int = 0
    opposing: bool = False


def levels_of(spans: Sequence[tuple[float, float]]) -> list[int]:
    """The level of each span (start, end): the lowest on which it overlaps none of those before it."""
    taken: list[list[tuple[float, float]]] = []
    levels = []
    for start, end in spans:
        free = (level for level, those in enumerate(taken) if all(end <= first or last <= start for first, last in those))
        level = next(free, len(taken))
        if level == len(taken):
            taken.append([])
        taken[level].append((start, end))
        levels.append(level)
    return levels


def _half_width_m(text: str, *, size_pt: float, m_per_in: float) -> float:
    """Half of the width of a text, with some room beside it, in metres of the road."""
    return m_per_in * (LETTER_WIDTH * size_pt / 72 * max(map(len, text.split("\n"))) + 0.06) / 2


def _placed_signs(run: ResultFolder, axes_width_in: float) -> list[Label]:
    """The signs with their texts; none covers another, or leaves the figure."""
    lowest, highest = _signed_road(run)
    m_per_in = (highest - lowest) / axes_width_in
    places = run.signs.assign(opposing=_faces_opposing_traffic(run))
    places = places.drop_duplicates(["text", "s_m", "opposing"]).sort_values("s_m")  # a freeway has each sign on both sides
    labels: list[Label] = []
    for opposing, group in places.groupby("opposing"):
        texts = [f"{plain(text)}\n{_distance(s, run.span)}" for s, text in zip(group["s_m"], group["text"], strict=True)]
        halves = [_half_width_m(text, size_pt=SIGN_TEXT_PT, m_per_in=m_per_in) for text in texts]
        ends = lowest - BESIDE_IN[0] * m_per_in, highest + BESIDE_IN[1] * m_per_in
        centres = [max(min(s, ends[1] - half), ends[0] + half) for s, half in zip(group["s_m"], halves, strict=True)]
        levels = levels_of([(centre - half, centre + half) for centre, half in zip(centres, halves, strict=True)])
        for s, text, centre, level in zip(group["s_m"], texts, centres, levels, strict=True):
            labels.append(Label(text=text, station=s, centre=centre, level=level, opposing=bool(opposing)))
    return labels


def _placed_areas(run: ResultFolder, axes_width_in: float) -> list[Label]:
    """The names and lengths of the zone's areas, in their order; neither they nor their lines cover another."""
    shown = run.span[0] - MARGIN_M[0], run.span[1] + MARGIN_M[0]
    m_per_in = (shown[1] - shown[0]) / axes_width_in
    labels, spans = [], []
    for name, start, end in run.areas:
        text = f"{plain(name)}, {end - start:.0f} m = {feet_from_metres(end - start):.0f} ft"
        half = _half_width_m(text, size_pt=AREA_TEXT_PT, m_per_in=m_per_in)
        centre = max(min((start + end) / 2, shown[1] - half), shown[0] + half)
        labels.append(Label(text=text, station=start, centre=centre))
        spans.append((min(start, centre - half), max(end, centre + half)))
    return [replace(label, level=level) for label, level in zip(labels, levels_of(spans), strict=True)]


def _signed_road(run: ResultFolder) -> tuple[float, float]:
    """The stations [m] between which all signs and the zone lie, with a margin."""
    (start, end), stations = run.span, run.signs["s_m"]
    lowest, highest = min(start, stations.min()), max(end, stations.max())
    margin = 0.06 * (highest - lowest)
    return lowest - margin, highest + margin


def _draw_signs(axes: Axes, run: ResultFolder, signs: list[Label], *, height_in: float) -> None:
    """The signs along the road, which is drawn as a line, with their texts."""
    axes.axhline(0, color="#777777", linewidth=3, zorder=1)
    axes.plot(run.span, [0, 0], color=ORANGE, linewidth=6, solid_capstyle="butt", zorder=2)
    for sign in signs:
        side = 1 if sign.opposing else -1
        axes.scatter([sign.station], [side * 0.28], marker="D", s=26, color=VERMILION, zorder=3)
        axes.annotate(
            sign.text, (sign.centre, side * (0.5 + SIGN_LEVEL_IN / height_in * sign.level)), ha="center", fontsize=SIGN_TEXT_PT,
            va="bottom" if sign.opposing else "top", annotation_clip=False,
        )  # fmt: skip
    axes.set(xlim=_signed_road(run), ylim=(-0.5, 0.5), yticks=[])
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


def _draw_plan(axes: Axes, run: ResultFolder, areas: list[Label], *, height_in: float) -> None:
    """The zone in road coordinates, with names and lengths of its areas."""
    show_zone(axes, run)
    name_work_space(axes, run)
    drivable = area_in_road_coordinates(run.polygons["drivable"], run.road)
    add_area(axes, drivable, label="drivable area", facecolor=SKY_BLUE, alpha=0.45, edgecolor="none")
    for label, (_, start, end) in zip(areas, run.areas, strict=True):
        for station in (start, end):
            axes.axvline(station, color="#777777", linewidth=0.6, linestyle=":")
        level = 1.03 + AREA_LEVEL_IN / height_in * label.level
        axes.plot(
            [start, end], [level - 0.025] * 2, transform=axes.get_xaxis_transform(), clip_on=False, color="#777777",
            linewidth=0.8, marker="|", markersize=5,
        )  # fmt: skip
        axes.annotate(label.text, (label.centre, level), xycoords=("data", "axes fraction"), ha="center", fontsize=AREA_TEXT_PT)


def name_work_space(axes: Axes, run: ResultFolder) -> None:
    """Write "work space" on the closed ground beside the activity area."""
    closed = area_in_road_coordinates(run.polygons["closed_area"], run.road)
    for name, start, end in run.areas:
        if name == "activity area":
            part = closed.intersection(shapely.box(start, -100, end, 100))
            if not part.is_empty:
                place = part.centroid
                axes.annotate("work space", (place.x, place.y), ha="center", va="center", fontsize=9, annotation_clip=True)


def _draw_to_scale(axes: Axes, run: ResultFolder, *, length_m: float) -> None:
    """The start of the activity area with the same scale along and across the road, and the widths of the lanes."""
    middle = next((start for name, start, _ in run.areas if name == "activity area"), run.span[0])
    interval = (middle - length_m / 2, middle + length_m / 2)
    show_zone(axes, run, interval=interval)
    drivable = area_in_road_coordinates(run.polygons["drivable"], run.road)
    add_area(axes, drivable, facecolor=SKY_BLUE, alpha=0.45, edgecolor="none")
    for right, left in run.lanes_at(middle + 1.0):
        s = interval[1] - 0.15 * length_m
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
