"""A WZDx 4.2 feed of what a lane map shows: where lanes are closed or shifted, how wide they are, how well that is known.

A road event is written for each stretch on which the same lanes are closed or shifted (business rule 1), linked in sequence. An
end of the zone is said to be verified where its standard deviation is within VERIFIED_WITHIN_M; the description states it.
"""

import math
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from wzsumo.errors import MapError
from wzsumo.feeds.check import VERSION
from wzsumo.feeds.road_event import BEARINGS_DEG
from wzsumo.frames import FloatArray, wrap_angle
from wzsumo.geography import LocalFrame
from wzsumo.grid import FREE_THRESHOLD, OCCUPIED_THRESHOLD
from wzsumo.lane_map import LaneMap, MappedLane
from wzsumo.units import feet_from_metres

VERIFIED_WITHIN_M = 15.0  # standard deviation of a verified end: that of AnnouncedZone, which reads such a feed
SHIFTED_M = 1.0  # of a lane's middle off its place where the map begins; chosen by us
ON_PLACE_M = 0.3  # a shifted lane has left its place, or is back on it; three deviations of a good map. Chosen by us
NARROW_M = 3.35  # 11 ft: below it a width restriction is published (MUTCD 11th ed., Section 6G, lane widths of 10 to 11 ft)
MIN_EVENT_M = 20.0  # a shorter stretch belongs to the one before it; chosen by us
LICENCE = "https://creativecommons.org/publicdomain/zero/1.0/"  # of all public feeds (WZDx 4.2, FeedInfo)


@dataclass(frozen=True, kw_only=True)
class FeedDetails:
    """What a feed says beside the map: who publishes it, the road's name, the direction (None: by the bearing), the times."""

    publisher: str
    road_name: str
    direction: str | None
    start_date: str
    end_date: str


@dataclass(frozen=True, kw_only=True)
class VerifiedZone:
    """Where a map shows a zone to start and end [m along its axis], with standard deviations [m], and the lanes it closes.

    A deviation is infinite where the map ends before the zone does. `shifted` are lanes that stay open and move aside.
    """

    start_m: float
    end_m: float
    start_sd_m: float
    end_sd_m: float
    closed_lanes: tuple[int, ...]
    shifted: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class _Stretch:
    start: float
    end: float
    start_sd: float | None  # None: another stretch goes on there
    end_sd: float | None
    statuses: tuple[str, ...]  # of the lanes, from the right


def verified_zone(lanes: LaneMap) -> VerifiedZone | None:
    """The zone that a map shows; None where no lane is closed or shifted."""
    stretches = _stretches(lanes)
    if not stretches:
        return None
    by_lane = [{stretch.statuses[number] for stretch in stretches} for number in range(len(lanes.lanes))]
    first, last = stretches[0], stretches[-1]
    return VerifiedZone(
        start_m=first.start, end_m=last.end,
        start_sd_m=np.inf if first.start_sd is None else first.start_sd,
        end_sd_m=np.inf if last.end_sd is None else last.end_sd,
        closed_lanes=tuple(number for number, found in enumerate(by_lane) if "closed" in found),
        shifted=tuple(n for n, found in enumerate(by_lane) if "closed" not in found and found != {"open"}),
    )  # fmt: skip


def published_zone(
    lanes: LaneMap, frame: LocalFrame, details: FeedDetails, *, speed_limit_mps: float | None = None
) -> dict[str, Any]:
    """The feed. Raises MapError where no lane of the map is closed or shifted."""
    stretches = _stretches(lanes)
    if not stretches:
        raise MapError("the map shows no lane that is closed or shifted: there is no work zone to publish")
    direction = details.direction or _direction(lanes, frame, stretches)
    name = f"{details.publisher}/{details.road_name}/{direction}/{details.start_date}"
    ids = [str(uuid.uuid5(uuid.NAMESPACE_URL, f"{name}/{number}")) for number in range(len(stretches))]
    events = [
        _event(lanes, frame, stretch, details=details, direction=direction, event_id=ids[number], related=_related(ids, number))
        for number, stretch in enumerate(stretches)
    ]
    if speed_limit_mps is not None:
        for event in events:
            event["properties"]["reduced_speed_limit_kph"] = round(3.6 * speed_limit_mps, 3)
    source = {"data_source_id": "wzsumo", "organization_name": details.publisher, "update_date": details.start_date}
    info = {
        "update_date": details.start_date, "publisher": details.publisher, "version": VERSION, "license": LICENCE,
        "data_sources": [source],
    }  # fmt: skip
    return {"feed_info": info, "type": "FeatureCollection", "features": events}


