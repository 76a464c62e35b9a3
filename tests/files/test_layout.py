import json
from pathlib import Path

import numpy as np
import pandas as pd
import shapely
from builders import paper_layout

from wzsumo.files.layout import layout_geojson, write_layout

LAYOUT = paper_layout()


def test_layout_has_a_feature_for_each_area_lane_device_and_sign() -> None:
    names = pd.Series([feature["properties"]["name"] for feature in layout_geojson(LAYOUT)["features"]]).value_counts()
    assert names.to_dict() == {
        "drivable": 1, "closed_area": 1, "pavement": 1, "reference_line": 1, "lane": len(LAYOUT.lanes),
        "device": len(LAYOUT.devices), "sign": len(LAYOUT.signs),
    }  # fmt: skip


def test_features_lie_in_world_metres_and_carry_their_columns() -> None:
    features = layout_geojson(LAYOUT)["features"]
    drivable = shapely.geometry.shape(next(f["geometry"] for f in features if f["properties"]["name"] == "drivable"))
    assert drivable.symmetric_difference(LAYOUT.drivable).area < 1e-6
    devices = [f for f in features if f["properties"]["name"] == "device"]
    xy = np.array([f["geometry"]["coordinates"] for f in devices])
    np.testing.assert_allclose(xy, LAYOUT.devices[["x_m", "y_m"]])
    assert [f["properties"]["kind"] for f in devices] == LAYOUT.devices["kind"].tolist()


def test_written_layout_is_json_and_a_table_of_devices_to_a_tenth_of_a_millimetre(tmp_path: Path) -> None:
    write_layout(LAYOUT, tmp_path)
    areas = json.loads((tmp_path / "layout.geojson").read_text())["areas"]
    assert [area["name"] for area in areas] == [area.name for area in LAYOUT.areas]
    table = pd.read_csv(tmp_path / "devices.csv")
    np.testing.assert_allclose(table["x_m"], LAYOUT.devices["x_m"], atol=5e-5)
    assert list(table.columns) == list(LAYOUT.devices.columns)
