import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from wzsumo.cli import main
from wzsumo.files.ros_map import read_map, write_map
from wzsumo.grid import blank_grid
from wzsumo.scenario.scenario import load_scenario

PAPER = Path(__file__).parents[2] / "scenarios" / "paper.toml"


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """(exit code, stdout, stderr) of one command."""
    with pytest.raises(SystemExit) as stopped:
        main([str(word) for word in words])
    out = capsys.readouterr()
    return int(stopped.value.code or 0), out.out, out.err


def paper_with(tmp_path: Path, **changes: str) -> Path:
    """The paper's scenario with some lines replaced, as a file."""
    text = PAPER.read_text()
    for key, line in changes.items():
        lines = [line if row.split("=")[0].strip() == key else row for row in text.splitlines()]
        assert "\n".join(lines) != text.rstrip(), key
        text = "\n".join(lines)
    path = tmp_path / "changed.toml"
    path.write_text(text)
    return path


def straight_trace_file(path: Path) -> None:
    s = np.arange(0, 200, 2.0)
    parts = [pd.DataFrame({"vehicle_id": f"v{n}", "time_s": s / 20, "x_m": s, "y_m": 0.3 * n}) for n in range(4)]
    pd.concat(parts).to_csv(path, index=False)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"posted_speed_mph": "posted_speed_mph = 42"}, ["posted_speed_mph=42", "40 and 45", "post 40 or 45"]),
        ({"closed_lanes": "closed_lanes = [0, 1, 2]"}, ["closed_lanes=(0, 1, 2)", "must leave open"]),
        (
            {"flow_vph": "flow_vhp = 1500"},
            ["simulation.demand.flow_vhp", "unknown key", "did you mean flow_vph?", "truck_share"],
        ),
        ({"work_length_ft": "work_length_ft = -650"}, ["work_zone.work_length_ft=-650", "greater than 0"]),
        ({"used": "used = 31"}, ["crowd.used=31", "crowd.collected=30"]),
        ({"start_lane": "start_lane = 3"}, ["route.start_lane=3", "0..2"]),
        (
            {"step_length_s": "step_length_s = 0.5", "drivers": 'drivers = "hcm_2_to_1_urban"'},
            ["step_length_s=0.5 does not go with", "step_length_s=0.1", 'drivers = "uncalibrated"'],
        ),
        (
            {"step_length_s": "step_length_s = 0.5"},
            ["step_length_s=0.5", 'with drivers "hcm"'],
        ),
        (
            {"posted_speed_mph": 'posted_speed_mph = 60\nroad_type = "rural"'},
            ['demand.drivers="hcm"', 'road_type="rural"', "of freeways", 'drivers = "uncalibrated"'],
        ),
        ({"duration_s": "duration_s = 120"}, ["demand.warm_up_s=120", "shorter than duration_s=120"]),
        (
            {"flow_vph": "flow_vph = 9000", "drivers": 'drivers = "uncalibrated"'},
            ["demand.flow_vph=9000", "lane 1 would get 3300 veh/h", "give at most 6802 veh/h"],
        ),
        ({"length_ft": "length_ft = 4000"}, ["the zone ends at", "lengthen the road by 860 ft"]),
        (
            {"length_ft": "alignment = [{ length_ft = 1500 }, { length_ft = 4000, radius_ft = 2500 }, { length_ft = 1500 }]"},
            ["map.resolution_m=0.127 makes", "million cells", "at most 40 million", "or more"],
        ),
    ],
)
def test_scenario_that_cannot_be_is_refused_in_one_line_with_its_rule(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, str], says: list[str]
) -> None:
    spec = paper_with(tmp_path, **changes)
    code, out, err = run(capsys, "layout", spec, "--out", tmp_path / "out")
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert all(part in err for part in [str(spec), *says]), err
    assert not (tmp_path / "out").exists()


