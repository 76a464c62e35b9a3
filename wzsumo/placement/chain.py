"""The chain of edges along which a zone lies, lane by lane.

A lane is followed along its connections: edges' middles jump at every auxiliary lane, through lanes do not. The lanes of the
edge where the zone begins are the slots, numbered from 0 = rightmost; each keeps its number as far as it leads straight on.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from wzsumo.errors import PlacementError
from wzsumo.placement.net import Connection, Net, NetEdge, NetLane


@dataclass(frozen=True, kw_only=True, eq=False)
class Link:
    """One edge of the chain: the lane index of each slot, and the connection over which each slot goes on to the next edge."""

    edge: NetEdge
    lanes: dict[int, int]  # by slot
    onward: dict[int, Connection]  # by slot; empty on the last edge

    def lane(self, slot: int) -> NetLane:
        """The lane of a slot."""
        return self.edge.lanes[self.lanes[slot]]


def roadway_slots(edge: NetEdge) -> dict[int, int]:
    """Lane index by slot of the lanes that motor vehicles use: those for pedestrians, bicycles and rails do not count."""
    roadway = [lane.index for lane in edge.lanes if lane.is_roadway]
    if not roadway:
        raise PlacementError(f"edge {edge.id!r} has no lane for motor vehicles; place the zone on a road")
    return dict(enumerate(roadway))


def chain_ahead(net: Net, edge: NetEdge, slots: dict[int, int], *, length: float) -> list[Link]:
    """The edges from `edge` on whose lanes the slots lead straight on, at least `length` [m] of them unless the road ends.

    Raises PlacementError where two edges continue the road alike.
    """
    links: list[Link] = []
    lanes, covered, seen = dict(slots), 0.0, {edge.id}
    while True:
        covered += edge.length
        onward = _onward(net, edge, lanes) if covered < length else {}
        next_id = next(iter(onward.values())).to_edge if onward else ""
        if next_id in seen:  # a roundabout or a ring
            onward = {}
        links.append(Link(edge=edge, lanes=lanes, onward=onward))
        if not onward:
            return links
        edge = net.edges[next_id]
        lanes = {slot: link.to_lane for slot, link in onward.items()}
        seen.add(next_id)


def chain_behind(net: Net, edge: NetEdge, lane: int, *, length: float) -> list[NetLane]:
    """The lanes that lead into a lane, internal ones included, in the order in which they are driven, over `length` [m]."""
    found: list[NetLane] = []
    covered, seen = 0.0, {edge.id}
    while covered < length:
        links = [link for link in net.incoming.get((edge.id, lane), []) if link.from_edge not in seen]
        if not links:
            break
        link = max(links, key=lambda c: (c.element.get("dir") == "s", len(net.edges[c.from_edge].lanes), c.from_lane))
        edge, lane = net.edges[link.from_edge], link.from_lane
        found = [edge.lanes[lane], *net.via_lanes(link), *found]
        covered += edge.length
        seen.add(edge.id)
    return found


def chain_beyond(net: Net, edge: NetEdge, lane: int, *, length: float) -> list[NetLane]:
    """The lanes onto which a lane leads straight on, internal ones included, in the order in which they are driven."""
    found: list[NetLane] = []
    covered, seen = 0.0, {edge.id}
    while covered < length:
        links = [c for c in net.outgoing.get((edge.id, lane), []) if c.element.get("dir") == "s" and c.to_edge not in seen]
        if not links:
            break
        link = max(links, key=lambda c: c.to_lane)
        edge, lane = net.edges[link.to_edge], link.to_lane
        found += [*net.via_lanes(link), edge.lanes[lane]]
        covered += edge.length
        seen.add(edge.id)
    return found


def _onward(net: Net, edge: NetEdge, lanes: dict[int, int]) -> dict[int, Connection]:
    """The connection of each slot to the one edge that goes on; slots that do not lead there are left out.

    Where the leftmost lane leads to several, as where a lane opens, it goes on to the one that most slots stay beside; of
    equal ones to the left one.
    """
    ahead = _edge_ahead(net, edge, lanes.values())
    ways: dict[int, dict[int, Connection]] = {}
    for slot, lane in lanes.items():
        links = {link.to_lane: link for link in net.outgoing.get((edge.id, lane), []) if link.to_edge == ahead}
        if links:
            ways[slot] = links
    if not ways:
        return {}
    leftmost = max(ways)
    return max((_side_by_side(ways, leftmost, to) for to in sorted(ways[leftmost], reverse=True)), key=len)


def _side_by_side(ways: dict[int, dict[int, Connection]], slot: int, to_lane: int) -> dict[int, Connection]:
    """The slots from the left on that keep their neighbours where the leftmost goes on to a lane."""
    kept: dict[int, Connection] = {}
    while to_lane in ways.get(slot, {}):
        kept[slot] = ways[slot][to_lane]
        slot, to_lane = slot - 1, to_lane - 1
    return kept


def _edge_ahead(net: Net, edge: NetEdge, lanes: Iterable[int]) -> str | None:
    links = [c for lane in lanes for c in net.outgoing.get((edge.id, lane), []) if c.element.get("dir") != "t"]
    for directions in ({"s"}, {"L", "R"}, {"l", "r"}):  # straight on, else a slight turn, else the only way on
        lanes_to: dict[str, set[int]] = {}
        for link in links:
            if link.element.get("dir") in directions:
                lanes_to.setdefault(link.to_edge, set()).add(link.from_lane)
        if lanes_to:
            break
    ranked = sorted(lanes_to, key=lambda to: len(lanes_to[to]), reverse=True)
    if len(ranked) > 1 and len(lanes_to[ranked[0]]) == len(lanes_to[ranked[1]]):
        raise PlacementError(
            f"edge {edge.id!r} goes on alike as {ranked[0]!r} and {ranked[1]!r}: the zone would reach beyond the place where "
            "the road splits; move it upstream or shorten it"
        )
    return ranked[0] if ranked else None
