"""zone.html: the lanes of a map on a plain vector map, and what was announced of the zone beside what the traces verify.

The page needs no network: the drawing is SVG in metres, north up, with a scale and, where the map has a place on earth, the
latitudes and longitudes of its corners.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.feeds.publication import VERIFIED_WITHIN_M
from wzsumo.feeds.verified import VerifiedZone, verified_zone
from wzsumo.figures.zone_axes import BLUE, GREY, ORANGE, VERMILION
from wzsumo.files.export.open_strips import open_sections
from wzsumo.files.lanes import LanesFile
from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap
from wzsumo.report.page import page_template

PAGE = "zone.html"
MAP_WIDTH, MAP_HEIGHT = 1100.0, 520.0  # of the drawing, in its own units
MARGIN = 60.0
LEAST_LANE_WIDTH = 3.0  # drawn, in the same units: a zone of 2 km on 1100 units would have lanes of 2
DETAIL_HEIGHT = 190.0  # of the drawing along the road, whose offsets are stretched
LABEL_WIDTH = 110.0  # of "announced start", in the same units
Z_95 = 1.96


@dataclass(frozen=True, kw_only=True)
class Difference:
    """One end of the zone: announced and verified [m along the road], and verified less announced with its 95 % interval."""

    name: str
    announced_m: float
    announced_sd_m: float
    verified_m: float
    verified_sd_m: float

    @property
    def off_m(self) -> float:
        """Verified less announced: positive where it lies farther along the road than announced."""
        return self.verified_m - self.announced_m

    @property
    def interval_m(self) -> tuple[float, float]:
        """95 % interval of that difference, from the map's standard deviation."""
        return self.off_m - Z_95 * self.verified_sd_m, self.off_m + Z_95 * self.verified_sd_m

    @property
    def is_explained(self) -> bool:
        """Whether the accuracy of the announcement and of the map together explain the difference at 95 %."""
        return bool(abs(self.off_m) <= Z_95 * np.hypot(self.announced_sd_m, self.verified_sd_m))


def differences(announced: AnnouncedZone, verified: VerifiedZone) -> tuple[Difference, Difference]:
    """How far the ends of a zone that a map verifies are from those that were announced."""
    start, end = (
        Difference(
            name=name,
            announced_m=getattr(announced, f"{name}_m"),
            announced_sd_m=getattr(announced, f"{name}_sd_m"),
            verified_m=getattr(verified, f"{name}_m"),
            verified_sd_m=getattr(verified, f"{name}_sd_m"),
        )
        for name in ("start", "end")
    )
    return start, end


def zone_page(content: LanesFile, *, announced: AnnouncedZone | None, title: str, words: Sequence[str] = ()) -> str:
    """The page as HTML. `words` are the warnings and notes of the map."""
    lanes, verified = content.lanes, verified_zone(content.lanes)
    compared = differences(announced, verified) if announced and verified else ()
    return page_template("zone.html.j2").render(
        title=title,
        frame=content.frame.as_json() if content.frame else None,
        n_traces=lanes.n_traces,
        map=_map_drawing(content, announced),
        detail=_detail_drawing(lanes, announced),
        announced=announced,
        verified=verified,
        compared=compared,
        verified_within_m=VERIFIED_WITHIN_M,
        lanes=_lane_rows(lanes, announced, verified),
        words=[*lanes.warnings, *words],
    )


def write_zone_page(content: LanesFile, folder: Path, *, announced: AnnouncedZone | None, words: Sequence[str] = ()) -> None:
    """Write zone.html."""
    page = zone_page(content, announced=announced, title="Work zone as driven", words=words)
    (folder / PAGE).write_text(page, encoding="utf-8")


