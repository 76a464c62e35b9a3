"""WorkZoneLayout -> SUMO network files.

SUMO has no tapered lane: a lane keeps one width along an edge. The road is therefore cut into edges so short that no lane
changes its width by more than MAX_WIDTH_STEP_M on any of them, each lane with an explicit shape along its true centre.
Where both directions take turns on one lane, their edges lie on top of each other and a traffic light lets one in at a time.
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
from wzsumo.simulation.turns import SIGNAL_ID, turns_program
from wzsumo.units import METRES_PER_FOOT, mps_from_mph
from wzsumo.work_zone import OpenLane, WorkZoneLayout

# What a vehicle jumps sideways where it changes lane on such an edge; SUMO moves up to 0.1 m a step anyway. Half of it costs a
# sixth more time in the paper's zone and brings hardly fewer jumps: of 56,000 steps 54 instead of 65 are above 0.2 m (seed 22).
MAX_WIDTH_STEP_M = 0.2
MERGE_END_WIDTH_M = 8 * METRES_PER_FOOT  # a closing lane ends where it is as narrow as this: a car just fits
SAME_STATION_M = 0.01
LAST_CHANGE_AHEAD_M = 100.0  # of closed lanes between two open ones: what is begun there ends before (4 s at 25 m/s)
NOBODY = "custom1"  # SUMO's vehicle class that no vehicle type here has
LINE_MARGIN_M = 0.2  # SUMO lets a vehicle touch its lane's line, and a 12 m truck cuts a kink of 1:30 by 0.1 m
_NETCONVERT_OPTIONS = (
    # The default junction radius of 4 m moves nodes and cuts lanes; normalising moves the whole net (SUMO 1.28).
    "--no-turnarounds", "--offset.disable-normalization", "--precision", "4", "--default.junctions.radius", "0.1",
    "--junctions.join", "false", "--xml-validation", "never",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Edge:
    """One SUMO edge: stations in metres (start < end), and its lanes in SUMO's order, from the right of who drives on it."""

    id: str
    start: float
    end: float
    lanes: tuple[OpenLane, ...]
    opposing: bool = False  # driven from `end` to `start`


def edges_of(layout: WorkZoneLayout) -> tuple[Edge, ...]:
    """The edges from the road's start to its end, each with at least one lane."""
    edges = []
    for number, (start, end) in enumerate(pairwise(_cuts(layout))):
        middle = (start + end) / 2
        lanes = [q for q in layout.lanes if not q.opposing and q.start <= middle < _passable_end(q)]
        name = next((area.name for area in layout.areas if area.start <= middle < area.end), "")
        name = name or ("approach" if middle < layout.start else "departure")
        id_ = f"{number:02d}_{name.replace(' ', '_')}"
        edges.append(Edge(id=id_, start=start, end=end, lanes=tuple(sorted(lanes, key=lambda q: float(q.right(middle))))))
    return tuple(edges)


def opposing_edges_of(layout: WorkZoneLayout) -> tuple[Edge, ...]:
    """The edges of the other direction, from the road's end to its start; none on a one-way carriageway."""
    lanes = tuple(sorted((q for q in layout.lanes if q.opposing), key=lambda q: -float(q.right(0.0))))
    if not lanes:
        return ()
    turns = layout.taking_turns
    stations = [layout.road.length, *((turns.end, turns.start) if turns else ()), 0.0]
    return tuple(
        Edge(id=f"opposing_{number}", start=start, end=end, lanes=lanes, opposing=True)
        for number, (end, start) in enumerate(pairwise(stations))
    )


def write_network(layout: WorkZoneLayout, folder: Path) -> Path:
    """Write zone.net.xml by netconvert from plain XML beside it; returns its path."""
    edges, opposing = edges_of(layout), opposing_edges_of(layout)
    connections = [*_connections(layout, edges), *_connections(layout, opposing)]
    roots = {
        "node": _nodes(layout, edges),
        "edge": _edge_list(layout, (*edges, *opposing)),
        "connection": ET.Element("connections"),
    }
    roots["connection"].extend(connections)
    if layout.taking_turns:
        entries = [edge.id for edge in (*edges, *opposing) if _is_entry(edge, layout)]
        roots["tllogic"] = turns_program(layout, [link for link in connections if link.get("from") in entries])
    command = [str(sumo_binary("netconvert")), *_NETCONVERT_OPTIONS]
    for kind, root in roots.items():
        path = folder / f"zone.{kind[:3]}.xml"
        write_xml(root, path)
        command += [f"--{kind}-files", str(path)]
    net = folder / "zone.net.xml"
    done = subprocess.run([*command, "--output-file", str(net)], capture_output=True, text=True, check=False)
    if done.returncode != 0 or not net.exists():
        raise SimulationError(f"netconvert failed: {(done.stderr or done.stdout).strip().splitlines()[-1:]}")
    return net


