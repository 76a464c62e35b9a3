import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
from builders import straight_traces
from case.finished_plans import SAFE_Y, coarse_paper, coarse_site, plan_of, run_along, straight_path

from wzsumo.case.assessment import assess
from wzsumo.case.case import CaseResult
from wzsumo.case.crowd import Crowd
from wzsumo.case.evaluation import MethodResult
from wzsumo.case.files import result_json, write_case
from wzsumo.case.lidar_baseline import LidarBaseline
from wzsumo.case.map_method import MadeMap
from wzsumo.case.zone import FleetMeasures
from wzsumo.crowd_mapping.mixture.maps import MixtureSpec
from wzsumo.ego import EgoRun
from wzsumo.files.ros_map import read_map
from wzsumo.grid import UNKNOWN
from wzsumo.metrics.fleet import summarise_fleet
from wzsumo.metrics.traffic import measure_traffic
from wzsumo.planning.plan import Plan
from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.trips import TRIP_COLUMNS

SITE = coarse_site()
FLEET = straight_traces([1.83, 5.49, 5.6], length_m=1500.0, step_m=5.0).assign(length_m=4.8, width_m=1.85)
IDS = ["v000", "v001", "v002"]


def method_result(plan: Plan, run: EgoRun | None = None) -> MethodResult:
    """The result of a method whose map is unknown in its first row and free elsewhere."""
    p_occupied = np.zeros(SITE.cells.shape)
    p_occupied[0] = UNKNOWN
    grid = SITE.cells.with_p_occupied(p_occupied)
    figures = assess(MadeMap(grid, {}), plan, run, crowd=None, over_zone=FLEET, scenario=coarse_paper(), site=SITE)
    return MethodResult(made=MadeMap(grid, {}), plan=plan, run=run, figures=figures)


def a_case(**changes: Any) -> CaseResult:
    """Three traces collected, of which two are used; "driven" found a path and drove it, "closed" found none."""
    trips = pd.DataFrame(
        [(name, 0.0, True, True, 75.0, 3.0, 3.0, 1500.0, 300.0, 0.2, 90.0) for name in IDS], columns=list(TRIP_COLUMNS)
    )
    traffic = measure_traffic(FLEET, trips, SITE.layout, dt=0.25, warm_up_s=10.0)
    path = straight_path(SAFE_Y)
    given: dict[str, Any] = {
        "scenario": coarse_paper(),
        "fleet": FleetMeasures(summary=summarise_fleet(FLEET, SITE.layout), traffic=traffic),
        "collected": FLEET,
        "crowd": Crowd(
            traces=FLEET[FLEET["vehicle_id"] != "v001"], road=SITE.layout.road, spec=MixtureSpec(k_max=2, n_samples=50), seed=1
        ),
        "lidar": None,
        "methods": {"driven": method_result(plan_of(path), run_along(path)), "closed": method_result(plan_of(None))},
        "to_open_lane": {"driven": plan_of(straight_path(1.83)), "closed": plan_of(None)},
        "seconds": {"network": 1.5},
        "warnings": [],
    }
    assert given["crowd"].mixture.n_components >= 1  # fitted, as a method of mixtures asks for it
    return CaseResult(**given | changes)


@pytest.fixture(scope="module")
def case() -> CaseResult:
    return a_case()


