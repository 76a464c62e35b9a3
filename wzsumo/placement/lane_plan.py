"""What a zone asks of the corridor's lanes: where edges are cut, which lanes are closed, moved or led over between the cuts.

SUMO's drivers see four to eight edges ahead, so there are few cuts: where a taper begins, where its lane is too narrow for a
car, where a lane moves over to the place beside, and where the closed lanes open again, past the downstream taper. A taper is
one piece: the closing lane bends along it, as narrow all along as it is at its end.
"""

from dataclasses import dataclass, field

import numpy as np

from wzsumo.errors import PlacementError
from wzsumo.frames import FloatArray
from wzsumo.placement.chain import Link
from wzsumo.placement.corridor import Corridor
from wzsumo.placement.cuts import SHORTEST_PIECE_M, CutEdge
from wzsumo.simulation.stretches import passable_end
from wzsumo.work_zone import OpenLane, WorkZoneLayout

# From the last device to where a closed lane opens: SUMO's vehicles change lanes from one moment to the next, and the tail of
# one that has just passed would sweep over the devices. A truck with trailer (SUMO docs, Vehicle Type Parameter Defaults).
LONGEST_VEHICLE_M = 16.5
SAME_PLACE_M = 0.5  # cuts nearer to each other than this are one
MOVED_M = 0.01  # a lane that lies this far off its place on the road is moved; SUMO's resolution


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """One lane of the layout and the SUMO lanes that it uses: that of road lane `home`, then that of road lane `final`.

    Stations in metres. `end` is where a closing lane is too narrow for a car, `changes` where the lane goes on as `final`.
    """

    lane: OpenLane
    start: float
    end: float
    home: int
    final: int
    changes: float

    def place_at(self, station: float) -> int | None:
        """The road lane whose SUMO lane it uses at a station; None where it is not there."""
        if not self.start <= station < self.end:
            return None
        return self.home if station < self.changes else self.final


@dataclass(frozen=True, kw_only=True, eq=False)
class LanePlan:
    """Cuts along the corridor, and the courses of the lanes that are open between them."""

    corridor: Corridor
    layout: WorkZoneLayout
    courses: tuple[Course, ...]
    cuts: tuple[CutEdge, ...]
    span: tuple[float, float]  # stations [m] between which lanes are closed, moved or narrowed
    taper_spans: tuple[tuple[float, float], ...]  # stations [m] of the closing lanes' tapers

    def course_at(self, place: int, station: float) -> Course | None:
        """Which lane uses SUMO's lane at the place of a road lane; None where that is closed."""
        return next((course for course in self.courses if course.place_at(station) == place), None)


def plan_lanes(corridor: Corridor, layout: WorkZoneLayout) -> LanePlan:
    """The plan of a layout. Raises PlacementError where a lane would have to change its place at a junction."""
    cuts = _Cuts(corridor)
    courses, stations, tapers = [], [], []
    for lane in layout.lanes:
        home, final = lane.index, _final_place(lane, corridor)
        start, end, changes = 0.0, np.inf, np.inf
        moves = _moves(lane)
        if lane.start > 0:
            start = cuts.later(lane.start + LONGEST_VEHICLE_M)
            stations.append(start)
        elif moves and lane.end < layout.road.length:
            first, end = cuts.earlier(moves[0]), cuts.earlier(passable_end(lane))
            stations += [first, end]
            tapers.append((first, end))
        elif moves:
            last = cuts.later(moves[1], within_edge=final != home)
            changes = last if final != home else np.inf
            stations += [cuts.earlier(moves[0]), last]
        courses.append(Course(lane=lane, start=start, end=end, home=home, final=final, changes=changes))
    span = (min(stations), max(stations)) if stations else (layout.start, layout.start)
    return LanePlan(
        corridor=corridor, layout=layout, courses=tuple(courses), cuts=cuts.edges(), span=span, taper_spans=tuple(tapers)
    )


def middle_of(lane: OpenLane, stations: FloatArray) -> FloatArray:
    """Lateral offsets (n,) [m] of a lane's middle."""
    return np.asarray((lane.left(stations) + lane.right(stations)) / 2)