def _map_drawing(content: LanesFile, announced: AnnouncedZone | None) -> dict[str, Any]:
    """Shapes of the map in the units of its drawing, north (or y) up."""
    lanes = content.lanes
    middle_line = np.mean([lane.middle for lane in lanes.lanes], axis=0)
    ground = lanes.to_xy(lanes.stations, middle_line)
    turn = 0.0 if content.frame is None else np.pi / 2 - content.frame.north_at(ground[len(ground) // 2])
    to_north = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    low, high = (ground @ to_north.T).min(axis=0), (ground @ to_north.T).max(axis=0)
    scale = min((MAP_WIDTH - 2 * MARGIN) / max(high[0] - low[0], 1.0), (MAP_HEIGHT - 2 * MARGIN) / max(high[1] - low[1], 1.0))
    height = 2 * MARGIN + max(scale * (high[1] - low[1]), 60.0)
    middle = (low + high) / 2

    def place(xy: FloatArray) -> FloatArray:
        moved = (xy @ to_north.T - middle) * scale
        return np.column_stack([MAP_WIDTH / 2 + moved[:, 0], height / 2 - moved[:, 1]])

    lane_width = float(np.median([lane.left - lane.right for lane in lanes.lanes]))
    width = max(scale * lane_width, LEAST_LANE_WIDTH)
    spread = width / (scale * lane_width)  # lanes are drawn apart where they would be hairlines
    shapes = []
    for index, lane in enumerate(lanes.lanes):
        offset = middle_line + (lane.middle - middle_line) * spread
        states = (
            (GREY, [(lanes.stations[0], lanes.stations[-1])]), (VERMILION, lanes.closed_intervals(index)),
            (BLUE, lanes.open_intervals(index)),
        )  # fmt: skip
        for colour, intervals in states:
            for first, last in intervals:
                s = np.linspace(first, last, 80)
                path = place(lanes.to_xy(s, np.interp(s, lanes.stations, offset)))
                shapes.append({"points": _points(path), "colour": colour, "width": round(0.8 * width, 2)})
    marks = []
    for name in ("start", "end") if announced else ():
        s = getattr(announced, f"{name}_m")
        across = place(lanes.to_xy([s, s], np.interp(s, lanes.stations, middle_line) + np.array([-14.0, 14.0]) / scale))
        marks.append({"points": _points(across), "name": f"announced {name}", **_label_place(across)})
    bar = _round_length(160.0 / scale)
    corners = []
    if content.frame is not None:
        for x, y, anchor in ((MARGIN / 3, height - 6, "start"), (MAP_WIDTH - MARGIN / 3, 16.0, "end")):
            metres = (np.array([x - MAP_WIDTH / 2, height / 2 - y]) / scale + middle) @ to_north
            lon, lat = content.frame.to_lonlat(metres)
            corners.append({"x": x, "y": y, "anchor": anchor, "text": f"{lat:.5f}, {lon:.5f}"})
    return {
        "width": MAP_WIDTH, "height": round(height, 1), "shapes": shapes, "marks": marks, "corners": corners,
        "bar": round(bar * scale, 2), "bar_m": bar, "north": content.frame is not None, "drawn_apart": spread > 1.01,
    }  # fmt: skip


def _label_place(across: FloatArray) -> dict[str, Any]:
    """Where the name of a mark across the road (2, 2) stands: above it, or at its side where the road runs up the drawing."""
    (left, y_left), (right, y_right) = across[np.argsort(across[:, 0])]
    if right - left < abs(y_right - y_left):
        x = float(np.clip((left + right) / 2, MARGIN, MAP_WIDTH - MARGIN))  # so that its name is not cut off
        return {"x": round(x, 1), "y": round(float(min(y_left, y_right)) - 4, 1), "anchor": "middle"}
    room = right + 6 + LABEL_WIDTH < MAP_WIDTH
    x, y = (right + 6, y_right) if room else (left - 6, y_left)
    return {"x": round(float(x), 1), "y": round(float(y) + 4, 1), "anchor": "start" if room else "end"}


def _detail_drawing(lanes: LaneMap, announced: AnnouncedZone | None) -> dict[str, Any]:
    """The open strips along the road, offsets stretched; the direction of travel to the right."""
    s0, s1 = float(lanes.stations[0]), float(lanes.stations[-1])
    low = min(float(lane.right.min()) for lane in lanes.lanes)
    high = max(float(lane.left.max()) for lane in lanes.lanes)
    along, across = (MAP_WIDTH - 2 * MARGIN) / (s1 - s0), (DETAIL_HEIGHT - 70.0) / (high - low)

    def place(s: FloatArray, d: FloatArray) -> FloatArray:
        return np.column_stack([MARGIN + (s - s0) * along, 20.0 + (high - d) * across])

    whole = np.vstack([place(lanes.stations, np.full(len(lanes.stations), d))[:: len(lanes.stations) - 1] for d in (low, high)])
    strips = [{"points": _points(whole[[0, 1, 3, 2]]), "colour": GREY}]
    for section in open_sections(lanes):
        for strip in section.strips:
            outline = np.vstack([place(section.stations, strip.right), place(section.stations, strip.left)[::-1]])
            strips.append({"points": _points(_simplified(outline)), "colour": BLUE})
    marks = []
    for name in ("start", "end") if announced else ():
        x = MARGIN + (getattr(announced, f"{name}_m") - s0) * along
        sd = getattr(announced, f"{name}_sd_m") * along
        marks.append({"x": round(x, 1), "left": round(x - sd, 1), "width": round(2 * sd, 1), "name": f"announced {name}"})
    step = _round_length((s1 - s0) / 6)
    at = np.arange(np.ceil(s0 / step) * step, s1, step)
    ticks = [{"x": round(MARGIN + (station - s0) * along, 1), "text": f"{abs(station):.0f} m"} for station in at]
    return {
        "width": MAP_WIDTH, "height": DETAIL_HEIGHT, "base": DETAIL_HEIGHT - 45.0, "strips": strips, "marks": marks,
        "ticks": ticks, "colour": ORANGE,
    }  # fmt: skip


def _simplified(outline: FloatArray) -> FloatArray:
    return shapely.get_coordinates(shapely.simplify(shapely.LinearRing(outline), 0.1))


def _points(path: FloatArray) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in path)


def _round_length(length: float) -> float:
    """The largest of 1, 2, 5, 10 ... that is not longer."""
    power = 10 ** np.floor(np.log10(length))
    return float(max(step * power for step in (1, 2, 5) if step * power <= length))


def _lane_rows(lanes: LaneMap, announced: AnnouncedZone | None, verified: VerifiedZone | None) -> list[dict[str, Any]]:
    """What was announced and what is verified of each lane, from the left."""
    rows = []
    for number in reversed(range(len(lanes.lanes))):
        said = "not said"
        if announced is not None and announced.closed_lanes is not None:
            said = "closed" if number in announced.closed_lanes else "open"
        found = "open"
        if verified is not None:
            found = "closed" if number in verified.closed_lanes else "shifted" if number in verified.shifted else "open"
        spans = [f"{first:.0f} to {last:.0f} m" for first, last in lanes.closed_intervals(number)]
        rows.append({"lane": number, "announced": said, "verified": found, "closed": ", ".join(spans) or "-",
                     "n_traces": lanes.lanes[number].n_traces})  # fmt: skip
    return rows
