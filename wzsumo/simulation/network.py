"""WorkZoneLayout -> SUMO's network, zone.net.xml.

Every lane has an explicit shape along its middle (see `edges`), because netconvert by itself lays the lanes of an edge side by
side around the edge's middle. Nodes have no lanes of their own: a vehicle passes from edge to edge where it is, and SUMO takes
it back to its place in the next lane bit by bit where that lies aside.

Where both directions take turns on one lane, a traffic light lets one of them in at a time (see `turns`).
"""

import subprocess
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from wzsumo.errors import SimulationError
from wzsumo.frames import FloatArray
from wzsumo.simulation.connection import sumo_binary
from wzsumo.simulation.edges import Edge, EdgeLane, edges_of, opposing_edges_of
from wzsumo.simulation.stretches import SAME_PLACE_M
from wzsumo.simulation.turns import SIGNAL_ID, turns_program
from wzsumo.units import mps_from_mph
from wzsumo.work_zone import WorkZoneLayout

UNUSED_VEHICLE_CLASS = "custom1"  # none of our vehicle types has it, so what allows it alone bars every vehicle
_NETCONVERT_OPTIONS = (
    # The default junction radius of 4 m moves nodes and cuts lanes; normalising moves the whole net (SUMO 1.28).
    "--no-turnarounds", "--offset.disable-normalization", "--precision", "4", "--default.junctions.radius", "0",
    "--junctions.join", "false", "--no-internal-links", "--xml-validation", "never",
)  # fmt: skip


def write_network(layout: WorkZoneLayout, folder: Path) -> Path:
    """Write zone.net.xml by netconvert from plain XML beside it; returns its path."""
    edges, opposing = edges_of(layout), opposing_edges_of(layout)
    connections = [*_connections(layout, edges), *_connections(layout, opposing)]
    roots = {
        "node": _nodes(layout, edges),
        "edge": _edge_elements(layout, (*edges, *opposing)),
        "connection": ET.Element("connections"),
    }
    roots["connection"].extend(connections)
    if layout.taking_turns:
        entries = [edge.id for edge in (*edges, *opposing) if _ends_at_stop_line(edge, layout)]
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
        if turns and min(abs(s - turns.start), abs(s - turns.end)) < SAME_PLACE_M:
            kind = {"type": "traffic_light", "tl": SIGNAL_ID}
        ET.SubElement(root, "node", {"id": f"n{number}", "x": f"{x:.4f}", "y": f"{y:.4f}", **kind})
    return root


def _edge_elements(layout: WorkZoneLayout, edges: tuple[Edge, ...]) -> ET.Element:
    root, speed = ET.Element("edges"), f"{mps_from_mph(layout.work_zone.posted_speed_mph):.3f}"
    node_stations = np.array([0.0, *(edge.end for edge in edges if not edge.opposing)])
    for edge in edges:
        nodes = [f"n{int(np.argmin(np.abs(node_stations - s)))}" for s in (edge.start, edge.end)]
        first, last = reversed(nodes) if edge.opposing else nodes
        # Without a length netconvert measures through the nodes: 18 m too much on the two edges beside the work.
        element = ET.SubElement(
            root, "edge", {"id": edge.id, "from": first, "to": last}, speed=speed, numLanes=str(len(edge.lanes)),
            spreadType="center", length=f"{edge.end - edge.start:.4f}",
        )  # fmt: skip
        for index, lane in enumerate(edge.lanes):
            shape = " ".join(f"{x:.4f},{y:.4f}" for x, y in _middle_line(layout, lane, edge))
            attributes = {"index": str(index), "width": f"{lane.width:.3f}", "shape": shape}
            ET.SubElement(element, "lane", attributes | _permissions(lane))
    return root


def _permissions(lane: EdgeLane) -> dict[str, str]:
    """The attributes of a lane that bar vehicles from it, or from changing to a lane beside."""
    allowed = {"all": None, "cars": "passenger", "none": UNUSED_VEHICLE_CLASS}[lane.allows]
    changes = {"changeLeft": lane.change_left, "changeRight": lane.change_right}
    barred = {name: UNUSED_VEHICLE_CLASS for name, may_change in changes.items() if not may_change}
    return barred | ({"allow": allowed} if allowed else {})


def _middle_line(layout: WorkZoneLayout, lane: EdgeLane, edge: Edge) -> FloatArray:
    """World points (n, 2) [m] along the middle of a lane, in the direction in which it is driven."""
    stations = np.unique(np.concatenate([layout.road.stations, lane.middle.stations]))
    inside = stations[(stations > edge.start + SAME_PLACE_M) & (stations < edge.end - SAME_PLACE_M)]
    s = np.concatenate([[edge.start], inside, [edge.end]])
    line = layout.road.to_xy(s, lane.middle(s))
    return line[::-1] if edge.opposing else line


def _connections(layout: WorkZoneLayout, edges: tuple[Edge, ...]) -> list[ET.Element]:
    """One connection from every lane to itself on the next edge; only those onto a shared lane obey its signal."""
    found = []
    for before, after in pairwise(edges):
        going_on = [lane.of for lane in after.lanes]
        for index, lane in enumerate(before.lanes):
            if lane.of is not None and lane.of in going_on:
                ends = {"from": before.id, "to": after.id, "fromLane": str(index), "toLane": str(going_on.index(lane.of))}
                if not _ends_at_stop_line(before, layout):
                    ends["uncontrolled"] = "true"
                found.append(ET.Element("connection", ends))
    return found


def _ends_at_stop_line(edge: Edge, layout: WorkZoneLayout) -> bool:
    """Whether an edge ends at the stop line where its direction waits for its turn."""
    turns = layout.taking_turns
    if turns is None:
        return False
    stop_line, edge_end = (turns.end, edge.start) if edge.opposing else (turns.start, edge.end)
    return abs(stop_line - edge_end) < SAME_PLACE_M
