"""WorkZoneLayout -> the stretches of road that become SUMO's edges.

A lane keeps one width along an edge of SUMO's, and in a taper it does not. The road is therefore cut into edges so short that
no lane changes its width by more than MAX_WIDTH_STEP_M on any of them. Where both directions take turns on one lane, the edges
of the two directions lie on top of each other.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.units import METRES_PER_FOOT
from wzsumo.work_zone import OpenLane, WorkZoneLayout

# A vehicle that changes lanes where two edges meet jumps sideways by at most this; SUMO moves it up to 0.1 m a step anyway.
# Half of it makes a simulation a sixth longer and hardly fewer vehicles jump by more than 0.2 m. Set on our simulated traffic.
MAX_WIDTH_STEP_M = 0.2
PASSABLE_WIDTH_M = 8 * METRES_PER_FOOT  # a closing lane ends where it is narrower: a car just fits; chosen by us
# The remnant of a closing lane goes on until it is down to this: half the width of the truck of `demand`. SUMO stops a vehicle
# that has found no gap at the remnant's end. There, a vehicle with its middle in the open lane does not reach the devices.
REMNANT_END_WIDTH_M = 1.25
SAME_PLACE_M = 0.01  # two places closer to each other than this are one


@dataclass(frozen=True, kw_only=True)
class Edge:
    """One SUMO edge: stations in metres (start < end), and its lanes in SUMO's order, from the right as they are driven.

    Some of `lanes` may be remnants of closing lanes, and some gores (see `network`); `through_lanes` are the others.
    """

    id: str
    start: float
    end: float
    lanes: tuple[OpenLane, ...]
    gores: tuple[OpenLane, ...] = ()  # closed ground between two lanes, with the index of the right one
    opposing: bool = False  # driven from `end` to `start`

    @property
    def through_lanes(self) -> tuple[OpenLane, ...]:
        """The lanes that traffic drives on, in SUMO's order."""
        lanes = (lane for lane in self.lanes if lane not in self.gores)
        return tuple(lane for lane in lanes if self.opposing or passable_end(lane) > self.start + SAME_PLACE_M)


def edges_of(layout: WorkZoneLayout) -> tuple[Edge, ...]:
    """The edges from the road's start to its end, each with at least one lane."""
    edges = []
    for number, (start, end) in enumerate(pairwise(_cuts(layout))):
        middle = (start + end) / 2
        lanes = [q for q in layout.lanes if not q.opposing and q.start <= middle < remnant_end(q)]
        lanes.sort(key=lambda q: float(q.right(middle)))
        gores = _gores(lanes, start, end)
        name = next((area.name for area in layout.areas if area.start <= middle < area.end), "")
        name = name or ("approach" if middle < layout.start else "departure")
        id_ = f"{number:02d}_{name.replace(' ', '_')}"
        in_order = sorted([*lanes, *gores], key=lambda q: float(q.right(middle)))
        edges.append(Edge(id=id_, start=start, end=end, lanes=tuple(in_order), gores=gores))
    return tuple(edges)


def opposing_edges_of(layout: WorkZoneLayout) -> tuple[Edge, ...]:
    """The edges of the other direction, from the road's end to its start; none on a one-way carriageway."""
    lanes = tuple(sorted((q for q in layout.lanes if q.opposing), key=lambda q: -float(q.right(0.0))))
    if not lanes:
        return ()
    turns = layout.taking_turns
    stations = [layout.road.length, *((turns.end, turns.start) if turns else ()), 0.0]
    return tuple(
        Edge(id=f"opposing_{number}", start=start, end=end, lanes=lanes, opposing=True)
        for number, (end, start) in enumerate(pairwise(stations))
    )


def passable_end(lane: OpenLane) -> float:
    """Station [m] where a closing lane is down to PASSABLE_WIDTH_M; the end of a lane that does not close."""
    return _station_of_width(PASSABLE_WIDTH_M, lane)


def remnant_end(lane: OpenLane) -> float:
    """Station [m] where a closing lane's remnant is down to REMNANT_END_WIDTH_M; the end of a lane that does not close."""
    return _station_of_width(REMNANT_END_WIDTH_M, lane)


def width_at(lane: OpenLane, s: float) -> float:
    """Width [m] of a lane at a station, square to the road."""
    return float(lane.left(s) - lane.right(s))


def gap_between(right: OpenLane, left: OpenLane, *, at: tuple[float, ...]) -> float:
    """The greatest distance [m] between two lanes at any of the stations `at`, square to the road."""
    return max(float(left.right(s) - right.left(s)) for s in at)


def _station_of_width(width: float, lane: OpenLane) -> float:
    """Station [m] where a lane has narrowed to `width` [m]; its end where it stays wider."""
    if width_at(lane, lane.end) >= width:
        return lane.end
    s = np.unique(np.concatenate([lane.left.stations, lane.right.stations, [lane.end]]))
    s = s[(s >= lane.start) & (s <= lane.end)]
    widths = lane.left(s) - lane.right(s)
    return float(np.interp(-width, -widths, s))


def _gores(lanes: list[OpenLane], start: float, end: float) -> tuple[OpenLane, ...]:
    """The closed ground between neighbours of `lanes` from `start` to `end` [m], each piece as a lane."""
    return tuple(
        OpenLane(index=right.index, start=start, end=end, right=right.left, left=left.right)
        for right, left in pairwise(lanes)
        if gap_between(right, left, at=(start, end)) > SAME_PLACE_M
    )


def _cuts(layout: WorkZoneLayout) -> FloatArray:
    """Stations (n,) [m] where a lane begins, ends, turns or has changed its width by MAX_WIDTH_STEP_M."""
    breaks = {0.0, layout.road.length}
    for lane in layout.lanes:
        ends = [lane.start, passable_end(lane), remnant_end(lane), lane.end]
        s = np.unique(np.concatenate([lane.right.stations, lane.left.stations, ends]))
        s = s[(s >= lane.start) & (s <= lane.end) & (s > 0) & (s < layout.road.length)]
        breaks.update(s.tolist())
    stations = np.array(sorted(breaks))
    stations = stations[np.concatenate([[True], np.diff(stations) > 1e-3])]
    pieces = []
    for start, end in pairwise(stations):
        middle = (start + end) / 2
        lanes_here = [lane for lane in layout.lanes if not lane.opposing and lane.start <= middle < passable_end(lane)]
        change = max(abs(width_at(lane, end) - width_at(lane, start)) for lane in lanes_here)
        n = max(1, int(np.ceil(change / MAX_WIDTH_STEP_M - 1e-6)))
        pieces.append(start + np.arange(n) / n * (end - start))
    return np.concatenate([*pieces, stations[-1:]])
