"""The picture at the head of a report: the zone with lane lines, direction and work space, and the drive on it, as SVG shapes.

Offsets are stretched. The page holds the picture twice: in one piece, and for narrow screens in several, one below the other.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from wzsumo.ego import Outcome
from wzsumo.figures.drive_figure import centre_line, swept_area
from wzsumo.figures.lane_lines import LaneLine, lane_lines
from wzsumo.figures.road_coordinates import area_in_road_coordinates
from wzsumo.figures.zone_axes import LEAST_DRIVEN_M
from wzsumo.files.result_folder import ResultFolder
from wzsumo.frames import FloatArray
from wzsumo.units import feet_from_metres

MARGIN_M = 40.0  # of road shown before the zone and after it
BROAD, NARROW = (1100.0, 1, 150.0), (360.0, 4, 88.0)  # width, pieces, height of the road, in the drawing's units
LETTER = 7.4  # mean width of a letter of the page's 13 px font
TICKS_APART = 85.0  # at least, in the same units
HATCH = 13.0  # between the strokes on closed ground


def zone_picture(run: ResultFolder, method: str | None) -> dict[str, Any]:
    """The drawings "broad" and "narrow" of a run's zone with the drive of a method, if it was driven, for the template."""
    log = run.drive_of(method) if method else None
    ground = {name: area_in_road_coordinates(run.polygons[name], run.road) for name in ("pavement", "drivable", "closed_area")}
    driven = {} if log is None else {"swept": swept_area(run, log), "centre": centre_line(run, log)}
    reached = run.methods.get(method or "", {}).get("outcome") == Outcome.REACHED_GOAL
    shapes = ground | driven | {"reached": reached}
    return {name: _drawing(run, shapes, *size) for name, size in (("broad", BROAD), ("narrow", NARROW))}


def _drawing(run: ResultFolder, shapes: dict[str, Any], width: float, pieces: int, road_height: float) -> dict[str, Any]:
    start, end = run.span[0] - MARGIN_M, run.span[1] + MARGIN_M
    edges = np.linspace(start, end, pieces + 1)
    low, high = -run.road.right_shoulder, run.road.left_edge
    along, across = width * pieces / (end - start), road_height / (high - low)
    panels, top = [], 0.0
    for a, b in pairwise(edges):
        # x = (s - a) * along, y = (high - d) * across: the coefficients of shapely's affine transformation
        to_paper = (along, 0.0, 0.0, -across, -a * along, high * across)
        names, levels = _area_names(run, (a, b), along, width, least_share=0.0 if pieces == 1 else 0.9)
        head = 20.0 * levels + 8.0
        panels.append(_panel(run, shapes, (a, b), to_paper) | {"top": round(top + head, 1), "names": names})
        top += head + road_height + 30.0
    return {"width": width, "height": round(top, 1), "panels": panels, "stretch": f"{across / along:.0f}", "road": road_height}


def _panel(
    run: ResultFolder, shapes: dict[str, Any], interval: tuple[float, float], to_paper: tuple[float, ...]
) -> dict[str, Any]:
    (a, b), along = interval, to_paper[0]
    ground = {
        name: affinity.affine_transform(shapely.clip_by_rect(shapes[name], a, -99, b, 999), to_paper)
        for name in ("pavement", "drivable", "closed_area", "swept")
        if name in shapes
    }
    lines = [
        {"kind": line.kind, "path": _path(_thinned(_on_paper(_piece(line, a, b), to_paper)))}
        for line in lane_lines(run)
        if line.stations[0] < b and line.stations[-1] > a
    ]
    for each in run.stop_lines:
        if a < each["s_m"] < b:
            across = np.array([[each["s_m"], each["right_m"]], [each["s_m"], each["left_m"]]])
            lines.append({"kind": "stop", "path": _path(_on_paper(across, to_paper))})
    devices = run.devices[run.devices["s_m"].between(a, b, inclusive="left")][["s_m", "d_m"]].to_numpy()
    step = _round_length(TICKS_APART / along)
    room = 130.0 if b >= run.span[1] + MARGIN_M else 25.0  # the last piece says how far the picture is stretched
    ticks = np.arange(np.ceil((a + 0.08 * (b - a)) / step) * step, b - room / along, step)
    panel: dict[str, Any] = {
        "ground": {name: _outline(area) for name, area in ground.items()},
        "hatch": _path_of_lines(_hatched(ground["closed_area"])),
        "lines": lines,
        "devices": _on_paper(devices, to_paper).round(1).tolist(),
        "arrows": [_triangle(*place) for place in _arrows(run, a + 18 / along, to_paper)],
        "ticks": [{"x": round((s - a) * along, 1), "text": f"{s:.0f} m"} for s in ticks],
        "work_space": _work_space(run, shapes["closed_area"], interval, to_paper),
    }
    if "centre" in shapes:
        centre = shapes["centre"]
        seen = (centre[:, 0] >= a) & (centre[:, 0] <= b)
        panel["drive"] = _path(_thinned(_on_paper(centre[seen], to_paper)))
        if seen.any() and seen[-1] and not shapes["reached"]:
            panel["ended"] = _on_paper(centre[-1:], to_paper)[0].round(1).tolist()
    return panel


