"""What a feed announces on a road: the events that pass along it, as one AnnouncedZone with the feed's own accuracy.

An event passes along a road where most of its line lies beside it and runs the same way. Events of one zone that follow each
other are taken together. What is left out, and what is taken for what, is said.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wzsumo.announced_zone import ESTIMATED_SD_M, VERIFIED_SD_M, AnnouncedZone
from wzsumo.errors import FeedError
from wzsumo.feeds.road_event import RoadEvent
from wzsumo.frames import FloatArray, wrap_angle
from wzsumo.geography import LocalFrame
from wzsumo.road import Road
from wzsumo.work_zone import Side

BESIDE_M = 60.0  # from the road's middle: carriageways of both directions, and lines drawn on a map. Chosen by us
MIN_SHARE_BESIDE = 0.5  # of an event's length within the road's; chosen by us
STEP_M = 10.0  # between the points at which an event's line is looked at
SAME_WAY_RAD = np.pi / 2.5  # between the road's bearing and the name of an event's direction, which names one of four
MOVING_SD_M = 500.0  # of the ends of an operation that moves while the feed is a minute or more old; chosen by us
CLOSED = ("closed", "merge-left", "merge-right")  # the lane does not go through
MAX_TOLD = 3  # events of one kind that a message names; a state has thousands
THROUGH_LANES = ("general",)  # others (shoulder, exit-lane, bike-lane ...) come and go beside them


@dataclass(frozen=True, kw_only=True)
class Announcement:
    """The zone that events announce on a road, the ids of those events, and what was said about reading them."""

    zone: AnnouncedZone
    events: tuple[str, ...]
    said: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class _Passing:
    event: RoadEvent
    start_m: float
    end_m: float
    reversed: bool
    said: tuple[str, ...]


def announced_on(
    events: Sequence[RoadEvent], road: Road, *, frame: LocalFrame, times_s: tuple[float, float] | None, source: str,
    n_lanes: int | None = None, faults: Sequence[str] = (),
) -> Announcement:  # fmt: skip
    """The zone that the events announce on a road, whose metres are those of a frame.

    `times_s` are the first and last time of the traces, where they count from 1970 UTC: events of other times are left out.
    `n_lanes` is how many lanes the road has (None: as its own lanes), `faults` tells the events that were broken. Raises
    FeedError where no event passes along the road.
    """
    passing, elsewhere, others = [], [], []
    for event in events:
        found = _passing(event, road, frame)
        if isinstance(found, _Passing):
            passing.append(found)
        elif isinstance(found, float):
            elsewhere.append((found, event.id))
        else:
            others.append(found)
    said = [*_at_most(others, "event(s) more"), *_elsewhere(elsewhere, len(events)), *_at_most(faults, "broken event(s) more")]
    said += [word for found in passing for word in found.said]
    passing = _at_the_time(passing, times_s, said)
    if not passing:
        if any(isinstance(_passing(_exchanged(event), road, frame), _Passing) for event in events):
            said.insert(0, "with latitude and longitude exchanged one would: the longitude comes first")
        why = "; ".join(said) or "the feed has no event"
        raise FeedError(f"{source}: no event passes along the road of the traces, in their direction ({why})")
    passing.sort(key=lambda found: found.start_m)
    first = min(passing, key=lambda found: found.start_m)
    last = max(passing, key=lambda found: found.end_m)
    lanes = _closed_lanes(passing, road.own_lanes if n_lanes is None else n_lanes, said)
    speeds = [found.event.speed_mps for found in passing if found.event.speed_mps is not None]
    if len(passing) > 1:
        said.append(f"{len(passing)} events are taken as one zone: {', '.join(found.event.id for found in passing)}")
    zone = AnnouncedZone(
        start_m=first.start_m,
        end_m=last.end_m,
        start_sd_m=_sd(first, verified=first.event.end_verified if first.reversed else first.event.start_verified),
        end_sd_m=_sd(last, verified=last.event.start_verified if last.reversed else last.event.end_verified),
        closed_lanes=lanes,
        side=_side(passing, lanes, road.own_lanes if n_lanes is None else n_lanes),
        speed_mps=min(speeds, default=None),
        source=f"{source}#{first.event.id}",
    )
    return Announcement(zone=zone, events=tuple(found.event.id for found in passing), said=tuple(said))


def _passing(event: RoadEvent, road: Road, frame: LocalFrame) -> _Passing | float | str:
    """The stretch of the road that an event passes along; else how far off it lies [m], or why it does not count."""
    if event.kind != "work-zone":
        return f"{event.id}: a {event.kind} closes nothing on the road"
    if event.movement == "planned-moving-area":
        return f"{event.id}: the planned area of a moving operation, which is no closed stretch"
    line = frame.from_lonlat(event.lonlat)
    if not np.isfinite(line).all():
        return float("inf")
    s, d = road.to_sd(_resampled(line) if event.in_order else line)
    beside = (np.abs(d - road.travelled_width / 2) < BESIDE_M) & (s >= 0) & (s <= road.length)
    if beside.mean() < MIN_SHARE_BESIDE or np.ptp(s[beside]) <= 0:
        return float(np.min(np.hypot(*(line - road.to_xy(np.clip(road.to_sd(line)[0], 0, road.length), 0)).T)))
    start, end = float(s[beside].min()), float(s[beside].max())
    against = event.in_order and s[beside][-1] < s[beside][0]
    named = _runs_with(event, road, frame, (start + end) / 2)
    if named is False or (named is None and against):
        return f"{event.id}: {event.direction}, the other way"
    said = []
    if against:
        said.append(f"{event.id}: its line runs against its direction ({event.direction}), and is taken the other way round")
    if event.movement == "moving":
        said.append(f"{event.id}: a moving operation, whose place is that of the feed's time")
    return _Passing(event=event, start_m=start, end_m=end, reversed=bool(against), said=tuple(said))


def _at_most(words: Sequence[str], more: str) -> list[str]:
    """The first of many words, and how many there are more."""
    return [*words[:MAX_TOLD], *([f"{len(words) - MAX_TOLD} {more}"] if len(words) > MAX_TOLD else [])]


def _elsewhere(found: list[tuple[float, str]], n_events: int) -> list[str]:
    """That events lie elsewhere, by the nearest of them."""
    if not found:
        return []
    distance, nearest = min(found)
    far = f"{distance:.0f} m" if distance < 1000 else f"{distance / 1000:.1f} km"
    return [f"{len(found)} of {n_events} event(s) lie elsewhere for the most part, the nearest ({nearest}) {far} from the road"]


def _exchanged(event: RoadEvent) -> RoadEvent:
    return replace(event, lonlat=event.lonlat[:, ::-1])


def _resampled(line: FloatArray) -> FloatArray:
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    points = np.linspace(0.0, at[-1], max(2, int(np.ceil(at[-1] / STEP_M)) + 1))
    return np.column_stack([np.interp(points, at, axis) for axis in line.T])


def _runs_with(event: RoadEvent, road: Road, frame: LocalFrame, station: float) -> bool | None:
    """Whether the name of the event's direction is that of the road; None where it names none, or lies across."""
    if event.bearing_deg is None:
        return None
    point = road.to_xy(station, road.travelled_width / 2)
    bearing = frame.north_at(point) - float(road.heading_at(station))
    off = abs(float(wrap_angle(np.deg2rad(event.bearing_deg) - bearing)))
    return True if off < SAME_WAY_RAD else False if off > np.pi - SAME_WAY_RAD else None


