"""Movements that a zone takes away: ways onto, along and off the corridor for which no lane is left.

Followed lane by lane: a vehicle reaches every lane beside its own over lanes that its class may use, and goes on over the
connections of the lanes that it reaches. Edges that are connected by lanes out of reach, as an exit behind a closed lane, do
not count as connected.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from wzsumo.placement.demand_files.vehicles import Demand, Trip
from wzsumo.placement.lane_states import ClosedLanes, Piece
from wzsumo.placement.net import Net, allows

Attributes = dict[str, str]
Route = tuple[str, ...]  # edges
Stage = tuple[str, list[Attributes], list[tuple[int, int]]]  # edge or piece, its lanes, the connections to the next one


@dataclass(frozen=True, kw_only=True)
class Movement:
    """From the edge `came_from` (empty: departing there) along corridor edges to `goes_to` (empty: arriving there)."""

    came_from: str
    along: tuple[str, ...]
    goes_to: str

    @property
    def edges(self) -> tuple[str, ...]:
        """All edges."""
        return tuple(edge for edge in (self.came_from, *self.along, self.goes_to) if edge)


def lost_movements(net: Net, closed: ClosedLanes, vehicle_class: str) -> list[Movement]:
    """Movements of a class that the network has and the closed network has not."""
    before = set(_movements(net, _stages(closed, closed_lanes=False), vehicle_class))
    after = set(_movements(net, _stages(closed, closed_lanes=True), vehicle_class))
    return sorted(before - after, key=lambda movement: (len(movement.along), movement.edges))


def vehicles_on(routes: Counter[Route], movements: Iterable[Movement]) -> int:
    """How many vehicles make one of the movements."""
    wanted = list(movements)
    return sum(n for route, n in routes.items() if any(_makes(route, movement) for movement in wanted))


def routes_of(net: Net, demand: Demand, vehicle_class: str) -> Counter[Route]:
    """The routes of a class with the number of vehicles; of trips without a route the one that is quickest on empty roads."""
    trips = [trip for trip in demand.trips if trip.vehicle_class == vehicle_class]
    routes: Counter[Route] = Counter()
    for trip in trips:
        if trip.routed:
            routes[trip.edges] += demand.trips[trip]
    for trip, route in _quickest_routes(net, [trip for trip in trips if not trip.routed], vehicle_class):
        routes[route] += demand.trips[trip]
    return routes


def _stages(closed: ClosedLanes, *, closed_lanes: bool) -> list[list[Stage]]:
    """For each edge of the corridor its pieces, one after the other, as they are with or without the zone."""
    by_edge: dict[str, list[Piece]] = defaultdict(list)
    for piece in closed.pieces:
        by_edge[piece.link.edge.id].append(piece)
    stages = []
    for link in closed.plan.corridor.links:
        pieces = by_edge[link.edge.id] if closed_lanes else by_edge[link.edge.id][:1]
        edge_stages: list[Stage] = []
        for number, piece in enumerate(pieces):
            changed = piece.lanes if closed_lanes else {}
            lanes = [
                {k: v for k, v in (lane.element.attributes | changed.get(lane.index, {})).items() if v is not None}
                for lane in link.edge.lanes
            ]
            onward = list(closed.leads_to(piece, pieces[number + 1]).items()) if number + 1 < len(pieces) else []
            edge_stages.append((link.edge.id, lanes, onward))
        stages.append(edge_stages)
    return stages


def _movements(net: Net, stages: list[list[Stage]], vehicle_class: str) -> Iterator[Movement]:
    """Every movement that lanes allow, from each way onto the corridor to each way off."""
    chain = [edge_stages[0][0] for edge_stages in stages]
    for first, edge_stages in enumerate(stages):
        entries = {"": set(range(len(edge_stages[0][1])))}
        for index in range(len(edge_stages[0][1])):
            for link in net.incoming.get((chain[first], index), []):
                from_outside = first == 0 or link.from_edge != chain[first - 1]
                if from_outside and net.edges[link.from_edge].lanes[link.from_lane].allows(vehicle_class):
                    entries.setdefault(link.from_edge, set()).add(index)
        for came_from, lanes in entries.items():
            yield from _ways_off(net, stages[first:], chain[first:], came_from, lanes, vehicle_class)


def _ways_off(
    net: Net, stages: list[list[Stage]], chain: list[str], came_from: str, lanes: set[int], vehicle_class: str
) -> Iterator[Movement]:
    reached = lanes
    for number, edge_stages in enumerate(stages):
        for _, attributes, onward in edge_stages:
            reached = _beside(reached, attributes, vehicle_class)
            if onward:
                reached = {to for lane, to in onward if lane in reached}
        if not reached:
            return
        along, next_edge = tuple(chain[: number + 1]), chain[number + 1] if number + 1 < len(chain) else ""
        yield Movement(came_from=came_from, along=along, goes_to="")
        ahead: dict[str, set[int]] = defaultdict(set)
        for lane in reached:
            for link in net.outgoing.get((chain[number], lane), []):
                if net.edges[link.to_edge].lanes[link.to_lane].allows(vehicle_class):
                    ahead[link.to_edge].add(link.to_lane)
        for goes_to in ahead.keys() - {next_edge}:
            yield Movement(came_from=came_from, along=along, goes_to=goes_to)
        reached = ahead.get(next_edge, set())


def _beside(lanes: set[int], attributes: list[Attributes], vehicle_class: str) -> set[int]:
    """The lanes that vehicles of a class reach from some of an edge's lanes by changing lanes."""
    reached = {lane for lane in lanes if allows(attributes[lane], vehicle_class)}
    queue = list(reached)
    while queue:
        lane = queue.pop()
        for beside, key in ((lane + 1, "changeLeft"), (lane - 1, "changeRight")):
            may = attributes[lane].get(key)
            may_change = may is None or vehicle_class in may.split()
            is_new = 0 <= beside < len(attributes) and beside not in reached
            if is_new and may_change and allows(attributes[beside], vehicle_class):
                reached.add(beside)
                queue.append(beside)
    return reached


