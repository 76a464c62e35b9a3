"""Feeds as state agencies publish them deviate from the specification; what can be read is read.

The forms are those of public feeds and of the issues of the specification's repository: positions with heights, deprecated
keys, values that are null or empty, times without seconds, ids that are numbers, events of a single point.
"""

from typing import Any

import numpy as np
import pytest
from builders import paper_road

from wzsumo.feeds.announcement import announced_on
from wzsumo.feeds.road_event import road_events
from wzsumo.geography import local_frame

PLACE = local_frame([[-93.65, 41.65]])
ROAD = paper_road()
LINE = PLACE.to_lonlat(ROAD.to_xy(np.linspace(300.0, 900.0, 4), 5.0)).tolist()


def older_keys() -> dict[str, Any]:
    """Version 4.0: accuracies and status under their deprecated names, positions with a height."""
    core = {"data_source_id": "7", "event_type": "work-zone", "road_names": ["I-80 EB"], "direction": "eastbound",
            "relationship": {"first": ["1"]}}  # fmt: skip
    properties = {
        "core_details": core, "beginning_accuracy": "verified", "ending_accuracy": "estimated", "event_status": "active",
        "start_date_accuracy": "estimated", "end_date_accuracy": "estimated", "start_date": "2026-06-01T05:00:00Z",
        "end_date": "2026-06-30T22:00:00Z", "vehicle_impact": "some-lanes-closed", "location_method": "unknown",
        "lanes": [{"order": n, "type": "general", "status": status} for n, status in ((1, "closed"), (2, "open"), (3, "open"))],
    }  # fmt: skip
    line = [[lon, lat, 310.5] for lon, lat in LINE]
    return {"id": "1", "type": "Feature", "geometry": {"type": "LineString", "coordinates": line}, "properties": properties}


def nulls() -> dict[str, Any]:
    """Nulls and empty texts where nothing is known, an id that is a number, the direction left open, times without seconds."""
    core: dict[str, Any] = {"data_source_id": None, "event_type": "work-zone", "road_names": [], "direction": "undefined"}
    properties = {
        "core_details": core, "is_start_position_verified": True, "is_end_position_verified": None,
        "start_date": "2026-06-01T05:00", "end_date": "", "vehicle_impact": None,
        "lanes": None, "reduced_speed_limit_kph": None, "work_zone_type": None,
        "restrictions": None,
    }  # fmt: skip
    return {"id": 1, "type": "Feature", "geometry": {"type": "LineString", "coordinates": LINE}, "properties": properties}


def points() -> dict[str, Any]:
    """The ends alone, the last first, and lanes of which the auxiliary ones are listed too."""
    core = {"data_source_id": "7", "event_type": "work-zone", "road_names": ["I-80"], "direction": "eastbound"}
    kinds = (("shoulder", "closed"), ("general", "closed"), ("general", "open"), ("general", "open"), ("exit-lane", "open"))
    properties = {
        "core_details": core, "is_start_position_verified": True, "is_end_position_verified": False,
        "start_date": "2026-06-01T05:00:00.000Z", "end_date": "2026-06-30T22:00:00+00:00",
        "vehicle_impact": "some-lanes-closed", "reduced_speed_limit_kph": "88.5",
        "lanes": [{"order": n + 1, "type": kind, "status": status} for n, (kind, status) in enumerate(kinds)],
    }  # fmt: skip
    ends = [LINE[-1], LINE[0]]
    return {"id": "1", "type": "Feature", "geometry": {"type": "MultiPoint", "coordinates": ends}, "properties": properties}


@pytest.mark.parametrize(("dialect", "closed"), [(older_keys, (2,)), (nulls, None), (points, (2,))])
def test_zone_is_read_from_each_dialect(dialect: Any, closed: tuple[int, ...] | None) -> None:
    events, faults = road_events({"features": [dialect()]}, source="f")
    assert faults == []
    zone = announced_on(events, ROAD, frame=PLACE, times_s=(1_780_322_400.0, 1_780_326_000.0), source="f").zone
    assert (zone.start_m, zone.end_m) == pytest.approx((300.0, 900.0), abs=0.1)
    assert zone.start_sd_m < 30
    assert zone.end_sd_m > 100
    assert zone.closed_lanes == closed


def test_event_of_a_single_point_is_passed_over_with_its_id() -> None:
    single = older_keys() | {"id": "p", "geometry": {"type": "Point", "coordinates": LINE[0]}}
    events, faults = road_events({"features": [single, older_keys()]}, source="f")
    assert len(events) == 1
    assert faults[0].startswith("f#p: ")