def _at_the_time(passing: list[_Passing], times_s: tuple[float, float] | None, said: list[str]) -> list[_Passing]:
    if times_s is None or not passing:
        return passing
    kept = [
        found for found in passing
        if (found.event.end_time_s or np.inf) >= times_s[0] and (found.event.start_time_s or -np.inf) <= times_s[1]
    ]  # fmt: skip
    if not kept:
        said.append("no event is of the time of the traces; all that pass are taken")
        return passing
    said += [f"{found.event.id}: of another time than the traces" for found in passing if found not in kept]
    return kept


def _sd(found: _Passing, *, verified: bool) -> float:
    if found.event.movement == "moving":
        return MOVING_SD_M
    return VERIFIED_SD_M if verified else ESTIMATED_SD_M


def _closed_lanes(passing: Sequence[_Passing], n_lanes: int, said: list[str]) -> tuple[int, ...] | None:
    """Lanes from the right that some event closes; None where no event says so, or of another number of lanes."""
    closed: set[int] = set()
    known = False
    for event in (found.event for found in passing):
        through = sorted((lane for lane in event.lanes if lane.kind in THROUGH_LANES), key=lambda lane: -lane.order)
        if not through and event.vehicle_impact.startswith("all-lanes-open"):
            known = True
        elif not through:
            said.append(f"{event.id}: does not say which lanes it closes")
        elif len(through) != n_lanes:
            said.append(f"{event.id}: says {len(through)} lanes where the road has {n_lanes}; its lanes are not used")
        else:
            known = True
            closed |= {number for number, lane in enumerate(through) if lane.status in CLOSED}
    return tuple(sorted(closed)) if known else None


def _side(passing: Sequence[_Passing], lanes: tuple[int, ...] | None, n_lanes: int) -> Side | None:
    """The side that is closed, by the lanes or by what traffic must do."""
    if lanes:
        right, left = 0 in lanes, n_lanes - 1 in lanes
        return None if right == left else "right" if right else "left"
    impacts = {found.event.vehicle_impact for found in passing}
    if "some-lanes-closed-merge-left" in impacts:
        return "right"
    return "left" if "some-lanes-closed-merge-right" in impacts else None
