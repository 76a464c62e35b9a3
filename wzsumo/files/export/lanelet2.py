"""Lanelet2 maps: OSM XML of lanelets with left and right bounds, one-way, with a speed limit.

Neighbours that are both open share their line, which is how Lanelet2 knows that one may change between them, and consecutive
lanelets share their end points, which is how it knows that one follows the other. Written here and not by the lanelet2 library,
whose projections are not those of a frame of ours; the library reads it back in the tests.
Source: Lanelet2 documentation, "LaneletPrimitives" and "LinestringTagging".
"""

from xml.etree import ElementTree as ET

import numpy as np

from wzsumo.errors import MapError
from wzsumo.files.export.open_strips import OpenSection, OpenStrip, open_sections
from wzsumo.files.lanes import LanesFile
from wzsumo.frames import FloatArray
from wzsumo.units import mph_from_mps

DECIMALS_DEG = 9  # 0.1 mm
MIN_POINT_DISTANCE_M = 0.001  # points of one line are farther apart


def lanelet2_osm(content: LanesFile, *, speed_limit_mps: float | None) -> bytes:
    """The OSM file of a map's open lanes. Raises MapError where the map has no place on earth or no open lane."""
    if content.frame is None:
        raise MapError(
            "Lanelet2 keeps places in degrees, and these lanes have none on earth; say where (0, 0) lies by --origin"
        )
    writer = _Writer(content)
    sections = open_sections(content.lanes)
    for section in sections:
        writer.add_section(section, speed_limit_mps=speed_limit_mps)
    if not writer.relations:
        raise MapError("no lane of this map is open anywhere: there is no lanelet to write")
    return writer.xml()


class _Writer:
    """Collects nodes, ways and relations; points are shared by their place in the road, lines by their points."""

    def __init__(self, content: LanesFile) -> None:
        self.lanes, self.frame = content.lanes, content.frame
        self.nodes: dict[tuple[float, float], int] = {}
        self.ways: dict[tuple[int, ...], ET.Element] = {}
        self.relations: list[ET.Element] = []
        self.last_id = 0

    def add_section(self, section: OpenSection, *, speed_limit_mps: float | None) -> None:
        for number, strip in enumerate(section.strips):
            beside = [section.strips[k] for k in (number - 1, number + 1) if 0 <= k < len(section.strips)]
            members = []
            for role, offsets, sd in (("left", strip.left, strip.left_sd), ("right", strip.right, strip.right_sd)):
                shared = any(np.array_equal(offsets, _facing(other, role)) for other in beside)
                members.append((role, self._way(section.stations, offsets, sd, dashed=shared)))
            relation = ET.Element("relation", id=self._id(), visible="true", version="1")
            for role, way in members:
                ET.SubElement(relation, "member", type="way", ref=way, role=role)
            tags = {
                "type": "lanelet", "subtype": "road", "location": "nonurban", "one_way": "yes", "participant:vehicle": "yes",
                "lane": str(strip.lane),
            }  # fmt: skip
            if speed_limit_mps is not None:
                tags["speed_limit"] = f"{mph_from_mps(speed_limit_mps):.0f} mph"
            _add_tags(relation, tags)
            self.relations.append(relation)

    def xml(self) -> bytes:
        """The file: nodes, ways and relations in this order."""
        root = ET.Element("osm", version="0.6", upload="false", generator="wzsumo")
        places = np.array(list(self.nodes))
        assert self.frame is not None  # noqa: S101 - checked at the entrance
        lonlat = self.frame.to_lonlat(self.lanes.to_xy(places[:, 0], places[:, 1]))
        for (lon, lat), node in zip(lonlat, self.nodes.values(), strict=True):
            place = {"lat": f"{lat:.{DECIMALS_DEG}f}", "lon": f"{lon:.{DECIMALS_DEG}f}"}
            ET.SubElement(root, "node", {"id": str(node), "visible": "true", "version": "1"} | place)
        root.extend([*self.ways.values(), *self.relations])
        ET.indent(root)
        return ET.tostring(root, encoding="utf-8", xml_declaration=True)

    def _way(self, stations: FloatArray, offsets: FloatArray, sd: FloatArray, *, dashed: bool) -> str:
        points = tuple(self._node(float(s), float(d)) for s, d in zip(stations, offsets, strict=True))
        if points not in self.ways:
            way = ET.Element("way", id=self._id(), visible="true", version="1")
            for point in points:
                ET.SubElement(way, "nd", ref=str(point))
            _add_tags(way, {"type": "line_thin", "subtype": "dashed" if dashed else "solid", "sd_m": f"{np.median(sd):.2f}"})
            self.ways[points] = way
        return str(self.ways[points].get("id"))

    def _node(self, station: float, offset: float) -> int:
        place = (round(station, 3), round(offset, 3))
        if place not in self.nodes:
            self.last_id += 1
            self.nodes[place] = self.last_id
        return self.nodes[place]

    def _id(self) -> str:
        self.last_id += 1
        return str(self.last_id)


def _facing(other: OpenStrip, role: str) -> FloatArray:
    """The side of a neighbour that faces a strip's left or right side."""
    return other.right if role == "left" else other.left


def _add_tags(element: ET.Element, tags: dict[str, str]) -> None:
    for key, value in tags.items():
        ET.SubElement(element, "tag", k=key, v=value)
