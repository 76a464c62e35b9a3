"""What the placement reads of a SUMO network: edges, lanes, connections and junctions, each with its place in the file."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from wzsumo.errors import PlacementError
from wzsumo.frames import FloatArray, arc_length
from wzsumo.placement.net_check import check_numbers, check_references, whole_number
from wzsumo.placement.xml_file import Element, XmlFile

DEFAULT_LANE_WIDTH_M = 3.2  # SUMO's, where a lane says none
# Classes that do not drive on a carriageway: a lane for these alone is no lane of the road (SUMO docs, Vehicle Classes).
OFF_ROAD_CLASSES = frozenset({
    "pedestrian", "bicycle", "tram", "rail", "rail_urban", "rail_electric", "rail_fast", "ship", "container", "cable_car",
    "subway", "aircraft", "wheelchair", "scooter", "drone",
})  # fmt: skip
ROAD_CLASSES = frozenset({
    "private", "emergency", "authority", "army", "vip", "passenger", "hov", "taxi", "bus", "coach", "delivery", "truck",
    "trailer", "motorcycle", "moped", "evehicle",
})  # fmt: skip


@dataclass(eq=False, slots=True)
class NetLane:
    """One lane of an edge; index 0 is the rightmost."""

    element: Element
    index: int

    @property
    def id(self) -> str:
        """SUMO's id of the lane."""
        return self.element.get("id")

    @property
    def length(self) -> float:
        """Length [m] by which SUMO counts positions; that of the shape may differ in nets drawn by hand."""
        return float(self.element.get("length"))

    @property
    def width(self) -> float:
        """Width [m]."""
        return float(self.element.get("width") or DEFAULT_LANE_WIDTH_M)

    @property
    def speed(self) -> float:
        """Limit [m/s]; 0 where the file has none."""
        return float(self.element.get("speed") or 0.0)

    @property
    def points(self) -> FloatArray:
        """The middle line's points (n, 2) [m]."""
        return parse_shape(self.element.get("shape"))

    def allows(self, vehicle_class: str) -> bool:
        """Whether vehicles of a class may drive here."""
        return allows(self.element.attributes, vehicle_class)

    @property
    def is_roadway(self) -> bool:
        """Whether any class that drives on carriageways may drive here."""
        return any(self.allows(name) for name in ROAD_CLASSES)


@dataclass(eq=False, slots=True)
class NetEdge:
    """One edge; internal ones lie in a junction."""

    element: Element
    lanes: list[NetLane]

    @property
    def id(self) -> str:
        """SUMO's id of the edge."""
        return self.element.get("id")

    @property
    def length(self) -> float:
        """Length [m] by which SUMO counts positions."""
        return self.lanes[0].length

    @property
    def is_internal(self) -> bool:
        """Whether it lies in a junction: an internal lane, a crossing or a walking area."""
        return bool(self.element.get("function")) and self.element.get("function") not in {"normal", "connector"}

    @property
    def from_node(self) -> str:
        """Id of the junction where it begins."""
        return self.element.get("from")

    @property
    def to_node(self) -> str:
        """Id of the junction where it ends."""
        return self.element.get("to")


@dataclass(eq=False, slots=True)
class Connection:
    """One connection between lanes of two edges, over the internal lane `via` where the net has internal lanes."""

    element: Element
    from_edge: str
    to_edge: str
    from_lane: int
    to_lane: int

    @property
    def via(self) -> str:
        """Id of the internal lane; empty where there is none."""
        return self.element.get("via")


