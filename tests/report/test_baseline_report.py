from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import paper_layout
from matplotlib.figure import Figure

from wzsumo.figures.map_figures import draw_baseline_paths, draw_crowd_and_slam
from wzsumo.files.layout import layout_geojson
from wzsumo.files.result_folder import ResultFolder
from wzsumo.files.ros_map import write_map
from wzsumo.grid import blank_grid
from wzsumo.path import ReferencePath
from wzsumo.report.report import best_method
from wzsumo.report.tables import goal_rows, goals_of


@pytest.fixture
def run(tmp_path: Path) -> ResultFolder:
    """Two maps of the paper's zone, free everywhere, and a path on each to the own lane, on one to the open lane too."""
    (tmp_path / "maps").mkdir()
    (tmp_path / "paths").mkdir()
    path = ReferencePath(poses=np.array([[200.0, 5.0, 0.0], [900.0, 5.0, 0.0], [1400.0, 5.0, 0.0]]))
    for name in ("swept", "slam_raw"):
        write_map(blank_grid((200, -5, 1400, 16), resolution=1.0, p_occupied=0.0), tmp_path / "maps", name=name)
        path.to_csv(tmp_path / "paths" / f"{name}.csv")
    path.to_csv(tmp_path / "paths" / "slam_raw_to_open_lane.csv")
    return ResultFolder(
        folder=tmp_path, result={"methods": {"swept": {}, "slam_raw": {}}}, layout=layout_geojson(paper_layout())
    )


def labels_of(figure: Figure) -> set[str]:
    return {text.get_text() for text in figure.legends[0].get_texts()}


def test_every_baseline_has_a_row_with_both_its_paths(run: ResultFolder) -> None:
    figure = draw_baseline_paths(run, ["slam_raw", "hd_map"])
    assert len(figure.axes) == 2
    assert [len(axes.lines) for axes in figure.axes] == [2, 0]
    assert {"path to the ego's own lane", "path to the open lane", "drivable area", "free"} <= labels_of(figure)


def test_crowd_and_slam_stand_in_one_figure_with_the_truth(run: ResultFolder) -> None:
    figure = draw_crowd_and_slam(run, "swept", "slam_raw")
    assert labels_of(figure) >= {"free by the crowd (swept)", "occupied by slam_raw", "drivable area (truth)", "path on swept"}


def test_best_method_is_one_of_the_crowd_even_where_a_baseline_scores_higher() -> None:
    methods = {"swept": {"outcome": "REACHED_GOAL", "iou": 0.7}, "slam_barrier": {"outcome": "REACHED_GOAL", "iou": 0.9}}
    assert best_method(methods) == "swept"
    assert best_method({"slam_barrier": methods["slam_barrier"]}) is None


def test_goal_rows_say_what_the_path_to_each_goal_does_and_dash_what_there_is_not() -> None:
    goals: dict[str, Any] = {
        "own_lane": {"planned_outcome": "STRUCK_DEVICE", "closed_area_share": 0.425, "n_devices_struck": 8},
        "open_lane": {"planned_outcome": "NO_PATH", "closed_area_share": None, "n_devices_struck": None},
    }
    methods: dict[str, dict[str, Any]] = {"hd_map": {"goals": goals}, "old": {"precision": 1.0}}
    (row,) = goal_rows(methods)
    assert row["name"] == "hd_map"
    assert row["goals"] == [
        {"outcome": "struck device", "closed": "42.5 %", "struck": "8"},
        {"outcome": "no path", "closed": "-", "struck": "-"},
    ]


def test_run_with_one_goal_has_the_columns_of_that_goal_alone() -> None:
    methods: dict[str, Any] = {
        "swept": {"goals": {"own_lane": {"planned_outcome": "REACHED_GOAL"}}},
        "lanes": {"goals": {"own_lane": {}}},
    }
    assert goals_of(methods) == ["own_lane"]
    assert [len(row["goals"]) for row in goal_rows(methods)] == [1, 1]
