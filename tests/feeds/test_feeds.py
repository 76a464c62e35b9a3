"""WZDx that is read: the examples of the specification, and feeds that deviate."""

import copy
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import paper_road

from wzsumo.errors import FeedError
from wzsumo.feeds.announcement import announced_on
from wzsumo.feeds.check import rule_faults, schema_faults
from wzsumo.feeds.road_event import read_feed, road_event, road_events, split_event
from wzsumo.geography import local_frame
from wzsumo.road import Road

PLACE = local_frame([[-93.65, 41.65]])
ROAD = paper_road()  # three lanes of 12 ft, eastbound, 1524 m


def event(start: float = 300.0, end: float = 900.0, *, points: int = 5, **properties: Any) -> dict[str, Any]:
    """A work zone event along ROAD between two stations."""
    lonlat = PLACE.to_lonlat(ROAD.to_xy(np.linspace(start, end, points), 5.0))
    core = {"data_source_id": "1", "event_type": "work-zone", "road_names": ["I-80"], "direction": "eastbound"}
    defaults = {
        "start_date": "2026-06-01T00:00:00Z", "end_date": "2026-06-30T00:00:00Z", "location_method": "unknown",
        "is_start_date_verified": False, "is_end_date_verified": False, "is_start_position_verified": True,
        "is_end_position_verified": False, "vehicle_impact": "some-lanes-closed",
    }  # fmt: skip
    return {
        "id": properties.pop("id", "a"), "type": "Feature",
        "geometry": {"type": properties.pop("geometry", "LineString"), "coordinates": lonlat.tolist()},
        "properties": {"core_details": core | properties.pop("core", {})} | defaults | properties,
    }  # fmt: skip


def lanes(*statuses: str, kinds: tuple[str, ...] = ()) -> list[dict[str, Any]]:
    """Lanes from the left."""
    kinds = kinds or ("general",) * len(statuses)
    return [{"order": n + 1, "type": kind, "status": s} for n, (kind, s) in enumerate(zip(kinds, statuses, strict=True))]


def feed(*events: dict[str, Any], version: str = "4.2") -> dict[str, Any]:
    source = {"data_source_id": "1", "organization_name": "Test DOT"}
    info = {"publisher": "Test DOT", "version": version, "update_date": "2026-06-01T00:00:00Z", "data_sources": [source]}
    return {"type": "FeatureCollection", "feed_info": info, "features": list(events)}


def announced(*events: dict[str, Any], road: Road = ROAD, times_s: tuple[float, float] | None = None) -> Any:
    return announced_on(road_events(feed(*events), source="f")[0], road, frame=PLACE, times_s=times_s, source="f")


def test_feed_of_the_tests_keeps_the_specification() -> None:
    assert schema_faults(feed(event(lanes=lanes("closed", "open", "open")))) == []
    assert rule_faults(feed(event(lanes=lanes("closed", "open", "open")))) == []


def test_event_becomes_a_zone_with_the_accuracy_of_the_feed() -> None:
    found = announced(event(lanes=lanes("shoulder", "closed", "open", "open", kinds=("shoulder", *["general"] * 3)),
                            reduced_speed_limit_kph=88.5))  # fmt: skip
    zone = found.zone
    assert (zone.start_m, zone.end_m) == pytest.approx((300.0, 900.0), abs=0.01)
    assert zone.start_sd_m < 30  # measured
    assert zone.end_sd_m > 100  # not measured
    assert zone.closed_lanes == (2,)  # the leftmost, counted from the right
    assert (zone.side, zone.speed_mps) == ("left", pytest.approx(88.5 / 3.6))


def test_older_keys_of_accuracy_are_read() -> None:
    given = event(beginning_accuracy="estimated", ending_accuracy="verified")
    for key in ("is_start_position_verified", "is_end_position_verified"):
        del given["properties"][key]
    zone = announced(given).zone
    assert zone.end_sd_m < 30 < zone.start_sd_m


