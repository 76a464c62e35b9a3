"""What a zone closes, counted from the side that stays open: closures on the left and on the right are laid out alike.

The offset e counts from the edge line of the open side towards the closed one: d = e for a closure on the left, and
d = (width of the zone's lanes) - e for one on the right.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray
from wzsumo.road import Profile, Road
from wzsumo.work_zone import Side, WorkZone


@dataclass(frozen=True, kw_only=True)
class Closure:
    """The lanes that a zone deals with, numbered from its open side: `first` to `first + count - 1` are closed.

    They are the carriageway's own lanes; where both directions take turns, the opposing ones belong to them.
    """

    road: Road
    side: Side
    first: int
    count: int
    takes_turns: bool = False

    @property
    def n_lanes(self) -> int:
        """Number of lanes that the zone deals with."""
        return len(self.road.lane_widths) if self.takes_turns else self.road.own_lanes

    @property
    def n_open(self) -> int:
        """Number of lanes that stay open."""
        return self.n_lanes - self.count

    @property
    def is_interior(self) -> bool:
        """Whether open lanes pass on both sides of the closed ones."""
        return self.count > 0 and self.first + self.count < self.n_lanes

    @cached_property
    def lines(self) -> tuple[float, ...]:
        """Offsets e [m] of the n_lanes + 1 lane lines from the open side on."""
        widths = self.road.lane_widths[: self.n_lanes]
        return tuple(np.cumsum([0.0, *(widths if self.side == "left" else widths[::-1])]).tolist())

    @property
    def travelled(self) -> float:
        """Width [m] of the lanes together: e of the edge line on the closed side."""
        return self.lines[-1]

    @property
    def outer(self) -> float:
        """Offset e [m] of the pavement's edge on the closed side; where opposing lanes lie there, of the line to them."""
        return self.travelled + self._shoulder(self.side)

    @property
    def open_shoulder(self) -> float:
        """Width [m] of the shoulder on the open side."""
        return self._shoulder("right" if self.side == "left" else "left")

    def road_lane(self, number: int) -> int:
        """Index in the road (0 = rightmost) of a lane counted from the open side."""
        return number if self.side == "left" else self.n_lanes - 1 - number

    def d_of(self, e: FloatArray) -> FloatArray:
        """Lateral offsets d of the road [m] of offsets e."""
        return e if self.side == "left" else self.travelled - e

    def in_d(self, profile: Profile) -> Profile:
        """A profile of lateral offsets d of one of e."""
        return Profile(stations=profile.stations, offsets=self.d_of(profile.offsets))

    def right_and_left(self, near_open: Profile, near_closed: Profile) -> tuple[Profile, Profile]:
        """(right, left) in d of two lines in e, the second nearer to the closed side."""
        ordered = (near_open, near_closed) if self.side == "left" else (near_closed, near_open)
        return self.in_d(ordered[0]), self.in_d(ordered[1])

    def _shoulder(self, side: Side) -> float:
        if side == "right":
            return self.road.right_shoulder
        beside_opposing = self.road.opposing_lanes > 0 and not self.takes_turns
        return 0.0 if beside_opposing else self.road.left_shoulder


def closure_of(work_zone: WorkZone, road: Road) -> Closure:
    """The closure that a zone asks for. Raises SpecError where the road's lanes do not allow it."""
    lanes, count = sorted(set(work_zone.closed_lanes)), road.own_lanes
    if lanes and not 0 <= lanes[0] <= lanes[-1] < count:
        raise SpecError(f"closed_lanes={tuple(lanes)} must be lanes of the road, 0..{count - 1} (0 = rightmost)")
    if len(lanes) < len(work_zone.closed_lanes):
        raise SpecError(f"closed_lanes={work_zone.closed_lanes} names a lane twice; give each once: {lanes}")
    if work_zone.one_lane_two_way:
        return _taking_turns(work_zone, road, lanes)
    if len(lanes) == count:
        raise SpecError(
            f"closed_lanes={tuple(lanes)} must leave open at least one of lanes 0..{count - 1} (0 = rightmost); on a road with "
            'an opposing lane, one_lane_two_way = "signal" lets both directions take turns on that'
        )
    if not lanes and work_zone.closed_shoulder is None:
        raise SpecError('nothing is closed: give closed_lanes or closed_shoulder = "left" or "right"')
    if lanes and lanes != list(range(lanes[0], lanes[-1] + 1)):
        raise SpecError(
            f"closed_lanes={tuple(lanes)} must lie side by side; close the lanes between them too, or lay out two zones"
        )
    side = _side(work_zone, lanes, count)
    first = count - len(lanes) if not lanes else lanes[0] if side == "left" else count - 1 - lanes[-1]
    return Closure(road=road, side=side, first=first, count=len(lanes))


def _side(work_zone: WorkZone, lanes: list[int], count: int) -> Side:
    if not lanes:
        return work_zone.closed_shoulder or "right"
    on_right, on_left = lanes[0] == 0, lanes[-1] == count - 1
    if not (on_right or on_left):
        if work_zone.shift_ft or work_zone.shifted_lane_width_ft is not None:
            raise SpecError(
                f"shift_ft={work_zone.shift_ft:g}: lanes are open on both sides of closed_lanes={tuple(lanes)} and cannot all "
                "move to one side; leave shift_ft and shifted_lane_width_ft out, or close the lanes beside it on one side too"
            )
        return work_zone.closed_shoulder or "left"  # the left lane carries the least traffic
    side: Side = "right" if on_right else "left"
    if work_zone.closed_shoulder not in {None, side}:
        raise SpecError(
            f'closed_shoulder="{work_zone.closed_shoulder}" must be the shoulder beside closed_lanes={tuple(lanes)}, "{side}"'
        )
    return side


def _taking_turns(work_zone: WorkZone, road: Road, lanes: list[int]) -> Closure:
    if (road.own_lanes, road.opposing_lanes) != (1, 1):
        raise SpecError(
            f'one_lane_two_way="{work_zone.one_lane_two_way}" needs a two-lane road: lane_count=1 and opposing_lane_count=1 '
            f"(given: {road.own_lanes} and {road.opposing_lanes})"
        )
    if lanes != [0] or work_zone.closed_shoulder == "left" or work_zone.shift_ft or work_zone.shifted_lane_width_ft is not None:
        raise SpecError(
            f'one_lane_two_way="{work_zone.one_lane_two_way}" closes the lane of its own direction: give closed_lanes = [0], '
            'closed_shoulder = "right" or none, and no shift'
        )
    return Closure(road=road, side="right", first=1, count=1, takes_turns=True)
