"""The road that the zone lies on, found in a network: the chain of edges, and its stations.

The reference line follows the leftmost lane that leads through the zone and lies in the middle of all that do. A SUMO position
on an edge counts along lanes, a station along the reference line; the two are converted over the point on the lane.
"""

from dataclasses import dataclass, replace

import numpy as np
import shapely

from wzsumo.errors import PlacementError, SpecError
from wzsumo.frames import FloatArray, arc_length
from wzsumo.placement.chain import Link, chain_ahead, chain_behind, chain_beyond, roadway_slots
from wzsumo.placement.net import Net, NetLane, point_on
from wzsumo.road import Road

# Of the road upstream of the zone: the farthest sign stands 1 mile ahead of it. Less where the road runs across itself.
UPSTREAM_M = (1_800.0, 900.0, 400.0, 100.0, 0.0)
# Of the road beyond the edge where the zone ends, on which a drive through it ends. None where no road can be laid so far.
BEYOND_M = (300.0, 0.0)
SHAPE_TOLERANCE_M = 0.02  # by which the reference line may leave the lane's points: SUMO writes two decimals
SMOOTHED_STEPS_M = (0.0, 5.0, 10.0, 20.0)  # spacings at which a line with kinks is drawn anew, the finest that makes a road
LONGEST_STEP_M = 20.0  # between points: offsets are mitred from point to point, and a kink should tell in its place alone
# By how much a lane's middle may lie off the road's: a third of a lane. What vehicles on it meet is a check of its own.
MAX_OFF_ROAD_M = 1.0
MAX_WIDTH_CHANGE_M = 0.3  # of a lane along the zone, likewise


@dataclass(frozen=True, kw_only=True, eq=False)
class Corridor:
    """The chain of edges from the one where the zone begins, and its Road; lane k of the road is slot `slots[k]`.

    The road begins with the lanes `before` the chain and goes on with those `beyond` it, internal ones included.
    """

    net: Net
    links: tuple[Link, ...]
    slots: tuple[int, ...]  # from the right
    road: Road
    start: float  # station [m] of the position that was asked for
    before: tuple[NetLane, ...] = ()
    beyond: tuple[NetLane, ...] = ()

    def station_of(self, lane: NetLane, position: float) -> float:
        """Station [m] of a position on a lane."""
        return float(self.road.to_sd(point_on(lane, position))[0][0])

    def span(self, link: Link, slot: int | None = None) -> tuple[float, float]:
        """Stations [m] where a lane of an edge begins and ends; of the leftmost where no slot is named."""
        lane = link.lane(self.slots[-1] if slot is None else slot)
        return self.station_of(lane, 0.0), self.station_of(lane, lane.length)

    def place_of(self, station: float) -> tuple[Link | None, float]:
        """(edge, position [m] on it) of a station; no edge where it lies in a junction or beyond the chain.

        The position is exact on the leftmost lane to the centimetre, SUMO's resolution.
        """
        for link in self.links:
            first, last = self.span(link)
            if first <= station <= last:
                lane = link.lane(self.slots[-1])
                positions = np.linspace(0.0, lane.length, max(int(lane.length / 2.0), 2) + 1)
                stations = self.road.to_sd(np.array([point_on(lane, p) for p in positions]))[0]
                return link, round(float(np.interp(station, stations, positions)), 2)
        return None, 0.0


def find_corridor(
    net: Net, edge_id: str, position: float, *, closed: tuple[int, ...], length: float, shoulders: tuple[float, float]
) -> Corridor:
    """The corridor of a zone of `length` [m] that begins at a position of an edge and closes lanes, 0 = rightmost there.

    `shoulders` are the widths [m] of the left and the right one. Lanes that end or turn off within that length are none of the
    road. Raises PlacementError where the road ends before, where a closed lane does not lead through or no other does, and
    where the lanes do not lie side by side.
    """
    edge = net.edges[edge_id]
    slots = roadway_slots(edge)
    links = chain_ahead(net, edge, slots, length=position + length + 1.0)
    through = _through_slots(links, position=position, length=length)
    if lost := sorted(set(closed) - set(through)):
        last = next(link for link in links if lost[0] not in link.onward)
        raise PlacementError(
            f"lane {lost[0]} of edge {edge_id!r}, which the zone closes, ends or turns off at the end of edge "
            f"{last.edge.id!r}, within the {length:.0f} m of the zone; move or shorten the zone, or close another lane"
        )
    if set(through) == set(closed):
        raise PlacementError(
            f"{len(through)} of the {len(slots)} lanes of edge {edge_id!r} lead through the {length:.0f} m of the zone, and it "
            "closes all of them; move or shorten the zone, or close fewer lanes"
        )
    corridor = _laid_corridor(net, links, through, shoulders=shoulders)
    start = corridor.station_of(links[0].lane(through[-1]), position)
    corridor = replace(corridor, start=start)
    _check_end(corridor, start + length)
    _check_lanes_on_road(corridor, start, start + length)
    return corridor


def _through_slots(links: list[Link], *, position: float, length: float) -> tuple[int, ...]:
    """The slots that lead through all edges that the zone reaches."""
    slots, covered = set(links[0].lanes), -position
    for link in links:
        slots &= set(link.lanes)
        covered += link.edge.length
        if covered >= length:
            break
    return tuple(sorted(slots))