def test_geometry_against_the_named_direction_is_turned_with_its_accuracy() -> None:
    found = announced(event(900.0, 300.0))
    assert (found.zone.start_m, found.zone.end_m) == pytest.approx((300.0, 900.0), abs=0.01)
    assert found.zone.end_sd_m < 30 < found.zone.start_sd_m
    assert any("the other way round" in word for word in found.said)


def test_events_of_both_directions_are_told_apart_by_their_name() -> None:
    found = announced(event(), event(1100.0, 200.0, id="other", core={"direction": "westbound"}))
    assert found.events == ("a",)
    assert any(word.startswith("other: westbound, the other way") for word in found.said)


def test_points_without_order_and_events_in_sequence_are_one_zone() -> None:
    found = announced(
        event(500.0, 300.0, points=2, geometry="MultiPoint", lanes=lanes("open", "open", "merge-left")),
        event(500.0, 900.0, id="b", lanes=lanes("open", "closed", "closed")),
    )
    assert (found.zone.start_m, found.zone.end_m) == pytest.approx((300.0, 900.0), abs=0.01)
    assert found.zone.closed_lanes == (0, 1)
    assert any("2 events are taken as one zone" in word for word in found.said)


def test_lanes_that_are_not_said_stay_open_questions() -> None:
    assert announced(event()).zone.closed_lanes is None
    other_number = announced(event(lanes=lanes("closed", "open")))
    assert other_number.zone.closed_lanes is None
    assert any("says 2 lanes where the road has 3" in word for word in other_number.said)
    assert announced(event(vehicle_impact="all-lanes-open-shift-left")).zone.closed_lanes == ()
    assert announced(event(vehicle_impact="some-lanes-closed-merge-left")).zone.side == "right"


def test_events_of_another_time_are_left_out() -> None:
    june, july = (1_780_322_400.0, 1_780_326_000.0), (1_783_000_000.0, 1_783_001_000.0)
    other = event(100.0, 1000.0, id="b", start_date="2026-07-01T00:00:00Z", end_date="2026-07-30T00:00:00Z")
    assert announced(event(), other, times_s=june).events == ("a",)
    assert announced(event(), other, times_s=july).events == ("b",)


ELSEWHERE = {
    "a detour": (event(core={"event_type": "detour"}), "a detour closes nothing"),
    "the plan of a moving operation": (event(work_zone_type="planned-moving-area"), "planned area of a moving operation"),
    "the other way": (event(900.0, 300.0, core={"direction": "westbound"}), "westbound, the other way"),
    "another road": (
        event() | {"geometry": {"type": "LineString", "coordinates": [[-93.0, 41.0], [-93.1, 41.0]]}},
        "elsewhere",
    ),
}


@pytest.mark.parametrize("case", ELSEWHERE)
def test_feed_without_an_event_on_the_road_is_refused_with_the_reason(case: str) -> None:
    given, said = ELSEWHERE[case]
    with pytest.raises(FeedError, match=said) as refused:
        announced(given)
    assert str(refused.value).startswith("f: no event passes along the road")


def moved(given: dict[str, Any], east_deg: float, name: str) -> dict[str, Any]:
    line = [[lon + east_deg, lat] for lon, lat in given["geometry"]["coordinates"]]
    return given | {"id": name, "geometry": {"type": "LineString", "coordinates": line}}


def test_events_of_a_whole_state_are_told_by_their_number_and_the_nearest() -> None:
    state = [moved(event(), 0.1 * number, f"far-{number}") for number in range(1, 400)]
    detours = [event(id=f"detour-{number}", core={"event_type": "detour"}) for number in range(5)]
    found = announced(*state, event(id="here", lanes=lanes("closed", "open", "open")), *detours)
    assert found.events == ("here",)
    told = [word for word in found.said if "lie elsewhere" in word]
    assert told == ["399 of 405 event(s) lie elsewhere for the most part, the nearest (far-1) 7.1 km from the road"]
    assert len([word for word in found.said if "detour" in word]) == 3
    assert "2 event(s) more" in found.said
    with pytest.raises(FeedError, match=r"399 of 399 event\(s\) lie elsewhere") as refused:
        announced(*state)
    assert len(str(refused.value)) < 300


