"""A stretch of a SUMO network as a Road: its edges in order, followed along the leftmost lane that goes through.

Lanes come and go on the right of a carriageway, so the middles of edges jump at every auxiliary lane; the leftmost lane that
goes through does not. It is followed backwards over the connections, from the last edge to the first, through the internal
lanes of the junctions. The Road has as many lanes, from it to the right, as every edge has; what is beyond is told, not drawn.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
import shapely.ops

from wzsumo.errors import InputError, SpecError
from wzsumo.frames import FloatArray, arc_length
from wzsumo.roads.found_road import FoundRoad, LaneCount, Ramp, road_along, without_repeats
from wzsumo.roads.sumo_net import DEFAULT_LANE_WIDTH_M, NetEdge, NetLane, SumoNet

# Where lanes of successive edges do not meet, as in older networks, the line is drawn from so far before to so far after.
CUT_BACK_M = (0.0, 5.0, 10.0, 20.0, 40.0)


def road_of_edges(net: SumoNet, edges: Sequence[str], *, shoulders: tuple[float, float] | None, source: str) -> FoundRoad:
    """The Road along edges that follow each other, in the network's metres. Raises InputError where no lane goes through."""
    tracked, vias = _leftmost_through(net, [net.edges[edge] for edge in edges], source=source)
    rights = [lane.index - net.edges[edge].car_lanes[0].index for lane, edge in zip(tracked, edges, strict=True)]
    n_lanes = min(rights) + 1
    widths, assumed = _widths(net, edges, tracked, n_lanes)
    speed = float(np.median([lane.speed for lane in tracked]))
    to_middle = (sum(widths) - widths[-1]) / 2
    refused: SpecError | None = None
    for cut_back in CUT_BACK_M:
        points, spans = _followed_line(tracked, vias, cut_back=cut_back)
        try:
            line = _moved_right(points, to_middle)
            road, said = road_along(line, lane_widths=widths, shoulders=shoulders, speed_mps=speed, source=source)
        except SpecError as why:
            refused = refused or why
            continue
        if cut_back:
            said.append(f"the network's lanes jump where edges meet: smoothed over {2 * cut_back:g} m there")
        scale = road.length / spans[-1][1]
        counts = tuple(
            LaneCount(
                start_m=start * scale, end_m=end * scale, lanes=len(net.edges[edge].car_lanes),
                extra=len(net.edges[edge].car_lanes) - n_lanes, name=edge,
            )
            for edge, (start, end) in zip(edges, spans, strict=True)
        )  # fmt: skip
        ramps = tuple(_ramps(net, edges, counts))
        return FoundRoad(road=road, counts=counts, ramps=ramps, speed_mps=speed, assumed=(*assumed, *said))
    raise refused or SpecError(source)


def _followed_line(
    tracked: Sequence[NetLane], vias: Sequence[Sequence[NetLane]], *, cut_back: float
) -> tuple[FloatArray, list[tuple[float, float]]]:
    """(the line along lanes and internal lanes, from where to where on it each lane lies).

    Lanes are cut back by a length [m] where they meet others; the internal lanes are left out then.
    """
    pieces: list[FloatArray] = []
    ends: list[tuple[int, int]] = []
    n = 0
    for number, (lane, via) in enumerate(zip(tracked, [*vias, []], strict=True)):
        shape = without_repeats(lane.shape)
        if cut_back:
            line = shapely.LineString(shape)
            back = min(cut_back, 0.4 * line.length)
            first, last = (back if number else 0.0), line.length - (back if number + 1 < len(tracked) else 0.0)
            shape = shapely.get_coordinates(shapely.ops.substring(line, first, last))
        ends.append((n, n + len(shape) - 1))
        pieces.append(shape)
        pieces += [] if cut_back else [inner.shape for inner in via]
        n = sum(map(len, pieces))
    points = np.concatenate(pieces)
    at = arc_length(points)
    return without_repeats(points), [(float(at[first]), float(at[last])) for first, last in ends]