def test_mistakes_of_a_scenario_are_told_at_once_a_line_each(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    changes = {"work_length_ft": "work_length_m = 200", "flow_vph": "flow_vph = -1", "used": 'used = "5"', "start_lane": ""}
    spec = paper_with(tmp_path, **changes)
    code, out, err = run(capsys, "layout", spec, "--out", tmp_path / "out")
    lines = err.splitlines()
    assert (code, out) == (2, "")
    assert all(line.startswith(f"wzsumo: {spec}: ") for line in lines)
    for part in (
        "work_zone.work_length_m: unknown key", "work_zone.work_length_ft: missing", "flow_vph=-1: ", "crowd: used='5': ",
        "route.start_lane: missing",
    ):  # fmt: skip
        assert sum(part in line for line in lines) == 1, (part, err)
    assert len(lines) == 5


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("sweep", "paper", "--out", "x"), "is a scenario, not a study; run it with `wzsumo run "),
        (("run", "how_many_traces", "--out", "x"), "is a study, not a scenario; run it with `wzsumo sweep "),
        (("run", "SWEPT", "--out", "x"), "add --case NAME"),
        (("sweep", "SWEPT", "--out", "x"), "give the study's file"),
        (("run", "RAN", "--out", "x"), "scenario.toml"),
        (("run", "papre", "--out", "x"), "did you mean paper?"),
        (("lay", "paper", "--out", "x"), "did you mean layout?"),
        (("run", "paper", "--out", "x", "--method", "lane"), "did you mean lanes?"),
    ],
)
def test_word_for_another_command_or_with_a_slip_is_answered_with_the_right_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], says: str
) -> None:
    folders = {"SWEPT": ("swept", "study.json"), "RAN": ("ran", "result.json")}
    for folder, file in folders.values():
        (tmp_path / folder).mkdir()
        (tmp_path / folder / file).write_text("{}")
    given = [str(tmp_path / folders[word][0]) if word in folders else word for word in words]
    code, _, err = run(capsys, *(str(tmp_path / "x") if word == "x" else word for word in given))
    assert (code, err.count("\n")) == (2, 1)
    assert says in err


@pytest.mark.parametrize("length_ft", [4000, 4859.7, 4860.4, 5187.2])
def test_advice_to_lengthen_the_road_helps_when_it_is_followed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], length_ft: float
) -> None:
    """First for the zone, then for the goal beyond it; also by parts of a foot, where rounding down would give 0."""
    given = []
    for _ in range(3):
        spec = paper_with(tmp_path, length_ft=f"length_ft = {length_ft}")
        code, _, err = run(capsys, "layout", spec, "--out", tmp_path / "out")
        if code == 0:
            break
        given += [int(feet) for feet in re.findall(r"lengthen the road by (\d+) ft", err)]
        length_ft += given[-1]
    assert code == 0
    assert 0 < len(given) <= 2
    assert min(given) > 0


def test_advice_to_start_the_zone_later_helps_when_it_is_followed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(capsys, "net", paper_with(tmp_path, start_ft="start_ft = 500"), "--out", tmp_path / "out")
    assert code == 2
    (feet,) = re.findall(r"raise work_zone.start_ft by (\d+)", err)
    spec = paper_with(tmp_path, start_ft=f"start_ft = {500 + int(feet)}")
    assert run(capsys, "layout", spec, "--out", tmp_path / "out")[0] == 0


def test_capacity_command_prints_what_the_manual_gives_for_the_papers_zone(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "capacity", PAPER, "--json")
    figures = json.loads(out)
    assert code == 0
    assert figures["queue_discharge_pcphpl"] == 1783.5  # 2093 - 154 x 0.75 - 194, HCM 7, Eq. 10-8
    assert figures["queue_discharge_all_lanes_vph"] == pytest.approx(2 * 1783.5 / 1.1)
    assert figures["demand_flow_vph"] == 1500


