"""A zone with a beginning and an end in time, in SUMO's own runs."""

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from placement.networks import freeway, placed_on_freeway, zone
from placement.study_case import scenario_file

from wzsumo.errors import PlacementError
from wzsumo.placement.net import Net
from wzsumo.placement.placement import place_zone
from wzsumo.placement.study.zone_times import ZoneTimes, timed_lanes
from wzsumo.placement.zone_file import ZoneToPlace
from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.fleet import run_to_end


def test_zone_stands_when_a_crew_at_walking_speed_has_come_to_its_end() -> None:
    placed = placed_on_freeway("m3", 300.0)
    taper = next(area for area in placed.layout.areas if area.name.startswith("merging taper"))
    begin, end = ZoneTimes(begin=100.0, end=2000.0).standing(placed.closed)
    assert begin == pytest.approx(100 + (placed.layout.end - taper.start) / 1.4, abs=10)
    assert end == 2000.0


def test_zone_that_would_be_taken_away_before_it_stands_is_refused() -> None:
    placed = placed_on_freeway("m3", 300.0)
    with pytest.raises(PlacementError, match=r"set up from 100 s .* begin earlier or end later"):
        ZoneTimes(begin=100.0, end=200.0).check(placed.closed, duration=3600.0)


def test_zone_that_shifts_open_lanes_cannot_have_a_time() -> None:
    shoulders = {"left_shoulder_ft": 10.0, "right_shoulder_ft": 10.0}
    to_place = ZoneToPlace.model_validate({"work_zone": zone(shift_ft=4.0).work_zone, "road": shoulders})
    placed = place_zone(Net.read(freeway()), to_place, edge_id="m3", position=300.0)
    with pytest.raises(PlacementError, match=r"the zone moves lane .* which stays open"):
        ZoneTimes(begin=0.0).check(placed.closed, duration=3600.0)


def test_lanes_are_barred_from_where_the_taper_begins_to_where_the_lane_opens_again() -> None:
    placed = placed_on_freeway("m3", 300.0)
    barred = timed_lanes(placed.closed)
    assert {index for _, index in barred} == {0}
    taper = next(area for area in placed.layout.areas if area.name.startswith("merging taper"))
    assert min(barred.values()) <= taper.start < max(barred.values()) < placed.layout.end


def test_vehicles_use_the_lane_before_and_after_and_not_while_the_zone_stands(tmp_path: Path) -> None:
    times = "closed_from_s = 80\nclosed_for_s = 170"
    scenario = load_scenario(scenario_file("timed", times=times, duration=330, warm_up=240))
    facility = scenario.facility()
    stands, opens = facility.standing
    assert 80 < stands < 240 < opens == 250
    files = scenario.write_sumo_files(tmp_path)
    fcd = tmp_path / "fcd.xml"
    options = ("--fcd-output", str(fcd), "--fcd-output.attributes", "lane")
    run_to_end(files, options=options, on_second=lambda _: None)
    barred = {"e2.wz1_1", "e2.wz2_1"}
    seen = [
        float(step.get("time", 0)) - 28800
        for step in ET.parse(fcd).getroot()
        if any(vehicle.get("lane") in barred for vehicle in step)
    ]
    assert min(seen) < 80
    assert [time for time in seen if stands <= time < opens] == []
    assert max(seen) > opens
