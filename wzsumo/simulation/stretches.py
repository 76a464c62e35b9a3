"""WorkZoneLayout -> the few stretches of road on which the lanes, and the width that each has, stay the same.

A lane of SUMO's keeps one width along an edge, so a lane counts on a whole stretch as it is at its narrowest place. A stretch
begins and ends where lanes do, where one has become narrower or wider, at a stop line, and NO_CHANGE_AHEAD_OF_GORE_M ahead of
closed ground between two open lanes (a gore). A zone has some six.

A closing lane ends where it is PASSABLE_WIDTH_M wide; the taper up to there is a stretch on which it has that width. Beyond,
its remnant goes on for a stretch. A vehicle that still straddles the line to the open lane drives on along the remnant and
comes in along the taper. Without it SUMO stops that vehicle where the lane ends, it can neither drive on nor change lanes while
another is beside it, and the queue behind it never moves again.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from wzsumo.units import METRES_PER_FOOT
from wzsumo.work_zone import OpenLane, WorkZoneLayout

PASSABLE_WIDTH_M = 8 * METRES_PER_FOOT  # where a closing lane ends: a car fits, and so does half a truck; chosen by us
# Where its remnant ends: half a truck is as wide, so a vehicle with its middle in the open lane does not reach the devices.
REMNANT_END_WIDTH_M = 1.25
NO_CHANGE_AHEAD_OF_GORE_M = 100.0  # a lane change takes some 4 s, 100 m at 25 m/s: begun before, it ends before the gore
SAME_PLACE_M = 0.01  # two places closer to each other than this are one


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A stretch of road, stations in metres, with the lanes that are open on all of it, from the right."""

    start: float
    end: float
    lanes: tuple[OpenLane, ...]
    remnant: OpenLane | None = None  # of a lane that has ended

    @property
    def widths(self) -> list[float]:
        """How wide [m] each lane is at its narrowest place, square to the road."""
        return [min(_width(lane, s) for s in self.turns(lane)) for lane in self.lanes]

    @property
    def greatest_widths(self) -> list[float]:
        """How wide [m] each lane is at its widest place."""
        return [max(_width(lane, s) for s in self.turns(lane)) for lane in self.lanes]

    @property
    def parted(self) -> list[bool]:
        """For every two neighbours whether closed ground lies between them."""
        return [
            max(float(left.right(s) - right.left(s)) for lane in (right, left) for s in self.turns(lane)) > SAME_PLACE_M
            for right, left in pairwise(self.lanes)
        ]

    @property
    def barred(self) -> list[bool]:
        """For every two neighbours whether no vehicle may change from one to the other: at a gore and soon ahead of it."""
        return replace(self, end=self.end + NO_CHANGE_AHEAD_OF_GORE_M).parted

    def turns(self, lane: OpenLane) -> list[float]:
        """Stations [m] of the stretch's ends and of the places between them where a line of the lane turns."""
        return [self.start, *(s for s in _turns(lane) if self.start < s < self.end), self.end]


def stretches_of(layout: WorkZoneLayout) -> list[Stretch]:
    """The stretches from the road's start to its end, as few as the lanes along the stations allow."""
    turns = layout.taking_turns
    stop_lines = [turns.start, turns.end] if turns else []
    found: list[Stretch] = []
    for stretch in _uniform_stretches(layout, stop_lines):
        at_stop_line = any(abs(stretch.start - s) < SAME_PLACE_M for s in stop_lines)
        if found and not at_stop_line and _are_alike(found[-1], stretch):
            found[-1] = replace(found[-1], end=stretch.end)
        else:
            found.append(stretch)
    return found


def passable_end(lane: OpenLane) -> float:
    """Station [m] where a closing lane is down to PASSABLE_WIDTH_M; the end of a lane that does not close."""
    return _station_of_width(PASSABLE_WIDTH_M, lane)


def remnant_end(lane: OpenLane) -> float:
    """Station [m] where a closing lane is down to REMNANT_END_WIDTH_M; the end of a lane that does not close."""
    return _station_of_width(REMNANT_END_WIDTH_M, lane)


def _station_of_width(width: float, lane: OpenLane) -> float:
    if _width(lane, lane.end) >= width:
        return lane.end
    s = [turn for turn in _turns(lane) if lane.start <= turn < lane.end] + [lane.end]
    return float(np.interp(-width, [-_width(lane, turn) for turn in s], s))


def _are_alike(one: Stretch, other: Stretch) -> bool:
    """Whether both have the same lanes, as wide, with the same gores."""
    return [id(lane) for lane in one.lanes] == [id(lane) for lane in other.lanes] and bool(
        np.allclose(one.widths, other.widths, rtol=0, atol=SAME_PLACE_M)
        and one.remnant is other.remnant
        and one.parted == other.parted
        and one.barred == other.barred
    )


def _uniform_stretches(layout: WorkZoneLayout, stop_lines: list[float]) -> list[Stretch]:
    """The road cut wherever a lane begins, ends or turns, at stop lines, and where changes of lane end ahead of a gore."""
    own = [lane for lane in layout.lanes if not lane.opposing]
    cuts = {0.0, layout.road.length, *stop_lines}
    cuts |= {s for lane in own for s in (lane.start, passable_end(lane), remnant_end(lane), *_turns(lane))}
    tips = [stretch.start for stretch in _between(cuts, layout) if any(stretch.parted)]
    return _between(cuts | {s - NO_CHANGE_AHEAD_OF_GORE_M for s in tips}, layout)


def _between(cuts: Iterable[float], layout: WorkZoneLayout) -> list[Stretch]:
    """The stretches between stations [m], with the lanes that are open there."""
    s = np.array(sorted(s for s in cuts if 0 <= s <= layout.road.length))
    apart = np.concatenate([[True], np.diff(s) > SAME_PLACE_M])
    found = []
    for start, end in pairwise(s[apart].tolist()):
        middle = (start + end) / 2
        here = [lane for lane in layout.lanes if not lane.opposing and lane.start <= middle < remnant_end(lane)]
        lanes = sorted((q for q in here if middle < passable_end(q)), key=lambda lane: float(lane.right(middle)))
        remnant = next((lane for lane in here if lane not in lanes), None)
        found.append(Stretch(start=start, end=end, lanes=tuple(lanes), remnant=remnant))
    return found


def _width(lane: OpenLane, s: float) -> float:
    return float(lane.left(s) - lane.right(s))


def _turns(lane: OpenLane) -> list[float]:
    """Stations [m] where a line of a lane may turn, in order."""
    return [float(s) for s in np.unique(np.concatenate([lane.right.stations, lane.left.stations]))]