def test_exchanged_coordinates_of_a_feed_are_told() -> None:
    line = PLACE.to_lonlat(ROAD.to_xy([300.0, 900.0], 5.0))[:, ::-1].tolist()  # latitudes of 93 degrees
    events, faults = road_events(feed(event() | {"geometry": {"type": "LineString", "coordinates": line}}), source="f")
    with pytest.raises(
        FeedError, match=r"holds \[41.6.*, -93.6.*\], which is no longitude and latitude; the longitude comes first"
    ):
        announced_on(events, ROAD, frame=PLACE, times_s=None, source="f", faults=faults)
    place = local_frame([[-80.3, 27.2]])  # where both orders are places on earth
    there = place.to_lonlat(ROAD.to_xy(np.linspace(300.0, 900.0, 5), 5.0))
    swapped = road_events(
        feed(event() | {"geometry": {"type": "LineString", "coordinates": there[:, ::-1].tolist()}}), source="f"
    )
    with pytest.raises(FeedError, match="with latitude and longitude exchanged one would"):
        announced_on(swapped[0], ROAD, frame=place, times_s=None, source="f")


def test_lanes_are_compared_with_those_that_a_map_has_along_a_line_without_any() -> None:
    line = Road(reference_line=ROAD.reference_line, lane_widths=(0.0,), left_shoulder=0.0, right_shoulder=0.0)
    events, _ = road_events(feed(event(lanes=lanes("closed", "open"))), source="f")
    told = announced_on(events, line, frame=PLACE, times_s=None, source="f", n_lanes=2).zone
    assert (told.closed_lanes, told.side) == ((1,), "left")
    other = announced_on(events, line, frame=PLACE, times_s=None, source="f", n_lanes=3)
    assert other.zone.closed_lanes is None
    assert any("says 2 lanes where the road has 3" in word for word in other.said)


def test_moving_operation_is_taken_with_wide_ends() -> None:
    zone = announced(event(work_zone_type="moving")).zone
    assert zone.start_sd_m == zone.end_sd_m > 200


def without(given: dict[str, Any], *path: str) -> dict[str, Any]:
    made = copy.deepcopy(given)
    inner = made
    for key in path[:-1]:
        inner = inner[key]
    del inner[path[-1]]
    return made


