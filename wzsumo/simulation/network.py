"""WorkZoneLayout -> SUMO's network, zone.net.xml.

SUMO knows lanes of constant width that begin and end at nodes, and lets vehicles straddle the line between two lanes. Four
things of a work zone do not fit into that; this is what the network has for each, and why.

Tapers: a chain of short edges (see `edges`), on each of which a lane keeps one width. Every lane has an explicit shape along
its true middle, because netconvert by itself lays the lanes of an edge side by side around the edge's middle.

Remnants of closing lanes: past the station where a car no longer fits into a closing lane, its remnant goes on for some edges
as a thin lane that no lane leads to. A vehicle that straddles the line to the open lane drives on along the remnant. Without
it SUMO stops that vehicle at the node, where it can neither drive on nor change lanes while another vehicle is beside it, and
the queue behind it never moves again (SUMO 1.28; in 2 or 3 of 59 runs of 25 to 80 minutes at capacity).

Gores: closed ground between two open lanes is a thin lane that bars every vehicle class. A vehicle that straddles the line
where the lanes part brakes and falls back into its own lane. Without a gore SUMO still takes the two lanes for neighbours, and
the vehicle drives on with half its width in the closed area.

Cut margins: both ends of a vehicle follow the lane, so the middle of a long vehicle cuts across the inner side of a bend, and
of a kink where a lane turns between two edges. SUMO does not see that. Every lane is therefore narrower in SUMO than on the
road by what the longest vehicle cuts, on either side.

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
from wzsumo.simulation.edges import PASSABLE_WIDTH_M, SAME_PLACE_M, Edge, edges_of, gap_between, opposing_edges_of, width_at
from wzsumo.simulation.turns import SIGNAL_ID, turns_program
from wzsumo.units import mps_from_mph
from wzsumo.work_zone import OpenLane, WorkZoneLayout

THIN_LANE_WIDTH_M = 0.1  # of a remnant and of a gore; chosen by us: SUMO needs the lane to be there, not to be driven on
UNUSED_VEHICLE_CLASS = "custom1"  # none of our vehicle types has it, so what allows it alone bars every vehicle
NO_CHANGE_AHEAD_OF_GORE_M = 100.0  # a lane change takes some 4 s, 100 m at 25 m/s: begun before, it ends before the gore
LONGEST_VEHICLE_M = 12.0  # the truck of `demand`
LINE_MARGIN_M = 0.2  # by which every lane is narrower: in SUMO a vehicle may touch its lane's line
CUT_WITHIN_LINE_MARGIN_M = 0.1  # half of that margin: what the longest vehicle cuts where a lane turns by 1:30
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
        cut_on_bends = _cut_on_bends(layout, edge)
        for index, lane in enumerate(edge.lanes):
            shape = " ".join(f"{x:.4f},{y:.4f}" for x, y in _middle_line(layout, lane, edge))
            width = _width_in_sumo(lane, edge, cut_on_bends=cut_on_bends)
            attributes = {"index": str(index), "width": f"{width:.3f}", "shape": shape}
            ET.SubElement(element, "lane", attributes | _permissions(index, edge))
    return root


def _permissions(index: int, edge: Edge) -> dict[str, str]:
    """The attributes of a lane that say which vehicle classes may drive on it, and which may leave it for the lanes beside."""
    lane, permissions = edge.lanes[index], {}
    if lane in edge.gores:
        permissions["allow"] = UNUSED_VEHICLE_CLASS
    elif lane not in edge.through_lanes:
        permissions["allow"] = "passenger"  # a remnant: SUMO lets no vehicle straddle the line to a lane that bars it
    elif _is_closing(lane, edge):
        permissions["disallow"] = "truck"  # wider than the lane's end: trucks merge before the taper
    for change, other in (("changeLeft", index + 1), ("changeRight", index - 1)):
        if 0 <= other < len(edge.lanes) and _bars_change(lane, edge.lanes[other], edge):
            permissions[change] = UNUSED_VEHICLE_CLASS
    return permissions


def _bars_change(lane: OpenLane, beside: OpenLane, edge: Edge) -> bool:
    """Whether no vehicle may change to the lane beside: a remnant or a gore, or a lane that a gore soon parts from this one."""
    if edge.opposing or lane not in edge.through_lanes:
        return False
    right, left = (lane, beside) if edge.lanes.index(lane) < edge.lanes.index(beside) else (beside, lane)
    gap = gap_between(right, left, at=(edge.start, edge.end, edge.end + NO_CHANGE_AHEAD_OF_GORE_M))
    return beside not in edge.through_lanes or gap > SAME_PLACE_M


def _is_closing(lane: OpenLane, edge: Edge) -> bool:
    return width_at(lane, lane.end) < PASSABLE_WIDTH_M and width_at(lane, edge.end) < width_at(lane, edge.start) - 1e-6


def _width_in_sumo(lane: OpenLane, edge: Edge, *, cut_on_bends: float) -> float:
    """Width [m] that a lane has in SUMO: that of its narrower end, less the margins on either side."""
    if lane not in edge.through_lanes:
        return THIN_LANE_WIDTH_M
    margin = LINE_MARGIN_M + 2 * (cut_on_bends + max(_cut_at_kinks(lane, edge) - CUT_WITHIN_LINE_MARGIN_M, 0.0))
    return min(width_at(lane, edge.start), width_at(lane, edge.end)) - margin


def _cut_on_bends(layout: WorkZoneLayout, edge: Edge) -> float:
    """How far [m] the middle of the longest vehicle lies inside a bend that both its ends follow; 0 on a straight."""
    half = LONGEST_VEHICLE_M / 2
    s = np.linspace(max(edge.start, half), min(edge.end, layout.road.length - half), 9)
    back, middle, front = (layout.road.to_xy(s + ahead, layout.road.travelled_width / 2) for ahead in (-half, 0.0, half))
    return float(np.linalg.norm(middle - (back + front) / 2, axis=1).max())


def _cut_at_kinks(lane: OpenLane, edge: Edge) -> float:
    """How far [m] the middle of the longest vehicle lies beside the lane's middle that its ends follow, on a straight road."""
    half = LONGEST_VEHICLE_M / 2
    s = np.linspace(edge.start, edge.end, 9) + np.array([[-half], [0.0], [half]])
    back, middle, front = (lane.left(s) + lane.right(s)) / 2
    return float(np.abs(middle - (back + front) / 2).max())


def _middle_line(layout: WorkZoneLayout, lane: OpenLane, edge: Edge) -> FloatArray:
    """World points (n, 2) [m] along the middle of a lane, in the direction in which it is driven."""
    stations = layout.road.stations
    inside = stations[(stations > edge.start + 0.01) & (stations < edge.end - 0.01)]
    s = np.concatenate([[edge.start], inside, [edge.end]])
    line = layout.road.to_xy(s, (lane.left(s) + lane.right(s)) / 2)
    return line[::-1] if edge.opposing else line


def _connections(layout: WorkZoneLayout, edges: tuple[Edge, ...]) -> list[ET.Element]:
    """One connection from every lane to itself on the next edge; only those onto a shared lane obey its signal."""
    found = []
    for before, after in pairwise(edges):
        for index, lane in enumerate(before.lanes):
            if lane in before.through_lanes and lane in after.through_lanes:
                ends = {"from": before.id, "to": after.id, "fromLane": str(index), "toLane": str(after.lanes.index(lane))}
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