def width_of(lane: OpenLane, stations: FloatArray) -> FloatArray:
    """Widths (n,) [m] of a lane."""
    return np.asarray(lane.left(stations) - lane.right(stations))


def _moves(lane: OpenLane) -> tuple[float, float] | None:
    """Stations [m] where a lane first leaves its straight course and where it ends to move; None where it runs straight."""
    s = np.unique(np.concatenate([lane.left.stations, lane.right.stations]))
    lines = np.column_stack([lane.left(s), lane.right(s)])
    changing = np.flatnonzero(np.abs(np.diff(lines, axis=0)).max(axis=1, initial=0.0) > MOVED_M) if len(s) > 1 else np.array([])
    return (float(s[changing[0]]), float(s[changing[-1] + 1])) if len(changing) else None


def _final_place(lane: OpenLane, corridor: Corridor) -> int:
    """The road lane at whose place a lane leads off the corridor."""
    road = corridor.road
    if lane.end < road.length:
        return lane.index
    middle = float(middle_of(lane, np.array([road.length]))[0])
    return int(np.argmin([abs(road.lane_centre(k) - middle) for k in range(road.own_lanes)]))


@dataclass(eq=False)
class _Cuts:
    """The cuts found so far. Near the end of an edge a cut moves to that end, to the side on which it does no harm."""

    corridor: Corridor
    positions: dict[str, tuple[Link, set[float]]] = field(default_factory=dict)

    def earlier(self, station: float) -> float:
        """Cut at a station or up to SHORTEST_PIECE_M before; returns the station of the cut, or of the edge's end."""
        link, position = self._before(station)
        if position < SHORTEST_PIECE_M or link.edge.length < 2 * SHORTEST_PIECE_M:
            return self.corridor.span(link)[0]
        return self._cut(link, min(position, link.edge.length - SHORTEST_PIECE_M))

    def later(self, station: float, *, within_edge: bool = False) -> float:
        """As `earlier`, but behind the station; `within_edge` asks for a cut even where an edge's end is near."""
        link, position = self._behind(station)
        number = self.corridor.links.index(link)
        if position > link.edge.length - SHORTEST_PIECE_M or link.edge.length < 2 * SHORTEST_PIECE_M:
            if not within_edge:
                return self.corridor.span(link)[1]
            following = self.corridor.links[number + 1 : number + 2]
            if not following or following[0].edge.length < 2 * SHORTEST_PIECE_M:
                raise PlacementError(
                    f"a lane would have to move over to the place beside at the end of edge {link.edge.id!r}, within a "
                    "junction; move the zone by some 50 m"
                )
            link, position = following[0], SHORTEST_PIECE_M
        return self._cut(link, max(position, SHORTEST_PIECE_M))

    def edges(self) -> tuple[CutEdge, ...]:
        """The edges that are cut."""
        return tuple(CutEdge(edge=link.edge, positions=tuple(sorted(at))) for link, at in self.positions.values() if at)

    def _cut(self, link: Link, position: float) -> float:
        known = self.positions.setdefault(link.edge.id, (link, set()))[1]
        position = next((at for at in known if abs(at - position) < SAME_PLACE_M), position)
        known.add(position)
        return self.corridor.station_of(link.lane(self.corridor.slots[-1]), position)

    def _before(self, station: float) -> tuple[Link, float]:
        """The edge at a station and the position there; the end of the edge before where a junction lies there."""
        link, position = self.corridor.place_of(station)
        if link:
            return link, position
        ended = [link for link in self.corridor.links if self.corridor.span(link)[1] <= station]
        return (ended[-1], ended[-1].edge.length) if ended else (self.corridor.links[0], 0.0)

    def _behind(self, station: float) -> tuple[Link, float]:
        """As `_before`, but the beginning of the edge behind the junction."""
        link, position = self.corridor.place_of(station)
        if link:
            return link, position
        begun = [link for link in self.corridor.links if self.corridor.span(link)[0] >= station]
        last = self.corridor.links[-1]
        return (begun[0], 0.0) if begun else (last, last.edge.length)
