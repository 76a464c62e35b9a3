"""Whether vehicles on the lanes that stay open keep clear of the ground that the zone closes.

All open lanes around the corridor are looked at as they run in the closed network, those of ramps and turns too. Lanes that
share no junction with the corridor pass above or below it.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely

from wzsumo.errors import PlacementError
from wzsumo.frames import FloatArray, arc_length
from wzsumo.placement.corridor import Corridor
from wzsumo.placement.cuts import CutEdge
from wzsumo.placement.lane_plan import LanePlan
from wzsumo.placement.lane_states import ClosedLanes
from wzsumo.placement.net import NetEdge, NetLane, parse_shape

CAR_LENGTH_M, CAR_WIDTH_M = 5.0, 1.8  # SUMO's passenger car
HALF_WIDTH_M = 1.1  # of vehicles: SUMO's delivery van, 2.16 m
BRUSHED_M, BRUSHED_M2 = 0.1, 0.3  # ground that is not counted: beside a lane that runs along it, and in a corner of it
STEP_M = 0.5  # from one place of a car to the next


def check_clear_ground(plan: LanePlan, closed: ClosedLanes) -> None:
    """Raise PlacementError where a lane leads through the closed ground, or a car swings over it where two lanes meet."""
    ground = plan.layout.closed_area
    if ground.is_empty:
        return
    shapely.prepare(ground)
    inner = ground.buffer(-BRUSHED_M)
    shapely.prepare(inner)
    lanes = dict(_open_lanes(plan, closed))
    for lane_id, points in lanes.items():
        path = shapely.LineString(points)
        if path.dwithin(ground, HALF_WIDTH_M):
            over = path.buffer(HALF_WIDTH_M, cap_style="flat").intersection(inner).area
            if over > BRUSHED_M2:
                raise PlacementError(
                    f"vehicles on lane {lane_id!r} would drive over {over:.1f} m2 of the ground that the zone closes; move the "
                    "zone past that lane, or close lanes on the other side"
                )
    for first, second, line in _joints(plan, closed, lanes):
        if shapely.LineString(line).dwithin(ground, CAR_LENGTH_M) and shapely.intersects(inner, _cars_along(line)).any():
            raise PlacementError(
                f"a car that drives from lane {first!r} to lane {second!r}, where the network's lanes jump sideways, would "
                "swing over the ground that the zone closes; move the zone, or mend the lanes' shapes in netedit"
            )


def _open_lanes(plan: LanePlan, closed: ClosedLanes) -> Iterator[tuple[str, FloatArray]]:
    """(id, middle line) of the lanes around the corridor that vehicles may drive on while the zone is there."""
    pieces = {piece.link.edge.id for piece in closed.pieces}
    for lane in _lanes_at_corridor(plan.corridor):
        if lane.is_roadway and lane.id not in closed.barred_via_lanes and lane.id.rpartition("_")[0] not in pieces:
            shape = closed.via_lanes.get(lane.id, {}).get("shape")
            points = parse_shape(shape) if shape else lane.points
            if len(points) > 1:
                yield lane.id, points
    cuts = {cut.edge.id: cut for cut in plan.cuts}
    for piece in closed.pieces:
        edge = piece.link.edge
        cut = cuts.get(edge.id) or CutEdge(edge=edge, positions=())
        for lane in edge.lanes:
            if lane.is_roadway and lane.index not in piece.barred:
                shape = piece.lanes.get(lane.index, {}).get("shape") or cut.shape_text(lane.element.get("shape"), piece.number)
                yield f"{piece.id}_{lane.index}", parse_shape(shape)


def _joints(plan: LanePlan, closed: ClosedLanes, lanes: dict[str, FloatArray]) -> Iterator[tuple[str, str, FloatArray]]:
    """(lane, lane, line from one to the other) wherever an open lane leads to another: its last metres, and the next one's."""
    net, cuts = plan.corridor.net, {cut.edge.id: cut for cut in plan.cuts}
    for link in net.connections:
        ends = (cuts[link.from_edge].ids[-1] if link.from_edge in cuts else link.from_edge,
                cuts[link.to_edge].ids[0] if link.to_edge in cuts else link.to_edge)  # fmt: skip
        first, second = f"{ends[0]}_{link.from_lane}", f"{ends[1]}_{link.to_lane}"
        if first in lanes and second in lanes and not first.startswith(":"):
            via = [lane.id for lane in net.via_lanes(link)]
            if all(id_ in lanes for id_ in via):
                yield first, second, _joined([lanes[first], *(lanes[id_] for id_ in via), lanes[second]])
    for piece, following in pairwise(closed.pieces):
        if piece.link is following.link:
            for lane, to in closed.leads_to(piece, following).items():
                first, second = f"{piece.id}_{lane}", f"{following.id}_{to}"
                if first in lanes and second in lanes:
                    yield first, second, _joined([lanes[first], lanes[second]])


def _joined(lines: list[FloatArray]) -> FloatArray:
    """One line of the last metres of the first, the whole of those between, and the first metres of the last."""
    reach = 2 * CAR_LENGTH_M
    before, after = arc_length(lines[0]), arc_length(lines[-1])
    last = np.column_stack([np.interp([max(before[-1] - reach, 0.0), before[-1]], before, column) for column in lines[0].T])
    first = np.column_stack([np.interp([0.0, min(reach, after[-1])], after, column) for column in lines[-1].T])
    points = np.vstack([last, *lines[1:-1], first])
    return np.asarray(points[np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) > 1e-3])])


def _cars_along(line: FloatArray) -> npt.NDArray[np.object_]:
    """Outlines (n,) of a car whose front and back follow a line."""
    along = arc_length(line)
    s = np.arange(CAR_LENGTH_M, along[-1], STEP_M)
    front, back = (np.column_stack([np.interp(at, along, column) for column in line.T]) for at in (s, s - CAR_LENGTH_M))
    ahead = front - back
    ahead /= np.maximum(np.hypot(*ahead.T), 1e-9)[:, None]
    across = np.column_stack([-ahead[:, 1], ahead[:, 0]]) * CAR_WIDTH_M / 2
    back = front - CAR_LENGTH_M * ahead
    corners = np.stack([front + across, front - across, back - across, back + across], axis=1)
    return np.asarray(shapely.polygons(corners))


def _lanes_at_corridor(corridor: Corridor) -> list[NetLane]:
    """All lanes of edges that share a junction with the corridor, and of those junctions."""
    nodes = {node for link in corridor.links for node in (link.edge.from_node, link.edge.to_node)}
    return [lane for edge in corridor.net.edges.values() if _touches(edge, nodes) for lane in edge.lanes]


def _touches(edge: NetEdge, nodes: set[str]) -> bool:
    if edge.is_internal:
        return edge.element.get("function") == "internal" and edge.id[1:].rpartition("_")[0] in nodes
    return edge.from_node in nodes or edge.to_node in nodes
