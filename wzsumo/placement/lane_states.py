"""What the zone makes of each SUMO lane of the corridor: closed, bent, narrowed, or left as it is."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from wzsumo.placement.chain import Link
from wzsumo.placement.cuts import CutEdge, text_of_shape
from wzsumo.placement.lane_plan import MOVED_M, Course, LanePlan, middle_of, width_of
from wzsumo.placement.net import NetLane, allows, decimals_of, parse_heights
from wzsumo.simulation.network import UNUSED_VEHICLE_CLASS
from wzsumo.simulation.stretches import NO_CHANGE_AHEAD_OF_GORE_M

# Wider than a closing lane at its end, 8 ft: they merge ahead of the taper (SUMO docs, Vehicle Type Parameter Defaults).
WIDE_CLASSES = ("bus", "coach", "truck", "trailer")
Attributes = dict[str, str | None]  # new values, None for those that go


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """A piece of an edge of the corridor, or a whole edge, and what its lanes become: new attributes by lane index."""

    link: Link
    number: int
    id: str
    lanes: dict[int, Attributes] = field(default_factory=dict)
    barred: frozenset[int] = frozenset()  # lane indices
    courses: dict[int, Course] = field(default_factory=dict)  # by lane index
    start: float = 0.0  # station [m]
    middle: float = 0.0  # likewise


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedLanes:
    """All lanes of the corridor as the zone leaves them."""

    plan: LanePlan

    @cached_property
    def pieces(self) -> list[Piece]:
        """The pieces in the order in which they are driven, from the edge where the zone begins."""
        cuts = {cut.edge.id: cut for cut in self.plan.cuts}
        pieces = []
        for link in self.plan.corridor.links:
            cut = cuts.get(link.edge.id) or CutEdge(edge=link.edge, positions=())
            ids = cut.ids if cut.positions else (link.edge.id,)
            pieces += [self._piece(cut, link, number, id_) for number, id_ in enumerate(ids)]
        return pieces

    @cached_property
    def via_lanes(self) -> dict[str, Attributes]:
        """New attributes of the internal lanes that the zone closes or moves, by their ids.

        Closed ones are barred: SUMO's vehicles change lanes within a junction, too.
        """
        changed: dict[str, Attributes] = {}
        corridor = self.plan.corridor
        for link in corridor.links:
            for place, slot in enumerate(corridor.slots):
                for lane in corridor.net.via_lanes(link.onward[slot]) if slot in link.onward else []:
                    start, end = corridor.station_of(lane, 0.0), corridor.station_of(lane, lane.length)
                    if self._touches(start, end) and end > start:
                        changed[lane.id] = self._state(self.plan.course_at(place, (start + end) / 2), place, lane, start, end)
        return {id_: changes for id_, changes in changed.items() if changes}

    @property
    def barred_via_lanes(self) -> frozenset[str]:
        """Ids of the internal lanes that are closed."""
        return frozenset(id_ for id_, changes in self.via_lanes.items() if changes.get("allow") == UNUSED_VEHICLE_CLASS)

    @property
    def closed_lanes(self) -> frozenset[str]:
        """Ids of the lanes, of pieces and of whole edges, that the zone closes to all vehicles or to some."""
        return frozenset(
            f"{piece.id}_{index}"
            for piece in self.pieces
            for index, changes in piece.lanes.items()
            if {"allow", "disallow"} & changes.keys()
        )

    def leads_to(self, piece: Piece, following: Piece) -> dict[int, int]:
        """Lane index on the next piece of the same edge by lane index: which lanes go on at a cut, and where."""
        slots, links = self.plan.corridor.slots, {}
        place_of = {piece.link.lanes[slot]: place for place, slot in enumerate(slots) if slot in piece.link.lanes}
        for lane in piece.link.edge.lanes:
            place = place_of.get(lane.index)
            if place is None or not (piece.lanes or following.lanes or piece.barred or following.barred):
                links[lane.index] = lane.index
                continue
            course = piece.courses.get(lane.index)
            goes_to = course.place_at(following.middle) if course else None
            if goes_to is not None and slots[goes_to] in piece.link.lanes:
                links[lane.index] = piece.link.lanes[slots[goes_to]]
        return links

    def _touches(self, start: float, end: float) -> bool:
        first, last = self.plan.span
        return start < last - MOVED_M and end > first + MOVED_M

    def _stations(self, cut: CutEdge, lane: NetLane, number: int) -> tuple[float, float]:
        """Stations [m] where a lane of a piece begins and ends."""
        first, last = (share * lane.length / cut.edge.length for share in cut.bounds[number : number + 2])
        return self.plan.corridor.station_of(lane, first), self.plan.corridor.station_of(lane, last)

    def _piece(self, cut: CutEdge, link: Link, number: int, id_: str) -> Piece:
        start, end = self._stations(cut, link.lane(max(link.lanes)), number)
        middle = (start + end) / 2
        lanes: dict[int, Attributes] = {}
        barred, courses = set(), {}
        for place, slot in enumerate(self.plan.corridor.slots):
            if slot not in link.lanes:
                continue
            lane = link.lane(slot)
            course = self.plan.course_at(place, middle)
            if course is not None:
                courses[lane.index] = course
            if not self._touches(start, end):
                continue
            if course is None:
                barred.add(lane.index)
            if changes := self._state(course, place, lane, *self._stations(cut, lane, number)):
                lanes[lane.index] = changes
        barred_changes = self._barred_changes(courses, start, end) | self._barred_from_beside(link, start, end)
        for index, changes in barred_changes.items():
            lanes[index] = lanes.get(index, {}) | changes
        return Piece(
            link=link, number=number, id=id_, lanes=lanes, barred=frozenset(barred), courses=courses, start=start, middle=middle
        )

    def _state(self, course: Course | None, place: int, lane: NetLane, start: float, end: float) -> Attributes:
        """New attributes of a lane from one station to another: barred where no lane of the layout uses it."""
        if course is None:
            return {"allow": UNUSED_VEHICLE_CLASS, "disallow": None}
        return self._bent(course, place, lane, start, end)

    def _bent(self, course: Course, place: int, lane: NetLane, start: float, end: float) -> Attributes:
        """New shape and width of a lane where the zone moves or narrows it, and the classes that it is then too narrow for."""
        road, shape = self.plan.corridor.road, lane.element.get("shape")
        stations = np.unique(np.concatenate([road.stations, course.lane.left.stations, course.lane.right.stations]))
        stations = np.concatenate([[start], stations[(stations > start + 0.1) & (stations < end - 0.1)], [end]])
        middle, width = middle_of(course.lane, stations), float(width_of(course.lane, stations).min())
        narrower = width < road.lane_widths[place] - MOVED_M
        if np.abs(middle - road.lane_centre(place)).max() <= MOVED_M and not narrower:
            return {}
        points = road.to_xy(stations, middle)
        if (heights := parse_heights(shape)) is not None:
            share = (stations - start) / max(end - start, 1e-9)
            points = np.column_stack([points, np.interp(share, np.linspace(0, 1, len(heights)), heights)])
        changes: Attributes = {"shape": text_of_shape(points, decimals=decimals_of(shape))}
        if narrower:
            changes["width"] = f"{width:.2f}"
        if np.isfinite(course.end):
            changes |= without_wide_classes(lane.element.attributes)
        return changes

    def _barred_changes(self, courses: dict[int, Course], start: float, end: float) -> dict[int, Attributes]:
        """Bars lane changes between neighbours that closed ground parts here or soon."""
        changes: dict[int, Attributes] = {}
        stations = np.array([start, end, end + NO_CHANGE_AHEAD_OF_GORE_M])
        for index, course in courses.items():
            beside = courses.get(index + 1)
            if beside is None or not self._touches(start, end):
                continue
            there = stations[(stations < course.end) & (stations < beside.end)]
            if len(there) and float((beside.lane.right(there) - course.lane.left(there)).max()) > MOVED_M:
                changes.setdefault(index, {})["changeLeft"] = UNUSED_VEHICLE_CLASS
                changes.setdefault(index + 1, {})["changeRight"] = UNUSED_VEHICLE_CLASS
        return changes

    def _barred_from_beside(self, link: Link, start: float, end: float) -> dict[int, Attributes]:
        """Bars lane changes between the road and lanes beside it, such as a ramp's, where closed ground lies between them."""
        changes: dict[int, Attributes] = {}
        slots, road = self.plan.corridor.slots, self.plan.corridor.road
        s = np.linspace(start, end, 20)
        for strip in self.plan.layout.closed_strips:
            there = s[(s >= strip.start) & (s <= strip.end)]
            if not len(there):
                continue
            rightmost, leftmost = link.lanes.get(slots[0]), link.lanes.get(slots[-1])
            if rightmost and float(strip.right(there).min()) <= MOVED_M:
                changes[rightmost - 1] = {"changeLeft": UNUSED_VEHICLE_CLASS}
                changes[rightmost] = {"changeRight": UNUSED_VEHICLE_CLASS}
            if (
                leftmost is not None
                and leftmost + 1 < len(link.edge.lanes)
                and (float(strip.left(there).max()) >= road.travelled_width - MOVED_M)
            ):
                changes[leftmost + 1] = {"changeRight": UNUSED_VEHICLE_CLASS}
                changes[leftmost] = {"changeLeft": UNUSED_VEHICLE_CLASS}
        return changes


def without_wide_classes(attributes: dict[str, str]) -> Attributes:
    """The permissions of a lane without the classes that are wider than it."""
    if (allowed := attributes.get("allow")) and allowed != "all":
        left = [name for name in allowed.split() if name not in WIDE_CLASSES]
        return {"allow": " ".join(left) or UNUSED_VEHICLE_CLASS}
    barred = [*attributes.get("disallow", "").split(), *(name for name in WIDE_CLASSES if allows(attributes, name))]
    return {"allow": None, "disallow": " ".join(barred)}