def _makes(edges: Route, movement: Movement) -> bool:
    part = movement.edges
    if part[0] not in edges:
        return False
    places = [n for n in range(len(edges) - len(part) + 1) if edges[n : n + len(part)] == part]
    if not movement.came_from:
        places = [n for n in places if n == 0]
    if not movement.goes_to:
        places = [n for n in places if n + len(part) == len(edges)]
    return bool(places)


def _quickest_routes(net: Net, trips: list[Trip], vehicle_class: str) -> Iterator[tuple[Trip, Route]]:
    """The quickest route of each trip over empty roads; none for trips that have no route even so."""
    if not trips:
        return
    edges = [edge for edge in net.edges.values() if not edge.is_internal]
    number = {edge.id: n for n, edge in enumerate(edges)}
    seconds = [edge.length / max(edge.lanes[-1].speed, 0.1) for edge in edges]
    pairs = {
        (number[link.from_edge], number[link.to_edge])
        for link in net.connections
        if link.from_edge in number and link.to_edge in number
        and net.edges[link.from_edge].lanes[link.from_lane].allows(vehicle_class)
        and net.edges[link.to_edge].lanes[link.to_lane].allows(vehicle_class)
    }  # fmt: skip
    rows, columns = np.array(sorted(pairs)).T
    graph = csr_array((np.array(seconds)[columns], (rows, columns)), shape=(len(edges), len(edges)))
    starts = sorted({number[edge] for trip in trips for edge in trip.edges[:-1] if edge in number})
    _, before = dijkstra(graph, indices=starts, return_predecessors=True)
    row_of = {start: row for row, start in enumerate(starts)}
    for trip in trips:
        if len(trip.edges) < 2 or any(edge not in number for edge in trip.edges):
            continue
        route: list[int] = [number[trip.edges[0]]]
        for start, end in pairwise(number[edge] for edge in trip.edges):
            part, at = [], end
            while at != start and at >= 0:
                part.append(at)
                at = int(before[row_of[start], at])
            if at < 0:
                break
            route += part[::-1]
        yield trip, tuple(edges[n].id for n in route)
