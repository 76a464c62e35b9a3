"""A SUMO network as its file says it: edges with the shapes of their lanes, and the connections between lanes."""

import io
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray
from wzsumo.geography import LocalFrame
from wzsumo.input_files import read_bytes

MAX_LANES = 100  # of an edge
MAX_COORDINATE_M = 1e8  # of any projection of the earth
DEFAULT_LANE_WIDTH_M = 3.2  # SUMO docs, "Networks/SUMO Road Networks": of lanes without a width
# Vehicle classes of which one must be allowed on a lane of general traffic (SUMO docs, "Vehicle Classes").
GENERAL = ("passenger", "private", "all")


@dataclass(frozen=True, kw_only=True, eq=False)
class NetLane:
    """A lane: centre line (n, 2) [m], width [m] (None: SUMO's default), speed [m/s], whether cars may drive on it."""

    id: str
    index: int
    shape: FloatArray
    width: float | None
    speed: float
    for_cars: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class NetEdge:
    """An edge: its lanes from the right, the junctions at its ends; internal edges lie within a junction."""

    id: str
    start: str
    end: str
    lanes: tuple[NetLane, ...]
    internal: bool

    @property
    def car_lanes(self) -> list[NetLane]:
        """Lanes for general traffic, from the right."""
        return [lane for lane in self.lanes if lane.for_cars]

    @property
    def length(self) -> float:
        """Length [m] of the leftmost lane's shape."""
        return float(np.sum(np.hypot(*np.diff(self.lanes[-1].shape, axis=0).T)))


@dataclass(frozen=True, kw_only=True)
class NetConnection:
    """From a lane of one edge to a lane of another, through the internal lane `via` where there is one."""

    start: str
    start_lane: int
    end: str
    end_lane: int
    via: str | None


@dataclass(frozen=True, kw_only=True, eq=False)
class SumoNet:
    """Edges by id, connections by (from, to), internal lanes by id, and the frame (None: the network has no place on earth)."""

    edges: dict[str, NetEdge]
    connections: dict[tuple[str, str], list[NetConnection]]
    internal_lanes: dict[str, NetLane]
    next_internal: dict[str, str]  # the internal lane that an internal lane goes on to within its junction
    frame: LocalFrame | None = None

    def followers(self, edge: str) -> list[str]:
        """Edges that cars may go on to."""
        return self._neighbours[0].get(edge, [])

    def predecessors(self, edge: str) -> list[str]:
        """Edges that cars may come from."""
        return self._neighbours[1].get(edge, [])

    @cached_property
    def _neighbours(self) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
        ahead: dict[str, list[str]] = {}
        behind: dict[str, list[str]] = {}
        for start, end in self.connections:
            ahead.setdefault(start, []).append(end)
            behind.setdefault(end, []).append(start)
        return ahead, behind


def read_net(path: Path) -> SumoNet:
    """The network of a .net.xml or .net.xml.gz file. Raises SpecError where it is none."""
    try:
        net = _collected(_top_elements(path))
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file; name a SUMO network (.net.xml)") from None
    except (OSError, ET.ParseError, KeyError, ValueError, IndexError) as error:
        raise SpecError(f"{path}: is no SUMO network ({type(error).__name__}: {error})") from None
    if not net.edges:
        raise SpecError(f"{path}: has no edge for cars; a SUMO network ends in .net.xml and comes from netconvert")
    return net


def _collected(elements: Iterator[ET.Element]) -> SumoNet:
    edges: dict[str, NetEdge] = {}
    internal: dict[str, NetLane] = {}
    next_internal: dict[str, str] = {}
    connections: dict[tuple[str, str], list[NetConnection]] = {}
    frame: LocalFrame | None = None
    for element in elements:
        if element.tag == "location":
            frame = _frame(element)
        elif element.tag == "edge" and element.get("function") in {None, "normal", "internal", "connector"}:
            edge = _edge(element)
            if edge.internal:
                internal |= {lane.id: lane for lane in edge.lanes}
            elif edge.car_lanes:
                edges[edge.id] = edge
        elif element.tag == "connection":
            found = _connection(element)
            if not found.start.startswith(":"):
                connections.setdefault((found.start, found.end), []).append(found)
            elif found.via is not None:
                next_internal[f"{found.start}_{found.start_lane}"] = found.via
    known = {pair: found for pair, found in connections.items() if pair[0] in edges and pair[1] in edges}
    _check_lanes(edges, known)
    return SumoNet(edges=edges, connections=known, internal_lanes=internal, next_internal=next_internal, frame=frame)


def _top_elements(path: Path) -> Iterator[ET.Element]:
    with io.BytesIO(read_bytes(path)) if path.suffix == ".gz" else path.open("rb") as file:
        depth = 0
        for event, element in ET.iterparse(file, events=("start", "end")):  # noqa: S314 - expat expands no external entities
            depth += 1 if event == "start" else -1
            if event == "end" and depth == 1:
                yield element
                element.clear()


def _frame(location: ET.Element) -> LocalFrame | None:
    projection = location.get("projParameter", "!")
    if projection in {"!", "-", ""}:
        return None
    east, north = (float(value) for value in location.attrib["netOffset"].split(","))
    try:
        return LocalFrame(crs=projection, origin_m=(-east, -north))
    except SpecError:
        return None  # degrees, or a projection of SUMO's own: metres without a place


def _edge(element: ET.Element) -> NetEdge:
    return NetEdge(
        id=element.attrib["id"],
        start=element.get("from", ""),
        end=element.get("to", ""),
        lanes=tuple(sorted((_lane(lane) for lane in element.findall("lane")), key=lambda lane: lane.index)),
        internal=element.get("function") == "internal",
    )


def _lane(element: ET.Element) -> NetLane:
    points = np.array([point.split(",")[:2] for point in element.attrib["shape"].split()], dtype=float)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not (np.abs(points) < MAX_COORDINATE_M).all():
        raise ValueError(f"the shape of lane {element.attrib['id']} is no line of two points or more")
    width = element.get("width")
    return NetLane(
        id=element.attrib["id"],
        index=_lane_number(element),
        shape=points,
        width=None if width is None else float(width),
        speed=float(element.attrib["speed"]),
        for_cars=_for_cars(element.get("allow"), element.get("disallow")),
    )


def _lane_number(element: ET.Element) -> int:
    index = int(element.attrib["index"])
    if not 0 <= index < MAX_LANES:
        raise ValueError(f"lane {element.attrib['id']} has the index {index}")
    return index


def _for_cars(allow: str | None, disallow: str | None) -> bool:
    if allow is not None:
        return bool(set(allow.split()) & set(GENERAL))
    return disallow is None or not set(disallow.split()) & {"passenger", "all"}


def _check_lanes(edges: dict[str, NetEdge], connections: dict[tuple[str, str], list[NetConnection]]) -> None:
    """Raise ValueError where a connection is of a lane that its edge has not."""
    for (start, end), found in connections.items():
        n_start, n_end = len(edges[start].lanes), len(edges[end].lanes)
        if not all(0 <= one.start_lane < n_start and 0 <= one.end_lane < n_end for one in found):
            raise ValueError(f"a connection from {start} to {end} is of a lane that is not there")


def _connection(element: ET.Element) -> NetConnection:
    return NetConnection(
        start=element.attrib["from"],
        start_lane=int(element.attrib["fromLane"]),
        end=element.attrib["to"],
        end_lane=int(element.attrib["toLane"]),
        via=element.get("via"),
    )