def _stretches(lanes: LaneMap) -> list[_Stretch]:
    s = lanes.stations
    spans: list[tuple[int, str, float, float, float, float]] = []  # lane, status, start, end, their deviations
    for number, lane in enumerate(lanes.lanes):
        closed = lane.p_open.min(axis=1) < 1 - OCCUPIED_THRESHOLD
        sure = lane.p_open.min(axis=1) > 1 - FREE_THRESHOLD
        for first, last in _runs(closed):
            spans.append((number, "closed", s[first], s[last], _doubt(s, sure, first, -1), _doubt(s, sure, last, 1)))
        shift = lane.middle - lane.middle[0]
        for status, moved in (("shift-left", shift > SHIFTED_M), ("shift-right", shift < -SHIFTED_M)):
            drivable = moved & (lane.p_open_middle > 1 - FREE_THRESHOLD)
            for first, last in _runs_that_hold(np.abs(shift) > ON_PLACE_M, drivable):
                sd = float(np.max([lane.right_sd[first], lane.left_sd[first]])) * 10  # along: a lane shifts 1 m in some 10 m
                spans.append((number, status, s[first], s[last], sd, sd))
    if not spans:
        return []
    ends = sorted({end for span in spans for end in (float(span[2]), float(span[3]))})
    cuts = [ends[0], *(cut for before, cut in pairwise(ends) if cut - before >= MIN_EVENT_M)]
    cuts[-1] = ends[-1]
    found = []
    for start, end in pairwise(cuts):
        middle = (start + end) / 2
        statuses = ["open"] * len(lanes.lanes)
        for number, status, begins, ends_at, _, _ in sorted(spans, key=lambda span: span[1] == "closed"):
            if begins <= middle <= ends_at:
                statuses[number] = status
        start_sd = max((sd for *_, first, _, sd, _ in spans if first == start), default=None) if start == ends[0] else None
        end_sd = max((sd for *_, last, _, sd in spans if last == end), default=None) if end == ends[-1] else None
        found.append(_Stretch(start=start, end=end, start_sd=start_sd, end_sd=end_sd, statuses=tuple(statuses)))
    return [stretch for stretch in found if set(stretch.statuses) != {"open"}]


def _runs_that_hold(wide: np.ndarray, core: np.ndarray) -> list[tuple[int, int]]:
    """The runs of `wide` in which `core` holds somewhere."""
    return [(first, last) for first, last in _runs(wide) if core[first : last + 1].any()]


