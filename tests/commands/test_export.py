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
    capsys: pytest.CaptureFixture[str], tmp_path: Path, *words: str, frame: LocalFrame | None = PLACE
) -> tuple[int, Any, str]:
    """(exit code, figures, stderr) of an export of the paper's zone."""
    write_lanes(LanesFile(lanes=lane_map_of(paper_layout()), frame=frame), tmp_path)
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