def _laid_corridor(net: Net, links: list[Link], slots: tuple[int, ...], *, shoulders: tuple[float, float]) -> Corridor:
    """The corridor with a road along its leftmost slot, in the middle of all slots.

    Raises PlacementError where none can be laid.
    """
    faults = []
    ahead, last = _lanes_ahead(net, links, slots[-1]), links[-1]
    widths = tuple(links[0].lane(slot).width for slot in slots)
    for upstream in UPSTREAM_M:
        before = chain_behind(net, links[0].edge, links[0].lanes[slots[-1]], length=upstream)
        for step in SMOOTHED_STEPS_M:
            for length in BEYOND_M:
                leads_on = slots[-1] in last.lanes
                beyond = chain_beyond(net, last.edge, last.lanes[slots[-1]], length=length) if leads_on else []
                try:
                    road = _road_along([*before, *ahead, *beyond], widths, shoulders=shoulders, step=step)
                except SpecError as error:
                    faults.append(str(error))
                    continue
                return Corridor(
                    net=net, links=tuple(links), slots=slots, road=road, start=0.0, before=tuple(before), beyond=tuple(beyond)
                )
    raise PlacementError(f"edge {links[0].edge.id!r}: no road can be laid along its lanes: {faults[-1]}")


def _lanes_ahead(net: Net, links: list[Link], leftmost: int) -> list[NetLane]:
    lanes: list[NetLane] = []
    for link in links:
        if leftmost not in link.lanes:
            break
        lanes.append(link.lane(leftmost))
        if leftmost in link.onward:
            lanes += net.via_lanes(link.onward[leftmost])
    return lanes


def _road_along(lanes: list[NetLane], widths: tuple[float, ...], *, shoulders: tuple[float, float], step: float) -> Road:
    """Road along a chain of leftmost lanes; SpecError where its points do not make one, or it runs across itself."""
    points = _distinct(np.vstack([lane.points for lane in lanes]))
    line = _redrawn(np.array(shapely.LineString(points).simplify(SHAPE_TOLERANCE_M).coords), step)
    guide = Road(reference_line=line, lane_widths=(widths[-1],), left_shoulder=0.0, right_shoulder=0.0)
    to_middle = widths[-1] - sum(widths) / 2  # d of the middle of all lanes where only the leftmost counts
    middle = _distinct(guide.to_xy(guide.stations, to_middle))
    left, right = shoulders
    road = Road(reference_line=middle, lane_widths=widths, left_shoulder=left, right_shoulder=right)
    if not road.strip(0.0, road.length, -right, road.left_edge).is_valid:
        raise SpecError(f"it runs across itself within {road.length:.0f} m")
    return road


def _distinct(points: FloatArray) -> FloatArray:
    """The points without those that lie within a centimetre of the one before."""
    keep = np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) > 0.01])
    return points[keep]


def _redrawn(line: FloatArray, step: float) -> FloatArray:
    """The line by points `step` [m] apart; for 0 with its own points, and more between them where they are far apart."""
    along = arc_length(line)
    at = np.linspace(0.0, along[-1], max(int(along[-1] / (step or LONGEST_STEP_M)), 1) + 1)
    if step == 0.0:
        more = at[np.abs(at[:, None] - along).min(axis=1) > LONGEST_STEP_M / 4]
        at = np.sort(np.concatenate([along, more]))
    return np.column_stack([np.interp(at, along, line[:, 0]), np.interp(at, along, line[:, 1])])


def _check_end(corridor: Corridor, end: float) -> None:
    last = [link for link in corridor.links if corridor.slots[-1] in link.lanes][-1]
    chain_end = corridor.span(last)[1]
    if end > chain_end - 0.5:
        raise PlacementError(
            f"the zone is {end - corridor.start:.0f} m long, and the road from its place on ends after "
            f"{chain_end - corridor.start:.0f} m, at the end of edge {corridor.links[-1].edge.id!r}; move it upstream or "
            "shorten it"
        )


def _check_lanes_on_road(corridor: Corridor, start: float, end: float) -> None:
    """Raise PlacementError where a lane within the zone is not as wide as, or not beside, the others all along."""
    road = corridor.road
    for link in corridor.links:
        for number, slot in enumerate(corridor.slots):
            if slot not in link.lanes:
                continue
            onward = corridor.net.via_lanes(link.onward[slot]) if slot in link.onward else []
            for lane in (link.lane(slot), *onward):
                line = _redrawn(_distinct(lane.points), 5.0) if len(_distinct(lane.points)) > 1 else lane.points
                s, d = road.to_sd(line)
                within = (s >= start) & (s <= end)
                if not within.any():
                    continue
                off = float(np.abs(d[within] - road.lane_centre(number)).max())
                if off > MAX_OFF_ROAD_M:
                    raise PlacementError(
                        f"lane {lane.id!r} lies up to {off:.1f} m off the place that it has beside the leftmost lane; at most "
                        f"{MAX_OFF_ROAD_M:g} m can be laid out: place the zone elsewhere, or mend the lane's shape in netedit"
                    )
                if abs(lane.width - road.lane_widths[number]) > MAX_WIDTH_CHANGE_M and lane in link.edge.lanes:
                    raise PlacementError(
                        f"lane {lane.id!r} is {lane.width:g} m wide, at the zone's beginning {road.lane_widths[number]:g} m; "
                        f"at most {MAX_WIDTH_CHANGE_M:g} m of change can be laid out: place the zone elsewhere"
                    )
