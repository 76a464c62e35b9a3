"""WorkZoneLayout -> SUMO network files.

Every lane has an explicit shape along its true centre. Beyond the end of a closing lane the rest of its taper stays as a thin
lane that none leads to: a driver who is still half over the line goes on there. Without it SUMO stops him at the node, where he
can neither move on nor aside as long as anybody is beside him, and everybody behind waits for good (SUMO 1.28; 2 or 3 of 59
runs of 25 to 80 minutes at capacity).
Closed ground between two lanes is a thin lane too, which bars everybody: who is half over the line where the lanes part brakes
and falls back into his own. Without it SUMO takes the lanes for neighbours still, and he drives on half in the closed area.
Where both directions take turns on one lane, a traffic light lets one in at a time.
"""

import subprocess
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from wzsumo.errors import SimulationError
from wzsumo.frames import FloatArray
from wzsumo.simulation.connection import sumo_binary
from wzsumo.simulation.edges import MERGE_END_WIDTH_M, SAME_STATION_M, Edge, edges_of, gap_between, opposing_edges_of, width_at
from wzsumo.simulation.turns import SIGNAL_ID, turns_program
from wzsumo.units import mps_from_mph
from wzsumo.work_zone import OpenLane, WorkZoneLayout

LAST_CHANGE_AHEAD_M = 100.0  # of closed lanes between two open ones: what is begun there ends before (4 s at 25 m/s)
REST_WIDTH_M = 0.1  # of a closed lane past its end and of a gore, of which nothing but their being there matters
NOBODY = "custom1"  # SUMO's vehicle class that no vehicle type here has
LONGEST_M = 12.0  # a truck
LINE_MARGIN_M = 0.2  # SUMO lets a vehicle touch its lane's line, and a truck cuts a kink by
KINK_CUT_M = 0.1  # where the lane turns by 1:30, which the margin on either side is for
_NETCONVERT_OPTIONS = (
    # The default junction radius of 4 m moves nodes and cuts lanes; normalising moves the whole net (SUMO 1.28).
    "--no-turnarounds", "--offset.disable-normalization", "--precision", "4", "--default.junctions.radius", "0.1",
    "--junctions.join", "false", "--xml-validation", "never",
)  # fmt: skip


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
        on_bends = _cut_on_bends(layout, edge)
        for index, lane in enumerate(edge.lanes):
            shape = " ".join(f"{x:.4f},{y:.4f}" for x, y in _centre_line(layout, lane, edge))
            margin = LINE_MARGIN_M + 2 * (on_bends + max(_cut_at_kinks(lane, edge) - KINK_CUT_M, 0.0))
            attributes = {"index": str(index), "width": f"{_width_on(lane, edge, margin=margin):.3f}", "shape": shape}
            if lane in edge.gores:
                attributes["allow"] = NOBODY
            elif lane not in edge.through:
                attributes["allow"] = "passenger"  # SUMO lets none straddle the line to a lane that bars him
            elif _is_closing(lane, edge):
                attributes["disallow"] = "truck"  # wider than the lane's end: trucks merge before the taper
            for change, other in (("changeLeft", index + 1), ("changeRight", index - 1)):
                if 0 <= other < len(edge.lanes) and _is_barred(lane, edge.lanes[other], edge):
                    attributes[change] = NOBODY
            ET.SubElement(item, "lane", attributes)
    return root


def _is_barred(lane: OpenLane, beside: OpenLane, edge: Edge) -> bool:
    """Whether nobody may change to the lane beside: a rest, or one that has closed lanes between, or soon will have."""
    if edge.opposing or lane not in edge.through:
        return False
    right, left = (lane, beside) if edge.lanes.index(lane) < edge.lanes.index(beside) else (beside, lane)
    gap = gap_between(right, left, at=(edge.start, edge.end, edge.end + LAST_CHANGE_AHEAD_M))
    return beside not in edge.through or gap > SAME_STATION_M


def _connections(layout: WorkZoneLayout, edges: tuple[Edge, ...]) -> list[ET.Element]:
    """Every lane leads on to itself; none but the ways onto a shared lane are held back by its signal."""
    found = []
    for before, after in pairwise(edges):
        for index, lane in enumerate(before.lanes):
            if lane in before.through and lane in after.through:
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


def _width_on(lane: OpenLane, edge: Edge, *, margin: float) -> float:
    return min(width_at(lane, edge.start), width_at(lane, edge.end)) - margin if lane in edge.through else REST_WIDTH_M


def _cut_on_bends(layout: WorkZoneLayout, edge: Edge) -> float:
    """How far [m] the middle of the longest vehicle lies inside of the bend that its ends follow; 0 on a straight."""
    half = LONGEST_M / 2
    s = np.linspace(max(edge.start, half), min(edge.end, layout.road.length - half), 9)
    back, middle, front = (layout.road.to_xy(s + ahead, layout.road.travelled_width / 2) for ahead in (-half, 0.0, half))
    return float(np.linalg.norm(middle - (back + front) / 2, axis=1).max())


def _cut_at_kinks(lane: OpenLane, edge: Edge) -> float:
    """How far [m] the middle of the longest vehicle lies beside a lane's middle that its ends follow, on a straight road."""
    half = LONGEST_M / 2
    s = np.linspace(edge.start, edge.end, 9) + np.array([[-half], [0.0], [half]])
    back, middle, front = (lane.left(s) + lane.right(s)) / 2
    return float(np.abs(middle - (back + front) / 2).max())


def _is_closing(lane: OpenLane, edge: Edge) -> bool:
    return width_at(lane, lane.end) < MERGE_END_WIDTH_M and width_at(lane, edge.end) < width_at(lane, edge.start) - 1e-6


def _centre_line(layout: WorkZoneLayout, lane: OpenLane, edge: Edge) -> FloatArray:
    inner = layout.road.stations
    s = np.concatenate([[edge.start], inner[(inner > edge.start + 0.01) & (inner < edge.end - 0.01)], [edge.end]])
    line = layout.road.to_xy(s, (lane.left(s) + lane.right(s)) / 2)
    return line[::-1] if edge.opposing else line
