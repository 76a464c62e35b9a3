"""The lanes around a corridor that vehicles drive on while the zone is there, and which of them leads to which."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from wzsumo.frames import FloatArray
from wzsumo.placement.corridor import Corridor
from wzsumo.placement.cuts import CutEdge
from wzsumo.placement.lane_plan import LanePlan
from wzsumo.placement.lane_states import Attributes, ClosedLanes
from wzsumo.placement.net import NetEdge, NetLane, allows, parse_shape


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenLane:
    """A lane as it runs in the closed network. `length` [m] is that by which SUMO counts positions, not that of its points."""

    id: str
    points: FloatArray
    length: float
    attributes: dict[str, str]

    def allows(self, vehicle_class: str) -> bool:
        """Whether vehicles of a class may drive here."""
        return allows(self.attributes, vehicle_class)


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenLanes:
    """Lanes by id, those of ramps and turns too, and the ids of the lanes that lead to each.

    Lanes that share no junction with the corridor pass above or below it.
    """

    lanes: dict[str, DrivenLane]
    before: dict[str, list[str]]

    def ways_to(self, lane_id: str, length: float) -> Iterator[tuple[DrivenLane, ...]]:
        """Chains of lanes that lead to a lane and end with it, with at least `length` [m] before it where they reach so far."""
        lane = self.lanes[lane_id]
        known = [id_ for id_ in self.before.get(lane_id, []) if id_ != lane_id]
        if length <= 0 or not known:
            yield (lane,)
            return
        for id_ in known:
            for way in self.ways_to(id_, length - max(self.lanes[id_].length, 0.1)):
                yield (*way, lane)


def driven_lanes(plan: LanePlan, closed: ClosedLanes) -> DrivenLanes:
    """The lanes that stay open around the corridor."""
    lanes = {lane.id: lane for lane in _open_lanes(plan, closed)}
    before: dict[str, list[str]] = defaultdict(list)
    for way in _ways(plan, closed):
        if all(id_ in lanes for id_ in way):
            for first, second in pairwise(way):
                if first not in before[second]:
                    before[second].append(first)
    return DrivenLanes(lanes=lanes, before=dict(before))


def _open_lanes(plan: LanePlan, closed: ClosedLanes) -> Iterator[DrivenLane]:
    pieces = {piece.link.edge.id for piece in closed.pieces}
    for lane in _lanes_at_corridor(plan.corridor):
        if lane.is_roadway and lane.id not in closed.barred_via_lanes and lane.id.rpartition("_")[0] not in pieces:
            yield _driven(lane, lane.id, lane.length, closed.via_lanes.get(lane.id, {}))
    cuts = {cut.edge.id: cut for cut in plan.cuts}
    for piece in closed.pieces:
        edge = piece.link.edge
        cut = cuts.get(edge.id) or CutEdge(edge=edge, positions=())
        for lane in edge.lanes:
            if lane.is_roadway and lane.index not in piece.barred:
                changes = {"shape": cut.shape_text(lane.element.get("shape"), piece.number)} | piece.lanes.get(lane.index, {})
                yield _driven(lane, f"{piece.id}_{lane.index}", cut.lane_length(lane, piece.number), changes)


def _driven(lane: NetLane, id_: str, length: float, changes: Attributes) -> DrivenLane:
    attributes = {key: value for key, value in (lane.element.attributes | changes).items() if value is not None}
    return DrivenLane(id=id_, points=parse_shape(attributes["shape"]), length=length, attributes=attributes)


def _ways(plan: LanePlan, closed: ClosedLanes) -> Iterator[tuple[str, ...]]:
    """The lanes of each connection, those within the junction between the other two, and the two lanes at each cut."""
    net, cuts = plan.corridor.net, {cut.edge.id: cut for cut in plan.cuts}
    for link in net.connections:
        if not link.from_edge.startswith(":"):
            first = cuts[link.from_edge].ids[-1] if link.from_edge in cuts else link.from_edge
            last = cuts[link.to_edge].ids[0] if link.to_edge in cuts else link.to_edge
            via = [lane.id for lane in net.via_lanes(link)]
            yield (f"{first}_{link.from_lane}", *via, f"{last}_{link.to_lane}")
    for piece, following in pairwise(closed.pieces):
        if piece.link is following.link:
            for lane, to in closed.leads_to(piece, following).items():
                yield f"{piece.id}_{lane}", f"{following.id}_{to}"


def _lanes_at_corridor(corridor: Corridor) -> list[NetLane]:
    """All lanes of edges that share a junction with the corridor, and of those junctions."""
    nodes = {node for link in corridor.links for node in (link.edge.from_node, link.edge.to_node)}
    return [lane for edge in corridor.net.edges.values() if _touches(edge, nodes) for lane in edge.lanes]


def _touches(edge: NetEdge, nodes: set[str]) -> bool:
    if edge.is_internal:
        return edge.element.get("function") == "internal" and edge.id[1:].rpartition("_")[0] in nodes
    return edge.from_node in nodes or edge.to_node in nodes
