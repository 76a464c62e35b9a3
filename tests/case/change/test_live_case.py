"""A road that closes ahead of the ego, in SUMO: with a live map it stops, with the map of before it drives into the devices."""

from pathlib import Path

import pytest

from wzsumo.case.case import CaseResult, run_case
from wzsumo.case.files import write_case
from wzsumo.case.methods import METHODS, chosen_methods
from wzsumo.case.watch import Watch
from wzsumo.ego import Outcome
from wzsumo.errors import SpecError
from wzsumo.scenario.scenario import Scenario

CLOSED_M = 4200 * 0.3048
SCENARIO = Scenario.model_validate({
    "name": "road_closes", "seed": 3,
    "road": {"lane_count": 2, "left_shoulder_ft": 10, "right_shoulder_ft": 10, "length_ft": 6000},
    "work_zone": {"posted_speed_mph": 55, "start_ft": 2800, "closed_lanes": [1], "work_length_ft": 500},
    "simulation": {"demand": {"flow_vph": 1000, "duration_s": 420}},
    "crowd": {"penetration": 0.5}, "gnss": {"error_m": 1.0, "sampling_interval_s": 1.0}, "map": {"resolution_m": 0.5},
    "route": {"start_lane": 1, "start_before_zone_m": 600, "goal_after_zone_m": 300, "goal_lane": 1},
    "live": {
        "changed_at_s": 250, "ego_after_s": 60, "before": {"stands": False},
        "after": {"stands": False, "road_closed_ft": 4200},
    },
})  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("road_closes")


@pytest.fixture(scope="module")
def result(folder: Path) -> CaseResult:
    sumo = folder / "sumo"
    sumo.mkdir()
    return run_case(SCENARIO, methods=chosen_methods(None, SCENARIO), sumo_folder=sumo, watch=Watch())


def test_without_names_the_live_map_and_the_map_of_before_are_driven_on(result: CaseResult) -> None:
    assert list(result.methods) == ["live", "map_of_before"]


def test_ego_that_is_told_stops_ahead_of_the_closed_road(result: CaseResult) -> None:
    live = result.methods["live"]
    assert live.run is not None
    assert live.run.outcome is Outcome.NO_PATH
    assert live.run.reason.endswith("it stopped")
    log = live.run.log
    assert log["x_m"].iloc[-1] + SCENARIO.vehicle.axle_to_bumper_m < CLOSED_M
    assert log["speed_mps"].iloc[-1] < 0.3
    assert log["speed_mps"].diff().min() > -5.0 * 0.05


def test_ego_that_keeps_the_map_of_before_runs_into_the_devices(result: CaseResult) -> None:
    before = result.methods["map_of_before"]
    assert before.run is not None
    assert before.run.outcome is Outcome.STRUCK_DEVICE
    assert before.run.replans == ()
    assert before.run.log["x_m"].iloc[-1] == pytest.approx(CLOSED_M, abs=8.0)


def test_closed_road_is_named_once_within_a_few_traces_and_nothing_before(result: CaseResult) -> None:
    figures = result.methods["live"].figures
    assert figures["false_alarms"] == []
    (alarm,) = figures["alarms"]
    assert alarm["kind"] == "road_closed"
    assert alarm["n_traces"] <= 5
    assert alarm["start_m"] == pytest.approx(CLOSED_M - 60.0, abs=50.0)  # traffic leaves the road 60 m ahead
    assert alarm["at_s"] > 310.0


def test_traffic_leaves_the_closed_road_ahead_of_its_devices(result: CaseResult) -> None:
    assert result.collected["x_m"].max() < CLOSED_M - 40.0
    assert result.collected["time_s"].min() >= 250.0


def test_result_has_alarms_and_replans_and_no_crowd(result: CaseResult, folder: Path) -> None:
    assert result.crowd is None
    content = write_case(result, folder)
    live = content["methods"]["live"]
    assert [one["kind"] for one in live["alarms"]] == ["road_closed"]
    assert live["replans"]
    assert live["n_traces"] is None
    assert content["methods"]["map_of_before"]["alarms"] == live["alarms"]


@pytest.mark.parametrize("method", ["lanes", "slam_raw"])
def test_method_of_an_unchanging_zone_is_refused(method: str) -> None:
    with pytest.raises(SpecError, match=r"section \[live\]"):
        chosen_methods([method], SCENARIO)
    with pytest.raises(SpecError, match=r"section \[live\]"):
        chosen_methods(["live"], SCENARIO.model_copy(update={"live": None}))
    assert METHODS["hd_map"] in chosen_methods(["hd_map"], SCENARIO)
