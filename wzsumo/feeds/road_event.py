"""RoadEvent: one road event of a WZDx feed, read from versions 4.0 to 4.2."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from wzsumo.errors import FeedError
from wzsumo.frames import FloatArray
from wzsumo.input_files import read_json, shown

VERSIONS = ("4.0", "4.1", "4.2")  # what complies with 4.1 complies with 4.2; 4.0 has the same events under older keys
MAX_IDS_SHOWN = 6
QUOTES = "'\""
MAX_WHY = 120  # letters of a fault that a message repeats
MAX_SPEED_KPH = 150  # above the highest posted limit, 85 mph
LANE_STATUSES = ("open", "closed", "shift-left", "shift-right", "merge-left", "merge-right", "alternating-flow")  # WZDx 4.2
# Bearing of a carriageway by the name of its direction [degrees clockwise from north] (WZDx 4.2, Direction).
BEARINGS_DEG = {"northbound": 0.0, "eastbound": 90.0, "southbound": 180.0, "westbound": 270.0}


@dataclass(frozen=True, kw_only=True)
class EventLane:
    """A lane of a road event; `order` 1 is the leftmost."""

    order: int
    kind: str
    status: str


@dataclass(frozen=True, kw_only=True, eq=False)
class RoadEvent:
    """A road event: where it is said to be, what it does to the lanes, how well that is known.

    `lonlat` (n, 2) [degrees] runs in the direction of travel where `in_order`; the points of a MultiPoint have no order. Values
    that the feed does not state are None; `lanes` is empty then. Times are in seconds since 1970-01-01 UTC.
    """

    id: str
    kind: str  # work-zone or detour
    road_names: tuple[str, ...]
    direction: str
    lonlat: FloatArray
    in_order: bool
    start_verified: bool
    end_verified: bool
    vehicle_impact: str
    lanes: tuple[EventLane, ...]
    movement: str | None  # static, moving or planned-moving-area
    speed_mps: float | None
    start_time_s: float | None
    end_time_s: float | None

    @property
    def bearing_deg(self) -> float | None:
        """Bearing of the carriageway by the name of its direction; None for inner-loop and the like."""
        return BEARINGS_DEG.get(self.direction)


def read_feed(path: Path) -> dict[str, Any]:
    """The content of a WZDx work zone feed. Raises FeedError where the file is none, or of a version before 4."""
    try:
        feed = read_json(path)
    except FileNotFoundError:
        raise FeedError(f"{path}: no such file; name a WZDx feed in a GeoJSON file, with #ID for one of its events") from None
    except (OSError, ValueError) as error:
        raise FeedError(f"{path}: is no GeoJSON ({str(error).splitlines()[0]})") from None
    if not isinstance(feed, dict) or feed.get("type") != "FeatureCollection" or not isinstance(feed.get("features"), list):
        raise FeedError(f"{path}: is no FeatureCollection; a WZDx feed is one, with feed_info and features")
    info = feed.get("feed_info") or feed.get("road_event_feed_info")
    version = str(info.get("version", "not said"))[:20] if isinstance(info, dict) else "not said"
    if version not in VERSIONS:
        raise FeedError(
            f"{path}: feed_info.version={version!r} must be one of {', '.join(VERSIONS)}; ask the publisher for its feed of "
            "that version"
        )
    if not any(_is_road_event(found) for found in feed["features"]):
        raise FeedError(f"{path}: has no road event (a device feed, or empty); give the work zone feed of the publisher")
    return feed


def road_events(feed: Mapping[str, Any], *, source: str) -> tuple[list[RoadEvent], list[str]]:
    """(the road events of a feed, what is wrong with those that are broken)."""
    events, faults = [], []
    for found in feed["features"]:
        try:
            events.append(_event(found, source=source))
        except FeedError as error:
            faults.append(str(error))
    return events, faults


def road_event(feed: Mapping[str, Any], event_id: str, *, source: str) -> RoadEvent:
    """The road event of an id. Raises FeedError where there is none, or it is broken."""
    for found in feed["features"]:
        if isinstance(found, dict) and str(found.get("id")) == event_id:
            return _event(found, source=source)
    ids = [str(found.get("id")) for found in feed["features"] if isinstance(found, dict)]
    shown = ", ".join(ids[:MAX_IDS_SHOWN]) + (f" and {len(ids) - MAX_IDS_SHOWN} more" if len(ids) > MAX_IDS_SHOWN else "")
    raise FeedError(f"{source}#{event_id}: no event of this id; the feed has {shown}")


def split_event(name: str) -> tuple[Path, str | None]:
    """(file, id of an event) of FEED.geojson#ID; None where no id is given.

    >>> split_event("feed.geojson#a-1")[1]
    'a-1'
    """
    path, _, event_id = name.partition("#")
    return Path(path), event_id or None


def _is_road_event(found: Any) -> bool:
    """Whether a feature is a road event: devices have core_details too, but no event_type."""
    properties = found.get("properties") if isinstance(found, dict) else None
    core = properties.get("core_details") if isinstance(properties, dict) else None
    return isinstance(core, dict) and "event_type" in core


def _event(found: Any, *, source: str) -> RoadEvent:
    name = f"{source}#{shown(found.get('id', '?') if isinstance(found, dict) else '?').strip(QUOTES)}"
    try:
        properties = found["properties"]
        core = properties["core_details"]
        geometry = found["geometry"]
        if geometry["type"] not in {"LineString", "MultiPoint"}:
            raise FeedError(f"{name}: geometry is a {shown(geometry['type']).strip(QUOTES)}; WZDx has LineString or MultiPoint")
        positions = [position[:2] for position in geometry["coordinates"]]
        if any(isinstance(value, bool) for position in positions for value in position):
            raise FeedError(f"{name}: geometry holds true or false in the place of a number")
        points = np.array(positions, dtype=float).reshape(-1, 2)
        if len(points) < 2:
            raise FeedError(f"{name}: geometry is a {geometry['type']} of {len(points)} points; WZDx has two or more")
        wrong = ~(np.isfinite(points).all(axis=1) & (np.abs(points) <= (180, 90)).all(axis=1))
        if wrong.any():
            given = points[wrong][0].tolist()
            raise FeedError(f"{name}: geometry holds {given}, which is no longitude and latitude; the longitude comes first")
        return RoadEvent(
            id=str(found.get("id", "?"))[:MAX_WHY],
            kind=str(core["event_type"])[:MAX_WHY],
            road_names=tuple(map(str, core.get("road_names") or ())),
            direction=str(core.get("direction") or "unknown")[:MAX_WHY],
            lonlat=points,
            in_order=geometry["type"] == "LineString",
            start_verified=_verified(properties, "is_start_position_verified", "beginning_accuracy"),
            end_verified=_verified(properties, "is_end_position_verified", "ending_accuracy"),
            vehicle_impact=str(properties.get("vehicle_impact") or "unknown"),
            lanes=_lanes(properties.get("lanes") or (), name=name),
            movement=_text(properties.get("work_zone_type")),
            speed_mps=_speed_mps(properties.get("reduced_speed_limit_kph"), name=name),
            start_time_s=_seconds(properties.get("start_date")),
            end_time_s=_seconds(properties.get("end_date")),
        )
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        why = f"{type(error).__name__}: {error}"[:MAX_WHY]
        raise FeedError(f"{name}: is no road event of WZDx 4 ({why}); it needs core_details, geometry and dates") from None


def _text(value: Any) -> str | None:
    return None if value is None else str(value)[:MAX_WHY]


def _lanes(lanes: Sequence[Mapping[str, Any]], *, name: str) -> tuple[EventLane, ...]:
    found = tuple(EventLane(order=lane["order"], kind=str(lane["type"]), status=str(lane["status"])) for lane in lanes)
    orders = [lane.order for lane in found]
    if not all(type(order) is int and order >= 1 for order in orders) or len({*orders}) < len(orders):
        raise FeedError(f"{name}: orders of lanes {shown(orders)} must be whole numbers from 1 (leftmost), each once")
    if odd := [lane.status for lane in found if lane.kind == "general" and lane.status not in LANE_STATUSES]:
        raise FeedError(f"{name}: status {shown(odd[0])} of a lane must be one of {', '.join(LANE_STATUSES)}")
    return found


def _speed_mps(given: Any, *, name: str) -> float | None:
    """The speed limit of a number, or of its text: some feeds write numbers as texts."""
    speed_kph = None if given is None else float(given)
    if speed_kph is not None and (isinstance(given, bool) or not 0 < speed_kph <= MAX_SPEED_KPH):
        raise FeedError(
            f"{name}: reduced_speed_limit_kph={shown(given)} must be above 0 and at most {MAX_SPEED_KPH} km/h; leave it out "
            "where no speed is posted"
        )
    return None if speed_kph is None else speed_kph / 3.6


def _verified(properties: Mapping[str, Any], key: str, older: str) -> bool:
    return bool(properties[key]) if key in properties else properties.get(older) == "verified"


def _seconds(text: Any) -> float | None:
    """Seconds since 1970-01-01 UTC of a date; None where there is none. A date without a zone is UTC (business rule 5)."""
    try:
        date = datetime.fromisoformat(text)
    except (TypeError, ValueError):
        return None
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
