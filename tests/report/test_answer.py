"""The head of a run's report: what it answers where drives end so or so."""

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from wzsumo.files.result_folder import ResultFolder
from wzsumo.report.answer import key_figures, sentences

TRAFFIC = {"n_vehicles": 209, "throughput_vph": 821.5, "mean_delay_s": 6.1, "max_queue_length_m": 201.0}


def run_of(
    folder: Path, method: dict[str, Any] | None, *, driven_m: float | None = 500.0, traffic: Any = TRAFFIC
) -> ResultFolder:
    if driven_m is not None:
        (folder / "drives").mkdir(exist_ok=True)
        pd.DataFrame({"s_m": [0.0, driven_m]}).to_csv(folder / "drives" / "swept.csv", index=False)
    methods = {} if method is None else {"swept": method}
    return ResultFolder(folder=folder, result={"n_traces": 5, "methods": methods, "traffic": traffic}, layout={})


@pytest.mark.parametrize(
    ("method", "driven_m", "answer"),
    [
        (
            {"outcome": "REACHED_GOAL", "clean": True}, 1086.0,
            "Yes: on a map of 5 traces (method “swept”) the vehicle drove the 1086 m to its goal and kept within all limits of "
            "conduct.",
        ),
        (
            {"outcome": "REACHED_GOAL", "clean": False, "faults": "braked 5.7 m/s2 (limit 3.4)"}, 1086.0,
            "Yes, but not cleanly: on a map of 5 traces (method “swept”) the vehicle drove the 1086 m to its goal, yet braked "
            "5.7 m/s2 (limit 3.4).",
        ),
        (
            {"outcome": "STRUCK_DEVICE", "reason": "a corner touched a cone"}, 230.0,
            "No: on a map of 5 traces (method “swept”) the drive ended after 230 m: struck device (a corner touched "
            "a cone).",
        ),
        (
            {"outcome": "NO_PATH", "plan_status": "LIMIT_REACHED"}, None,
            "No: on a map of 5 traces (method “swept”) no path was found, so nothing was driven (planner gave up "
            "at its limit).",
        ),
    ],
)  # fmt: skip
def test_first_sentence_says_how_the_drive_ended(
    method: dict[str, Any], driven_m: float | None, answer: str, tmp_path: Path
) -> None:
    assert sentences(run_of(tmp_path, method, driven_m=driven_m), "swept")[0] == answer


@pytest.mark.parametrize(
    ("changes", "answer"),
    [
        ({}, "The zone let 822 veh/h through, each lost 6 s on average and a queue reached back 201 m at most "
             "(n = 209 vehicles, one simulation)."),
        ({"max_queue_length_m": 0.0, "throughput_vph": None}, "Each lost 6 s on average and no queue formed "
             "(n = 209 vehicles, one simulation)."),
        ({"locked_s": 720.0, "locked_station_m": 440.0}, "The traffic locked after 12 min: a vehicle at 440 m stood and never "
             "drove on, so delays and flows hold up to then."),
    ],
)  # fmt: skip
def test_second_sentence_says_what_the_zone_does_to_traffic(changes: dict[str, Any], answer: str, tmp_path: Path) -> None:
    assert sentences(run_of(tmp_path, None, traffic=TRAFFIC | changes), None)[1] == answer


def test_run_without_a_map_of_traces_does_not_answer(tmp_path: Path) -> None:
    assert sentences(run_of(tmp_path, None, traffic={}), None)[0].startswith("No map of traces was made")


def test_six_figures_keep_their_limits_or_do_not(tmp_path: Path) -> None:
    method = {
        "outcome": "REACHED_GOAL",
        "driven": {"min_clearance_devices_m": 0.2, "closed_area_share": 0.01},
        "conduct": {"min_time_gap_s": None, "braking_unprompted_mps2": 3.4},
    }
    traffic = TRAFFIC | {"mean_delay_s": 721.0, "max_queue_length_m": 1207.0}
    figures = key_figures(run_of(tmp_path, method, traffic=traffic), "swept")
    assert [(each.value, each.kept) for each in figures] == [
        ("0.20 m", False), ("1.0 %", False), ("3.4 m/s²", True), ("nobody to follow", None), ("721 s", False), ("1207 m", True),
    ]  # fmt: skip
    at_limit = method | {"driven": {"min_clearance_devices_m": 0.23}}
    assert key_figures(run_of(tmp_path, at_limit), "swept")[0].kept
    # The limits are those of the drive's conduct: what is beside a vehicle of the greatest legal width in the narrowest lane,
    # AASHTO's deceleration, the smallest gap of ISO 15622.
    assert [each.limit for each in figures[:4]] == ["at least 0.23 m", "0 %", "at most 3.4 m/s²", "at least 0.8 s"]
