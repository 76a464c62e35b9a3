"""`wzsumo export`: files that others read, or one line that says why not."""

import json
from pathlib import Path
from typing import Any

import pytest
from builders import lane_map_of, paper_layout

from wzsumo.cli import main
from wzsumo.files.lanes import LanesFile, write_lanes
from wzsumo.geography import LocalFrame, local_frame

PLACE = local_frame([[-83.74, 42.28]])


def export(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, *words: str, frame: LocalFrame | None = PLACE, utc: bool = True
) -> tuple[int, Any, str]:
    """(exit code, figures, stderr) of an export of the paper's zone."""
    write_lanes(LanesFile(lanes=lane_map_of(paper_layout()), frame=frame, utc=utc), tmp_path)
    with pytest.raises(SystemExit) as stopped:
        main(["export", str(tmp_path), "--json", *words])
    out = capsys.readouterr()
    return int(stopped.value.code or 0), json.loads(out.out) if out.out else None, out.err


@pytest.mark.parametrize(("to", "begins"), [("lanelet2", b"<?xml"), ("opendrive", b"<?xml"), ("geoparquet", b"PAR1")])
def test_each_format_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str], to: str, begins: bytes) -> None:
    code, figures, _ = export(capsys, tmp_path, "--to", to, "--out", str(tmp_path / "out"))
    assert code == 0
    assert (tmp_path / "out").read_bytes().startswith(begins)
    assert figures["frame"]["crs"] == PLACE.crs


def test_origin_gives_a_place_to_lanes_that_have_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--to", "lanelet2", "--out", str(tmp_path / "out.osm"))
    code, _, err = export(capsys, tmp_path, *words, frame=None)
    assert code == 2
    assert "--origin" in err
    assert not (tmp_path / "out.osm").exists()
    code, figures, _ = export(capsys, tmp_path, *words, "--origin", "42.123456", "-83.654321", frame=None)
    assert code == 0
    assert (figures["frame"]["origin_lat"], figures["frame"]["origin_lon"]) == pytest.approx((42.123456, -83.654321), abs=1e-9)


def test_feed_says_what_it_assumed_and_takes_what_is_given(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    about = ("--about", "road_name=I-94", "publisher=Test DOT", "end_date=2026-07-01T00:00:00Z")
    words = ("--to", "wzdx", "--out", str(tmp_path / "feed.geojson"), "--speed-limit-mph", "45")
    code, figures, _ = export(capsys, tmp_path, *words, *about)
    assert code == 0
    assert figures["assumed"] == ["start_date: 2026-06-01T14:00:00Z"]
    feed = json.loads((tmp_path / "feed.geojson").read_text())
    first = feed["features"][0]["properties"]
    assert (feed["feed_info"]["publisher"], first["core_details"]["road_names"]) == ("Test DOT", ["I-94"])
    assert first["core_details"]["direction"] == "eastbound"
    assert first["reduced_speed_limit_kph"] == pytest.approx(72.42, abs=0.01)


@pytest.mark.parametrize(
    ("about", "utc", "said"),
    [
        (["colour=red"], True, "--about colour=red: must be KEY=VALUE"),
        (["direction=uphill"], True, "would break WZDx 4.2: features[0].properties.core_details.direction"),
        (["start_date=2026-06-01T00:00:00-05:00"], True, "must be in UTC"),
        (["road_name=I-94"], False, "the traces' times are no dates"),
    ],
)
def test_feed_that_would_break_the_specification_is_not_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], about: list[str], utc: bool, said: str
) -> None:
    code, _, err = export(capsys, tmp_path, "--to", "wzdx", "--out", str(tmp_path / "f.geojson"), "--about", *about, utc=utc)
    assert code == 2
    assert said in err
    assert not (tmp_path / "f.geojson").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [(("--origin", "42", "-83"), "has a place on earth already"), (("--speed-limit-mph", "0"), "above 0 and at most 100")],
)
def test_options_that_cannot_be_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], said: str
) -> None:
    code, _, err = export(capsys, tmp_path, "--to", "opendrive", "--out", str(tmp_path / "o.xodr"), *words)
    assert code == 2
    assert said in err


@pytest.mark.parametrize("origin", [("1e300", "0"), ("42", "1e300"), ("91", "0"), ("0", "-181")])
def test_an_origin_that_is_no_place_on_earth_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], origin: tuple[str, str]
) -> None:
    words = ("--to", "lanelet2", "--out", str(tmp_path / "out.osm"), "--origin", *origin)
    code, _, err = export(capsys, tmp_path, *words, frame=None)
    assert (code, err.count("\n")) == (2, 1)
    assert "give a latitude of -90..90" in err