BROKEN = {
    "no JSON": ("{", "is no GeoJSON"),
    "a list": (json.dumps([]), "is no FeatureCollection"),
    "version 3": (json.dumps(feed(event(), version="3.1")), "version='3.1' must be one of 4.0, 4.1, 4.2"),
    "no feed_info": (json.dumps(without(feed(event()), "feed_info")), "version='not said'"),
    "devices with details": (
        json.dumps(feed(event() | {"properties": {"core_details": {"device_type": "camera", "data_source_id": "1"}}})),
        "has no road event",
    ),
    "properties of another kind": (json.dumps(feed(event() | {"properties": ["core_details"]})), "has no road event"),
    "devices": (json.dumps(feed({"id": "d", "type": "Feature", "properties": {}, "geometry": None})), "has no road event"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_file_that_is_no_work_zone_feed_is_refused(tmp_path: Path, case: str) -> None:
    content, said = BROKEN[case]
    (tmp_path / "feed.geojson").write_text(content)
    with pytest.raises(FeedError, match=said):
        read_feed(tmp_path / "feed.geojson")


def test_broken_event_is_refused_by_its_id_and_passed_over_among_others() -> None:
    broken = without(event(id="bad"), "geometry")
    given = feed(broken, event())
    with pytest.raises(FeedError, match=r"f#bad: is no road event of WZDx 4 \(KeyError: 'geometry'\)"):
        road_event(given, "bad", source="f")
    events, faults = road_events(given, source="f")
    assert [found.id for found in events] == ["a"]
    assert len(faults) == 1
    with pytest.raises(FeedError, match="f#c: no event of this id; the feed has bad, a"):
        road_event(given, "c", source="f")
    assert split_event("dir/feed.geojson#a#b") == (Path("dir/feed.geojson"), "a#b")


FAULTS = {
    "a lane left out": (event(lanes=lanes("open", "closed")[1:]), "orders of lanes [2] must be 1 (leftmost) to 1"),
    "an unknown source": (event(core={"data_source_id": "9"}), "data_source_id '9' is none of feed_info.data_sources"),
    "local time": (event(start_date="2026-06-01T00:00:00-05:00"), "start_date='2026-06-01T00:00:00-05:00' must be in UTC"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_business_rules_are_checked(case: str) -> None:
    given, said = FAULTS[case]
    assert [fault for fault in rule_faults(feed(given)) if said in fault]


def test_schema_faults_name_their_place() -> None:
    (fault,) = schema_faults(feed(without(event(), "properties", "vehicle_impact")))
    assert fault.startswith("features[0]")
    assert "'vehicle_impact' is a required property" in fault
    assert schema_faults(feed(event(lanes=[{"order": 0, "type": "general", "status": "open"}])))


def test_direction_that_lies_across_leaves_it_to_the_geometry() -> None:
    assert announced(event(core={"direction": "northbound"})).zone.start_m == pytest.approx(300.0, abs=0.01)
    for direction in ("northbound", "undefined", "inner-loop"):
        with pytest.raises(FeedError, match="the other way"):
            announced(event(900.0, 300.0, core={"direction": direction}))


def test_event_that_begins_or_ends_within_the_traces_counts() -> None:
    hour = (1_780_322_400.0, 1_780_326_000.0)  # 14:00 to 15:00 of 2026-06-01
    for dates, counts in (
        (("2026-06-01T14:30:00Z", "2026-06-02T00:00:00Z"), True),
        (("2026-05-01T00:00:00Z", "2026-06-01T14:00:00Z"), True),
        (("2026-06-01T15:00:01Z", "2026-06-02T00:00:00Z"), False),
        (("2026-05-01T00:00:00Z", "2026-06-01T13:59:59Z"), False),
    ):
        other = event(100.0, 1000.0, id="b", start_date=dates[0], end_date=dates[1])
        assert ("b" in announced(event(), other, times_s=hour).events) == counts


def test_line_that_leaves_the_road_counts_by_its_share_beside_it() -> None:
    inside = PLACE.to_lonlat([*ROAD.to_xy([300.0, 900.0], 5.0), (900.0, 500.0)]).tolist()  # 600 m beside, 500 m away
    away = PLACE.to_lonlat([*ROAD.to_xy([300.0, 600.0], 5.0), (600.0, 500.0)]).tolist()
    given = event() | {"geometry": {"type": "LineString", "coordinates": inside}}
    assert announced(given).zone.end_m == pytest.approx(900.0, abs=1.0)
    with pytest.raises(FeedError, match="lie elsewhere"):
        announced(event() | {"geometry": {"type": "LineString", "coordinates": away}})
    assert not any("moving operation" in word for word in announced(given).said)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        *(({"reduced_speed_limit_kph": speed}, "reduced_speed_limit_kph=") for speed in (0, -50, 500, math.inf, True, "1e400")),
        ({"lanes": lanes("melted", "open")}, "status 'melted' of a lane must be one of open, closed"),
        *(
            ({"lanes": [{"order": n, "type": "general", "status": "open"} for n in orders]}, "orders of lanes")
            for orders in ((1, 1), (0, 1), (1.7, 2), (True, 2), ("1", "2"))
        ),
    ],
)
def test_values_that_cannot_be_are_refused_and_not_bent_into_shape(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(FeedError, match=said):
        road_event(feed(event(id="a", **changes)), "a", source="f")


def test_positions_of_true_and_false_are_no_places() -> None:
    broken = event(id="a")
    broken["geometry"]["coordinates"] = [[True, False], [True, True]]
    with pytest.raises(FeedError, match="true or false in the place of a number"):
        road_event(feed(broken), "a", source="f")


def test_geometry_that_is_no_place_is_refused() -> None:
    swapped = event() | {"geometry": {"type": "LineString", "coordinates": [[41.6, -93.6], [41.7, -193.6]]}}
    with pytest.raises(FeedError, match="which is no longitude and latitude"):
        road_event(feed(swapped), "a", source="f")
