from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from sweep_trials import a_study

from wzsumo.case.case import CaseResult, run_case
from wzsumo.case.evaluation import table_row
from wzsumo.case.files import result_json
from wzsumo.case.methods import method_named
from wzsumo.case.watch import Watch
from wzsumo.sweep.evaluation.study_case import StudyCase
from wzsumo.sweep.evaluation.tasks import evaluate_cases, read_simulated, simulate
from wzsumo.sweep.results import MEASURED_COLUMNS

SHORT = {
    "simulation.demand.duration_s": 200.0, "simulation.demand.flow_vph": 1200.0, "work_zone.work_length_ft": 200.0,
    "map.resolution_m": 0.25, "mixture.k_max": 10, "control.target_speed_mps": 20.0,
}  # fmt: skip
SMALL_LIDAR = {
    "slam.lidar.layers": 32, "slam.lidar.azimuth_count": 300, "slam.lidar.rate_hz": 2.0, "simulation.demand.duration_s": 300.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def simulated() -> bytes:
    return simulate(a_study(fixed=SHORT, seed=[21]).cases[0].scenario)


def rows_of(simulated: bytes, **study: Any) -> list[dict[str, Any]]:
    return [measured(row) for row in evaluate_cases(simulated, a_study(fixed=SHORT, **study).cases)]


def measured(row: dict[str, Any]) -> dict[str, Any]:
    """What the table keeps of a row: all but how long it took."""
    return {name: row[name] for name in ("case", *MEASURED_COLUMNS) if name in row}


def run_alone(case: StudyCase, folder: Path) -> CaseResult:
    """The case as `wzsumo run` has it."""
    return run_case(case.scenario, methods=[method_named(case.method)], sumo_folder=folder, watch=Watch())


@pytest.mark.parametrize("method", ["swept", "hd_map"])
def test_row_of_a_case_has_every_figure_of_the_same_case_run_alone(simulated: bytes, tmp_path: Path, method: str) -> None:
    study = a_study(drive=True, methods=(method,), fixed=SHORT, seed=[21], crowd__used=[3], crowd__penetration=[0.5])
    (row,) = evaluate_cases(simulated, study.cases)
    alone = run_alone(study.cases[0], tmp_path)
    figures = table_row(alone.methods[method], lidar=None, drives=True)
    shared = sorted((figures.keys() & row.keys()) - {"plan_ms"})  # which depends on the machine's load
    assert {"iou", "plan_status", "outcome", "planned_min_clearance_devices_m", "driven_max_braking_mps2"} <= set(shared)
    assert {name: row[name] for name in shared} == {name: figures[name] for name in shared}
    fleet = result_json(alone)["fleet"] | result_json(alone)["traffic"]
    for name in ("n_passed", "throughput_vph", "mean_delay_s", "n_hard_braking"):
        assert row[f"fleet_{name}"] == fleet[name]


def test_cases_evaluated_together_and_alone_give_the_same_rows(simulated: bytes) -> None:
    factors: dict[str, Any] = {"seed": [21], "crowd.used": [3], "crowd.penetration": [0.3, 0.6], "gnss.error_m": [0.0, 1.0]}
    study = a_study(fixed=SHORT, methods=("swept", "paper"), **factors)
    together = evaluate_cases(simulated, study.cases)
    alone = [row for case in study.cases for row in evaluate_cases(simulated, [case])]
    pd.testing.assert_frame_equal(pd.DataFrame(map(measured, together)), pd.DataFrame(map(measured, alone)))


def test_cases_that_share_a_map_give_the_same_rows_as_alone(simulated: bytes) -> None:
    factors: dict[str, Any] = {"seed": [21], "planner.planned_speed_mps": [10.0, 25.0], "map.resolution_m": [0.25, 0.5]}
    study = a_study(fixed={name: SHORT[name] for name in SHORT if name != "map.resolution_m"}, methods=("swept",), **factors)
    together = evaluate_cases(simulated, study.cases)
    alone = [row for case in study.cases for row in evaluate_cases(simulated, [case])]
    pd.testing.assert_frame_equal(pd.DataFrame(map(measured, together)), pd.DataFrame(map(measured, alone)))
    assert len({row["iou"] for row in together}) == 2
    assert len({row["plan_speed_mps"] for row in together}) == 2


def test_more_traces_than_the_fleet_gives_are_a_refused_case_and_not_a_failure(simulated: bytes) -> None:
    done, refused = rows_of(simulated, seed=[21], crowd__used=[1, 500])
    assert (done["status"], refused["status"]) == ("DONE", "REFUSED")
    assert "crowd.used=500 asks for more traces than the fleet gives" in refused["reason"]


def test_minutes_to_collect_count_from_the_first_vehicle_to_the_last_equipped_one_that_is_needed(simulated: bytes) -> None:
    left_at_s = read_simulated(simulated)[0].groupby("vehicle_id")["time_s"].max().sort_values()
    (row,) = rows_of(simulated, seed=[21], crowd__used=[4], crowd__penetration=[1.0])  # everybody is equipped
    assert row["minutes_to_collect"] == pytest.approx((left_at_s.iloc[3] - left_at_s.iloc[0]) / 60)
    assert row["n_equipped"] == len(left_at_s) == row["fleet_n_passed"]


def test_lidar_maps_of_one_drive_have_the_figures_of_the_same_case_run_alone(tmp_path: Path) -> None:
    fixed = SHORT | SMALL_LIDAR | {"crowd.used": 1, "crowd.collected": 1}
    study = a_study(fixed=fixed, methods=("slam_raw", "slam_barrier"), seed=[21], slam__scene__faults__missing_share=[0.4])
    assert len({case.source for case in study.cases}) == 1
    rows = evaluate_cases(simulate(study.cases[0].scenario), study.cases)
    alone = result_json(run_alone(study.cases[1], tmp_path))
    assert [row["status"] for row in rows] == ["DONE", "DONE"]
    assert {name: rows[1][name] for name in ("n_traces", "iou")} == {
        "n_traces": None, "iou": alone["methods"]["slam_barrier"]["iou"],
    }  # fmt: skip
    for name in ("ate_m", "n_devices_mapped"):
        assert rows[0][f"slam_{name}"] == rows[1][f"slam_{name}"] == pytest.approx(alone["slam"][name])


def test_map_of_before_is_evaluated_once_whatever_the_crowd_and_the_lidar_see(simulated: bytes) -> None:
    factors: dict[str, Any] = {"seed": [21], "crowd__used": [1, 500], "slam__scene__faults__missing_share": [0.0, 0.4]}
    cases = a_study(fixed=SHORT, methods=("hd_map", "lanes"), **factors).cases
    before, crowd = ([case for case in cases if case.method == name] for name in ("hd_map", "lanes"))
    assert (len(before), len({case.evaluation for case in before}), len({case.evaluation for case in crowd})) == (4, 1, 2)
    rows = evaluate_cases(simulated, before)
    assert {row["status"] for row in rows} == {"DONE"}
    assert len({(row["iou"], row["n_expansions"]) for row in rows}) == 1
    assert "n_equipped" not in rows[0]


def test_traffic_without_a_vehicle_is_a_refused_case_and_not_a_failure() -> None:
    """One vehicle an hour, over 140 s."""
    fixed = {"simulation.demand.flow_vph": 1.0, "simulation.demand.duration_s": 140.0}
    study = a_study(seed=[1], crowd__used=[1, 2], fixed=fixed)
    rows = evaluate_cases(simulate(study.cases[0].scenario), study.cases)
    assert [row["status"] for row in rows] == ["REFUSED", "REFUSED"]
    assert {row["case"] for row in rows} == {case.id for case in study.cases}
    assert all("no vehicle entered the road" in row["reason"] for row in rows)
