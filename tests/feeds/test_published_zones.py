"""WZDx that is written: feeds of maps that are known exactly."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from builders import lane_map_of, paper_layout
from scipy.stats import norm

from wzsumo.errors import MapError
from wzsumo.feeds.announcement import announced_on
from wzsumo.feeds.check import rule_faults, schema_faults
from wzsumo.feeds.publication import FeedDetails, published_zone
from wzsumo.feeds.road_event import road_events
from wzsumo.feeds.verified import verified_zone
from wzsumo.geography import local_frame
from wzsumo.scenario.scenario import load_scenario

PLACE = local_frame([[-93.65, 41.65]])
SCENARIOS = Path(__file__).parents[2] / "scenarios"
DETAILS = FeedDetails(
    publisher="Test DOT", road_name="I-80", direction=None, start_date="2026-06-01T14:00:00Z", end_date="2026-06-02T14:00:00Z"
)


ZONES = ["paper", "right_lane", "double_closure", "lane_shift", "paper_bend_300m"]


@pytest.mark.parametrize("zone", ZONES)
def test_feed_of_a_known_zone_is_valid_and_reads_back_as_that_zone(zone: str) -> None:
    layout = load_scenario(SCENARIOS / f"{zone}.toml").layout()
    made = published_zone(lane_map_of(layout), PLACE, DETAILS)
    assert schema_faults(made) == []
    assert rule_faults(made) == []
    found = announced_on(road_events(made, source="f")[0], layout.road, frame=PLACE, times_s=None, source="f").zone
    tapers = [area for area in layout.areas if "taper" in area.name and not area.name.startswith("shoulder")]
    first = tapers[0]
    assert first.start - 1 < found.start_m < first.start + 0.3 * first.length + 5
    assert found.end_m == pytest.approx(layout.end, abs=60)
    if len(made["features"][0]["properties"]["lanes"]) == layout.road.own_lanes:
        assert found.closed_lanes == tuple(sorted(layout.work_zone.closed_lanes))
    assert all(core["properties"]["core_details"]["direction"] == "eastbound" for core in made["features"][:1])


def test_stretches_with_other_lanes_are_events_of_their_own_in_sequence() -> None:
    layout = load_scenario(SCENARIOS / "double_closure.toml").layout()
    made = published_zone(lane_map_of(layout), PLACE, DETAILS)["features"]
    statuses = [[lane["status"] for lane in found["properties"]["lanes"]] for found in made]
    assert statuses[0].count("closed") == 1
    assert max(status.count("closed") for status in statuses) == 2
    assert made[0]["properties"]["core_details"]["related_road_events"] == [{"type": "next-in-sequence", "id": made[1]["id"]}]
    ends = [np.array(found["geometry"]["coordinates"])[[0, -1]] for found in made]
    assert all(np.allclose(before[1], after[0]) for before, after in pairwise(ends))


def test_end_is_verified_only_where_it_is_known_well() -> None:
    exact = lane_map_of(paper_layout())
    closed = exact.lanes[2]
    blurred = closed.p_open.copy()
    start = np.flatnonzero(blurred.min(axis=1) < 0.35)[0]
    blurred[start - 60 : start] = np.linspace(0.9, 0.1, 60)[:, None]  # it begins anywhere in the 120 m ahead
    unsure = replace(exact, lanes=(*exact.lanes[:2], replace(closed, p_open=blurred)))
    for lane_map, verified in ((exact, True), (unsure, False)):
        first = published_zone(lane_map, PLACE, DETAILS)["features"][0]["properties"]
        assert first["is_start_position_verified"] is verified


def test_narrow_lane_is_published_as_a_restriction_in_feet() -> None:
    made = published_zone(lane_map_of(paper_layout(), sd_m=0.02), PLACE, DETAILS)["features"]
    shifted = made[1]["properties"]["lanes"][1]  # the left one of the two open lanes, 11 ft wide along the work space
    assert shifted["restrictions"] == [{"type": "reduced-width", "value": pytest.approx(10.8, abs=0.11), "unit": "feet"}]


def test_map_without_a_work_zone_is_not_published() -> None:
    exact = lane_map_of(paper_layout())
    straight = replace(exact.lanes[0], right=np.zeros(len(exact.stations)), left=np.full(len(exact.stations), 3.66))
    with pytest.raises(MapError, match="no work zone to publish"):
        published_zone(replace(exact, lanes=(straight,)), PLACE, DETAILS)


@pytest.mark.parametrize(
    ("zone", "impact", "lane_statuses"),
    [
        ("right_lane", "some-lanes-closed-merge-left", ["open", "closed"]),
        ("left_lane", "some-lanes-closed-merge-right", ["closed", "open"]),
        ("lane_shift", "all-lanes-open-shift-right", ["shift-right", "shift-right"]),
    ],
)
def test_impact_and_lanes_are_those_of_the_zone(zone: str, impact: str, lane_statuses: list[str]) -> None:
    layout = load_scenario(SCENARIOS / f"{zone}.toml").layout()
    (found,) = published_zone(lane_map_of(layout, sd_m=0.02), PLACE, DETAILS)["features"]
    assert found["properties"]["vehicle_impact"] == impact
    assert [lane["status"] for lane in found["properties"]["lanes"]] == lane_statuses
    if zone != "lane_shift":  # its lanes keep 12 ft
        assert not any("restrictions" in lane for lane in found["properties"]["lanes"])


@pytest.mark.parametrize(("sd_m", "verified"), [(10.0, True), (20.0, False)])
def test_end_is_known_as_well_as_its_probability_falls(sd_m: float, verified: bool) -> None:
    exact = lane_map_of(load_scenario(SCENARIOS / "right_lane.toml").layout())
    p_open = exact.lanes[0].p_open.copy()
    end = exact.stations[np.flatnonzero(p_open.min(axis=1) < 0.35)[-1]]
    behind = exact.stations > end - 100
    p_open[behind] = norm.cdf(exact.stations[behind], loc=end, scale=sd_m)[:, None]
    unsure = replace(exact, lanes=(replace(exact.lanes[0], p_open=p_open), *exact.lanes[1:]))
    zone = verified_zone(unsure)
    assert zone is not None
    assert zone.end_m == pytest.approx(end, abs=1.0)
    assert zone.end_sd_m == pytest.approx(sd_m, rel=0.05)
    assert zone.start_sd_m < 3
    assert (zone.closed_lanes, zone.shifted) == ((0,), ())
    assert published_zone(unsure, PLACE, DETAILS)["features"][-1]["properties"]["is_end_position_verified"] is verified


def test_slow_drift_of_a_lane_from_the_axis_is_no_shift() -> None:
    exact = lane_map_of(load_scenario(SCENARIOS / "right_lane.toml").layout())
    drift = 3.0 * np.sin(exact.stations / 400.0)  # at most 3 m in 400 m
    moved = tuple(replace(lane, right=lane.right + drift, left=lane.left + drift) for lane in exact.lanes)
    zone = verified_zone(replace(exact, lanes=moved))
    assert zone is not None
    assert (zone.closed_lanes, zone.shifted) == ((0,), ())


def test_zone_that_goes_on_beyond_the_map_has_an_end_that_nobody_knows() -> None:
    exact = lane_map_of(load_scenario(SCENARIOS / "right_lane.toml").layout())
    closed = np.minimum(exact.lanes[0].p_open, np.where(exact.stations[:, None] > 700, 0.01, 1.0))
    zone = verified_zone(replace(exact, lanes=(replace(exact.lanes[0], p_open=closed), *exact.lanes[1:])))
    assert zone is not None
    assert zone.end_sd_m == float("inf")
    assert zone.end_m == exact.stations[-1]
