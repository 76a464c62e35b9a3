"""Places at which a zone cannot stand, each refused in one line with edge, rule and remedy."""

from collections.abc import Iterator

import shapely

from wzsumo.errors import PlacementError
from wzsumo.frames import FloatArray
from wzsumo.placement.corridor import Corridor
from wzsumo.placement.cuts import CutEdge
from wzsumo.placement.lane_plan import LanePlan
from wzsumo.placement.lane_states import ClosedLanes
from wzsumo.placement.net import NetEdge, NetLane, parse_shape

HALF_WIDTH_M = 1.1  # of vehicles: SUMO's truck and delivery van with their share of places in the lane, 2.2 m
BRUSHED_M, BRUSHED_M2 = 0.1, 0.3  # ground that is not counted: beside a lane that runs along it, and in a corner of it
SIGNALS = ("traffic_light", "traffic_light_unregulated", "traffic_light_right_on_red", "rail_signal", "rail_crossing")


def check_cuts(cuts: tuple[CutEdge, ...]) -> None:
    """Raise PlacementError where an edge cannot be cut without changing more than its pieces."""
    for cut in cuts:
        edge = cut.edge
        for lane in edge.lanes:
            if any(child.tag == "neigh" for child in lane.element.children):
                raise PlacementError(
                    f"edge {edge.id!r}: lane {lane.id!r} has a neighbouring lane of the other direction (<neigh>), which a cut "
                    "would lose; place the zone on another edge"
                )
            if abs(lane.length - edge.length) > 0.01:
                raise PlacementError(
                    f"edge {edge.id!r}: its lanes are {edge.length:g} and {lane.length:g} m long, and a cut across them is at "
                    "no one position; place the zone on another edge"
                )
        if edge.element.get("bidi"):
            raise PlacementError(
                f"edge {edge.id!r} is one track for both directions (bidi={edge.element.get('bidi')!r}), which a cut would "
                "part; place the zone on another edge"
            )


def check_corridor(plan: LanePlan, closed: ClosedLanes) -> None:
    """Raise PlacementError for a signal within a taper, and for lanes that lead through the closed ground."""
    _refuse_signals(plan)
    _refuse_lanes_in_closed_ground(plan, closed)


def _refuse_signals(plan: LanePlan) -> None:
    corridor = plan.corridor
    tapers = [(area.start, area.end) for area in plan.layout.areas if "taper" in area.name or "shift" in area.name]
    for link in corridor.links:
        node = corridor.net.junctions.get(link.edge.to_node)
        end = corridor.span(link)[1]
        if node is None or node.get("type") not in SIGNALS:
            continue
        for start, stop in tapers:
            if start < end < stop:
                raise PlacementError(
                    f"edge {link.edge.id!r} ends at the signal of junction {link.edge.to_node!r}, within a taper, where "
                    f"traffic must not stop; move the zone by {stop - end:.0f} m downstream or {end - start:.0f} m upstream"
                )


def _refuse_lanes_in_closed_ground(plan: LanePlan, closed: ClosedLanes) -> None:
    """Every lane that stays open, as it runs in the closed network, must leave its vehicles clear of the devices."""
    ground = plan.layout.closed_area
    if ground.is_empty:
        return
    shapely.prepare(ground)
    inner = ground.buffer(-BRUSHED_M)
    for lane_id, points in _open_lanes(plan, closed):
        if len(points) < 2 or not (path := shapely.LineString(points)).dwithin(ground, HALF_WIDTH_M):
            continue
        over = path.buffer(HALF_WIDTH_M, cap_style="flat").intersection(inner).area
        if over > BRUSHED_M2:
            raise PlacementError(
                f"vehicles on lane {lane_id!r} would drive over {over:.1f} m2 of the ground that the zone closes; move the "
                "zone past that lane, or close lanes on the other side"
            )


def _open_lanes(plan: LanePlan, closed: ClosedLanes) -> Iterator[tuple[str, FloatArray]]:
    """(id, middle line) of the lanes around the corridor that vehicles may drive on while the zone is there."""
    bent = closed.via_lanes
    barred = closed.barred_via_lanes
    pieces = {piece.link.edge.id for piece in closed.pieces}
    for lane in _lanes_at_corridor(plan.corridor):
        if lane.is_roadway and lane.id not in barred and lane.id.rpartition("_")[0] not in pieces:
            shape = bent.get(lane.id, {}).get("shape")
            yield lane.id, parse_shape(shape) if shape else lane.points
    cuts = {cut.edge.id: cut for cut in plan.cuts}
    for piece in closed.pieces:
        edge = piece.link.edge
        cut = cuts.get(edge.id) or CutEdge(edge=edge, positions=())
        for lane in edge.lanes:
            if lane.is_roadway and lane.index not in piece.barred:
                shape = piece.lanes.get(lane.index, {}).get("shape") or cut.shape_text(lane.element.get("shape"), piece.number)
                yield f"{piece.id}_{lane.index}", parse_shape(shape)


def _lanes_at_corridor(corridor: Corridor) -> list[NetLane]:
    """All lanes of edges that share a junction with the corridor, and of those junctions: others pass above or below it."""
    net = corridor.net
    nodes = {node for link in corridor.links for node in (link.edge.from_node, link.edge.to_node)}
    lanes = []
    for edge in net.edges.values():
        if _touches(edge, nodes):
            lanes += edge.lanes
    return lanes


def _touches(edge: NetEdge, nodes: set[str]) -> bool:
    if edge.is_internal:
        return edge.element.get("function") == "internal" and edge.id[1:].rpartition("_")[0] in nodes
    return edge.from_node in nodes or edge.to_node in nodes
