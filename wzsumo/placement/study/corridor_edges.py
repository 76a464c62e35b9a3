"""The road of a placed zone in SUMO's edges: where each lane lies on the road, and which edges lie along it or beside it."""

from collections.abc import Container, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.placement.corridor import Corridor
from wzsumo.placement.cuts import CutEdge
from wzsumo.placement.lane_plan import middle_of
from wzsumo.placement.lane_states import ClosedLanes, Piece
from wzsumo.placement.net import Net, NetEdge, NetLane, parse_shape
from wzsumo.placement.study.zone_times import timed_lanes
from wzsumo.road import Profile
from wzsumo.simulation.edges import Edge, EdgeLane
from wzsumo.work_zone import OpenLane, WorkZoneLayout

SAME_LANE_M = 1.2  # SUMO's lane and a lane of the layout are one where their middles are nearer than this; chosen by us


@dataclass(frozen=True, kw_only=True)
class RoadEdges:
    """The road's edges in the order in which they are driven, and ids of SUMO's edges along it and around it."""

    edges: tuple[Edge, ...]
    along: tuple[str, ...]  # on which vehicles are on the road; those within its junctions included
    around: tuple[str, ...]  # those, and all that share a junction with them


def road_edges(closed: ClosedLanes, *, straight: bool = False) -> RoadEdges:
    """The edges of the road from its beginning to its end, as the zone leaves them.

    `straight` says that no lane bends and those that narrow are barred, as in a zone that stands for a time.
    """
    plan = closed.plan
    corridor, layout = plan.corridor, plan.layout
    before, beyond = (_ordinary(corridor.net, lanes) for lanes in (corridor.before, corridor.beyond))
    laid = [_whole_edge(edge, layout) for edge in before]
    barred = timed_lanes(closed) if straight else {}
    laid += [_piece_edge(piece, _cut_of(closed, piece), layout, barred=barred, straight=straight) for piece in closed.pieces]
    laid += [_whole_edge(edge, layout) for edge in beyond]
    # A junction between two edges counts to the first, so that every station lies on an edge.
    edges = [replace(edge, end=following.start) for edge, following in pairwise(laid)] + laid[-1:]
    chain = [*before, *(link.edge for link in corridor.links), *beyond]
    nodes = {node for edge in chain for node in (edge.from_node, edge.to_node)}
    inner = [edge.id for edge in corridor.net.edges.values() if edge.is_internal and _node_of(edge) in nodes]
    ids = [edge.id for edge in edges]
    ordinary = [edge for edge in corridor.net.edges.values() if not edge.is_internal]
    cut = {cut.edge.id: cut.ids for cut in plan.cuts}
    beside = [id_ for edge in ordinary if {edge.from_node, edge.to_node} & nodes for id_ in cut.get(edge.id, (edge.id,))]
    along, around = [*ids, *_junctions_along(corridor, chain)], [*ids, *beside, *inner]
    return RoadEdges(edges=tuple(edges), along=tuple(dict.fromkeys(along)), around=tuple(dict.fromkeys(around)))


def _ordinary(net: Net, lanes: tuple[NetLane, ...]) -> list[NetEdge]:
    """The edges of lanes that lie between junctions."""
    edges = [net.edges[lane.id.rpartition("_")[0]] for lane in lanes]
    return [edge for edge in edges if not edge.is_internal]


def _junctions_along(corridor: Corridor, chain: list[NetEdge]) -> Iterator[str]:
    """Ids of the internal edges over which one edge of the chain leads to the next."""
    following = {first.id: second.id for first, second in pairwise(chain)}
    for link in corridor.net.connections:
        if following.get(link.from_edge) == link.to_edge:
            for lane in corridor.net.via_lanes(link):
                yield lane.id.rpartition("_")[0]


def _node_of(edge: NetEdge) -> str:
    """The junction of an internal edge, :JUNCTION_3."""
    return edge.id[1:].rpartition("_")[0]


def _cut_of(closed: ClosedLanes, piece: Piece) -> CutEdge:
    cuts = {cut.edge.id: cut for cut in closed.plan.cuts}
    return cuts.get(piece.link.edge.id) or CutEdge(edge=piece.link.edge, positions=())


def _whole_edge(edge: NetEdge, layout: WorkZoneLayout) -> Edge:
    return _edge(edge.id, [(lane.points, lane.width, lane.is_roadway) for lane in edge.lanes], layout)


def _piece_edge(
    piece: Piece, cut: CutEdge, layout: WorkZoneLayout, *, barred: Container[tuple[str, int]], straight: bool
) -> Edge:
    lanes = []
    for lane in piece.link.edge.lanes:
        changes = {} if straight else piece.lanes.get(lane.index, {})
        shape = changes.get("shape") or cut.shape_text(lane.element.get("shape"), piece.number)
        width = float(changes.get("width") or lane.width)
        is_open = lane.is_roadway and lane.index not in piece.barred and (piece.id, lane.index) not in barred
        lanes.append((parse_shape(shape), width, is_open))
    return _edge(piece.id, lanes, layout)


def _edge(id_: str, lanes: list[tuple[FloatArray, float, bool]], layout: WorkZoneLayout) -> Edge:
    """An edge of lanes given by middle line, width [m] and whether vehicles may drive on them."""
    laid, spans = [], []
    for points, width, is_open in lanes:
        stations, offsets = layout.road.to_sd(points)
        rising = np.concatenate([[True], stations[1:] > np.maximum.accumulate(stations)[:-1]])
        middle = Profile(stations=stations[rising], offsets=offsets[rising])
        spans.append((stations[0], stations[-1]))
        laid.append(EdgeLane(of=_lane_of(middle, layout) if is_open else None, middle=middle, width=width))
    on_road = [span for span, lane in zip(spans, laid, strict=True) if lane.of] or spans
    start, end = on_road[-1]  # positions count along the leftmost lane
    return Edge(id=id_, start=float(start), end=float(end), lanes=tuple(laid))


def _lane_of(middle: Profile, layout: WorkZoneLayout) -> OpenLane | None:
    """The lane of the layout that a lane of SUMO's is; None for a ramp's or a turning lane."""
    s = float(middle.stations.mean())
    here = [lane for lane in layout.lanes if not lane.opposing and lane.start <= s < lane.end]
    away = {n: abs(float(middle_of(lane, np.array([s]))[0] - middle(s))) for n, lane in enumerate(here)}
    nearest = min(away, key=lambda n: away[n], default=None)
    return here[nearest] if nearest is not None and away[nearest] < SAME_LANE_M else None