def write_xml(root: ET.Element, path: Path) -> None:
    """Write an indented XML file."""
    ET.indent(root)
    ET.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _nodes(layout: WorkZoneLayout, edges: tuple[Edge, ...]) -> ET.Element:
    root, turns = ET.Element("nodes"), layout.taking_turns
    for number, s in enumerate([edges[0].start, *(edge.end for edge in edges)]):
        x, y = layout.road.to_xy(s, layout.road.travelled_width / 2)
        kind = {"type": "priority"}
        if turns and min(abs(s - turns.start), abs(s - turns.end)) < SAME_STATION_M:
            kind = {"type": "traffic_light", "tl": SIGNAL_ID}
        ET.SubElement(root, "node", {"id": f"n{number}", "x": f"{x:.4f}", "y": f"{y:.4f}", **kind})
    return root


def _edge_list(layout: WorkZoneLayout, edges: tuple[Edge, ...]) -> ET.Element:
    root, speed = ET.Element("edges"), f"{mps_from_mph(layout.work_zone.posted_speed_mph):.3f}"
    stations = np.array([0.0, *(edge.end for edge in edges if not edge.opposing)])
    for edge in edges:
        nodes = [f"n{int(np.argmin(np.abs(stations - s)))}" for s in (edge.start, edge.end)]
        first, last = reversed(nodes) if edge.opposing else nodes
        # Without a length netconvert measures through the nodes: 18 m too much on the two edges beside the work.
        item = ET.SubElement(
            root, "edge", {"id": edge.id, "from": first, "to": last}, speed=speed, numLanes=str(len(edge.lanes)),
            spreadType="center", length=f"{edge.end - edge.start:.4f}",
        )  # fmt: skip
        for index, lane in enumerate(edge.lanes):
            shape = " ".join(f"{x:.4f},{y:.4f}" for x, y in _centre_line(layout, lane, edge))
            attributes = {"index": str(index), "width": f"{_width_on(lane, edge):.3f}", "shape": shape}
            if _is_closing(lane, edge):
                attributes["disallow"] = "truck"  # wider than the lane's end: trucks merge before the taper
            # Neighbours in SUMO's order may have closed lanes between them, or soon will have.
            if index + 1 < len(edge.lanes) and _apart(lane, edge.lanes[index + 1], edge):
                attributes["changeLeft"] = NOBODY
            if index > 0 and _apart(edge.lanes[index - 1], lane, edge):
                attributes["changeRight"] = NOBODY
            ET.SubElement(item, "lane", attributes)
    return root


def _apart(right: OpenLane, left: OpenLane, edge: Edge) -> bool:
    gap = max(float(left.right(s) - right.left(s)) for s in (edge.start, edge.end, edge.end + LAST_CHANGE_AHEAD_M))
    return not edge.opposing and gap > SAME_STATION_M


def _connections(layout: WorkZoneLayout, edges: tuple[Edge, ...]) -> list[ET.Element]:
    """Every lane leads on to itself; none but the ways onto a shared lane are held back by its signal."""
    found = []
    for before, after in pairwise(edges):
        for index, lane in enumerate(before.lanes):
            if lane in after.lanes:
                ends = {"from": before.id, "to": after.id, "fromLane": str(index), "toLane": str(after.lanes.index(lane))}
                if not _is_entry(before, layout):
                    ends["uncontrolled"] = "true"
                found.append(ET.Element("connection", ends))
    return found


def _is_entry(edge: Edge, layout: WorkZoneLayout) -> bool:
    """Whether an edge ends at the stop line where its direction waits for its turn."""
    turns = layout.taking_turns
    if turns is None:
        return False
    stop, here = (turns.end, edge.start) if edge.opposing else (turns.start, edge.end)
    return abs(stop - here) < SAME_STATION_M


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
        on_it = [lane for lane in layout.lanes if not lane.opposing and lane.start <= middle < _passable_end(lane)]
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
    line = layout.road.to_xy(s, (lane.left(s) + lane.right(s)) / 2)
    return line[::-1] if edge.opposing else line
