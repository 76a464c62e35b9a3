"""`wzsumo map` on files as they come: each fault is handled and named, or refused in one line."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from wzsumo.cli import main
from wzsumo.files.ros_map import read_map
from wzsumo.grid import UNKNOWN, OccupancyGrid, blank_grid
from wzsumo.scenario.scenario import load_scenario

SCENARIOS = Path(__file__).parents[2] / "scenarios"

LENGTH_M = 400.0


def drive(
    vehicle_id: str,
    y_m: float,
    *,
    seed: int,
    interval_s: float = 0.5,
    speed_mps: float = 20.0,
    start_s: float = 0.0,
    reverse: bool = False,
) -> pd.DataFrame:
    """One vehicle along the x axis at an offset, with 5 cm of scatter."""
    time = np.arange(0, LENGTH_M / speed_mps, interval_s)
    x = speed_mps * time
    scatter = 0.05 * np.random.default_rng(seed).standard_normal((2, len(time)))
    places = {"x_m": (LENGTH_M - x if reverse else x) + scatter[0], "y_m": y_m + scatter[1]}
    return pd.DataFrame({"vehicle_id": vehicle_id, "time_s": start_s + time} | places)


def crowd(n: int = 6, **how: Any) -> pd.DataFrame:
    """Vehicles in one lane, one every 5 s."""
    return pd.concat([drive(f"v{i}", 0.1 * (i - n / 2), seed=i, start_s=5.0 * i, **how) for i in range(n)], ignore_index=True)


NO_MAP = blank_grid((0, 0, 1, 1), resolution=1.0, p_occupied=0.5)


def map_of(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, table: pd.DataFrame, *words: str
) -> tuple[int, Any, str, OccupancyGrid]:
    """(exit code, figures, stderr, map) of `wzsumo map` on a table; a map without cells where there is none."""
    path = tmp_path / "traces.csv"
    table.to_csv(path, index=False)
    with pytest.raises(SystemExit) as stopped:
        main(["map", str(path), "--out", str(tmp_path / "out"), "--json", *words])
    out = capsys.readouterr()
    if stopped.value.code:
        assert not (tmp_path / "out").exists()
        return int(stopped.value.code), None, out.err, NO_MAP
    return 0, json.loads(out.out), out.err, read_map(tmp_path / "out" / "map.yaml")


def assert_shows_the_lane(grid: OccupancyGrid) -> None:
    """The lane along y = 0 is free, 6 m beside it nobody knows."""
    x = np.linspace(20, LENGTH_M - 40, 30)
    for y in (-1.0, 0.0, 1.0):
        assert grid.free[grid.cell_of(np.column_stack([x, np.full_like(x, y)]))].all()
    for y in (-6.0, 6.0):
        assert grid.p_occupied[grid.cell_of(np.column_stack([x, np.full_like(x, y)]))] == pytest.approx(UNKNOWN, abs=0.01)


TRACK = drive("odd", 0.0, seed=99, start_s=100.0)
ODD = {
    "outlier 50 m off": (TRACK.assign(y_m=TRACK["y_m"] + 50), ["odd"], "beside the others"),
    "outlier in another town": (TRACK.assign(y_m=TRACK["y_m"] + 9000), ["odd"], "away from the others"),
    "parked": (TRACK.assign(x_m=200.0 + 0.01 * np.arange(len(TRACK)) % 0.05, y_m=3.0), ["odd"], "fewer than"),
    "other way": (drive("odd", 4.0, seed=98, reverse=True), ["odd"], "against the others"),
    "one fix": (TRACK.iloc[[30]], ["odd"], "stations, fewer than"),
    "some fixes no numbers": (TRACK.assign(x_m=TRACK["x_m"].where(TRACK.index % 9 > 0)), ["odd"], "no finite number"),
    "fixes without an id": (TRACK.assign(vehicle_id=None), ["(none)"], "vehicle_id is empty"),
    "one wild fix": (TRACK.assign(y_m=TRACK["y_m"] + 300.0 * (TRACK.index == 12)), ["odd"], "cannot be reached"),
    "the same fixes twice": (pd.concat([TRACK, TRACK]), ["odd"], "repeats a fix"),
}  # fmt: skip


@pytest.mark.parametrize("fault", ODD)
def test_odd_trace_is_left_out_and_named_and_the_others_make_the_map(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], fault: str
) -> None:
    odd, ids, reason = ODD[fault]
    code, figures, err, grid = map_of(capsys, tmp_path, pd.concat([crowd(), odd], ignore_index=True))
    assert code == 0
    assert [entry["vehicle_id"] for entry in figures["dropped"]] == ids
    assert reason in figures["dropped"][0]["reason"]
    assert reason in err
    assert sum(entry["n_fixes"] for entry in figures["dropped"]) == figures["n_fixes"] - figures["n_fixes_used"]
    assert_shows_the_lane(grid)


def test_longest_trace_driven_the_wrong_way_does_not_turn_the_road(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = drive("wrong", 4.0, seed=5, reverse=True)
    table = pd.concat([crowd(), wrong.assign(x_m=wrong["x_m"] * 1.2 - 20)], ignore_index=True)
    _, figures, _, grid = map_of(capsys, tmp_path, table)
    assert [entry["vehicle_id"] for entry in figures["dropped"]] == ["wrong"]
    assert_shows_the_lane(grid)


REORDERED = {
    "newest first": lambda table: table.iloc[::-1],
    "shuffled": lambda table: table.sample(frac=1, random_state=0),
    "second half of a trace first": lambda table: pd.concat([table.iloc[20:], table.iloc[:20]]),
}


@pytest.mark.parametrize("order", REORDERED)
def test_rows_in_any_order_make_the_same_map(tmp_path: Path, capsys: pytest.CaptureFixture[str], order: str) -> None:
    _, figures, _, grid = map_of(capsys, tmp_path, crowd())
    _, again, _, reordered = map_of(capsys, tmp_path, REORDERED[order](crowd()))
    assert again["n_traces"] == figures["n_traces"] == 6
    assert again["dropped"] == []
    np.testing.assert_array_equal(reordered.p_occupied, grid.p_occupied)


def test_two_vehicles_of_one_id_one_after_the_other_are_two_traces(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    later = crowd().query("vehicle_id == 'v0'")
    # Driven again an hour later; and, in other files, at the same times by another vehicle appended to the file.
    for time_s in (3600.0, 2.0):
        table = pd.concat([crowd(), later.assign(time_s=later["time_s"] + time_s)], ignore_index=True)
        _, figures, _, grid = map_of(capsys, tmp_path, table)
        assert figures["n_traces"] == 7
        assert_shows_the_lane(grid)


def test_two_vehicles_that_report_in_turn_under_one_id_are_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = TRACK.assign(x_m=TRACK["x_m"] + 120, y_m=TRACK["y_m"] + 8, time_s=TRACK["time_s"] + 0.05)
    mixed = pd.concat([TRACK, other]).sort_values("time_s")
    _, figures, _, grid = map_of(capsys, tmp_path, pd.concat([crowd(), mixed], ignore_index=True))
    assert figures["dropped"] == [
        {"vehicle_id": "odd", "n_fixes": 80, "reason": "jumps to and fro between fixes: several vehicles under one vehicle_id"}
    ]
    assert_shows_the_lane(grid)


REFUSED = {
    "two zones": (
        pd.concat([crowd(), crowd().assign(x_m=lambda t: t["x_m"] + 5000, vehicle_id=lambda t: "w" + t["vehicle_id"])]),
        ["2 places", "5.0 km apart", "6 around", "cut the file"],
    ),
    "degrees": (
        crowd().assign(x_m=lambda t: -86.9 + t["x_m"] / 84_700, y_m=lambda t: 40.4 + t["y_m"] / 111_000),
        ["-86.9", "longitude and latitude", "20 m/s", "--columns lon=x_m lat=y_m"],
    ),
    "one fix a trace": (
        crowd().assign(vehicle_id=lambda t: np.arange(len(t))), ["each of 240 vehicle_ids has one fix", "the same id"]
    ),
    "all in one place": (crowd().assign(x_m=3.0, y_m=lambda t: t["y_m"] / 10), ["all fixes lie within", "vehicles that move"]),
    "all parked": (crowd().assign(x_m=lambda t: t["x_m"] / 100), ["at least 50 m"]),
    "half of the fixes no numbers": (
        crowd().assign(y_m=lambda t: t["y_m"].where(t.index >= 120)), ["y_m of row 0", "120 of 240 rows"]
    ),
    "one id for all": (crowd().assign(vehicle_id="v").sample(frac=1, random_state=1), ["no fix is left", "to and fro"]),
}  # fmt: skip


@pytest.mark.parametrize("fault", REFUSED)
def test_file_that_makes_no_map_is_refused_in_one_line_with_the_remedy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], fault: str
) -> None:
    table, says = REFUSED[fault]
    code, _, err, _ = map_of(capsys, tmp_path, table)
    assert code == 2
    message = err.splitlines()[-1]
    assert message.startswith("wzsumo: ")
    assert all(part in message for part in says), message


def test_map_too_large_for_its_cells_is_refused_with_cells_that_fit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = crowd().assign(y_m=lambda t: t["y_m"] + 20 * t["x_m"], x_m=lambda t: 20 * t["x_m"])
    fast = table.assign(time_s=lambda t: 40 * t["time_s"])
    code, _, err, _ = map_of(capsys, tmp_path, fast)
    assert code == 2
    assert "million cells" in err
    coarser = float(err.split("a resolution of")[-1].split()[0])
    assert 7800 * 7800 / 1e8 <= coarser**2 <= 1.1 * 7800 * 7800 / 1e8


def test_methods_share_what_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    odd, _, reason = ODD["outlier 50 m off"]
    _, figures, _, grid = map_of(capsys, tmp_path, pd.concat([crowd(), odd], ignore_index=True), "--method", "swept")
    assert reason in figures["dropped"][0]["reason"]
    assert figures["n_components"] >= 1
    assert grid.free[grid.cell_of([[200.0, 0.0]])].all()


ROAD = """\
[road]
lane_count = 2
left_shoulder_ft = 10
right_shoulder_ft = 10
reference_points_m = [[-50.0, 1.83], [450.0, 1.83]]
[announced]
start_ft = {start}
end_ft = {end}
start_sd_ft = 15
end_sd_ft = 15
"""


def joined_map_of(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    *,
    start: int = 500,
    end: int = 1000,
    table: pd.DataFrame | None = None,
    words: Sequence[str] = (),
) -> tuple[int, Any, str, OccupancyGrid]:
    """The map of vehicles in the right of two lanes, joined to a road of stations -50 m .. 450 m on the x axis."""
    road = tmp_path / "road.toml"
    road.write_text(ROAD.format(start=start, end=end))
    return map_of(capsys, tmp_path, crowd() if table is None else table, "--road", str(road), *words)


def test_map_joined_to_the_road_knows_its_lanes_outside_the_announced_zone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, _, grid = joined_map_of(capsys, tmp_path, table=crowd(speed_mps=13.0))
    assert code == 0
    # The zone runs from x = 102 m to 255 m; at 30 mph its tapers take 75 m and 30 m. The left lane was not driven.
    for x, free in ((60.0, True), (205.0, False), (300.0, True)):
        assert grid.free[grid.cell_of(np.array([[x, 0.0]]))].all()
        # Nobody drove there: outside the zone it is likely open, and no more, for an announcement may be wrong.
        assert (grid.p_occupied[grid.cell_of(np.array([[x, 3.66]]))] < 0.5).all() == free


def test_scenario_stands_for_its_road(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = SCENARIOS / "paper.toml"
    zone = load_scenario(scenario)
    start = zone.layout().start
    table = crowd().assign(x_m=lambda t: t["x_m"] + start - 100, y_m=lambda t: t["y_m"] + 1.83)
    code, figures, _, grid = map_of(capsys, tmp_path, table, "--road", str(scenario))
    assert code == 0
    assert figures["lanes"] == 3  # what the scenario closes is no part of the map of before
    assert grid.free[grid.cell_of(np.array([[start - 50, 9.0]]))].all()


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"start": 1000, "end": 500}, ["announced.start_ft=1000", "in this order"]),
        ({"end": 5000}, ["announced.end_ft=5000", "1640 ft long"]),
        ({"start": -3}, ["announced.start_ft=-3", "greater than or equal to 0"]),
        ({"table": crowd().assign(y_m=lambda t: t["y_m"] + 3000)}, ["0 of 240 fixes", "in the road's frame"]),
        ({"words": ("--method", "swept")}, ["road.toml: the method swept makes no use"]),
    ],
)
def test_road_that_does_not_fit_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], how: Any, said: list[str]
) -> None:
    code, _, err, _ = joined_map_of(capsys, tmp_path, **how)
    assert code == 2
    assert all(words in err for words in said)


def test_traces_against_the_road_are_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err, _ = joined_map_of(capsys, tmp_path, table=crowd(reverse=True))
    assert code == 2
    assert "traces.csv: most vehicles drive against the road" in err
