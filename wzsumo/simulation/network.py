"""WorkZoneLayout -> SUMO network files.

SUMO has no tapered lane: a lane keeps one width along an edge. The road is therefore cut into edges so short that no lane
changes its width by more than MAX_WIDTH_STEP_M on any of them, each lane with an explicit shape along its true centre.
"""

import subprocess
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from wzsumo.errors import SimulationError
from wzsumo.frames import FloatArray
from wzsumo.simulation.installation import sumo_binary
from wzsumo.units import METRES_PER_FOOT, mps_from_mph
from wzsumo.work_zone import OpenLane, WorkZoneLayout

MAX_WIDTH_STEP_M = 0.1  # what a vehicle jumps sideways where it changes lane on such an edge; SUMO moves 0.1 m a step anyway
MERGE_END_WIDTH_M = 8 * METRES_PER_FOOT  # a closing lane ends where it is as narrow as this: a car just fits
LINE_MARGIN_M = 0.2  # SUMO lets a vehicle touch its lane's line, and a 12 m truck cuts a kink of 1:30 by 0.1 m
_NETCONVERT_OPTIONS = (
    # The default junction radius of 4 m moves nodes and cuts lanes; normalising moves the whole net (SUMO 1.28).
    "--no-turnarounds", "--offset.disable-normalization", "--precision", "4", "--default.junctions.radius", "0.1",
    "--junctions.join", "false", "--xml-validation", "never",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Edge:
    """One SUMO edge: stations in metres, and the road's lanes on it from right to left."""

    id: str
    start: float
    end: float
    lanes: tuple[OpenLane, ...]

    def sumo_index(self, road_lane: int) -> int | None:
        """SUMO's lane index of one of the road's lanes, None where it is closed."""
        return next((i for i, lane in enumerate(self.lanes) if lane.index == road_lane), None)


def edges_of(layout: WorkZoneLayout) -> tuple[Edge, ...]:
    """The edges from the road's start to its end, each with at least one lane."""
    cuts = _cuts(layout)
    edges = []
    for number, (start, end) in enumerate(pairwise(cuts)):
        middle = (start + end) / 2
        lanes = sorted((q for q in layout.lanes if q.start <= middle < _passable_end(q)), key=lambda q: q.index)
        name = next((area.name for area in layout.areas if area.start <= middle < area.end), "")
        name = name or ("approach" if middle < layout.start else "departure")
        edges.append(Edge(id=f"{number:02d}_{name.replace(' ', '_')}", start=start, end=end, lanes=tuple(lanes)))
    return tuple(edges)


def write_network(layout: WorkZoneLayout, folder: Path) -> Path:
    """Write zone.net.xml by netconvert from plain XML beside it; returns its path."""
    edges = edges_of(layout)
    nodes = ET.Element("nodes")
    for number, s in enumerate([edges[0].start, *(edge.end for edge in edges)]):
        x, y = layout.road.to_xy(s, layout.road.travelled_width / 2)
        ET.SubElement(nodes, "node", id=f"n{number}", x=f"{x:.4f}", y=f"{y:.4f}", type="priority")
    parts = {"node": nodes, "edge": _edge_list(layout, edges), "connection": _connections(edges)}
    files = {kind: folder / f"zone.{kind[:3]}.xml" for kind in parts}
    for kind, root in parts.items():
        write_xml(root, files[kind])
    net = folder / "zone.net.xml"
    command = [str(sumo_binary("netconvert")), *_NETCONVERT_OPTIONS, "--output-file", str(net)]
    for kind, path in files.items():
        command += [f"--{kind}-files", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0 or not net.exists():
        raise SimulationError(f"netconvert failed: {(done.stderr or done.stdout).strip().splitlines()[-1:]}")
    return net


def write_xml(root: ET.Element, path: Path) -> None:
    """Write an indented XML file."""
    ET.indent(root)
    ET.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _edge_list(layout: WorkZoneLayout, edges: tuple[Edge, ...]) -> ET.Element:
    root, speed = ET.Element("edges"), f"{mps_from_mph(layout.work_zone.posted_speed_mph):.3f}"
    for number, edge in enumerate(edges):
        ends = {"id": edge.id, "from": f"n{number}", "to": f"n{number + 1}"}
        # Without a length netconvert measures through the nodes: 18 m too much on the two edges beside the work.
        length = f"{edge.end - edge.start:.4f}"
        item = ET.SubElement(root, "edge", ends, speed=speed, numLanes=str(len(edge.lanes)), spreadType="center", length=length)
        for index, lane in enumerate(edge.lanes):
            shape = " ".join(f"{x:.4f},{y:.4f}" for x, y in _centre_line(layout, lane, edge))
            attributes = {"index": str(index), "width": f"{_width_on(lane, edge):.3f}", "shape": shape}
            if _is_closing(lane, edge):
                attributes["disallow"] = "truck"  # wider than the lane's end: trucks merge before the taper
            ET.SubElement(item, "lane", attributes)
    return root


def _connections(edges: tuple[Edge, ...]) -> ET.Element:
    root = ET.Element("connections")
    for before, after in pairwise(edges):
        for index, lane in enumerate(before.lanes):
            onward = after.sumo_index(lane.index)
            if onward is not None:
                ends = {"from": before.id, "to": after.id}
                ET.SubElement(root, "connection", ends, fromLane=str(index), toLane=str(onward))
    return root


def _cuts(layout: WorkZoneLayout) -> FloatArray:
    """Stations where a lane begins, ends, bends or has changed its width by a step."""
    breaks = {0.0, layout.road.length}
    for lane in layout.lanes:
        s = np.unique(np.concatenate([lane.right.stations, lane.left.stations, [lane.start, _passable_end(lane)]]))
        s = s[(s >= lane.start) & (s <= _passable_end(lane)) & (s > 0) & (s < layout.road.length)]
        breaks.update(s.tolist())
    stations = np.array(sorted(breaks))
    stations = stations[np.concatenate([[True], np.diff(stations) > 1e-3])]
    pieces = []
    for start, end in pairwise(stations):
        middle = (start + end) / 2
        on_it = [lane for lane in layout.lanes if lane.start <= middle < _passable_end(lane)]
        change = max(abs(_width(lane, end) - _width(lane, start)) for lane in on_it)
        n = max(1, int(np.ceil(change / MAX_WIDTH_STEP_M - 1e-6)))
        pieces.append(start + np.arange(n) / n * (end - start))
    return np.concatenate([*pieces, stations[-1:]])


def _width(lane: OpenLane, s: float) -> float:
    return float(lane.left(s) - lane.right(s))


def _width_on(lane: OpenLane, edge: Edge) -> float:
    return min(_width(lane, edge.start), _width(lane, edge.end)) - LINE_MARGIN_M


def _passable_end(lane: OpenLane) -> float:
    """Station [m] where a closing lane is down to MERGE_END_WIDTH_M; the lane's own end where it does not close."""
    if _width(lane, lane.end) >= MERGE_END_WIDTH_M:
        return lane.end
    s = np.unique(np.concatenate([lane.left.stations, lane.right.stations, [lane.end]]))
    s = s[(s >= lane.start) & (s <= lane.end)]
    widths = lane.left(s) - lane.right(s)
    return float(np.interp(-MERGE_END_WIDTH_M, -widths, s))


def _is_closing(lane: OpenLane, edge: Edge) -> bool:
    return _width(lane, lane.end) < MERGE_END_WIDTH_M and _width(lane, edge.end) < _width(lane, edge.start) - 1e-6


def _centre_line(layout: WorkZoneLayout, lane: OpenLane, edge: Edge) -> FloatArray:
    inner = layout.road.stations
    s = np.concatenate([[edge.start], inner[(inner > edge.start + 0.01) & (inner < edge.end - 0.01)], [edge.end]])
    return layout.road.to_xy(s, (lane.left(s) + lane.right(s)) / 2)