def _runs(chosen: np.ndarray) -> list[tuple[int, int]]:
    """(first, last) number of each run."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(int)))
    return [(int(first), int(end) - 1) for first, end in zip(ends[::2], ends[1::2], strict=True)]


def _doubt(s: FloatArray, sure: np.ndarray, at: int, step: int) -> float:
    """Standard deviation [m] of an end: a third of the way from where a lane is surely closed to where it is surely open."""
    beyond = at
    while 0 <= beyond < len(s) and not sure[beyond]:
        beyond += step
    if not 0 <= beyond < len(s):
        return float("inf")  # the map ends before the lane opens
    return max(abs(float(s[beyond] - s[at])), float(np.median(np.diff(s)))) / 3


def _event(
    lanes: LaneMap, frame: LocalFrame, stretch: _Stretch, *, details: FeedDetails, direction: str, event_id: str,
    related: list[dict[str, str]],
) -> dict[str, Any]:  # fmt: skip
    here = (lanes.stations >= stretch.start) & (lanes.stations <= stretch.end)
    s = np.unique(np.concatenate([[stretch.start, stretch.end], lanes.stations[here]]))
    line = shapely.simplify(shapely.LineString(lanes.to_xy(s, lanes.axis.own_width / 2)), 0.1)
    lonlat = np.round(frame.to_lonlat(shapely.get_coordinates(line)), 7)
    core: dict[str, Any] = {
        "data_source_id": "wzsumo", "event_type": "work-zone", "road_names": [details.road_name], "direction": direction,
        "description": _description(lanes, stretch), "update_date": details.start_date,
    }  # fmt: skip
    if related:
        core["related_road_events"] = related
    properties = {
        "core_details": core,
        "start_date": details.start_date, "end_date": details.end_date,
        "is_start_date_verified": True, "is_end_date_verified": False,
        "is_start_position_verified": _is_verified(stretch.start_sd), "is_end_position_verified": _is_verified(stretch.end_sd),
        "location_method": "other", "vehicle_impact": _impact(stretch.statuses), "lanes": _lanes(lanes, stretch, here),
    }  # fmt: skip
    return {
        "id": event_id, "type": "Feature", "properties": properties,
        "geometry": {"type": "LineString", "coordinates": lonlat.tolist()},
    }  # fmt: skip


def _is_verified(sd: float | None) -> bool:
    return sd is not None and sd <= VERIFIED_WITHIN_M


def _description(lanes: LaneMap, stretch: _Stretch) -> str:
    words = [f"Lanes as driven by {lanes.n_traces} vehicles"]
    for name, sd in (("start", stretch.start_sd), ("end", stretch.end_sd)):
        if sd is not None:
            words.append(f"{name} known to {sd:.0f} m" if np.isfinite(sd) else f"{name} beyond the mapped stretch")
    return "; ".join(words) + " (one standard deviation)"


def _lanes(lanes: LaneMap, stretch: _Stretch, here: np.ndarray) -> list[dict[str, Any]]:
    """The lanes from the left, as WZDx counts them."""
    found: list[dict[str, Any]] = []
    for order, number in enumerate(reversed(range(len(lanes.lanes))), start=1):
        lane: dict[str, Any] = {"order": order, "type": "general", "status": stretch.statuses[number]}
        width = _narrowest(lanes.lanes[number], here)
        if stretch.statuses[number] != "closed" and width < NARROW_M:
            limit = math.floor(10 * feet_from_metres(width)) / 10
            lane["restrictions"] = [{"type": "reduced-width", "value": limit, "unit": "feet"}]
        found.append(lane)
    return found


def _narrowest(lane: MappedLane, here: np.ndarray) -> float:
    """Width [m] of which a lane is wider in 95 % of its places, two deviations of its lines on the safe side."""
    sure = (lane.left - lane.right)[here] - 2 * np.hypot(lane.left_sd, lane.right_sd)[here]
    return float(np.quantile(sure, 0.05)) if here.any() else float("inf")


def _impact(statuses: tuple[str, ...]) -> str:
    closed = [status == "closed" for status in statuses]
    if all(closed):
        return "all-lanes-closed"
    if not any(closed):
        kinds = set(statuses) - {"open"}
        return f"all-lanes-open-{kinds.pop()}" if len(kinds) == 1 else "all-lanes-open"
    if closed[0] and not closed[-1]:
        return "some-lanes-closed-merge-left"
    return "some-lanes-closed-merge-right" if closed[-1] and not closed[0] else "some-lanes-closed"


def _direction(lanes: LaneMap, frame: LocalFrame, stretches: list[_Stretch]) -> str:
    """The name of the direction nearest to the bearing from the zone's start to its end."""
    start, end = lanes.to_xy([stretches[0].start, stretches[-1].end], lanes.axis.own_width / 2)
    bearing = frame.north_at(start) - np.arctan2(*(end - start)[::-1])
    return min(BEARINGS_DEG, key=lambda name: abs(float(wrap_angle(bearing - np.deg2rad(BEARINGS_DEG[name])))))


def _related(ids: list[str], number: int) -> list[dict[str, str]]:
    found: list[Mapping[str, str]] = []
    if number > 0:
        found.append({"type": "first-in-sequence", "id": ids[0]})
    if number + 1 < len(ids):
        found.append({"type": "next-in-sequence", "id": ids[number + 1]})
    return [dict(entry) for entry in found]
