import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import shapely
from PIL import Image
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

from wzsumo.errors import InputError
from wzsumo.figures.drive_reasons import slowings_of
from wzsumo.figures.zone_axes import new_figure, state_stretch
from wzsumo.files.result_folder import read_result_folder
from wzsumo.files.ros_map import write_map
from wzsumo.grid import blank_grid, cells_inside
from wzsumo.report.report import _page, best_method, write_report
from wzsumo.scenario.scenario import load_scenario
from wzsumo.spec import write_toml

SCENARIOS = Path(__file__).parents[2] / "scenarios"

HOSTILE = "<img src=x onerror=alert(1)>"
STEMS = ["fig04_zone", "fig05_criteria", "fig06_components", "fig07_samples", "fig08_maps",
         "fig09_truth_literal", "fig09_truth_swept", "fig11_drive_swept"]  # fmt: skip
DRIVABLE, CLOSED = shapely.box(0, 0, 600, 7.2), shapely.box(100, 7.2, 500, 12)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two methods over a zone from x = 100 to 500 m; only "swept" found a path and drove it."""
    folder, random = tmp_path_factory.mktemp("run"), np.random.default_rng(1)
    for name in ("maps", "paths", "drives"):
        (folder / name).mkdir()
    areas = [("merging $L$ taper", 100, 300), (HOSTILE, 300, 480), ("downstream taper", 480, 500)]
    polygons = {"drivable": DRIVABLE, "closed_area": CLOSED, "pavement": shapely.box(0, -3, 600, 12) - CLOSED}
    features = [_feature(polygon, name=name) for name, polygon in polygons.items()]
    features += [_feature(shapely.Point(x, 7.4), name="device", kind="drum", s_m=x, d_m=7.4, heading_rad=0.0, height_m=0.9,
                          radius_m=0.2, length_m=0.0) for x in range(100, 501, 20)]  # fmt: skip
    features.append(_feature(shapely.Point(20, -5), name="sign", code="W20-1", text=HOSTILE, s_m=20, d_m=-5, heading_rad=0.0))
    section = {"lane_widths_m": [3.6, 3.6], "left_shoulder_m": 4.8, "right_shoulder_m": 3.0, "opposing_lanes": 0}
    features.append(_feature(shapely.LineString([(0, 3.6), (600, 3.6)]), name="reference_line", **section))
    place = {"index": 0, "opposing": False, "start_m": 0, "end_m": 600}
    features.append(_feature(shapely.box(0, 0, 600, 3.6), name="lane", **place))
    _write_json(
        folder / "layout.geojson",
        {
            "type": "FeatureCollection",
            "areas": [{"name": n, "start_m": a, "end_m": b} for n, a, b in areas],
            "features": features,
        },
    )
    x = np.linspace(50, 550, 200)
    traces = [
        pd.DataFrame({"vehicle_id": str(i), "time_s": x / 20, "x_m": x, "y_m": 3.6 + 0.2 * i, "used": i < 2}) for i in range(3)
    ]
    pd.concat(traces).to_parquet(folder / "traces.parquet")
    k = np.arange(1, 9)
    pd.DataFrame({"n_components": k, "log_likelihood": -1000 / k, "aic": 2000 / k + k, "bic": 2000 / k + 3 * k}).to_csv(
        folder / "mixture_sweep.csv", index=False
    )
    covariance = [[900.0, 0.0], [0.0, 0.05]]
    _write_json(
        folder / "mixture.json", {"weights": [0.5] * 2, "means": [[200, 3.6], [400, 3.8]], "covariances": [covariance] * 2}
    )
    samples = random.multivariate_normal((300, 3.6), covariance, size=300)
    pd.DataFrame(samples, columns=["x_m", "y_m"]).to_csv(folder / "samples.csv", index=False)
    grid = blank_grid((50, -2, 550, 11), resolution=0.25, p_occupied=1.0)
    for name, free in (("literal", shapely.box(50, 3, 550, 4)), ("swept", shapely.box(50, 2, 550, 8.2))):
        write_map(grid.with_p_occupied(np.where(cells_inside(grid, free), 0, 1)), folder / "maps", name=name)
    drive = pd.DataFrame({"x_m": x, "y_m": 3.7, "heading_rad": 0.0, "s_m": x - 50, "curvature_1pm": 0.0})
    drive.to_csv(folder / "paths" / "swept.csv", index=False)
    drive.assign(time_s=x / 10, speed_mps=10.0, steering_rad=0.01).to_csv(folder / "drives" / "swept.csv", index=False)
    clearances = {"min_clearance_devices_m": 1.29684, "min_clearance_road_edge_m": 3.5, "closed_area_share": 0.0}
    scores = {"precision": 0.98765, "recall": 0.75432, "iou": 0.71}
    methods = {
        "literal": {"outcome": "NO_PATH", "reason": f"no way {HOSTILE}", "iou": 0.9, "precision": None, "planned": None},
        "swept": {
            "outcome": "REACHED_GOAL",
            "reason": "",
            **scores,
            "planned": clearances,
            "driven": clearances,
            "plan_ms": 12.3,
        },
    }
    result = {"scenario": HOSTILE, "seed": 7, "version": "0.1.0", "format": 1}
    result |= {"n_traces": 2, "n_components": 2, "n_components_rule": "bic"}
    fleet = {"n_vehicles": 40, "merge_position_m": {"q10": -200.0, "q50": -80.4, "q90": None}}
    not_run = {"slam": f"no LiDAR {HOSTILE}"}
    _write_json(
        folder / "result.json", result | {"methods": methods, "fleet": fleet, "not_run": not_run, "timings_s": {"plan": 1.5}}
    )
    return folder


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return write_report(folder).read_text(encoding="utf-8")


def _feature(geometry: BaseGeometry, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": mapping(geometry), "properties": properties}


def _write_json(path: Path, content: Any) -> None:
    path.write_text(json.dumps(content), encoding="utf-8")


def _cells(page: str) -> list[list[str]]:
    return [
        re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row, flags=re.S)
        for row in re.findall(r"<tr[^>]*>(.*?)</tr>", page, flags=re.S)
    ]


def test_figures_of_a_run_are_written_once_for_each_method_that_has_them(folder: Path, page: str) -> None:
    for suffix in ("png", "svg"):
        assert sorted(path.stem for path in (folder / "figures").glob(f"*.{suffix}")) == STEMS
    for stem in STEMS:
        with Image.open(folder / "figures" / f"{stem}.png") as image:
            assert image.width == 1575  # 10.5 in at 150 dpi
            assert len(image.convert("RGB").getcolors(maxcolors=1 << 24) or ()) > 20


def test_page_loads_nothing_and_links_to_itself_and_to_its_folder_alone(folder: Path, page: str) -> None:
    images = re.findall(r"""<img[^>]*?\ssrc="([^"]{0,30})""", page)
    assert len(images) == len(STEMS)
    assert all(source.startswith("data:image/png;base64,") for source in images)
    links = re.findall(r"""\shref="([^"]*)\"""", page)
    anchors = {link[1:] for link in links if link.startswith("#")}
    assert anchors
    assert anchors <= set(re.findall(r"""\sid="([^"]*)\"""", page))
    files = [link for link in links if not link.startswith("#")]
    assert {"result.json", "traces.parquet", "maps/swept.yaml", "drives/swept.csv", "figures/fig04_zone.svg"} <= set(files)
    assert all((folder / name).is_file() for name in files)
    assert not re.search(r"https?://|url\(|@import|<script", page)


def test_files_of_a_drawing_are_the_same_each_time(folder: Path, page: str) -> None:
    before = {path.name: path.read_bytes() for path in (folder / "figures").iterdir()}
    write_report(folder)
    assert {path.name: path.read_bytes() for path in (folder / "figures").iterdir()} == before


def test_hostile_names_in_a_run_are_escaped(page: str) -> None:
    assert HOSTILE not in page
    assert page.count("&lt;img src=x onerror=alert(1)&gt;") >= 3  # title, reason of the failure, reason of "not run"


def test_head_answers_in_two_sentences_and_holds_six_figures_against_their_limits(page: str) -> None:
    (answer,) = re.findall(r'<div class="answer">(.*?)</div>', page, flags=re.S)
    first, second = re.findall(r"<p>(.*?)</p>", answer)
    # The figures of the drive are those of the result; its conduct was not measured.
    assert first.startswith(
        "Yes, but not cleanly: on a map of 2 traces (method “swept”) the vehicle drove the 500 m to its goal"
    )
    assert second == "What the zone does to traffic was not measured."
    figures = re.findall(
        r'<li><a class="name" href="#(\w+)">(.*?)</a><span class="value">(.*?)</span>\s*(.*?)</li>', page, flags=re.S
    )
    assert len(figures) == 6
    assert figures[0][:3] == ("drive", "Closest to a device", "1.30 m")
    assert "✓ kept:" in figures[0][3]
    assert figures[2][2] == "-"
    assert "kept" not in figures[2][3]  # what was not measured neither keeps a limit nor breaks it


@pytest.mark.parametrize(
    ("name", "changes", "compared"),
    [
        ("paper", {}, True),
        ("paper_single_lane", {}, True),  # the other reading of the same 36 ft
        ("paper", {"work_length_ft": 700}, False),
        ("paper", {"posted_speed_mph": 65}, False),
        ("paper", {"used": 8}, False),
        ("paper", {"target_speed_mps": 20}, False),
        ("paper", {"shift_ft": 0}, False),
        ("right_lane", {"name": '"paper"'}, False),
        ("paper_bend_300m", {}, False),
    ],
)
def test_paper_is_compared_with_runs_of_its_own_case_alone(
    folder: Path, page: str, tmp_path: Path, name: str, changes: dict[str, Any], compared: bool
) -> None:
    run = read_result_folder(folder)
    assert "(paper: Fig." not in page
    assert "90.08 %" not in page
    text = (SCENARIOS / f"{name}.toml").read_text()
    for key, value in changes.items():
        text = re.sub(rf"(?m)^{key} = .*$", f"{key} = {value}", text)
    (tmp_path / "zone.toml").write_text(text)
    write_toml(load_scenario(tmp_path / "zone.toml").model_dump(mode="json"), tmp_path / "scenario.toml")
    html = _page(replace(run, folder=tmp_path, result=dict(run.result) | {"scenario": "mine"}), [])
    assert ("The paper and this run" in html) == compared
    if compared:
        cells = _cells(html)
        assert ["Precision of the map", "90.08 %", "98.77 %"] in cells
        assert ["Components K of the mixture", "15", "2"] in cells
        assert ["Least clearance to cones, planned path", "1.297 m", "1.297 m"] in cells
        assert ["Share of the driven path in the closed area", "not reported", "0.00 %"] in cells


def test_doubts_stand_near_the_top_of_the_page_and_nothing_where_there_are_none(folder: Path, page: str) -> None:
    assert "What there is to doubt" not in page
    run = read_result_folder(folder)
    html = _page(replace(run, result=dict(run.result) | {"warnings": ["12 vehicles wait", HOSTILE]}), [])
    assert html.index("What there is to doubt in this run, 2 things:") < html.index("12 vehicles wait") < html.index("<nav")
    assert HOSTILE not in html


def test_method_without_path_shows_dashes_and_its_reason(page: str) -> None:
    cells = _cells(page)
    at = next(at for at, row in enumerate(cells) if row and row[0] == "literal")
    row, reason = cells[at], cells[at + 1]
    assert row[1] == "no path"
    assert reason[0] == ""
    assert reason[1].startswith("no way")
    assert row[3:] == ["-", "-", "90.0 %", *["-"] * 7]


def test_closed_share_says_of_how_long_a_drive_it_is(page: str) -> None:
    assert any(row[0] == "swept" and "0.0 % of 500 m" in row for row in _cells(page) if row)


def test_methods_that_were_not_run_have_a_row_that_says_so(page: str) -> None:
    assert any(row[0] == "LiDAR SLAM baseline" and row[1].startswith("not run: no LiDAR") for row in _cells(page) if row)


def test_best_method_prefers_one_that_arrived_over_a_better_map() -> None:
    methods: dict[str, dict[str, Any]] = {
        "a": {"outcome": "NO_PATH", "iou": 0.9},
        "b": {"outcome": "REACHED_GOAL", "iou": 0.5},
        "c": {"outcome": "NO_PATH"},
    }
    assert best_method(methods) == "b"
    assert best_method({"a": methods["a"], "c": methods["c"]}) == "a"
    assert best_method({}) is None


def test_truth_on_a_map_counts_the_cells_of_the_drivable_area_within_the_zone(folder: Path) -> None:
    run = read_result_folder(folder)
    grid = run.map_of("swept")
    assert grid is not None
    zone, truth = run.truth_on(grid)
    assert zone.sum() == 400 * 13 / 0.25**2
    assert truth.sum() == 400 / 0.25 * round(7.2 / 0.25)  # 29 rows have their centre below y = 7.2 m
    assert (zone | ~truth).all()


def test_stretch_of_an_axis_is_the_ratio_of_its_two_scales() -> None:
    _, (axes,) = new_figure(1, row_height=1.6)
    axes.set(xlim=(0, 950.25), ylim=(0, 16))  # 10.5 in * 0.905 = 9.5025 in for 950.25 m; 1.6 in for 16 m: 1 to 10
    state_stretch(axes)
    assert axes.get_xlabel() == "station [m]  (the offset is stretched 10.0 : 1)"


def test_outline_of_the_drive_is_the_vehicle_of_the_run(folder: Path, tmp_path: Path) -> None:
    run = read_result_folder(folder)
    assert run.vehicle.width_m == 1.86
    (tmp_path / "scenario.toml").write_text("[vehicle]\nwidth_m = 2.5\n")
    assert replace(run, folder=tmp_path).vehicle.width_m == 2.5


def test_run_whose_scenario_has_keys_that_are_no_longer_known_is_still_told(folder: Path, tmp_path: Path) -> None:
    run = replace(read_result_folder(folder), folder=tmp_path)
    (tmp_path / "drives").mkdir()
    x = np.linspace(50, 550, 501)  # a metre a row, at 20 rows a second
    log = {"time_s": x / 20, "x_m": x, "y_m": 3.7, "heading_rad": 0.0, "speed_mps": 20.0, "steering_rad": 0.0}
    pd.DataFrame(log).to_csv(tmp_path / "drives" / "swept.csv", index=False)
    ahead = pd.DataFrame({"vehicle_id": "a", "time_s": np.arange(3, 27, 0.1).round(1), "y_m": 3.7, "heading_rad": 0.0})
    ahead = ahead.assign(x_m=20 * ahead["time_s"] + 30, speed_mps=20.0, length_m=5.0, width_m=2.0)
    ahead.to_parquet(tmp_path / "drives" / "swept_traffic.parquet")
    (tmp_path / "scenario.toml").write_text("[control]\ntarget_speed_mps = 25.0\n[control.regulated]\nno_longer = 1.0\n")
    (slowing,) = slowings_of(run, "swept")
    assert slowing.why == "a vehicle ahead"
    (tmp_path / "scenario.toml").write_text("[control]\ntarget_speed_mps = 20.5\n")
    assert slowings_of(run, "swept") == []


def test_folder_without_a_run_is_refused_with_the_files_it_lacks(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"result\.json, .*traces\.parquet missing"):
        write_report(tmp_path)


def test_broken_result_file_is_refused_by_name(folder: Path, tmp_path: Path) -> None:
    for path in folder.iterdir():
        if path.is_file():
            (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "result.json").write_text("{")
    with pytest.raises(InputError, match=r"result\.json: not JSON"):
        write_report(tmp_path)
