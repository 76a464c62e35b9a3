"""The drawings of zone.html: the lanes of a map as they lie, and stretched along the road.

They are SVG in metres: north up, with a scale and, where the map has a place on earth, the latitudes and longitudes of its
corners. Each is made twice, for broad and for narrow screens.
"""

from typing import Any

import numpy as np
import shapely

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.files.export.open_strips import open_sections
from wzsumo.files.lanes import LanesFile
from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap

WIDTHS = {"broad": 1100.0, "narrow": 360.0}  # of the drawings, in their own units: pixels of the page
MAP_HEIGHT, MARGIN = 520.0, 60.0
LEAST_LANE_WIDTH = 3.0  # drawn, in the same units: a zone of 2 km on 1100 units would have lanes of 2
DETAIL_HEIGHT = 190.0  # of the drawing along the road, whose offsets are stretched
LABEL_WIDTH = 110.0  # of "announced start", in the same units
LABEL_HEIGHT = 16.0  # ibid.
TICK_WIDTH = 64.0  # of "1400 m" with some room beside it, ibid.
ARROW = 46.0  # length of the arrow that shows the direction of travel, ibid.


def map_drawing(content: LanesFile, announced: AnnouncedZone | None, *, width: float) -> dict[str, Any]:
    """Shapes of the map in the units of its drawing, north (or y) up."""
    lanes = content.lanes
    middle_line = np.mean([lane.middle for lane in lanes.lanes], axis=0)
    ground = lanes.to_xy(lanes.stations, middle_line)
    turn = 0.0 if content.frame is None else np.pi / 2 - content.frame.north_at(ground[len(ground) // 2])
    to_north = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    low, high = (ground @ to_north.T).min(axis=0), (ground @ to_north.T).max(axis=0)
    margin = _margin(width)
    scale = min((width - 2 * margin) / max(high[0] - low[0], 1.0), (MAP_HEIGHT - 2 * MARGIN) / max(high[1] - low[1], 1.0))
    height = 2 * MARGIN + max(scale * (high[1] - low[1]), 60.0)
    middle = (low + high) / 2

    def place(xy: FloatArray) -> FloatArray:
        moved = (xy @ to_north.T - middle) * scale
        return np.column_stack([width / 2 + moved[:, 0], height / 2 - moved[:, 1]])

    lane_width = float(np.median([lane.left - lane.right for lane in lanes.lanes]))
    stroke = max(scale * lane_width, LEAST_LANE_WIDTH)
    spread = stroke / (scale * lane_width)  # lanes are drawn apart where they would be hairlines
    shapes = []
    for index, lane in enumerate(lanes.lanes):
        offset = middle_line + (lane.middle - middle_line) * spread
        for state, intervals in _states(lanes, index):
            for first, last in intervals:
                s = np.linspace(first, last, 80)
                path = place(lanes.to_xy(s, np.interp(s, lanes.stations, offset)))
                shapes.append({"points": _points(path), "state": state, "width": round(0.8 * stroke, 2)})
    marks = []
    for name in ("start", "end") if announced else ():
        s = getattr(announced, f"{name}_m")
        across = place(lanes.to_xy([s, s], np.interp(s, lanes.stations, middle_line) + np.array([-14.0, 14.0]) / scale))
        marks.append({"points": _points(across), "name": f"announced {name}", **label_place(across, width=width)})
    _set_apart(marks, at="x", width=width)
    bar = _round_length(160.0 / scale * min(1.0, width / 800))
    corners = []
    if content.frame is not None:
        for x, y, anchor in ((margin / 3, height - 6, "start"), (width - margin / 3, 16.0, "end")):
            metres = (np.array([x - width / 2, height / 2 - y]) / scale + middle) @ to_north
            lon, lat = content.frame.to_lonlat(metres)
            corners.append({"x": x, "y": y, "anchor": anchor, "text": f"{lat:.5f}, {lon:.5f}"})
    return {
        "width": width, "height": round(height, 1), "shapes": shapes, "marks": marks, "corners": corners,
        "arrow": _arrow(place(lanes.to_xy(lanes.stations, middle_line)), beside=stroke * len(lanes.lanes) / 2 + 14.0),
        "bar": round(bar * scale, 2), "bar_m": bar, "north": content.frame is not None, "drawn_apart": spread > 1.01,
    }  # fmt: skip


def detail_drawing(lanes: LaneMap, announced: AnnouncedZone | None, *, width: float) -> dict[str, Any]:
    """Ground that is open, closed and not known along the road, offsets stretched; the direction of travel to the right."""
    s0, s1 = float(lanes.stations[0]), float(lanes.stations[-1])
    low = min(float(lane.right.min()) for lane in lanes.lanes)
    high = max(float(lane.left.max()) for lane in lanes.lanes)
    margin = _margin(width)
    along, across = (width - 2 * margin) / (s1 - s0), (DETAIL_HEIGHT - 70.0) / (high - low)

    def place(s: FloatArray, d: FloatArray) -> FloatArray:
        return np.column_stack([margin + (s - s0) * along, 20.0 + (high - d) * across])

    strips, lines, names = [], [], []
    for index, lane in enumerate(lanes.lanes):
        for state, intervals in _states(lanes, index)[:2]:
            for first, last in intervals:
                s = np.unique([first, *lanes.stations[(lanes.stations > first) & (lanes.stations < last)], last])
                right, left = (np.interp(s, lanes.stations, side) for side in (lane.right, lane.left))
                outline = np.vstack([place(s, right), place(s, left)[::-1]])
                strips.append({"points": _points(_simplified(outline)), "state": state})
        names.append({"y": round(float(place(lanes.stations, lane.middle)[0, 1]) + 4, 1), "text": f"lane {index}"})
        lines += [
            {"points": _points(place(lanes.stations, side)), "kind": kind}
            for side, kind in ((lane.right, "edge" if index == 0 else "lane"), (lane.left, "edge"))
            if kind == "lane" or side is not lane.left or index == len(lanes.lanes) - 1
        ]
    for section in open_sections(lanes):
        for strip in section.strips:
            outline = np.vstack([place(section.stations, strip.right), place(section.stations, strip.left)[::-1]])
            strips.append({"points": _points(_simplified(outline)), "state": "open"})
    marks = []
    for name in ("start", "end") if announced else ():
        x = margin + (getattr(announced, f"{name}_m") - s0) * along
        sd = getattr(announced, f"{name}_sd_m") * along
        label = float(np.clip(x, LABEL_WIDTH / 2, width - LABEL_WIDTH / 2))
        marks.append({
            "x": round(x, 1), "left": round(x - sd, 1), "width": round(2 * sd, 1), "label": round(label, 1),
            "name": f"announced {name}",
        })  # fmt: skip
    _set_apart(marks, at="label", width=width)
    step = _round_length(max((s1 - s0) / 6, 2.5 * TICK_WIDTH / along))  # a round length is up to 2.5 times shorter
    at = np.arange(np.ceil(s0 / step) * step, s1, step)
    ticks = [{"x": round(margin + (station - s0) * along, 1), "text": f"{abs(station):.0f} m"} for station in at]
    return {
        "width": width, "height": DETAIL_HEIGHT, "base": DETAIL_HEIGHT - 45.0, "strips": strips, "lines": lines, "names": names,
        "marks": marks, "ticks": ticks, "left": margin, "stretch": f"{across / along:.0f}",
    }  # fmt: skip


def label_place(across: FloatArray, *, width: float) -> dict[str, Any]:
    """Where the name of a mark across the road (2, 2) stands: above it, or at its side where the road runs up the drawing."""
    (left, y_left), (right, y_right) = across[np.argsort(across[:, 0])]
    if right - left < abs(y_right - y_left):
        x = float(np.clip((left + right) / 2, LABEL_WIDTH / 2, width - LABEL_WIDTH / 2))  # so that its name is not cut off
        return {"x": round(x, 1), "y": round(float(min(y_left, y_right)) - 4, 1), "anchor": "middle"}
    room = right + 6 + LABEL_WIDTH < width
    x, y = (right + 6, y_right) if room else (left - 6, y_left)
    return {"x": round(float(x), 1), "y": round(float(y) + 4, 1), "anchor": "start" if room else "end"}


def _set_apart(marks: list[dict[str, Any]], *, at: str, width: float) -> None:
    """Move the names of two marks so far apart that neither covers the other, where both are written in one line."""
    if len(marks) == 2 and all(mark.get("anchor", "middle") == "middle" for mark in marks):
        first, last = sorted(marks, key=lambda mark: float(mark[at]))
        is_one_line = abs(first.get("y", 0.0) - last.get("y", 0.0)) < LABEL_HEIGHT
        if is_one_line and last[at] - first[at] < LABEL_WIDTH:
            middle = float(np.clip((first[at] + last[at]) / 2, LABEL_WIDTH, width - LABEL_WIDTH))
            first[at], last[at] = round(middle - LABEL_WIDTH / 2, 1), round(middle + LABEL_WIDTH / 2, 1)


def _states(lanes: LaneMap, index: int) -> list[tuple[str, Any]]:
    """Intervals [m along the road] in which a lane is not known, closed and open; each covers those before it."""
    whole = [(float(lanes.stations[0]), float(lanes.stations[-1]))]
    return [("unknown", whole), ("shut", lanes.closed_intervals(index)), ("open", lanes.open_intervals(index))]


def _arrow(line: FloatArray, *, beside: float) -> str:
    """Points of an arrow to the right of a line, near its start, that points along it."""
    gone = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    start = min(0.1 * gone[-1], 40.0)
    tail, head = (np.array([np.interp(at, gone, line[:, 0]), np.interp(at, gone, line[:, 1])]) for at in (start, start + ARROW))
    along = (head - tail) / max(float(np.hypot(*(head - tail))), 1e-9)
    right = np.array([-along[1], along[0]])  # y runs down the drawing
    tail, head = tail + beside * right, head + beside * right
    barbs = [head - 9 * along + side * 5 * right for side in (1, -1)]
    return _points(np.array([tail, head, barbs[0], head, barbs[1]]))


def _margin(width: float) -> float:
    return min(MARGIN, 0.13 * width)


def _simplified(outline: FloatArray) -> FloatArray:
    return shapely.get_coordinates(shapely.simplify(shapely.LinearRing(outline), 0.1))


def _points(path: FloatArray) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in path)


def _round_length(length: float) -> float:
    """The largest of 1, 2, 5, 10 ... that is not longer."""
    power = 10 ** np.floor(np.log10(length))
    return float(max(step * power for step in (1, 2, 5) if step * power <= length))
