"""The lanes that stay open along a zone, and those that close and open again, with their lines as functions of the station."""

import numpy as np

from wzsumo.mutcd.closure import Closure
from wzsumo.road import Profile
from wzsumo.work_zone import Area, OpenLane, TakingTurns

# From a stop line to the taper. The manual draws the stop line ahead of the taper without a number for every case. Chosen by
# us: with 100 ft a lane crosses to the other one half as sharply as the taper does.
STOP_LINE_AHEAD_FT = 100.0


def open_lanes(
    closure: Closure, areas: tuple[Area, ...], *, outer: Profile, open_edge: Profile, turns: TakingTurns | None
) -> tuple[OpenLane, ...]:
    """Every lane that is open somewhere, from the right where it begins.

    `outer` and `open_edge` are the device line of the closed side and the edge line of the open side, offsets e.
    """
    if turns:
        return _lanes_by_turns(closure, areas, turns)
    lanes = _lanes_around(closure, areas) if closure.is_interior else _lanes_beside(closure, outer=outer, open_edge=open_edge)
    lanes += _lanes_that_close(closure, areas)
    lanes += [
        _lane(closure, number, *_straight(closure, number), start=areas[-1].end)
        for number in range(closure.first, closure.first + closure.count)
    ]
    lanes += _opposing_lanes(closure)
    return tuple(sorted(lanes, key=lambda lane: (lane.start, lane.index)))


def _lanes_beside(closure: Closure, *, outer: Profile, open_edge: Profile) -> list[OpenLane]:
    """The open lanes, which share the width between the open edge line and the device line (or their own outer line)."""
    stations = np.union1d(outer.stations, open_edge.stations)
    width, base = closure.lines[closure.n_open], open_edge(stations)
    available = np.minimum(outer(stations), width) - base
    lanes = []
    for number in range(closure.n_open):
        shares = (closure.lines[number] / width, closure.lines[number + 1] / width)
        near, far = (Profile(stations=stations, offsets=base + share * available) for share in shares)
        lanes.append(_lane(closure, number, near, far))
    return lanes


def _lanes_around(closure: Closure, areas: tuple[Area, ...]) -> list[OpenLane]:
    """Lanes on the open side of the closed ones go straight on, the others move out by the closed lanes' width."""
    taper = next(area for area in areas if area.name == "shifting taper")
    lanes = []
    for number in range(closure.n_open):
        place = number if number < closure.first else number + closure.count
        near, far = (
            Profile(stations=np.array([taper.start, taper.end]), offsets=np.array([closure.lines[a], closure.lines[b]]))
            for a, b in ((number, place), (number + 1, place + 1))
        )
        lanes.append(_lane(closure, number, near, far))
    return lanes


def _lanes_that_close(closure: Closure, areas: tuple[Area, ...]) -> list[OpenLane]:
    """The outermost lanes, each up to the end of its merging taper."""
    tapers = [area for area in areas if area.name.startswith("merging taper")]
    lanes = []
    for number, taper in zip(range(closure.n_lanes - 1, closure.n_open - 1, -1), tapers, strict=True):
        near, far = _straight(closure, number)
        closing = Profile(stations=np.array([taper.start, taper.end]), offsets=np.array([far.offsets[0], near.offsets[0]]))
        lanes.append(_lane(closure, number, near, closing, end=taper.end))
    return lanes


def _lanes_by_turns(closure: Closure, areas: tuple[Area, ...], turns: TakingTurns) -> tuple[OpenLane, ...]:
    """Between the stop lines the own lane leads over to the place of the opposing one, and back."""
    taper_end = next(area.end for area in areas if area.name == "one-lane two-way taper")
    stations = np.array([turns.start, taper_end, areas[-1].start, turns.end])
    own, opposing = closure.road.lane_span(0), closure.road.lane_span(1)
    right, left = (Profile(stations=stations, offsets=np.array([a, b, b, a])) for a, b in zip(own, opposing, strict=True))
    own_lane = OpenLane(index=0, start=0.0, end=closure.road.length, right=right, left=left)
    return (own_lane, *_opposing_lanes(closure))


def _opposing_lanes(closure: Closure) -> list[OpenLane]:
    road = closure.road
    return [
        OpenLane(index=index, start=0.0, end=road.length, right=_constant(right), left=_constant(left), opposing=True)
        for index in range(road.own_lanes, len(road.lane_widths))
        for right, left in [road.lane_span(index)]
    ]


def _lane(
    closure: Closure, number: int, near: Profile, far: Profile, *, start: float = 0.0, end: float | None = None
) -> OpenLane:
    right, left = closure.right_and_left(near, far)
    end = closure.road.length if end is None else end
    return OpenLane(index=closure.road_lane(number), start=start, end=end, right=right, left=left)


def _straight(closure: Closure, number: int) -> tuple[Profile, Profile]:
    return _constant(closure.lines[number]), _constant(closure.lines[number + 1])


def _constant(offset: float) -> Profile:
    return Profile(stations=np.array([0.0]), offsets=np.array([offset]))
