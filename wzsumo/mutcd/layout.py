"""WorkZone + Road -> WorkZoneLayout: the stretches of a zone placed along its road."""

import math
from dataclasses import dataclass

import numpy as np

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray
from wzsumo.mutcd.closure import Closure, closure_of
from wzsumo.mutcd.device_rows import device_table
from wzsumo.mutcd.lanes import STOP_LINE_AHEAD_FT, open_lanes
from wzsumo.mutcd.sequence import Lines, Stretch, stretches_of
from wzsumo.mutcd.signs import sign_table
from wzsumo.mutcd.typical import refuse_mismatch, refuse_too_narrow
from wzsumo.road import Profile, Road
from wzsumo.units import METRES_PER_FOOT, feet_from_metres
from wzsumo.work_zone import Area, ClosedStrip, TakingTurns, WorkZone, WorkZoneLayout


def lay_out(work_zone: WorkZone, road: Road) -> WorkZoneLayout:
    """The layout of `work_zone` on `road`. Raises SpecError, with the numbers and what would fit, where it cannot be."""
    refuse_too_narrow(work_zone, road)
    closure = closure_of(work_zone, road)
    refuse_mismatch(work_zone, closure)
    begin, stretches = stretches_of(work_zone, closure)
    stations = work_zone.start_ft * METRES_PER_FOOT + np.cumsum([0.0, *(stretch.length for stretch in stretches)])
    _refuse_beyond_the_road(float(stations[-1]), road, stretches)
    _refuse_gaps_beyond_the_zone(work_zone, float(stations[-1] - stations[0]))
    areas = tuple(
        Area(name=stretch.name, start=float(start), end=float(end))
        for stretch, start, end in zip(stretches, stations[:-1], stations[1:], strict=True)
    )
    lines = _profiles(stations, begin, stretches)
    turns = _taking_turns(work_zone, areas)
    strips = _closed_strips(lines, closure)
    lanes = open_lanes(closure, areas, outer=lines.outer, open_edge=lines.open_edge, turns=turns)
    nearer = np.minimum(lines.outer.offsets, closure.travelled)  # of the line of devices and the edge line
    right, left = closure.right_and_left(lines.open_edge, Profile(stations=lines.outer.stations, offsets=nearer))
    if turns:  # this direction may use the opposing lane as far as its own lane leads over there
        left = lanes[0].left
    return WorkZoneLayout(
        work_zone=work_zone,
        road=road,
        areas=areas,
        lanes=lanes,
        drivable_right=right,
        drivable_left=left,
        closed_strips=strips,
        devices=device_table(work_zone, closure, areas=areas, stretches=stretches, lines=lines.of_devices),
        signs=sign_table(work_zone, closure, areas=areas, turns=turns),
        taking_turns=turns,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Profiles:
    """The lines of a zone as functions of the station, offsets e [m]."""

    outer: Profile
    open_edge: Profile
    gore: tuple[Profile, Profile] | None

    @property
    def of_devices(self) -> tuple[tuple[Profile, int], ...]:
        """Lines that devices stand along, each with the side of the closed ground: +1 towards greater e, -1 towards smaller."""
        return ((self.outer, 1),) + (((self.gore[0], 1), (self.gore[1], -1)) if self.gore else ())


def _profiles(stations: FloatArray, begin: Lines, stretches: tuple[Stretch, ...]) -> _Profiles:
    at = [begin, *(stretch.end for stretch in stretches)]
    outer = [(s, lines.outer) for s, lines in zip(stations, at, strict=True) if lines.outer is not None]
    gore = [(s, lines.gore) for s, lines in zip(stations, at, strict=True) if lines.gore is not None]
    if gore:
        tip = float(stations[next(number for number, lines in enumerate(at) if lines.gore) - 1])
        gore.insert(0, (tip, (gore[0][1][0], gore[0][1][0])))
    s = np.array([station for station, _ in gore])
    return _Profiles(
        outer=Profile(stations=np.array([s for s, _ in outer]), offsets=np.array([e for _, e in outer])),
        open_edge=Profile(stations=stations, offsets=np.array([lines.open_edge for lines in at])),
        gore=(
            Profile(stations=s, offsets=np.array([inner for _, (inner, _) in gore])),
            Profile(stations=s, offsets=np.array([outer for _, (_, outer) in gore])),
        )
        if gore
        else None,
    )


def _closed_strips(lines: _Profiles, closure: Closure) -> tuple[ClosedStrip, ...]:
    ends = lines.outer.stations[[0, -1]]
    edge = Profile(stations=ends, offsets=np.array([closure.outer, closure.outer]))
    right, left = closure.right_and_left(lines.outer, edge)
    strips = [ClosedStrip(start=float(ends[0]), end=float(ends[1]), right=right, left=left)]
    if lines.gore:
        start, end = lines.gore[0].stations[[0, -1]].tolist()
        right, left = closure.right_and_left(*lines.gore)
        strips.append(ClosedStrip(start=start, end=end, right=right, left=left, interior=True))
    return tuple(strips)


def _taking_turns(work_zone: WorkZone, areas: tuple[Area, ...]) -> TakingTurns | None:
    if work_zone.one_lane_two_way is None:
        return None
    taper = next(area for area in areas if area.name == "one-lane two-way taper")
    ahead = STOP_LINE_AHEAD_FT * METRES_PER_FOOT
    return TakingTurns(start=taper.start - ahead, end=areas[-1].end + ahead, control=work_zone.one_lane_two_way)


def _refuse_beyond_the_road(end: float, road: Road, stretches: tuple[Stretch, ...]) -> None:
    if end > road.length:
        lengths = " + ".join(f"{stretch.name} {feet_from_metres(stretch.length):.0f}" for stretch in stretches)
        missing_ft = math.ceil(feet_from_metres(end - road.length))
        raise SpecError(
            f"the zone ends at station {feet_from_metres(end):.0f} ft ({lengths} ft), the road at "
            f"{feet_from_metres(road.length):.0f} ft; lengthen the road by {missing_ft} ft, "
            "or start the zone earlier, or shorten work_length_ft"
        )


def _refuse_gaps_beyond_the_zone(work_zone: WorkZone, length: float) -> None:
    for start, end in work_zone.device_gaps_ft:
        if end > feet_from_metres(length) + 1e-6:
            raise SpecError(
                f"device_gaps_ft: [{start:g}, {end:g}] ends beyond the zone, which is {feet_from_metres(length):.0f} ft long; "
                "count from start_ft on and end at most there"
            )
