"""A WZDx 4.2 feed of what a lane map shows: where lanes are closed or shifted, how wide they are, how well that is known.

A road event is written for each stretch on which the same lanes are closed or shifted (business rule 1), linked in sequence. An
end of the zone is said to be verified where its standard deviation is within VERIFIED_WITHIN_M; the description states it.
"""

import math
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from wzsumo.errors import MapError
from wzsumo.feeds.check import VERSION
from wzsumo.feeds.road_event import BEARINGS_DEG
from wzsumo.feeds.verified import Stretch, zone_stretches
from wzsumo.frames import FloatArray, wrap_angle
from wzsumo.geography import LocalFrame
from wzsumo.lane_map import LaneMap, MappedLane
from wzsumo.units import feet_from_metres

VERIFIED_WITHIN_M = 15.0  # standard deviation of a verified end: that of AnnouncedZone, which reads such a feed
NARROW_M = 3.35  # 11 ft: below it a width restriction is published (MUTCD 11th ed., Section 6G, lane widths of 10 to 11 ft)
LICENCE = "https://creativecommons.org/publicdomain/zero/1.0/"  # of all public feeds (WZDx 4.2, FeedInfo)


@dataclass(frozen=True, kw_only=True)
class FeedDetails:
    """What a feed says beside the map: its publisher, the road's name, the direction (None: by the bearing), the times."""

    publisher: str
    road_name: str
    direction: str | None
    start_date: str
    end_date: str


def published_zone(
    lanes: LaneMap, frame: LocalFrame, details: FeedDetails, *, speed_limit_mps: float | None = None
) -> dict[str, Any]:
    """The feed. Raises MapError where no lane of the map is closed or shifted."""
    stretches = zone_stretches(lanes)
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


def _event(
    lanes: LaneMap, frame: LocalFrame, stretch: Stretch, *, details: FeedDetails, direction: str, event_id: str,
    related: list[dict[str, str]],
) -> dict[str, Any]:  # fmt: skip
    here = (lanes.stations >= stretch.start) & (lanes.stations <= stretch.end)
    s = np.unique(np.concatenate([[stretch.start, stretch.end], lanes.stations[here]]))
    line = shapely.simplify(shapely.LineString(lanes.to_xy(s, np.interp(s, lanes.stations, _middle(lanes)))), 0.1)
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


def _middle(lanes: LaneMap) -> FloatArray:
    """Offsets (n,) [m] of the middle of all lanes."""
    return np.asarray(np.mean([lane.middle for lane in lanes.lanes], axis=0))


def _is_verified(sd: float | None) -> bool:
    return sd is not None and sd <= VERIFIED_WITHIN_M


def _description(lanes: LaneMap, stretch: Stretch) -> str:
    words = [f"Lanes as driven by {lanes.n_traces} vehicles"]
    for name, sd in (("start", stretch.start_sd), ("end", stretch.end_sd)):
        if sd is not None:
            words.append(f"{name} known to {sd:.0f} m" if np.isfinite(sd) else f"{name} beyond the mapped stretch")
    return "; ".join(words) + " (one standard deviation)"


def _lanes(lanes: LaneMap, stretch: Stretch, here: np.ndarray) -> list[dict[str, Any]]:
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


def _direction(lanes: LaneMap, frame: LocalFrame, stretches: list[Stretch]) -> str:
    """The name of the direction nearest to the bearing from the zone's start to its end."""
    ends = [stretches[0].start, stretches[-1].end]
    start, end = lanes.to_xy(ends, np.interp(ends, lanes.stations, _middle(lanes)))
    bearing = frame.north_at(start) - np.arctan2(*(end - start)[::-1])
    return min(BEARINGS_DEG, key=lambda name: abs(float(wrap_angle(bearing - np.deg2rad(BEARINGS_DEG[name])))))


def _related(ids: list[str], number: int) -> list[dict[str, str]]:
    found: list[Mapping[str, str]] = []
    if number > 0:
        found.append({"type": "first-in-sequence", "id": ids[0]})
    if number + 1 < len(ids):
        found.append({"type": "next-in-sequence", "id": ids[number + 1]})
    return [dict(entry) for entry in found]