@pytest.fixture(scope="module")
def folder(case: CaseResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("case")
    write_case(case, folder)
    return folder


def test_case_writes_a_map_for_each_method_and_a_path_and_a_drive_where_there_is_one(folder: Path) -> None:
    assert {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()} == {
        "result.json", "scenario.toml", "layout.geojson", "devices.csv", "traces.parquet",
        "mixture_sweep.csv", "mixture.json", "samples.csv",
        "traffic/vehicles.csv", "traffic/minutes.csv", "traffic/stations.csv", "traffic/cells.parquet",
        "maps/driven.yaml", "maps/driven.pgm", "maps/closed.yaml", "maps/closed.pgm",
        "paths/driven.csv", "paths/driven_to_open_lane.csv", "drives/driven.csv", "drives/driven_traffic.parquet",
    }  # fmt: skip


def test_traces_are_all_that_were_collected_with_a_mark_at_those_of_the_map(folder: Path) -> None:
    traces = pd.read_parquet(folder / "traces.parquet")
    pd.testing.assert_frame_equal(traces.drop(columns="used"), FLEET)
    assert traces.groupby("vehicle_id")["used"].mean().to_dict() == {"v000": 1.0, "v001": 0.0, "v002": 1.0}


def test_mixture_and_samples_are_read_back_as_they_were_learned(case: CaseResult, folder: Path) -> None:
    assert case.crowd is not None
    mixture = json.loads((folder / "mixture.json").read_text())
    for name in ("weights", "means", "covariances"):
        np.testing.assert_array_equal(mixture[name], getattr(case.crowd.mixture, name))
    tried = pd.read_csv(folder / "mixture_sweep.csv")
    assert tried["n_components"].tolist() == [1, 2]
    np.testing.assert_allclose(tried["bic"], case.crowd.sweep.table["bic"])
    samples = pd.read_csv(folder / "samples.csv")
    assert list(samples.columns) == ["x_m", "y_m"]
    np.testing.assert_allclose(samples, case.crowd.samples, atol=0.5e-4)


def test_map_path_and_drive_of_a_method_are_read_back_as_they_were(folder: Path) -> None:
    grid = read_map(folder / "maps" / "driven.yaml")
    assert grid.free[1:].all()
    assert not grid.free[0].any()
    path = pd.read_csv(folder / "paths" / "driven.csv")
    np.testing.assert_allclose(path[["x_m", "y_m"]], straight_path(SAFE_Y).poses[:, :2])
    np.testing.assert_allclose(pd.read_csv(folder / "paths" / "driven_to_open_lane.csv")["y_m"], 1.83)
    drive = pd.read_csv(folder / "drives" / "driven.csv")
    np.testing.assert_allclose(drive["time_s"], 200 + 0.1 * np.arange(101))  # 100 m at 10 m/s
    assert pd.read_parquet(folder / "drives" / "driven_traffic.parquet").empty


def test_traffic_tables_are_read_back_as_they_were_measured(case: CaseResult, folder: Path) -> None:
    traffic = case.fleet.traffic
    for name in ("vehicles", "minutes", "stations"):
        table = pd.read_csv(folder / "traffic" / f"{name}.csv")
        pd.testing.assert_frame_equal(table, getattr(traffic, name), check_dtype=False, rtol=0, atol=0.5e-4)
    pd.testing.assert_frame_equal(pd.read_parquet(folder / "traffic" / "cells.parquet"), traffic.grid.table())


def test_scenario_of_a_case_is_read_back_as_it_was_run(folder: Path) -> None:
    assert load_scenario(folder / "scenario.toml") == coarse_paper()


def test_result_is_what_its_file_holds_with_null_where_a_figure_is_not_a_number(case: CaseResult, tmp_path: Path) -> None:
    content = write_case(case, tmp_path)
    text = (tmp_path / "result.json").read_text()
    assert json.loads(text) == content
    assert text.startswith('{\n  "scenario": "paper",')
    assert content["traffic"]["breakdown_s"] is None  # three vehicles do not break down
    assert content["methods"]["driven"]["drive"]["min_ttc_s"] is None  # no other vehicle was near
    assert content["methods"]["driven"]["outcome"] == "REACHED_GOAL"
    assert content["methods"]["closed"]["reason"] == "NO_PATH: no free corridor"


def test_result_counts_traces_and_components_and_names_the_rule_and_the_times(case: CaseResult) -> None:
    assert case.crowd is not None
    result = result_json(case)
    assert (result["n_collected"], result["n_traces"]) == (3, 2)
    assert (result["n_components"], result["n_components_rule"]) == (case.crowd.mixture.n_components, "bic")
    assert result["timings_s"] == {"network": 1.5}
    assert result["fleet"]["n_passed"] == 3
    assert list(result["methods"]) == ["driven", "closed"]


def test_capacity_by_the_hcm_is_given_for_a_freeway_and_not_for_a_zone_driven_by_turns(case: CaseResult) -> None:
    # Two of three lanes: 2093 - 154 x 0.75 - 194 (cones) = 1783.5 pc/h/lane; x 2 lanes / 1.1 with 10 % trucks.
    of_freeway = result_json(case)["traffic"]["hcm_queue_discharge_vph"]
    assert case.scenario.simulation.demand.truck_share == 0.1
    assert of_freeway == pytest.approx(2 * 1783.5 / 1.1)
    by_turns = replace(case, scenario=load_scenario("scenarios/one_lane_flaggers.toml"))
    assert result_json(by_turns)["traffic"]["hcm_queue_discharge_vph"] is None


def test_case_without_a_mapping_drive_says_that_slam_was_not_run_and_one_with_it_has_its_figures(case: CaseResult) -> None:
    without = result_json(case)
    assert without["slam"] == {}
    assert "make baselines" in without["not_run"]["slam"]
    maps = SimpleNamespace(devices=np.zeros((5, 2)), links=np.zeros((3, 2)))
    lidar = cast(
        "LidarBaseline",
        SimpleNamespace(
            vehicle_id="v7", poses=np.zeros((9, 4, 4)), states={"OK": 9}, ate_m=0.02, dead_reckoning_ate_m=1.5, maps=maps
        ),
    )
    with_lidar = result_json(replace(case, lidar=lidar))
    assert with_lidar["not_run"] == {}
    assert with_lidar["slam"] == {
        "vehicle_id": "v7", "n_scans": 9, "scan_states": {"OK": 9}, "ate_m": 0.02, "dead_reckoning_ate_m": 1.5,
        "n_devices_mapped": 5, "n_links": 3,
    }  # fmt: skip


def test_case_without_a_method_of_mixtures_fits_none_and_writes_none(tmp_path: Path) -> None:
    crowd = Crowd(traces=FLEET, road=SITE.layout.road, spec=MixtureSpec(k_max=2, n_samples=50), seed=1)
    content = write_case(a_case(crowd=crowd), tmp_path)
    assert content["n_components"] is None
    assert not any((tmp_path / name).exists() for name in ("mixture.json", "mixture_sweep.csv", "samples.csv"))
