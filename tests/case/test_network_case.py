"""Whole cases in a network: traffic with and without the zone, map and drive, from the files to result.json."""

import functools
import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from placement.networks import new_folder
from placement.study_case import scenario_file

import wzsumo
from wzsumo.scenario.scenario import load_scenario


@functools.cache
def run() -> tuple[Path, dict[str, Any]]:
    """The result folder and result.json of the street's case."""
    out = new_folder() / "run"
    wzsumo.run_case(load_scenario(scenario_file("placed")), out, methods=["lanes"])
    return out, json.loads((out / "result.json").read_text())


def test_ego_learns_from_the_traces_of_the_network_and_reaches_its_goal_beside_the_closed_lane() -> None:
    _, result = run()
    method = result["methods"]["lanes"]
    assert (method["outcome"], method["n_traces"]) == ("REACHED_GOAL", 3)
    assert method["driven"]["closed_area_share"] == 0
    assert method["min_clearance_devices_m"] > 0
    assert method["iou"] > 0.7


def test_times_count_from_the_beginning_of_a_simulation_that_begins_at_8_o_clock() -> None:
    out, _ = run()
    traces = pd.read_parquet(out / "traces.parquet")
    assert 0 < traces["time_s"].min() < traces["time_s"].max() < 150
    assert pd.read_csv(out / "drives" / "lanes.csv")["time_s"].iloc[0] == pytest.approx(80, abs=5)


def test_no_vehicle_enters_the_closed_area_and_vehicles_are_as_large_as_their_types_say() -> None:
    out, result = run()
    assert result["fleet"]["n_in_closed_area"] == 0
    assert result["fleet"]["n_passed"] > 5
    traffic = pd.read_parquet(out / "drives" / "lanes_traffic.parquet")
    sizes = {tuple(size) for size in traffic[["length_m", "width_m"]].drop_duplicates().to_numpy()}
    assert sizes <= {(4.6, 1.7), (6.5, 2.16)}


def test_network_is_measured_with_and_without_the_zone_and_the_change_is_their_difference() -> None:
    out, result = run()
    network = result["network"]
    with_zone, without = network["with_zone"], network["without_zone"]
    assert with_zone["n_vehicles"] == without["n_vehicles"] == 30 + 8  # every 5 s and every 20 s for 150 s
    assert network["change"]["delay_h"] == pytest.approx(with_zone["delay_h"] - without["delay_h"])
    assert 0 < without["corridor_delay_h"] <= without["delay_h"]
    edges = pd.read_csv(out / "traffic" / "edges.csv").set_index("edge_id")
    assert set(edges.index[edges["shape"].notna()]) == {"e1", "e2", "e3", "ramp"}
    # SUMO's trips and its edges count the same time lost.
    assert edges["delay_with_zone_s"].sum() / 3600 == pytest.approx(with_zone["delay_h"], rel=0.05, abs=2e-3)


def test_report_shows_the_network_beside_the_corridor() -> None:
    out, _ = run()
    assert {"fig04_zone.png", "network_delay.png"} <= {path.name for path in (out / "figures").iterdir()}
    page = (out / "report.html").read_text()
    assert "<h2>Network</h2>" in page
    assert "Delay on the road of the zone" in page
    assert "asked for in the scenario" not in page  # no flow is asked for: the vehicles are those of the routes
