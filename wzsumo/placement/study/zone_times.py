"""A zone that is set up and taken away while traffic runs: SUMO's rerouters bar its lanes for a time.

A crew closes a lane at its upstream end and sets out its devices downstream at walking speed. So the first closed piece of a
lane is barred when the set-up begins, each piece behind it when the crew is there, and the zone stands when the crew has come
to its end. Then the vehicles that were in the lane have left it, and the devices stand on empty ground.

SUMO's lanes cannot bend while a simulation runs. They run straight under the closed ground, and are barred from where their
taper begins.
"""

from dataclasses import dataclass

from wzsumo.errors import PlacementError
from wzsumo.placement.lane_states import ClosedLanes
from wzsumo.placement.xml_file import start_tag

SET_UP_SPEED_MPS = 1.4  # walking speed, at which devices are set out from a truck; chosen by us


@dataclass(frozen=True, kw_only=True)
class ZoneTimes:
    """When the set-up begins and when the lanes open again, in seconds from the simulation's beginning."""

    begin: float
    end: float | None = None  # None: they stay closed

    def standing(self, closed: ClosedLanes) -> tuple[float, float]:
        """The times [s] between which the zone stands whole."""
        stands = self.begin + (closed.plan.layout.end - first_barred_station(closed)) / SET_UP_SPEED_MPS
        return stands, float("inf") if self.end is None else self.end

    def check(self, closed: ClosedLanes, *, duration: float = float("inf")) -> None:
        """Raise PlacementError where the zone never stands within the simulation, or moves lanes that stay open."""
        stands, until = self.standing(closed)
        if not stands < min(until, duration):
            raise PlacementError(
                f"the zone is set up from {self.begin:g} s to {stands:.0f} s at {SET_UP_SPEED_MPS:g} m/s, and the lanes "
                f"open again, or the simulation ends, at {min(until, duration):g} s; begin earlier or end later"
            )
        moved = [
            f"{piece.id}_{index}"
            for piece in closed.pieces
            for index, changes in piece.lanes.items()
            if "shape" in changes and (piece.id, index) not in timed_lanes(closed)
        ]
        if moved:
            raise PlacementError(
                f"the zone moves lane {moved[0]!r}, which stays open, and SUMO's lanes cannot move while a simulation runs; "
                "let the zone stand from the beginning, or close lanes without a shift"
            )


def zone_times(closed_from_s: float, closed_for_s: float | None) -> ZoneTimes | None:
    """The times of a zone from its keys; None for a zone that stands from the beginning to the end."""
    if closed_from_s < 0 or (closed_for_s is not None and closed_for_s <= 0):
        raise PlacementError(
            f"closed from {closed_from_s:g} s for {closed_for_s or 0:g} s: give a time of 0 or more from the simulation's "
            "beginning, and a duration above 0"
        )
    if not closed_from_s and closed_for_s is None:
        return None
    return ZoneTimes(begin=closed_from_s, end=None if closed_for_s is None else closed_from_s + closed_for_s)


def first_barred_station(closed: ClosedLanes) -> float:
    """Station [m] from which on a lane is barred: where the first taper begins."""
    return min([start for start, _ in closed.plan.taper_spans] or [closed.plan.span[0]])


def timed_lanes(closed: ClosedLanes) -> dict[tuple[str, int], float]:
    """Station [m] where each lane (edge or piece, index) begins that is barred while the zone stands."""
    found: dict[tuple[str, int], float] = {}
    corridor = closed.plan.corridor
    for piece in closed.pieces:
        narrowing = {
            index
            for index, course in piece.courses.items()
            if index in piece.lanes and course.end < float("inf") and "shape" in piece.lanes[index]
        }
        for index in piece.barred | narrowing:
            found[piece.id, index] = piece.start
    for id_ in sorted(closed.barred_via_lanes):
        via, _, number = id_.rpartition("_")
        found[via, int(number)] = corridor.station_of(corridor.net.lane_of(id_), 0.0)
    return found


def rerouters(closed: ClosedLanes, times: ZoneTimes, *, begin: float, prefix: str) -> str:
    """An additional file that bars the zone's lanes for its time; `begin` is SUMO's time at the simulation's beginning.

    Ids begin with `prefix`. The rerouters send nobody elsewhere: their probability is 0.
    """
    first = first_barred_station(closed)
    until = begin + (1e9 if times.end is None else times.end)
    rows = []
    lanes = sorted(timed_lanes(closed).items(), key=lambda item: (item[1], item[0]))
    for number, ((edge, index), station) in enumerate(lanes):
        at = begin + times.begin + max(station - first, 0.0) / SET_UP_SPEED_MPS
        lane = start_tag("closingLaneReroute", {"id": f"{edge}_{index}", "disallow": "all"}, empty=True)
        interval = start_tag("interval", {"begin": f"{at:.1f}", "end": f"{until:.1f}"}, empty=False)
        on = next(piece.id for piece in closed.pieces)
        rerouter = start_tag("rerouter", {"id": f"{prefix}{number}", "edges": on, "probability": "0"}, empty=False)
        rows.append(f"    {rerouter}\n        {interval}{lane}</interval>\n    </rerouter>\n")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<additional>\n{"".join(rows)}</additional>\n'
