import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shapely
from builders import by_turns_layout, paper_layout

from wzsumo.files.frame import read_frame
from wzsumo.files.geojson import collection_in_metres
from wzsumo.files.layout import layout_geojson, write_layout
from wzsumo.geography import local_frame

PLACE = local_frame([[-83.74, 42.28]])
LAYOUT = paper_layout()


def test_layout_has_a_feature_for_each_area_lane_device_and_sign() -> None:
    names = pd.Series([feature["properties"]["name"] for feature in layout_geojson(LAYOUT)["features"]]).value_counts()
    assert names.to_dict() == {
        "drivable": 1, "closed_area": 1, "pavement": 1, "reference_line": 1, "lane": len(LAYOUT.lanes),
        "device": len(LAYOUT.devices), "sign": len(LAYOUT.signs),
    }  # fmt: skip


def test_stop_lines_lie_across_the_lane_of_those_who_wait_at_them() -> None:
    layout = by_turns_layout()
    turns = layout.taking_turns
    assert turns is not None
    found = [f for f in layout_geojson(layout)["features"] if f["properties"]["name"] == "stop_line"]
    forward, against = sorted((f["properties"] for f in found), key=lambda each: each["opposing"])
    assert (forward["s_m"], against["s_m"]) == (turns.start, turns.end)
    lane_m = 12 * 0.3048  # the right lane forward, the left one against the stations
    assert (forward["right_m"], forward["left_m"]) == pytest.approx((0, lane_m), abs=0.01)
    assert (against["right_m"], against["left_m"]) == pytest.approx((lane_m, 2 * lane_m), abs=0.01)
    line = shapely.geometry.shape(found[0]["geometry"])
    assert line.length == pytest.approx(lane_m, abs=0.01)


def test_features_lie_in_world_metres_and_carry_their_columns() -> None:
    features = layout_geojson(LAYOUT)["features"]
    drivable = shapely.geometry.shape(next(f["geometry"] for f in features if f["properties"]["name"] == "drivable"))
    assert drivable.symmetric_difference(LAYOUT.drivable).area < 1e-6
    devices = [f for f in features if f["properties"]["name"] == "device"]
    xy = np.array([f["geometry"]["coordinates"] for f in devices])
    np.testing.assert_allclose(xy, LAYOUT.devices[["x_m", "y_m"]])
    assert [f["properties"]["kind"] for f in devices] == LAYOUT.devices["kind"].tolist()


def test_written_layout_is_json_and_a_table_of_devices_to_a_tenth_of_a_millimetre(tmp_path: Path) -> None:
    write_layout(LAYOUT, tmp_path, frame=None)
    areas = json.loads((tmp_path / "layout.geojson").read_text())["areas"]
    assert [area["name"] for area in areas] == [area.name for area in LAYOUT.areas]
    table = pd.read_csv(tmp_path / "devices.csv")
    np.testing.assert_allclose(table["x_m"], LAYOUT.devices["x_m"], atol=5e-5)
    assert list(table.columns) == list(LAYOUT.devices.columns)


def test_layout_of_a_road_with_a_place_is_written_in_degrees_and_read_back_in_metres(tmp_path: Path) -> None:
    write_layout(LAYOUT, tmp_path, frame=PLACE)
    written = json.loads((tmp_path / "layout.geojson").read_text())
    device = next(f["geometry"]["coordinates"] for f in written["features"] if f["properties"]["name"] == "device")
    assert device == pytest.approx(PLACE.to_lonlat(LAYOUT.devices[["x_m", "y_m"]].to_numpy()[0]), abs=1e-8)
    assert read_frame(tmp_path) == PLACE
    features = collection_in_metres(written)["features"]
    drivable = shapely.geometry.shape(next(f["geometry"] for f in features if f["properties"]["name"] == "drivable"))
    assert drivable.symmetric_difference(LAYOUT.drivable).area < 0.1


def test_layout_without_a_place_says_so(tmp_path: Path) -> None:
    write_layout(LAYOUT, tmp_path, frame=None)
    assert "not RFC 7946" in json.loads((tmp_path / "layout.geojson").read_text())["coordinates"]
    assert read_frame(tmp_path) is None