def _leftmost_through(net: SumoNet, edges: Sequence[NetEdge], *, source: str) -> tuple[list[NetLane], list[list[NetLane]]]:
    """(the lane followed on each edge, the internal lanes between each two).

    It is the leftmost lane of the last edge that can be followed back to the first.
    """
    for last in reversed(edges[-1].car_lanes):
        lanes, vias = [last], []
        for edge, after in zip(reversed(edges[:-1]), reversed(edges[1:]), strict=True):
            leading = [
                found for found in net.connections[edge.id, after.id]
                if found.end_lane == lanes[-1].index and edge.lanes[found.start_lane].for_cars
            ]  # fmt: skip
            if not leading:
                break
            chosen = max(leading, key=lambda found: found.start_lane)
            lanes.append(edge.lanes[chosen.start_lane])
            vias.append(_internal(net, chosen.via))
        else:
            return lanes[::-1], vias[::-1]
    raise InputError(
        f"{source}: no lane goes through from edge {edges[0].id} to {edges[-1].id} without a lane change, as from a ramp; name "
        "a shorter stretch with --edges"
    )


def _internal(net: SumoNet, via: str | None) -> list[NetLane]:
    """The internal lanes of a connection, one after another."""
    found = []
    while via is not None and via in net.internal_lanes:
        found.append(net.internal_lanes[via])
        via = net.next_internal.get(via)
    return found


def _moved_right(line: FloatArray, distance: float) -> FloatArray:
    """The line moved to its right by a distance, at mitres."""
    steps = np.diff(line, axis=0)
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    inner = (heading[:-1] + heading[1:]) / 2
    at_points = np.concatenate([heading[:1], inner, heading[-1:]])
    half_turn = np.concatenate([[0.0], np.diff(heading) / 2, [0.0]])
    normal = np.column_stack([np.sin(at_points), -np.cos(at_points)]) / np.maximum(np.cos(half_turn), 0.5)[:, None]
    return line + distance * normal


def _widths(net: SumoNet, edges: Sequence[str], tracked: Sequence[NetLane], n_lanes: int) -> tuple[list[float], list[str]]:
    """(widths of the lanes that go through, from the right; what was assumed).

    Two lanes or more are as wide as their centre lines are apart, which older networks draw 0.1 m wider than they say.
    """
    said: list[float] = []
    apart: list[float] = []
    unsaid = False
    for edge, lane in zip(edges, tracked, strict=True):
        own = net.edges[edge]
        weight = max(1, round(own.length / 10))
        for back in range(n_lanes):
            width = own.lanes[lane.index - back].width
            unsaid |= width is None
            said += [DEFAULT_LANE_WIDTH_M if width is None else width] * weight
        if n_lanes > 1:
            apart += [_apart(lane, own.lanes[lane.index - n_lanes + 1]) / (n_lanes - 1)] * weight
    width = float(np.median(apart or said))
    assumed = [f"lanes without a width are {DEFAULT_LANE_WIDTH_M} m wide, SUMO's default"] if unsaid and not apart else []
    if np.ptp(said) > 0.3:
        assumed.append(f"lanes are {min(said):.2f} to {max(said):.2f} m wide along the stretch; {width:.2f} m is taken for all")
    return [width] * n_lanes, assumed


def _apart(left: NetLane, right: NetLane) -> float:
    """Median distance [m] between the centre lines of two lanes of an edge."""
    at = shapely.line_interpolate_point(shapely.LineString(left.shape), np.linspace(0.1, 0.9, 9), normalized=True)
    return float(np.median(shapely.distance(at, shapely.LineString(right.shape))))


def _ramps(net: SumoNet, edges: Sequence[str], counts: Sequence[LaneCount]) -> list[Ramp]:
    chain = set(edges)
    found = []
    for count, (before, after) in zip(counts, pairwise(edges), strict=False):
        on = [edge for edge in net.predecessors(after) if edge not in chain]
        off = [edge for edge in net.followers(before) if edge not in chain]
        found += [Ramp(at_m=count.end_m, kind="on-ramp", name=edge) for edge in on]
        found += [Ramp(at_m=count.end_m, kind="off-ramp", name=edge) for edge in off]
    return found
