import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shapely
from shapely.geometry import mapping

from wzsumo.files.result_folder import ResultFolder
from wzsumo.report.drive_player import player_data
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()


@pytest.fixture
def run(tmp_path: Path) -> ResultFolder:
    """Two seconds at 10 m/s along +x at 20 commands a second, one vehicle passing at 20 m/s, another there for a second."""
    (tmp_path / "drives").mkdir()
    time = 100.05 + 0.05 * np.arange(41)
    log = {"time_s": time, "x_m": 10 * (time - 100), "y_m": 5.0, "heading_rad": 0.0, "speed_mps": 10.0}
    pd.DataFrame(log).to_csv(tmp_path / "drives" / "swept.csv", index=False)
    ticks = np.round(100.1 + 0.1 * np.arange(20), 3)
    passing = pd.DataFrame({"vehicle_id": "b", "time_s": ticks, "x_m": 20 * (ticks - 100), "y_m": 8.6, "speed_mps": 20.0})
    leaving = pd.DataFrame({"vehicle_id": "a", "time_s": ticks[:10], "x_m": 50.0, "y_m": 8.6, "speed_mps": 0.0})
    traffic = pd.concat([passing, leaving]).assign(heading_rad=0.0, length_m=4.8, width_m=1.85)
    traffic.to_parquet(tmp_path / "drives" / "swept_traffic.parquet")
    areas = {"drivable": shapely.box(0, 0, 60, 7), "closed_area": shapely.box(0, 7, 60, 12), "pavement": shapely.Polygon()}
    features = [{"properties": {"name": name}, "geometry": mapping(area)} for name, area in areas.items()]
    section = {"lane_widths_m": [3.5, 3.5], "left_shoulder_m": 4.0, "right_shoulder_m": 1.0, "opposing_lanes": 0}
    line = {"properties": {"name": "reference_line"} | section, "geometry": mapping(shapely.LineString([(0, 3.5), (99, 3.5)]))}
    zone = [{"name": "merging taper", "start_m": 40, "end_m": 60}]
    return ResultFolder(
        folder=tmp_path, result={"methods": {"swept": {}}}, layout={"areas": zone, "features": [*features, line]}
    )


def test_played_drive_has_a_frame_each_fifth_of_a_second_at_the_vehicle_centre(run: ResultFolder) -> None:
    data = json.loads(player_data(run, "swept") or "")
    assert data["frame_s"] == 0.2
    # 100.2 .. 102.0 s
    assert [row[0] for row in data["ego"]] == pytest.approx(
        [10 * 0.2 * k + CAR.axle_to_centre_m for k in range(1, 11)], abs=0.006
    )
    assert {tuple(row[1:]) for row in data["ego"]} == {(5.0, 0.0, 10.0, 0.0)}
    # The zone begins at 40 m, and the player 30 m ahead of it: the centre is at 1.4 m + 2 m a frame from 2 m on.
    assert data["zone_frame"] == 3


def test_played_drive_shows_each_other_vehicle_while_it_is_there_under_one_number(run: ResultFolder) -> None:
    others = json.loads(player_data(run, "swept") or "")["others"]
    assert len(others) == 10
    assert [len(frame) for frame in others] == [2] * 5 + [1] * 5
    passing = others[-1][0][3]
    assert [row[0] for frame in others for row in frame if row[3] == passing] == pytest.approx([4.0 * k for k in range(1, 11)])


def test_vehicle_that_slows_down_by_more_than_0_7_mps2_shows_its_brake_lights(run: ResultFolder) -> None:
    path = run.folder / "drives" / "swept_traffic.parquet"
    traffic = pd.read_parquet(path)
    since = (traffic["time_s"] - 101.0).clip(lower=0)
    for braking, lit in ((0.6, set()), (0.8, {0.0, 1.0})):
        traffic.assign(speed_mps=traffic["speed_mps"] - since * braking * (traffic["vehicle_id"] == "b")).to_parquet(path)
        others = json.loads(player_data(run, "swept") or "")["others"]
        passing = [row[6] for frame in others for row in frame if row[4:6] and row[3] == others[-1][0][3]]
        assert passing[0] == 0.0
        assert set(passing) == (lit or {0.0})


def test_played_drive_has_the_areas_as_rings_without_empty_ones(run: ResultFolder) -> None:
    areas = json.loads(player_data(run, "swept") or "")["areas"]
    assert areas["pavement"] == []
    assert shapely.Polygon(areas["closed_area"][0]).area == pytest.approx(300)


def test_method_without_a_drive_is_not_played(run: ResultFolder) -> None:
    assert player_data(run, "lanes") is None
    assert player_data(run, None) is None
