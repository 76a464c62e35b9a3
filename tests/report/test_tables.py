from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from wzsumo.figures.traffic_figures import draw_space_time
from wzsumo.files.result_folder import ResultFolder
from wzsumo.metrics.traffic import MINUTE_COLUMNS, STATION_COLUMNS, VEHICLE_COLUMNS, TrafficSummary
from wzsumo.report.tables import conduct_rows, goal_rows, outcome_code, outcome_in_words

LAYOUT = {"areas": [{"name": "merging taper", "start_m": 200, "end_m": 400}, {"name": "work $", "start_m": 400, "end_m": 800}]}


def test_space_time_diagram_shows_every_cell_at_its_time_and_station(tmp_path: Path) -> None:
    time, station = np.meshgrid(np.arange(0, 60, 10.0), np.arange(0, 1000, 20.0), indexing="ij")
    speed = np.where(station < 300, 5.0, 25.0)
    speed[0, 10:] = np.nan
    columns = {"time_s": time, "station_m": station, "speed_mps": speed}
    cells = pd.DataFrame({name: values.ravel() for name, values in columns.items()})
    figure = draw_space_time(ResultFolder(folder=tmp_path, result={}, layout=LAYOUT), cells)
    axes, scale = figure.axes
    (mesh,) = axes.collections
    shown: np.ma.MaskedArray[Any, Any] = np.ma.asarray(mesh.get_array())
    assert shown.shape == (50, 6)  # stations up, times across
    np.testing.assert_array_equal(shown.filled(np.nan), speed.T)
    assert axes.get_xlim() == (0, 60)
    assert axes.get_ylim() == (0, 1000)
    assert scale.get_ylabel() == "speed [m/s]"
    assert mesh.get_clim() == pytest.approx((0.0, 25.0))


@pytest.mark.parametrize("traffic", [{"locked_s": 30.0, "locked_station_m": 350.0}, {"locked_s": None}, {}])
def test_space_time_diagram_marks_where_the_traffic_locked_if_it_did(tmp_path: Path, traffic: dict[str, float | None]) -> None:
    cells = pd.DataFrame({"time_s": [0.0, 10.0] * 2, "station_m": [0.0, 0.0, 20.0, 20.0], "speed_mps": 5.0})
    figure = draw_space_time(ResultFolder(folder=tmp_path, result={"traffic": traffic}, layout=LAYOUT), cells)
    marks = [line.get_xydata() for line in figure.axes[0].lines if line.get_marker() == "x"]
    if traffic.get("locked_s") is None:
        assert marks == []
    else:
        np.testing.assert_array_equal(marks, [[[30.0, 350.0]]])


def test_page_of_measures_names_every_figure_and_column_of_a_run() -> None:
    page = (Path(__file__).parents[2] / "docs" / "method" / "metrics.md").read_text(encoding="utf-8")
    figures = [field.name for field in fields(TrafficSummary)]
    assert {
        name for name in [*figures, *VEHICLE_COLUMNS, *MINUTE_COLUMNS, *STATION_COLUMNS] if f"`{name}`" not in page
    } == set()


@pytest.mark.parametrize(
    ("outcome", "plan_status", "code", "words"),
    [
        ("NO_PATH", "NO_PATH", "NO_PATH", "no path"),
        ("NO_PATH", "LIMIT_REACHED", "LIMIT_REACHED", "planner gave up at its limit"),
        ("NO_PATH", "START_OCCUPIED", "START_OCCUPIED", "start is not free"),
        ("NO_PATH", "FOUND", "NO_PATH", "no path"),  # none on a map that came on the way
        ("REACHED_GOAL", "FOUND", "REACHED_GOAL", "reached goal"),
    ],
)
def test_planner_that_gave_up_is_not_told_as_a_map_without_a_path(
    outcome: str, plan_status: str, code: str, words: str
) -> None:
    figures = {"outcome": outcome, "plan_status": plan_status, "planned_outcome": outcome}
    assert outcome_code(figures) == code
    assert outcome_in_words(figures) == words
    assert goal_rows({"swept": {"goals": {"own_lane": figures}}})[0]["goals"][0]["outcome"] == words


def test_conduct_row_says_clean_or_what_was_not_and_leaves_out_what_did_not_drive() -> None:
    conduct = {
        "n_unprompted_stops": 1, "n_stops": 2, "braking_unprompted_mps2": 3.46, "braking_asked_behind_mps2": 2.0,
        "max_jerk_1s_mps3": 1.0, "over_line_share": 0.021, "mean_off_middle_m": 0.1, "sd_off_middle_m": 0.05,
        "n_lane_changes": 1, "n_needed_changes": 0, "min_time_gap_s": None,
    }  # fmt: skip
    methods: dict[str, dict[str, Any]] = {
        "lanes": {"conduct": conduct, "clean": False, "faults": "braked 3.5 m/s2 (limit 3.4)"},
        "swept": {"conduct": conduct, "clean": True, "faults": ""},
        "paper": {"conduct": None},
    }
    lanes, swept = conduct_rows(methods)
    assert (lanes["verdict"], swept["verdict"]) == ("braked 3.5 m/s2 (limit 3.4)", "clean")
    assert (lanes["stops"], lanes["braking"], lanes["over_line"], lanes["time_gap"]) == ("1 of 2", "3.5 m/s²", "2.1 %", "-")
