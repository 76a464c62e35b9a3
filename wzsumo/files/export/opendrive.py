"""OpenDRIVE 1.7 of a lane map: one road whose driving lanes are the open parts of the lanes.

The reference line of the road is a chain of cubics through the axis of the map, smooth in direction. Lanes lie to its right: a
lane offset moves the leftmost edge there, widths are linear between stations. What lies between open lanes is a lane of type
`none`.
Source: ASAM OpenDRIVE 1.7, sections 8.2.5 (paramPoly3), 9.3 (lane sections), 9.4 (lane offset), 9.5 (lane width).
"""

from itertools import pairwise
from xml.etree import ElementTree as ET

import numpy as np
import shapely

from wzsumo.errors import MapError
from wzsumo.files.export.open_strips import OpenSection, open_sections
from wzsumo.files.lanes import LanesFile
from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap

MAX_PIECE_M = 5.0  # of the reference line: at a kink of 1 degree a cubic of 5 m leaves the chords by 1 cm
STRAIGHT_M = 1e-9  # off its chord: a piece that does not bend
MIN_GAP_M = 0.05  # between two open lanes, that is a lane of its own; chosen by us
LINE_TOLERANCE_M = 1e-4  # of widths and offsets
SAMPLES = 33  # per cubic, for its arc length: exact to 1e-6 m for pieces of MAX_PIECE_M


def opendrive_xml(content: LanesFile, *, speed_limit_mps: float | None, name: str) -> bytes:
    """The OpenDRIVE file of a map's open lanes. Raises MapError where no lane is open, or somewhere between the ends."""
    sections = [section for section in open_sections(content.lanes) if section.strips]
    if not sections:
        raise MapError("no lane of this map is open anywhere: there is no road to write")
    for before, after in pairwise(sections):
        if before.stations[-1] != after.stations[0]:
            raise MapError(
                f"no lane is open from {before.stations[-1]:.0f} to {after.stations[0]:.0f} m: a road of OpenDRIVE has no "
                "gap; export GeoJSON or GeoParquet"
            )
    root = ET.Element("OpenDRIVE")
    _add_header(root, content, name=name)
    line = _ReferenceLine(content.lanes, sections[0].stations[0], sections[-1].stations[-1])
    road = ET.SubElement(root, "road", name=name, length=_text(line.length), id="1", junction="-1", rule="RHT")
    kind = ET.SubElement(road, "type", s="0", type="motorway")
    if speed_limit_mps is not None:
        ET.SubElement(kind, "speed", max=_text(speed_limit_mps), unit="m/s")
    line.add_to(road)
    lanes = ET.SubElement(road, "lanes")
    at = content.lanes.stations
    mapped = (at >= sections[0].stations[0]) & (at <= sections[-1].stations[-1])
    edge = _left_edge(content.lanes)
    middle = content.lanes.axis.travelled_width / 2
    _add_linear(lanes, "laneOffset", "s", line.station(at[mapped]), edge[mapped] - middle)
    cross = [_strips(section, np.interp(section.stations, at, edge)) for section in sections]
    for number, section in enumerate(sections):
        neighbours = [_ids(cross[k]) if 0 <= k < len(sections) else {} for k in (number - 1, number + 1)]
        _add_section(lanes, line.station(section.stations), cross[number], neighbours)
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


class _ReferenceLine:
    """Cubics through the axis from one station of the map to another."""

    def __init__(self, lanes: LaneMap, start: float, end: float) -> None:
        axis = lanes.axis
        inner = axis.stations[(axis.stations > start + 0.01) & (axis.stations < end - 0.01)]
        corners = np.concatenate([[start], inner, [end]])
        pieces = [np.linspace(a, b, int(np.ceil((b - a) / MAX_PIECE_M)) + 1)[:-1] for a, b in pairwise(corners)]
        self.at = np.concatenate([*pieces, [end]])
        self.points = axis.to_xy(self.at, axis.travelled_width / 2)
        # Headings of chords, weighted so that the curve turns evenly through its points.
        chord = np.diff(self.points, axis=0)
        heading = np.unwrap(np.arctan2(chord[:, 1], chord[:, 0]))
        length = np.hypot(*chord.T)
        middle = (heading[:-1] * length[1:] + heading[1:] * length[:-1]) / (length[1:] + length[:-1])
        self.heading = np.concatenate([heading[:1], middle, heading[-1:]])
        pairs = zip(self.points[:-1], self.points[1:], self.heading[:-1], self.heading[1:], strict=True)
        self.cubics = [_cubic(start, end, float(h0), float(h1)) for start, end, h0, h1 in pairs]
        self.s = np.concatenate([[0.0], np.cumsum([_arc_length(*cubic) for cubic in self.cubics])])

    @property
    def length(self) -> float:
        return float(self.s[-1])

    def station(self, at: FloatArray) -> FloatArray:
        """Stations of the reference line at stations of the map."""
        return np.interp(at, self.at, self.s)

    def add_to(self, road: ET.Element) -> None:
        view = ET.SubElement(road, "planView")
        straight = [max(abs(v)) < STRAIGHT_M for _, v in self.cubics]
        number = 0
        while number < len(self.cubics):
            end = number + 1
            while straight[number] and end < len(self.cubics) and straight[end]:
                end += 1
            x, y = self.points[number]
            geometry = ET.SubElement(
                view, "geometry", s=_text(self.s[number]), x=_text(x), y=_text(y), hdg=_text(self.heading[number]),
                length=_text(self.s[end] - self.s[number]),
            )  # fmt: skip
            if straight[number]:
                ET.SubElement(geometry, "line")
            else:
                poly = {f"{letter}{axis}": _text(k) for axis, ks in zip("UV", self.cubics[number], strict=True)
                        for letter, k in zip("abcd", ks, strict=True)}  # fmt: skip
                ET.SubElement(geometry, "paramPoly3", poly, pRange="normalized")
            number = end