def test_barrier_beside_the_work_raises_the_discharge_by_what_the_manual_gives_for_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spec = paper_with(tmp_path, device='device = "drum"\nwork_space_device = "barrier"')
    _, out, _ = run(capsys, "capacity", spec, "--json")
    assert json.loads(out)["queue_discharge_pcphpl"] == 1783.5 + 194  # f_Br, HCM 7, Eq. 10-8


def test_zone_posted_below_a_freeways_speed_keeps_its_fitted_drivers(tmp_path: Path) -> None:
    # HCM 7, Eq. 10-8 gives the discharge without a speed; `capacity` alone needs a freeway's free-flow speed.
    slow = load_scenario(paper_with(tmp_path, posted_speed_mph="posted_speed_mph = 45"))
    assert slow.zone_simulation().demand.drivers == load_scenario(PAPER).zone_simulation().demand.drivers


def test_capacity_of_a_street_is_refused_in_one_line_with_the_models_range(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spec = paper_with(tmp_path, posted_speed_mph="posted_speed_mph = 35")
    code, out, err = run(capsys, "capacity", spec)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert all(part in err for part in (str(spec), "free-flow speed of 40 mph", "55 to 75 mph", "site.normal_speed_limit_mph"))


def test_layout_command_writes_the_zone_that_the_paper_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "layout", PAPER, "--out", tmp_path / "out", "--json")
    assert code == 0
    areas = json.loads(out)["areas_m"]
    lengths_ft = {"shoulder taper": 240, "merging taper": 720, "shifting taper": 360, "activity area": 650}
    assert {name: areas[name] / 0.3048 for name in lengths_ft} == pytest.approx(lengths_ft, abs=0.01)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "devices.csv", "lanes.geojson", "layout.geojson", "layout.png", "layout.svg",
    ]  # fmt: skip
    features = json.loads((tmp_path / "out" / "layout.geojson").read_text())["features"]
    assert {f["properties"]["name"] for f in features} == {
        "drivable",
        "closed_area",
        "pavement",
        "reference_line",
        "lane",
        "device",
        "sign",
    }


def test_map_command_frees_the_lane_that_was_driven_and_leaves_the_rest_unknown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    straight_trace_file(tmp_path / "traces.csv")
    code, out, _ = run(capsys, "map", tmp_path / "traces.csv", "--out", tmp_path / "out", "--json")
    assert code == 0
    assert json.loads(out)["n_traces"] == 4
    grid = read_map(tmp_path / "out" / "map.yaml")
    driven, beside = grid.cell_of([[100.0, 0.45]]), grid.cell_of([[100.0, 6.0]])
    assert grid.p_occupied[driven][0] == 0
    assert grid.p_occupied[beside][0] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "cannot be read"),
        ("vehicle_id,time_s,x_m\nv1,0,1\n", "no column for y_m"),
        ("vehicle_id,time_s,x_m,y_m\n", "no fixes"),
        ("vehicle_id,time_s,x_m,y_m\nv1,0,nan,2\nv1,1,2,2\n", "x_m of row 0"),
        ("vehicle_id,time_s,x_m,y_m\nv1,0,-86.91,40.42\nv1,1,-86.9101,40.42\n", "metres"),
    ],
)
def test_trace_file_that_is_none_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str, says: str
) -> None:
    path = tmp_path / "traces.csv"
    path.write_text(content)
    code, _, err = run(capsys, "map", path, "--out", tmp_path / "out")
    assert code == 2
    assert says in err
    assert str(path) in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_plan_command_writes_a_path_of_the_rear_axle_from_start_to_goal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_map(blank_grid((0, -5, 120, 5), resolution=0.25, p_occupied=0.0), tmp_path)
    words = ("--start", 10, 0, 0, "--goal", 100, 1, 0, "--out", tmp_path / "path.csv", "--json")
    code, out, _ = run(capsys, "plan", tmp_path / "map.yaml", *words)
    assert code == 0
    assert json.loads(out)["status"] == "FOUND"
    path = pd.read_csv(tmp_path / "path.csv")
    assert list(path) == ["x_m", "y_m", "heading_rad", "s_m", "curvature_1pm"]
    assert path[["x_m", "y_m"]].iloc[0].tolist() == pytest.approx([10, 0], abs=0.01)
    assert path[["x_m", "y_m"]].iloc[-1].tolist() == pytest.approx([100, 1], abs=0.1)


