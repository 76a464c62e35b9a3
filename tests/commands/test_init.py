"""`wzsumo init`: scenarios to start from, which are scenarios."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wzsumo.cli import main
from wzsumo.errors import SpecError
from wzsumo.geography import local_frame
from wzsumo.scenario.scenario import load_scenario
from wzsumo.sweep.study_file import load_study

SCENARIOS = Path(__file__).parents[2] / "scenarios"
PLACE = local_frame([[-93.6, 41.6]])


def init(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, Any, str]:
    with pytest.raises(SystemExit) as stopped:
        main(["init", *map(str, words), "--json"])
    out = capsys.readouterr()
    return int(stopped.value.code or 0), json.loads(out.out) if out.out else None, out.err


def feed_file(path: Path, *, points: Any = None, geometry: str = "LineString", **properties: Any) -> Path:
    """A feed of one event e1, 1500 m of a road that runs west on a slight bend."""
    x = -np.linspace(0, 1500, 16)
    xy = np.column_stack([x, 40 * (x / 1500) ** 2]) if points is None else np.array(points, dtype=float)
    core = {"data_source_id": "1", "event_type": "work-zone", "road_names": ["I-80"], "direction": "westbound"}
    event = {
        "id": "e1", "type": "Feature", "geometry": {"type": geometry, "coordinates": PLACE.to_lonlat(xy).tolist()},
        "properties": {
            "core_details": core, "start_date": "2026-06-01T00:00:00Z", "end_date": "2026-06-30T00:00:00Z",
            "vehicle_impact": "some-lanes-closed",
        } | properties,
    }  # fmt: skip
    info = {"publisher": "DOT", "version": "4.2", "data_sources": [], "update_date": "2026-06-01T00:00:00Z"}
    path.write_text(json.dumps({"type": "FeatureCollection", "feed_info": info, "features": [event]}))
    return path


def lanes(*pairs: tuple[str, str]) -> list[dict[str, Any]]:
    return [{"order": number + 1, "type": kind, "status": status} for number, (kind, status) in enumerate(pairs)]


LEFT_CLOSED = lanes(
    ("shoulder", "closed"), ("general", "closed"), ("general", "open"), ("general", "open"), ("shoulder", "open")
)


def test_scenario_of_the_library_is_copied(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, _ = init(capsys, "paper", "--out", tmp_path / "mine.toml")
    assert code == 0
    assert load_scenario(tmp_path / "mine.toml") == load_scenario(SCENARIOS / "paper.toml")
    assert (tmp_path / "mine.toml").read_text().startswith((SCENARIOS / "paper.toml").read_text().partition("#:schema")[0])
    assert (tmp_path / "scenario.schema.json").read_bytes() == (SCENARIOS / "scenario.schema.json").read_bytes()
    listed = init(capsys)[1]
    assert listed["zones"] == sorted(path.stem for path in SCENARIOS.glob("*.toml"))
    assert (listed["networks"], "how_many_traces" in listed["studies"]) == (["freeway"], True)


def test_scenario_in_a_network_and_study_run_from_where_they_were_copied_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert init(capsys, "freeway", "--out", tmp_path / "mine.toml")[0] == 0
    network = load_scenario(tmp_path / "mine.toml").network
    assert network is not None
    assert network.net == tmp_path / "freeway" / "freeway.net.xml"
    assert init(capsys, "how_many_traces", "--out", tmp_path / "study.toml")[0] == 0
    assert len(load_study(tmp_path / "study.toml").cases) == 2 * 2 * 4 * 2 * 3 * 4


def test_scenario_is_run_by_its_name_and_a_file_of_that_name_wins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert load_scenario("right_lane") == load_scenario(SCENARIOS / "right_lane.toml")
    (tmp_path / "right_lane").mkdir()  # such as the folder of an earlier result
    assert load_scenario("right_lane").name == "right_lane"
    (tmp_path / "right_lane").rmdir()
    (tmp_path / "right_lane").write_bytes((SCENARIOS / "left_lane.toml").read_bytes())
    assert load_scenario("right_lane").name == "left_lane"
    with pytest.raises(SpecError, match=r"rigth_lane: no such file; .*did you mean right_lane.*it has confusing, double_clo"):
        load_scenario("rigth_lane")
    with pytest.raises(SpecError, match=r"how_many: no such file; no study of the library \(did you mean|how_many: .*it has"):
        load_study(Path("how_many"))


def test_file_that_is_there_is_not_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.toml").write_text("mine")
    code, _, err = init(capsys, "paper", "--out", tmp_path / "mine.toml")
    assert code == 2
    assert "is there already" in err
    assert (tmp_path / "mine.toml").read_text() == "mine"
    code, _, err = init(capsys, "papre")
    assert (code, "no scenario or study of the library (did you mean paper?); it has confusing" in err) == (2, True)


def test_event_becomes_a_scenario_of_its_lanes_speed_place_and_length(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    feed = feed_file(tmp_path / "f.geojson", lanes=LEFT_CLOSED, reduced_speed_limit_kph=88.514)
    code, figures, _ = init(capsys, "--from", f"{feed}#e1", "--out", tmp_path / "zone.toml")
    assert code == 0
    scenario = load_scenario(tmp_path / "zone.toml")
    layout = scenario.layout()
    assert scenario.road is not None
    assert (scenario.road.lane_count, scenario.work_zone.closed_lanes) == (3, (2,))
    assert scenario.work_zone.posted_speed_mph == 55
    assert layout.end - layout.start == pytest.approx(1502, abs=3)  # the line of the event is 1502 m long
    assert scenario.road.frame is not None
    first_device = scenario.road.frame.to_lonlat(layout.road.to_xy(layout.start, layout.road.travelled_width / 2))
    assert first_device == pytest.approx(PLACE.to_lonlat((0.0, 0.0)), abs=1e-6)  # 0.1 m
    text = (tmp_path / "zone.toml").read_text()
    assert "# It leaves open, and this was assumed:" in text
    assert any("lanes of 12 ft" in word for word in figures["assumed"])


def test_shift_shoulder_and_lane_by_turns_are_laid_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shifted = lanes(("shoulder", "closed"), ("general", "shift-right"), ("general", "shift-right"), ("shoulder", "closed"))
    cases: dict[str, dict[str, Any]] = {
        "shift": {"lanes": shifted, "vehicle_impact": "all-lanes-open-shift-right"},
        "shoulder": {"lanes": lanes(("general", "open"), ("general", "open"), ("shoulder", "closed"))},
        "turns": {"vehicle_impact": "flagging", "reduced_speed_limit_kph": 56.3},
        "points": {"lanes": LEFT_CLOSED, "geometry": "MultiPoint", "points": [(0, 0), (-1000, 0)]},
    }
    found = {}
    for name, given in cases.items():
        feed = feed_file(tmp_path / f"{name}.geojson", **given)
        assert init(capsys, "--from", feed, "--out", tmp_path / f"{name}.toml")[0] == 0
        found[name] = load_scenario(tmp_path / f"{name}.toml").work_zone
    assert (found["shift"].shift_ft, found["shift"].closed_shoulder) == (10, "left")
    assert (found["shoulder"].closed_lanes, found["shoulder"].closed_shoulder) == ((), "right")
    assert (found["turns"].one_lane_two_way, found["turns"].posted_speed_mph) == ("flaggers", 35)
    assert found["points"].closed_lanes == (2,)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "no lanes": ({}, "has no `lanes` of type general"),
    "all lanes closed": ({"lanes": lanes(("general", "closed"))}, "closes all 1 lanes"),
    "a detour": ({"core_details": {"event_type": "detour", "data_source_id": "1"}}, "is a detour"),
    "one place": ({"lanes": LEFT_CLOSED, "points": [(0, 0), (0, 0)]}, "is one place"),
    "a hairpin": ({"lanes": LEFT_CLOSED, "points": [(0, 0), (300, 0), (295, 5), (0, 5)]}, "sharp turns"),
    "both sides": ({"lanes": lanes(("general", "closed"), ("general", "open"), ("general", "closed"))}, "makes no scenario"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_event_that_makes_no_scenario_is_refused_by_its_id(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], case: str
) -> None:
    given, said = REFUSED[case]
    feed = feed_file(tmp_path / "f.geojson", **given)
    code, _, err = init(capsys, "--from", f"{feed}#e1", "--out", tmp_path / "zone.toml")
    assert code == 2
    assert said in err
    assert f"{feed}#e1" in err
    assert not (tmp_path / "zone.toml").exists()


def test_what_a_feed_says_stays_in_the_comments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    feed = feed_file(tmp_path / "feed.geojson", lanes=LEFT_CLOSED, reduced_speed_limit_kph=88.514)
    content = json.loads(feed.read_text())
    content["features"][0]["properties"]["core_details"]["road_names"] = ["I-80\nname = 'mine'\ud800"]
    feed.write_text(json.dumps(content))
    code, _, said = init(capsys, "--from", f"{feed}#e1", "--out", tmp_path / "z.toml")
    assert code == 0, said
    assert load_scenario(tmp_path / "z.toml").name == "wzdx_e1"


def test_names_that_no_scenario_can_have_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("x" * 300, "scenario.schema.json", "."):
        code, _, said = init(capsys, "paper", "--out", tmp_path / name)
        assert (code, said.count("\n")) == (2, 1), said
    assert list(tmp_path.iterdir()) == []