@dataclass(frozen=True, kw_only=True, eq=False)
class Net:
    """A network as it lies in its file."""

    file: XmlFile
    edges: dict[str, NetEdge]
    connections: list[Connection]
    junctions: dict[str, Element]
    roundabouts: list[Element]
    location: dict[str, str] = field(default_factory=dict)
    lefthand: bool = False
    junctions_end: int = 0  # byte behind the last junction
    connections_begin: int = 0  # byte of the first connection

    @classmethod
    def read(cls, path: Path) -> Self:
        """The network of a net.xml. Raises PlacementError where the file is none."""
        file = XmlFile.read(path, role="the network")
        edges: dict[str, NetEdge] = {}
        connections: list[Connection] = []
        junctions: dict[str, Element] = {}
        roundabouts: list[Element] = []
        places = {"junctions_end": 0, "connections_begin": 0}
        location: dict[str, str] = {}

        def take(element: Element) -> None:
            match element.tag:
                case "edge":
                    lanes = [lane for lane in element.children if lane.tag == "lane"]
                    edges[element.get("id")] = NetEdge(element, [NetLane(lane, i) for i, lane in enumerate(lanes)])
                case "connection":
                    places["connections_begin"] = places["connections_begin"] or element.begin
                    lanes_ = (whole_number(path, element, key) for key in ("fromLane", "toLane"))
                    connections.append(Connection(element, element.get("from"), element.get("to"), *lanes_))
                case "junction":
                    junctions[element.get("id")] = element
                    places["junctions_end"] = element.end
                case "roundabout":
                    roundabouts.append(element)
                case "location":
                    location.update(element.attributes)

        root = file.root_and_children(take)
        if root.tag != "net" or not edges or not connections:
            raise PlacementError(
                f"{path}: is no SUMO network (its root is <{root.tag}>, with {len(edges)} edges and {len(connections)} "
                "connections); give the .net.xml that netconvert or netedit wrote"
            )
        check_numbers(path, [edge.element for edge in edges.values()], junctions.values(), location=location)
        lane_counts = {edge.id: len(edge.lanes) for edge in edges.values()}
        check_references(path, [link.element for link in connections], lane_counts=lane_counts)
        return cls(
            file=file, edges=edges, connections=connections, junctions=junctions, roundabouts=roundabouts,
            location=location, lefthand=root.get("lefthand") in {"true", "1", "yes", "on"}, **places,
        )  # fmt: skip

    @cached_property
    def outgoing(self) -> dict[tuple[str, int], list[Connection]]:
        """Connections by the edge and the lane that they leave."""
        return _grouped(self.connections, lambda link: (link.from_edge, link.from_lane))

    @cached_property
    def incoming(self) -> dict[tuple[str, int], list[Connection]]:
        """Connections between ordinary edges by the edge and the lane that they reach."""
        ordinary = [link for link in self.connections if not link.from_edge.startswith(":")]
        return _grouped(ordinary, lambda link: (link.to_edge, link.to_lane))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Least x and y, greatest x and y [m] of the junctions, between which sumo-gui shows the whole network."""
        points = np.array([[float(node.get("x")), float(node.get("y"))] for node in self.junctions.values()])
        return *points.min(axis=0).tolist(), *points.max(axis=0).tolist()

    def lane_of(self, lane_id: str) -> NetLane:
        """The lane of an id such as E_0 or :J_3_0."""
        edge, _, index = lane_id.rpartition("_")
        return self.edges[edge].lanes[int(index)]

    def via_lanes(self, link: Connection) -> list[NetLane]:
        """The internal lanes of a connection, in the order in which they are driven."""
        lanes, via = [], link.via
        while via:
            lanes.append(self.lane_of(via))
            edge, _, index = via.rpartition("_")
            onward = [c for c in self.outgoing.get((edge, int(index)), []) if c.to_edge == link.to_edge]
            via = onward[0].via if onward else ""
        return lanes


def allows(attributes: dict[str, str], vehicle_class: str) -> bool:
    """Whether a lane with these attributes lets vehicles of a class drive on it."""
    if allowed := attributes.get("allow"):
        return allowed == "all" or vehicle_class in allowed.split()
    barred = attributes.get("disallow", "")
    return barred != "all" and vehicle_class not in barred.split()


def parse_shape(text: str) -> FloatArray:
    """Points (n, 2) [m] of a shape as SUMO writes it; heights are left out."""
    return np.array([[float(v) for v in point.split(",")[:2]] for point in text.split()], dtype=float).reshape(-1, 2)


def parse_heights(text: str) -> FloatArray | None:
    """Heights (n,) [m] of the points of a shape; None where it has none."""
    points = [point.split(",") for point in text.split()]
    return np.array([float(point[2]) for point in points]) if points and all(len(point) == 3 for point in points) else None


def decimals_of(text: str) -> int:
    """With how many decimals a shape is written: SUMO's two at least."""
    return max(2, len(text.split(",", maxsplit=1)[0].partition(".")[2]))


def point_on(lane: NetLane, position: float) -> FloatArray:
    """The point (2,) at a position [m] of a lane, which SUMO scales from the lane's length to that of its shape."""
    points = lane.points
    along = arc_length(points)
    at = np.clip(position / lane.length, 0, 1) * along[-1]
    return np.array([np.interp(at, along, points[:, 0]), np.interp(at, along, points[:, 1])])


def _grouped(
    connections: list[Connection], key: Callable[[Connection], tuple[str, int]]
) -> dict[tuple[str, int], list[Connection]]:
    groups: dict[tuple[str, int], list[Connection]] = defaultdict(list)
    for link in connections:
        groups[key(link)].append(link)
    return dict(groups)
