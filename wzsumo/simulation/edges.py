"""The stretches of a zone's road as SUMO's edges: where every lane lies on each, and how wide it is.

SUMO takes the lanes of an edge to lie side by side without a gap. They are therefore laid from one line, the anchor: that
between the two lanes whose widths change least. A vehicle that crosses a line in SUMO then crosses it on the road, without a
jump. A lane that narrows hugs the lanes that don't: in a closing lane drivers keep clear of the taper's devices from the
taper's start.

From edge to edge a vehicle stays at its place in the lane. A lane's middle is therefore rounded over the whole road: no step
where one edge ends, no kink where a taper begins.

Closed ground between two open lanes (a gore) is a thin lane that bars every vehicle. A vehicle that straddles the line where
the lanes part brakes and falls back into its own lane. Without a gore SUMO takes the two lanes for neighbours, and the vehicle
drives on with half its width in the closed area.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.road import Profile, Road
from wzsumo.simulation.stretches import SAME_PLACE_M, Stretch, stretches_of
from wzsumo.work_zone import OpenLane, WorkZoneLayout

THIN_WIDTH_M = 0.1  # of gores and remnants; chosen by us: SUMO needs the lane to be there, not to be driven on
LONGEST_VEHICLE_M = 12.0  # the truck of `demand`
SIDE_MARGIN_M = 0.1  # between the outermost lanes and their outer lines: in SUMO a vehicle may touch its lane's line
ROUNDING_M = 15.0  # from a kink to where the rounded middle leaves and meets the straight one; chosen by us: 0.6 s at 25 m/s
SHAPE_STEP_M, SHAPE_TOLERANCE_M = 2.5, 1e-4  # of the points of a middle that turns


@dataclass(frozen=True, kw_only=True, eq=False)
class EdgeLane:
    """A lane of SUMO's on one edge: one width [m], around a middle that is a lateral offset [m] by station."""

    of: OpenLane | None  # the lane of the layout; None: a gore or a remnant, to which no lane leads
    middle: Profile
    width: float
    allows: Literal["all", "cars", "none"] = "all"  # cars alone on a remnant: a truck does not fit; none on a gore
    change_left: bool = True  # whether vehicles may change from it to the lane on the left, as they drive
    change_right: bool = True

    def lines(self, station: float) -> tuple[float, float]:
        """Lateral offsets [m] of its two lines at a station, the right one first as seen along the stations."""
        middle = float(self.middle(station))
        return middle - self.width / 2, middle + self.width / 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Edge:
    """One SUMO edge: stations in metres (start < end), and its lanes in SUMO's order, from the right as they are driven."""

    id: str
    start: float
    end: float
    lanes: tuple[EdgeLane, ...]
    opposing: bool = False  # driven from `end` to `start`

    @property
    def through_lanes(self) -> tuple[EdgeLane, ...]:
        """The lanes that traffic drives on: all but gores and remnants, in SUMO's order."""
        return tuple(lane for lane in self.lanes if lane.of is not None)

    def lane_at(self, station: float, offset: float) -> int:
        """Index among `lanes` of the through lane whose middle is nearest to a place [m]."""
        away = {n: abs(float(lane.middle(station)) - offset) for n, lane in enumerate(self.lanes) if lane.of is not None}
        return min(away, key=lambda number: away[number])


def edge_at(edges: tuple[Edge, ...], station: float) -> Edge:
    """The edge that holds a station [m]; the last one beyond its end."""
    return next((edge for edge in edges if edge.start <= station < edge.end), edges[-1])


def edges_of(layout: WorkZoneLayout) -> tuple[Edge, ...]:
    """The edges from the road's start to its end, each with at least one lane."""
    edges = []
    for number, stretch in enumerate(stretches_of(layout)):
        id_ = f"{number:02d}_{_name(layout, stretch)}"
        lanes = _laid_side_by_side(stretch, layout.road)
        edges.append(Edge(id=id_, start=stretch.start, end=stretch.end, lanes=lanes))
    return _rounded_from_edge_to_edge(edges)


def opposing_edges_of(layout: WorkZoneLayout) -> tuple[Edge, ...]:
    """The edges of the other direction, from the road's end to its start; none on a one-way carriageway."""
    lanes = tuple(sorted((lane for lane in layout.lanes if lane.opposing), key=lambda lane: float(lane.right(0.0))))
    if not lanes:
        return ()
    turns = layout.taking_turns
    stations = [layout.road.length, *((turns.end, turns.start) if turns else ()), 0.0]
    edges = []
    for number, (end, start) in enumerate(pairwise(stations)):
        laid = _laid_side_by_side(Stretch(start=start, end=end, lanes=lanes), layout.road)
        edges.append(Edge(id=f"opposing_{number}", start=start, end=end, lanes=laid[::-1], opposing=True))
    return tuple(edges)


def _name(layout: WorkZoneLayout, stretch: Stretch) -> str:
    """The areas that a stretch begins and ends in."""
    names = []
    for s in (stretch.start + SAME_PLACE_M, stretch.end - SAME_PLACE_M):
        beside_zone = "approach" if s < layout.start else "departure"
        names.append(next((area.name for area in layout.areas if area.start <= s < area.end), beside_zone).replace(" ", "_"))
    return "_to_".join(dict.fromkeys(names))


