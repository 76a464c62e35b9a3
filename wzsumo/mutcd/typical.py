"""The typical applications of the manual that a zone may be named after, and what each needs of the zone and its road."""

from collections.abc import Callable
from dataclasses import dataclass

from wzsumo.errors import SpecError
from wzsumo.mutcd.closure import Closure
from wzsumo.road import Road
from wzsumo.work_zone import DeviceKind, WorkZone


@dataclass(frozen=True, kw_only=True)
class _Need:
    """What a typical application shows: fewest lanes in the direction of travel, and what must hold of the zone."""

    title: str
    lanes: int
    rule: str
    holds: Callable[[WorkZone, Closure], bool]


def _only_shoulder(zone: WorkZone, closure: Closure) -> bool:
    return closure.count == 0 and zone.shift_ft == 0


def _one_outer_lane(zone: WorkZone, closure: Closure) -> bool:
    return closure.count == 1 and not closure.is_interior and zone.shift_ft == 0


_BY_TURNS = "closed_lanes = [0] and one_lane_two_way"
# MUTCD 11th ed., Chapter 6P, Figures 6P-3 to 6P-38; the numbers are those of the typical applications.
_TYPICAL = {
    "TA-3": _Need(title="work on shoulders", lanes=1, rule="closed_shoulder, no closed_lanes, no shift", holds=_only_shoulder),
    "TA-5": _Need(
        title="shoulder closure on a freeway", lanes=2, rule="closed_shoulder, no closed_lanes, no shift", holds=_only_shoulder
    ),
    "TA-10": _Need(
        title="lane closure on a two-lane road with flaggers",
        lanes=1,
        rule=f'{_BY_TURNS} = "flaggers"',
        holds=lambda zone, _: zone.one_lane_two_way == "flaggers",
    ),
    "TA-12": _Need(
        title="lane closure on a two-lane road with a signal",
        lanes=1,
        rule=f'{_BY_TURNS} = "signal"',
        holds=lambda zone, _: zone.one_lane_two_way == "signal",
    ),
    "TA-30": _Need(
        title="interior lane closure on a multi-lane street",
        lanes=2,
        rule="the lane beside the opposing ones closed, at 40 mph or less",
        holds=lambda zone, closure: _one_outer_lane(zone, closure) and closure.side == "left" and zone.posted_speed_mph <= 40,
    ),
    "TA-33": _Need(
        title="lane closure on a divided highway", lanes=2, rule="one outer lane closed, no shift", holds=_one_outer_lane
    ),
    "TA-34": _Need(
        title="lane closure with a barrier",
        lanes=2,
        rule='one outer lane closed, no shift, work_space_device = "barrier"',
        holds=lambda zone, closure: _one_outer_lane(zone, closure) and zone.work_space_device is DeviceKind.BARRIER,
    ),
    "TA-36": _Need(
        title="lane shift on a freeway",
        lanes=2,
        rule="no closed_lanes, and shift_ft above 0",
        holds=lambda zone, closure: closure.count == 0 and zone.shift_ft > 0,
    ),
    "TA-37": _Need(
        title="double lane closure on a freeway",
        lanes=3,
        rule="two outer lanes on one side closed",
        holds=lambda _, closure: closure.count == 2 and not closure.is_interior,
    ),
    "TA-38": _Need(
        title="interior lane closure on a freeway",
        lanes=3,
        rule="a lane closed that has open lanes on both sides",
        holds=lambda _, closure: closure.is_interior,
    ),
}


def refuse_too_narrow(work_zone: WorkZone, road: Road) -> None:
    """Raise SpecError where the zone is named after an unknown typical application, or one that the road has no lanes for."""
    name = work_zone.typical_application
    if name is None:
        return
    need = _TYPICAL.get(name)
    if need is None:
        raise SpecError(
            f'typical_application="{name}": unknown; known ones: {", ".join(_TYPICAL)}; leave the key out for others'
        )
    if road.own_lanes < need.lanes:
        raise SpecError(
            f'typical_application="{name}" ({need.title}) needs {need.lanes} lanes in the direction of travel, the road has '
            f"lane_count={road.own_lanes}; add lanes or choose another application"
        )


def refuse_mismatch(work_zone: WorkZone, closure: Closure) -> None:
    """Raise SpecError where the zone differs from the typical application that it is named after."""
    name = work_zone.typical_application
    if name is not None and not _TYPICAL[name].holds(work_zone, closure):
        raise SpecError(
            f'typical_application="{name}" ({_TYPICAL[name].title}) is drawn with {_TYPICAL[name].rule}; change the zone or '
            "leave the key out"
        )