def test_plan_command_without_a_way_says_why_and_exits_with_0(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_map(blank_grid((0, -5, 120, 5), resolution=0.25, p_occupied=1.0), tmp_path)
    words = ("--start", 10, 0, 0, "--goal", 100, 0, 0, "--out", tmp_path / "path.csv", "--json")
    code, out, _ = run(capsys, "plan", tmp_path / "map.yaml", *words)
    assert code == 0
    assert json.loads(out)["status"] == "START_OCCUPIED" or json.loads(out)["status"] == "GOAL_OCCUPIED"
    assert not (tmp_path / "path.csv").exists()


def test_methods_given_one_option_each_are_all_taken(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(capsys, "run", PAPER, "--out", tmp_path / "out", "--method", "nonsense", "--method", "swept")
    assert code == 2
    assert "method nonsense: unknown" in err  # the last --method alone would have run


def test_more_traces_than_the_fleet_gives_are_refused_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spec = paper_with(tmp_path, duration_s="duration_s = 150", penetration="penetration = 0.01")
    code, _, err = run(capsys, "run", spec, "--out", tmp_path / "out", "--method", "swept")
    assert code == 2
    assert "crowd.collected=30" in err
    assert "raise crowd.penetration" in err
    assert not (tmp_path / "out").exists()


def test_same_scenario_and_seed_give_the_same_result_in_another_process(tmp_path: Path) -> None:
    spec = paper_with(tmp_path, duration_s="duration_s = 300", penetration="penetration = 0.5", collected="collected = 6")
    results = []
    for name in ("first", "second"):
        out = tmp_path / name
        command = [sys.executable, "-m", "wzsumo", "run", str(spec), "--out", str(out), "--method", "swept"]
        subprocess.run(command, check=True, capture_output=True)
        result = json.loads((out / "result.json").read_text())
        del result["timings_s"], result["methods"]["swept"]["plan_ms"]
        results.append(json.dumps(result))
    assert results[0] == results[1]
    assert json.loads(results[0])["methods"]["swept"]["outcome"] != "NO_PATH"
    shutil.rmtree(tmp_path / "first")


def test_run_in_a_window_on_a_machine_without_a_display_is_refused_before_anything_is_simulated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    code, out, err = run(capsys, "run", PAPER, "--out", tmp_path / "run", "--gui")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "--gui: there is no display here" in err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("name", ["x" * 300, "nul\0byte"])
@pytest.mark.parametrize(
    "words",
    [
        ("map", "NAME", "--out", "o"), ("live", "NAME", "--map", "NAME", "--out", "o"), ("run", "NAME", "--out", "o"),
        ("export", "NAME", "--to", "opendrive", "--out", "o"), ("report", "NAME"), ("sweep", "NAME", "--out", "o"),
        ("place", "NAME", "--zone", "z", "--at", "e", "1", "--out", "o"), ("ground", "NAME", "--out", "o"),
        ("plan", "NAME", "--start", "0", "0", "0", "--goal", "1", "0", "0", "--out", "o"), ("layout", "paper", "--out", "NAME"),
        ("map", "a.csv", "--road", "NAME", "--out", "o"), ("schema", "--out", "NAME"),
    ],
)  # fmt: skip
def test_a_name_that_no_file_can_have_is_told_in_one_line(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], name: str
) -> None:
    code, _, said = run(capsys, *(name if word == "NAME" else word for word in words))
    assert (code, said.count("\n")) == (2, 1), said
    assert len(said) < 600