def _piece(line: LaneLine, start: float, end: float) -> FloatArray:
    """Stations and offsets (n, 2) of a line within an interval, its ends included."""
    first, last = max(start, line.stations[0]), min(end, line.stations[-1])
    inside = line.stations[(line.stations > first) & (line.stations < last)]
    stations = np.array([first, *inside, last])
    return np.column_stack([stations, np.interp(stations, line.stations, line.offsets)])


def _area_names(
    run: ResultFolder, interval: tuple[float, float], along: float, width: float, *, least_share: float
) -> tuple[list[dict[str, Any]], int]:
    """Names of areas over their brackets, on as many levels as they need so as not to overlap.

    A name is left out where its area has less room in the interval than that share of the name's length.
    """
    taken: list[float] = []
    names = []
    for name, start, end in run.areas:
        first, last = max(start, interval[0]), min(end, interval[1])
        text = f"{name}, {end - start:.0f} m = {feet_from_metres(end - start):.0f} ft"
        if least_share:
            text = name
        length = LETTER * len(text)
        x, x_end = (first - interval[0]) * along, (last - interval[0]) * along
        if last <= first or (x_end - x) < least_share * length:
            continue
        middle = float(np.clip((x + x_end) / 2, length / 2, width - length / 2))
        level = next((n for n, right in enumerate(taken) if min(middle - length / 2, x) > right + 8), len(taken))
        right = max(middle + length / 2, x_end)
        taken = [*taken[:level], right, *taken[level + 1 :]]
        names.append(
            {"x": round(x, 1), "end": round(x_end, 1), "middle": round(middle, 1), "y": -10 - 20 * level, "text": text}
        )
    return names, len(taken)


def _work_space(run: ResultFolder, closed: BaseGeometry, interval: tuple[float, float], to_paper: tuple[float, ...]) -> Any:
    """Where "work space" is written: in the middle of the closed ground beside the activity area; None where not seen."""
    for name, start, end in run.areas:
        first, last = max(start, interval[0]), min(end, interval[1])
        if name == "activity area" and last > first:
            part = shapely.clip_by_rect(closed, first, -99, last, 999)
            if not part.is_empty and (last - first) * to_paper[0] > 10 * LETTER:
                place = part.representative_point() if part.geom_type != "Polygon" else part.centroid
                return _on_paper(np.array([[place.x, place.y]]), to_paper)[0].round(1).tolist()
    return None


def _arrows(run: ResultFolder, station: float, to_paper: tuple[float, ...]) -> Iterator[tuple[float, float, int]]:
    """Place and direction (1: to the right) of an arrow in each lane that is open at a station."""
    for lane in run.lanes:
        if lane.start <= station < lane.end and lane.left(station) - lane.right(station) > LEAST_DRIVEN_M:
            middle = float(lane.left(station) + lane.right(station)) / 2
            x, y = _on_paper(np.array([[station, middle]]), to_paper)[0]
            yield float(x), float(y), -1 if lane.opposing else 1


def _triangle(x: float, y: float, way: int) -> str:
    return f"{x + 9 * way:.1f},{y:.1f} {x - 7 * way:.1f},{y - 5:.1f} {x - 7 * way:.1f},{y + 5:.1f}"


def _hatched(area: BaseGeometry) -> BaseGeometry:
    """Diagonal strokes on an area."""
    if area.is_empty:
        return area
    x0, y0, x1, y1 = area.bounds
    starts = np.arange(x0 - (y1 - y0), x1, HATCH)
    rise = y1 - y0
    ends = np.stack(
        [np.column_stack([starts, np.full_like(starts, y1)]), np.column_stack([starts + rise, np.full_like(starts, y0)])],
        axis=1,
    )
    return shapely.MultiLineString(list(ends)).intersection(area)


def _on_paper(points: FloatArray, to_paper: tuple[float, ...]) -> FloatArray:
    a, _, _, e, x, y = to_paper
    return np.asarray(points, dtype=float) * [a, e] + [x, y]


def _thinned(path: FloatArray) -> FloatArray:
    return shapely.get_coordinates(shapely.simplify(shapely.LineString(path), 0.2)) if len(path) > 1 else path


def _outline(area: BaseGeometry) -> str:
    parts = getattr(shapely.simplify(area, 0.2), "geoms", [shapely.simplify(area, 0.2)])
    rings = [ring for part in parts if part.geom_type == "Polygon" for ring in (part.exterior, *part.interiors)]
    return "".join(_path(np.asarray(ring.coords)) + "Z" for ring in rings)


def _path_of_lines(lines: BaseGeometry) -> str:
    parts = getattr(lines, "geoms", [lines])
    return "".join(_path(np.asarray(part.coords)) for part in parts if part.geom_type == "LineString" and not part.is_empty)


def _path(points: FloatArray) -> str:
    return "" if len(points) < 2 else "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _round_length(length: float) -> float:
    """The smallest of 1, 2, 5, 10 ... that is not shorter."""
    power = 10 ** np.floor(np.log10(length))
    return float(min(step * power for step in (1, 2, 5, 10) if step * power >= length))