def _cubic(start: FloatArray, end: FloatArray, h0: float, h1: float) -> tuple[FloatArray, FloatArray]:
    """Coefficients of u(p) and v(p), p in 0..1, of Hermite's cubic in the frame of its start."""
    cos, sin = np.cos(h0), np.sin(h0)
    du, dv = np.array([[cos, sin], [-sin, cos]]) @ (end - start)
    chord = float(np.hypot(du, dv))
    tangents = (chord * np.array([1.0, 0.0]), chord * np.array([np.cos(h1 - h0), np.sin(h1 - h0)]))
    u, v = (
        np.array([0.0, t0, 3 * delta - 2 * t0 - t1, -2 * delta + t0 + t1])
        for delta, t0, t1 in zip((du, dv), *tangents, strict=True)
    )
    return u, v


def _arc_length(u: FloatArray, v: FloatArray) -> float:
    p = np.linspace(0.0, 1.0, SAMPLES)
    speed = np.hypot(*(np.polyval(np.polyder(k[::-1]), p) for k in (u, v)))
    return float(np.sum((speed[:-1] + speed[1:]) / 2) / (SAMPLES - 1))


def _add_header(root: ET.Element, content: LanesFile, *, name: str) -> None:
    header = ET.SubElement(root, "header", revMajor="1", revMinor="7", name=name, vendor="wzsumo")
    if content.frame is not None:
        ET.SubElement(header, "geoReference").text = content.frame.crs
        east, north = content.frame.origin_m
        if east or north:
            ET.SubElement(header, "offset", x=_text(east), y=_text(north), z="0", hdg="0")


def _left_edge(lane_map: LaneMap) -> FloatArray:
    """The leftmost line (n,) of all lanes, open or closed: lanes are counted from it to the right."""
    return np.asarray(np.max([lane.left for lane in lane_map.lanes], axis=0))


def _add_section(
    lanes: ET.Element, s: FloatArray, cross: list[tuple[int | None, FloatArray]], neighbours: list[dict[int, int]]
) -> None:
    """The section at stations (k,) with lanes from the left; `neighbours` are the ids of lanes before and after it."""
    element = ET.SubElement(lanes, "laneSection", s=_text(s[0]))
    centre = ET.SubElement(ET.SubElement(element, "center"), "lane", id="0", type="none", level="false")
    _add_mark(centre, "solid")
    right = ET.SubElement(element, "right")
    for number, (lane, widths) in enumerate(cross):
        own = ET.SubElement(right, "lane", id=str(-number - 1), type="none" if lane is None else "driving", level="false")
        if lane is not None:
            link = ET.SubElement(own, "link")
            for tag, ids in zip(("predecessor", "successor"), neighbours, strict=True):
                if lane in ids:
                    ET.SubElement(link, tag, id=str(ids[lane]))
        _add_linear(own, "width", "sOffset", s - s[0], widths)
        if lane is not None:
            beside = number + 1 < len(cross) and cross[number + 1][0] is not None
            _add_mark(own, "broken" if beside else "solid")


def _add_mark(lane: ET.Element, kind: str) -> None:
    ET.SubElement(lane, "roadMark", sOffset="0", type=kind, weight="standard", color="standard", width="0.12")


def _strips(section: OpenSection, edge: FloatArray) -> list[tuple[int | None, FloatArray]]:
    """(lane, widths (k,)) from the left edge to the right; None for the ground that is no open lane."""
    found: list[tuple[int | None, FloatArray]] = []
    upper = edge
    for strip in section.strips[::-1]:
        gap = np.maximum(upper - strip.left, 0.0)
        if gap.max() > MIN_GAP_M:
            found.append((None, gap))
        found.append((strip.lane, strip.left - strip.right))
        upper = strip.right
    return found


def _ids(cross: list[tuple[int | None, FloatArray]]) -> dict[int, int]:
    """The id of each open lane in its section: negative, counted to the right."""
    return {lane: -number - 1 for number, (lane, _) in enumerate(cross) if lane is not None}


def _add_linear(parent: ET.Element, tag: str, key: str, s: FloatArray, values: FloatArray) -> None:
    """Elements of linear pieces (a + b ds) through values at stations, to within LINE_TOLERANCE_M."""
    kept = shapely.get_coordinates(shapely.simplify(shapely.LineString(np.column_stack([s, values])), LINE_TOLERANCE_M))
    for (at, value), (end, last) in pairwise(kept):
        ET.SubElement(parent, tag, {key: _text(at)}, a=_text(value), b=_text((last - value) / (end - at)), c="0", d="0")


def _text(value: float) -> str:
    return f"{value:.9g}" if abs(value) < 1e4 else f"{value:.6f}"
