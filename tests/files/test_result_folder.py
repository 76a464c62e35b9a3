import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import shapely
from shapely.geometry import mapping

from wzsumo.errors import InputError
from wzsumo.files.result_folder import ResultFolder, read_result_folder

READERS: dict[str, Callable[[ResultFolder], Any]] = {
    "traces.parquet": lambda run: run.used_traces,
    "mixture_sweep.csv": lambda run: run.mixtures_tried,
    "mixture.json": lambda run: run.mixture,
    "samples.csv": lambda run: run.samples,
    "traffic/cells.parquet": lambda run: run.traffic_cells,
    "paths/swept.csv": lambda run: run.path_of("swept"),
    "drives/swept.csv": lambda run: run.drive_of("swept"),
    "drives/swept_traffic.parquet": lambda run: run.drive_traffic_of("swept"),
    "maps/swept.yaml": lambda run: run.map_of("swept"),
    "scenario.toml": lambda run: run.vehicle,
}
AREAS = ("drivable", "closed_area", "pavement")
DAMAGE: dict[str, Callable[[Path], Any]] = {
    "cut short": lambda path: path.write_bytes(b"PAR1" + b"\0" * 9),
    "of another kind": lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n\0\0[1, 2"),
    "a folder": lambda path: path.mkdir(),
    "deeply nested": lambda path: path.write_bytes(b"[" * 50_000),
}


@pytest.mark.parametrize("how", DAMAGE)
@pytest.mark.parametrize("name", READERS)
def test_damaged_file_of_a_run_is_refused_by_its_name_with_the_remedy(tmp_path: Path, name: str, how: str) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    DAMAGE[how](path)
    run = ResultFolder(folder=tmp_path, result={}, layout={"areas": [], "features": []})
    with pytest.raises(InputError, match=path.name):
        READERS[name](run)


@pytest.mark.parametrize(
    "content",
    [None, [], {"weights": 1, "means": [], "covariances": []}, {"weights": ["a"]}, {"weights": [1.0], "means": [[1]]}],
)
def test_mixture_of_another_shape_is_refused(tmp_path: Path, content: Any) -> None:
    (tmp_path / "mixture.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"mixture\.json: cannot be read .*run the scenario again"):
        _ = ResultFolder(folder=tmp_path, result={}, layout={}).mixture


def layout(**changes: Any) -> dict[str, Any]:
    """A layout of one device on a straight road, with some parts changed."""
    device = {
        "name": "device",
        "kind": "drum",
        "s_m": 1,
        "d_m": 1,
        "heading_rad": 0,
        "height_m": 1,
        "radius_m": 0.2,
        "length_m": 0,
    }
    section = {
        "name": "reference_line",
        "lane_widths_m": [3.6],
        "left_shoulder_m": 1,
        "right_shoulder_m": 1,
        "opposing_lanes": 0,
    }
    line = shapely.LineString([(0, 1.8), (100, 1.8)])
    features = [
        {"properties": section | changes.get("section", {}), "geometry": mapping(line)},
        {"properties": device | changes.get("device", {}), "geometry": changes.get("place", mapping(shapely.Point(1, 1)))},
        *(
            {"properties": {"name": n}, "geometry": mapping(shapely.box(0, 0, 9, 9))}
            for n in ("drivable", "closed_area", "pavement")
        ),
    ]
    return {"areas": changes.get("areas", [{"name": "a", "start_m": 0, "end_m": 9}]), "features": features}


@pytest.mark.parametrize(
    "changes",
    [
        {"section": {"lane_widths_m": None}}, {"section": {"lane_widths_m": ["a"]}}, {"section": {"left_shoulder_m": "x"}},
        {"device": {"s_m": "far"}}, {"device": {"radius_m": None}, "place": {"type": "Point", "coordinates": []}},
        {"place": None}, {"areas": [{"name": "a"}]}, {"areas": [1]}, {"areas": [{"name": "a", "start_m": "x", "end_m": 1}]},
    ],
)  # fmt: skip
def test_layout_of_other_types_is_refused_by_its_name(tmp_path: Path, changes: dict[str, Any]) -> None:
    run = ResultFolder(folder=tmp_path, result={}, layout=layout(**changes))
    with pytest.raises(InputError, match=r"layout\.geojson"):
        _ = run.road.length, run.devices, run.areas, run.polygons


def test_layout_as_it_should_be_is_read(tmp_path: Path) -> None:
    run = ResultFolder(folder=tmp_path, result={}, layout=layout())
    assert run.road.length == 100
    assert run.devices["x_m"].tolist() == [1.0]
    assert (run.span, run.polygons["drivable"].area) == ((0.0, 9.0), 81.0)


METHODS: dict[str, Any] = {"swept": {"planned": {}, "driven": None}}
RESULT: dict[str, Any] = {"scenario": "s", "seed": 1, "version": "0.1.0", "format": 1, "methods": METHODS}


def write_run(folder: Path, **changes: Any) -> ResultFolder:
    """A run of one method that has a map, with some parts of its result changed, or left out by `...`."""
    result = {key: value for key, value in (RESULT | changes).items() if value is not ...}
    (folder / "maps").mkdir()
    for name in ("traces.parquet", "maps/swept.yaml"):
        (folder / name).write_text("x")
    (folder / "layout.geojson").write_text(json.dumps(layout()))
    (folder / "result.json").write_text(json.dumps(result))
    return read_result_folder(folder)


@pytest.mark.parametrize("other", [..., 2, "1", None, [1]])
def test_result_of_another_format_is_refused_with_both_formats(tmp_path: Path, other: Any) -> None:
    with pytest.raises(
        InputError, match=r"result\.json: written by another version .*'0\.1\.0'.*this one reads format 1.*again"
    ):
        write_run(tmp_path, format=other)


def test_run_with_all_that_its_result_tells_of_is_read(tmp_path: Path) -> None:
    assert list(write_run(tmp_path, fleet=None, network={}).methods) == ["swept"]


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"methods": ...}, r"result\.json: methods missing; it is no result of wzsumo .*: run the scenario again"),
        ({"scenario": ..., "seed": ...}, r"result\.json: scenario, seed missing"),
        ({"methods": None}, r"result\.json: methods must be a JSON object, given: NoneType"),
        ({"methods": []}, r"result\.json: methods must be a JSON object, given: list"),
        ({"methods": {"swept": 1}}, r"result\.json: methods\.swept must be a JSON object, given: int"),
        ({"fleet": [1]}, r"result\.json: fleet must be a JSON object, given: list"),
        ({"methods": {"swept": {}, "lanes": {}}}, r": maps/lanes\.yaml missing; a report needs the folder that"),
        ({"methods": {"swept": {"planned": {"a": 1}}}}, r": paths/swept\.csv missing"),
        ({"methods": {"swept": {"driven": {"a": 1}}}}, r": drives/swept\.csv missing"),
        ({"n_components": 2}, r": mixture_sweep\.csv, mixture\.json, samples\.csv missing"),
    ],
)
def test_result_of_another_kind_or_without_what_it_tells_of_is_refused(
    tmp_path: Path, changes: dict[str, Any], told: str
) -> None:
    with pytest.raises(InputError, match=told):
        write_run(tmp_path, **changes)


@pytest.mark.parametrize("content", ["", "null", "[1]", "{", '{"a": ' + "[" * 50_000, '{"a": 1' + "0" * 5000 + "}"])
def test_result_that_is_no_object_of_json_is_refused(tmp_path: Path, content: str) -> None:
    for name in ("layout.geojson", "traces.parquet", "mixture_sweep.csv", "mixture.json", "samples.csv"):
        (tmp_path / name).write_text("x")
    (tmp_path / "result.json").write_text(content)
    with pytest.raises(InputError, match=r"result\.json: ") as refused:
        read_result_folder(tmp_path)
    assert len(str(refused.value)) < 500 + len(str(tmp_path))


def test_table_that_is_not_there_is_none_and_one_that_is_there_is_read(tmp_path: Path) -> None:
    run = ResultFolder(folder=tmp_path, result={}, layout={})
    assert run.traffic_cells is None
    (tmp_path / "paths").mkdir()
    pd.DataFrame({"x_m": np.arange(3.0)}).to_csv(tmp_path / "paths" / "swept.csv", index=False)
    found = run.path_of("swept")
    assert found is not None
    assert found["x_m"].tolist() == [0, 1, 2]
