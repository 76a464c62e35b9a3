"""Readers of real vehicles' trips in analysis/lane_map, on small files of the same form."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest
from commonroad import joined_scenarios
from real_traffic import real_kinds, trips_of_ngsim

Joined = tuple[pd.DataFrame, dict[str, Any]]
Floats = npt.NDArray[np.float64]
HEADER = "Vehicle_ID,Frame_ID,Total_Frames,Global_Time,Local_X,Local_Y,v_length,v_Width,v_Class,v_Vel,v_Acc,Lane_ID,Location\n"
DEGREES = np.deg2rad(-40)


def ngsim_file(folder: Path) -> Path:
    """Three vehicles over 1200 ft: one in lane 2, one that goes over to lane 4, one of another road."""
    drives = ((7, [2] * 13, "i-80"), (8, [3] * 6 + [4] * 7, "i-80"), (9, [2] * 13, "us-101"))
    rows = [
        f"{vehicle},{frame},13,{1113433136000 + 1000 * frame},18.0,{100.0 * frame},15.0,6.0,2,50,0,{lane},{road}"
        for vehicle, lanes, road in drives
        for frame, lane in enumerate(lanes)
    ]
    path = folder / "ngsim.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n")
    return path


def test_ngsim_vehicles_of_three_lanes_are_read_in_metres_from_the_left_edge(tmp_path: Path) -> None:
    trips = trips_of_ngsim(ngsim_file(tmp_path))
    assert trips["trip"].nunique() == 1
    assert trips["y"].unique() == pytest.approx([-18 * 0.3048])
    assert trips["x"].to_numpy() == pytest.approx((100.0 * np.arange(13) - 7.5) * 0.3048)
    assert trips["t"].diff().dropna().to_numpy() == pytest.approx(1.0)


def lanelet(name: int, bottom: float, *, left: int | None, shift: Floats) -> str:
    def bound(tag: str, y: float) -> str:
        turn = np.array([[np.cos(DEGREES), -np.sin(DEGREES)], [np.sin(DEGREES), np.cos(DEGREES)]])
        wave = np.random.default_rng(name).normal(0, 0.02, 60)  # maps are not exact, and all copies are inexact alike
        points = np.column_stack([np.linspace(0, 590, 60), y + wave]) @ turn.T + shift
        return f"<{tag}>" + "".join(f"<point><x>{x:.4f}</x><y>{y:.4f}</y></point>" for x, y in points) + f"</{tag}>"

    beside = f'<adjacentLeft ref="{left}" drivingDir="same"/>' if left else ""
    return f'<lanelet id="{name}">{bound("leftBound", bottom + 3.5)}{bound("rightBound", bottom)}{beside}</lanelet>'


def scenario_file(path: Path, shift: Floats, *, vehicles: str = "") -> Path:
    lanes = lanelet(11, 3.5, left=None, shift=shift) + lanelet(12, 0.0, left=11, shift=shift)
    path.write_text(f'<?xml version="1.0"?><commonRoad timeStepSize="0.1">{lanes}{vehicles}</commonRoad>')
    return path


def vehicle(name: int, start: Floats, length: float) -> str:
    along = np.array([np.cos(DEGREES), np.sin(DEGREES)])
    states = []
    for step in range(41):
        x, y = start + along * length * step / 40
        states.append(
            (step, f"<position><point><x>{x:.4f}</x><y>{y:.4f}</y></point></position><time><exact>{step}</exact></time>")
        )
    later = "".join(f"<state>{state}</state>" for step, state in states if step)
    first = f"<initialState>{states[0][1]}</initialState>"
    return f'<dynamicObstacle id="{name}">{first}<trajectory>{later}</trajectory></dynamicObstacle>'


@pytest.fixture
def joined(tmp_path: Path) -> Joined:
    at, moved = np.array([1000.0, 2000.0]), np.array([-400.0, 700.0])
    base = scenario_file(tmp_path / "map.xml", at)
    along = np.array([np.cos(DEGREES), np.sin(DEGREES)])
    first = scenario_file(tmp_path / "a.xml", at, vehicles=vehicle(1, at + 100 * along, 80.0) + vehicle(2, at, 12.0))
    second = scenario_file(tmp_path / "b.xml", at + moved, vehicles=vehicle(1, at + moved + 250 * along, 60.0))
    return joined_scenarios([first, second], base)


def test_scenarios_whose_frames_differ_by_a_translation_are_joined(joined: Joined) -> None:
    trips, known = joined
    starts = trips.groupby("trip")[["x", "y"]].first().to_numpy()
    along = np.array([np.cos(DEGREES), np.sin(DEGREES)])
    assert len(starts) == 2  # the trip of 12 m is left out
    assert (starts[1] - starts[0]) @ along == pytest.approx(150, abs=0.1)
    assert (starts[1] - starts[0]) @ np.array([-along[1], along[0]]) == pytest.approx(0, abs=0.1)
    assert trips.groupby("trip")["t"].max().to_numpy() == pytest.approx(4.0)
    assert known["lanes"] == 2
    width = np.hypot(*(np.array(known["left"]) - np.array(known["right"])).T)
    assert width == pytest.approx(7.0, abs=0.15)


def test_real_kinds_are_those_whose_files_are_there(tmp_path: Path, joined: Joined) -> None:
    assert real_kinds(tmp_path) == {}
    rows = pd.DataFrame({"trip": "a", "t": np.arange(20.0), "x": 25.0 * np.arange(20.0), "y": -1.8})
    pd.concat([rows, rows.assign(trip="b", y=-5.5)]).to_parquet(tmp_path / "i80.parquet")
    kind = real_kinds(tmp_path)["i80"]
    case = kind.case(n=2, seed=1, receivers="0")
    assert sorted(case.traces.groupby("vehicle_id")["y_m"].median()) == pytest.approx([-5.5, -1.8])
    before = case.before()
    _, offset = before.road.to_sd(case.traces[["x_m", "y_m"]].to_numpy())
    assert sorted(np.unique(offset.round(3))) == pytest.approx([3 * 3.6576 - 5.5, 3 * 3.6576 - 1.8], abs=1e-3)
    with pytest.raises(ValueError, match="at most its 2 trips"):
        kind.case(n=3, seed=1)