def _laid_side_by_side(stretch: Stretch, road: Road) -> tuple[EdgeLane, ...]:
    """The lanes of a stretch in SUMO, and its gores, from the right."""
    groups = [[stretch.lanes[0]]]
    for lane, is_parted in zip(stretch.lanes[1:], stretch.parted, strict=True):
        if is_parted:
            groups.append([])
        groups[-1].append(lane)
    may_change = [True, *(not bars for bars in stretch.barred), True]
    laid: list[EdgeLane] = []
    for group in groups:
        lines = _lines(replace(stretch, lanes=tuple(group)), road)
        s = lines[0].stations
        if laid:
            between = (laid[-1].middle(s) + laid[-1].width / 2 + lines[0].offsets) / 2
            laid.append(EdgeLane(of=None, middle=Profile(stations=s, offsets=between), width=THIN_WIDTH_M, allows="none"))
        for lane, (right, left) in zip(group, pairwise(lines), strict=True):
            number = stretch.lanes.index(lane)
            laid.append(
                EdgeLane(
                    of=lane,
                    middle=Profile(stations=s, offsets=(right.offsets + left.offsets) / 2),
                    width=float(left.offsets[0] - right.offsets[0]),
                    change_right=may_change[number],
                    change_left=may_change[number + 1],
                )
            )
    return tuple(laid if stretch.remnant is None else _with_remnant(laid, stretch.remnant, stretch))


def _with_remnant(laid: list[EdgeLane], remnant: OpenLane, stretch: Stretch) -> list[EdgeLane]:
    """The lanes with that of a remnant on its side of them. Vehicles may leave it and not enter it."""
    on_left = float(remnant.right(stretch.start)) > float(stretch.lanes[0].right(stretch.start))
    beside = laid[-1 if on_left else 0]
    side = 1 if on_left else -1
    aside = side * (beside.width + THIN_WIDTH_M) / 2
    middle = Profile(stations=beside.middle.stations, offsets=beside.middle.offsets + aside)
    thin = EdgeLane(of=None, middle=middle, width=THIN_WIDTH_M, allows="cars")
    if on_left:
        return [*laid[:-1], replace(beside, change_left=False), thin]
    return [thin, replace(beside, change_right=False), *laid[1:]]


def _lines(stretch: Stretch, road: Road) -> list[Profile]:
    """The lines of lanes without a gore between them, from the right: parallel to the anchor, a lane's least width apart."""
    lanes, widths = stretch.lanes, stretch.widths
    change = np.subtract(stretch.greatest_widths, widths)
    anchor = min(range(1, len(lanes)), key=lambda k: change[k - 1] + change[k], default=0)  # 0: the middle of the only lane

    def anchor_line(s: FloatArray) -> FloatArray:
        return lanes[anchor].right(s) if anchor else (lanes[0].right(s) + lanes[0].left(s)) / 2

    s = np.array(sorted({s for lane in lanes for s in stretch.turns(lane)}))
    across = np.concatenate([[0.0], np.cumsum(widths)])
    across -= across[anchor] if anchor else across[-1] / 2
    margin = SIDE_MARGIN_M + _cut_inside(anchor_line, s, road)
    across[[0, -1]] += margin, -margin
    return [Profile(stations=s, offsets=anchor_line(s) + aside) for aside in across]


def _cut_inside(line: Callable[[FloatArray], FloatArray], stations: FloatArray, road: Road) -> float:
    """How far [m] the middle of the longest vehicle lies inside the turns of a line, where both its ends follow it rounded."""
    half = LONGEST_VEHICLE_M / 2
    s = np.concatenate([stations, np.linspace(stations[0], stations[-1], 50)])
    s = np.clip(s, half, road.length - half)
    back, front = (road.to_xy(s + along, _rounded(line, s + along)) for along in (-half, half))
    return float(np.linalg.norm(road.to_xy(s, line(s)) - (back + front) / 2, axis=1).max())


def _rounded_from_edge_to_edge(edges: list[Edge]) -> tuple[Edge, ...]:
    """The same edges with the middle of every lane rounded over all of them."""
    pieces: dict[int, list[Profile]] = {}
    for edge in edges:
        for lane in edge.through_lanes:
            pieces.setdefault(id(lane.of), []).append(lane.middle)
    whole = {lane: _one_after_the_other(middles) for lane, middles in pieces.items()}
    rounded = []
    for edge in edges:
        s = np.linspace(edge.start, edge.end, int(np.ceil((edge.end - edge.start) / SHAPE_STEP_M)) + 1)
        lanes = [replace(q, middle=_thinned(s, _rounded(whole.get(id(q.of), q.middle), s))) for q in edge.lanes]
        rounded.append(replace(edge, lanes=tuple(lanes)))
    return tuple(rounded)


def _one_after_the_other(middles: list[Profile]) -> Profile:
    """One profile of several, each of which begins where the one before ends, perhaps with a step."""
    ends = [np.append(middle.stations[:-1], middle.stations[-1] - 1e-6) for middle in middles]
    return Profile(stations=np.concatenate(ends), offsets=np.concatenate([middle.offsets for middle in middles]))


def _rounded(line: Callable[[FloatArray], FloatArray], s: FloatArray) -> FloatArray:
    """A line at stations s (n,) as drivers follow it, without kinks and steps: its mean over ROUNDING_M behind and ahead.

    What is farther away counts less, down to nothing.
    """
    along = np.linspace(-ROUNDING_M, ROUNDING_M, 61)
    return np.asarray(np.average([line(s + d) for d in along], axis=0, weights=ROUNDING_M - np.abs(along)))


def _thinned(s: FloatArray, offsets: FloatArray) -> Profile:
    """A profile without the points at which it does not turn."""
    keep = np.concatenate([[True], np.abs(np.diff(offsets, n=2)) > SHAPE_TOLERANCE_M, [True]])
    return Profile(stations=s[keep], offsets=offsets[keep])
