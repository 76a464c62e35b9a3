from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.errors import SpecError
from wzsumo.road import Bend, RoadSpec
from wzsumo.scenario.scenario import load_scenario
from wzsumo.spec import Spec, parse_spec, read_toml

PAPER = Path(__file__).parents[2] / "scenarios" / "paper.toml"


class Numbers(Spec):
    whole: int = 1
    real: float = 1.0
    maybe: float | None = None
    pairs: tuple[tuple[float, float], ...] = ()
    flag: bool = True
    name: str = "x"


@given(st.one_of(st.booleans(), st.text(max_size=5)), st.sampled_from(["whole", "real", "maybe"]))
def test_number_is_neither_a_text_nor_a_truth_value(value: object, key: str) -> None:
    with pytest.raises(SpecError, match=f"{key}=.*must be a number, without quotes"):
        parse_spec(Numbers, {key: value}, source="a.toml")


@pytest.mark.parametrize("pairs", [[[1, True]], [["1", 2]], "ab", True])
def test_number_in_a_list_is_neither_a_text_nor_a_truth_value(pairs: object) -> None:
    with pytest.raises(SpecError, match=r"pairs=.*must be a number"):
        parse_spec(Numbers, {"pairs": pairs}, source="a.toml")
    assert parse_spec(Numbers, {"pairs": [[1, 2]], "whole": 3, "flag": False, "name": "3"}, source="a.toml").pairs == ((1, 2),)


def test_file_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    (tmp_path / "bom.toml").write_bytes(b"\xef\xbb\xbf" + PAPER.read_bytes())
    assert load_scenario(tmp_path / "bom.toml") == load_scenario(PAPER)


@pytest.mark.parametrize(
    "content",
    [b"a = " + b"[" * 20_000, b"a = " + b"9" * 6000, b"a = 2001-99-99", b"a = \xff", b"a = 1\0", b"x" * 10_000_000, b"[a\n"],
)
def test_text_that_is_no_toml_is_refused_in_a_short_message(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "bad.toml").write_bytes(content)
    with pytest.raises(SpecError, match=r"bad\.toml: ") as refused:
        read_toml(tmp_path / "bad.toml")
    assert len(str(refused.value)) < 500 + len(str(tmp_path))


def test_pipe_and_folder_are_refused_and_not_waited_for(tmp_path: Path) -> None:
    import os

    os.mkfifo(tmp_path / "pipe.toml")
    for path, what in ((tmp_path / "pipe.toml", "no regular file"), (tmp_path, "a folder"), (Path("a\0b"), "cannot|null")):
        with pytest.raises(SpecError, match=what):
            read_toml(path)


def test_value_of_megabytes_is_shown_cut_and_of_thousands_of_mistakes_the_first(tmp_path: Path) -> None:
    with pytest.raises(SpecError) as refused:
        parse_spec(Numbers, {"name": 1, "flag": "x" * 10_000_000, **{f"k{n}": n for n in range(5000)}}, source="a.toml")
    assert len(str(refused.value)) < 6000
    assert "and 4982 more mistakes" in str(refused.value)


@pytest.mark.parametrize("radius", [1e-9, 1e-300, -1e-5])
def test_bend_that_would_take_millions_of_points_is_refused_before_they_are_made(radius: float) -> None:
    road = RoadSpec(lane_count=1, left_shoulder_ft=6, right_shoulder_ft=6, alignment=(Bend(length_ft=1000, radius_ft=radius),))
    with pytest.raises(SpecError, match="takes more than 200000 points"):
        road.build()


@pytest.mark.parametrize("length", [1e7, 2.0**63, 1e300])
def test_road_of_thousands_of_miles_is_refused(length: float) -> None:
    content = {"lane_count": 1, "left_shoulder_ft": 6, "right_shoulder_ft": 6, "length_ft": length}
    with pytest.raises(SpecError, match=r"length_ft=.*less than or equal to 528000"):
        parse_spec(RoadSpec, content, source="a.toml")
