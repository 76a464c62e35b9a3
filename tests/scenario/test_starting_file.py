"""What `wzsumo init` writes: the scenario of the library, with every other key as a comment that may be taken away."""

import re
from pathlib import Path

import pytest

from wzsumo.scenario.scenario import load_scenario
from wzsumo.scenario.starting_file import starting_text

LIBRARY = sorted((Path(__file__).parents[2] / "scenarios").glob("*.toml"))


@pytest.mark.parametrize("path", LIBRARY, ids=lambda path: path.stem)
def test_starting_file_is_the_scenario_also_with_every_offered_key_set(path: Path, tmp_path: Path) -> None:
    scenario = load_scenario(path)
    text = starting_text(path.read_text(encoding="utf-8"), scenario)
    mine = tmp_path / "mine.toml"
    mine.write_text(text, encoding="utf-8")
    assert load_scenario(mine) == scenario
    offered = re.sub(r"(?m)^# (\w+ = [^ #].*|\[\w+\])$", r"\1", text)
    assert offered.count("\n# ") < text.count("\n# ") - 20
    mine.write_text(offered, encoding="utf-8")
    assert load_scenario(mine) == scenario
    assert "# buffer_ft = " in text
    assert max(map(len, text.splitlines())) < 200


@pytest.mark.parametrize(
    ("name", "changes", "taper_ft"),
    [  # as docs/guide/scenarios.md has it; merging tapers of MUTCD 11th ed., Table 6B-4: WS, and WS^2/60 up to 40 mph
        ("left_lane", ["posted_speed_mph = 70"], 12 * 70),
        (
            "right_lane",
            ["posted_speed_mph = 45", 'road_type = "urban_high_speed"', 'drivers = "uncalibrated"'],
            12 * 45,
        ),
        ("street_interior_lane", ["posted_speed_mph = 30"], 12 * 30**2 / 60),
    ],
)
def test_zone_of_another_speed_is_made_of_a_starting_file_as_the_guide_says(
    tmp_path: Path, name: str, changes: list[str], taper_ft: float
) -> None:
    text = starting_text((LIBRARY[0].parent / f"{name}.toml").read_text(encoding="utf-8"), load_scenario(name))
    for line in changes:
        key = line.partition(" = ")[0]
        text, n = re.subn(rf"(?m)^(?:# )?{key} = \S+", line, text)
        assert n == 1, key
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    scenario = load_scenario(tmp_path / "mine.toml")
    assert scenario.layout().area("merging taper").length / 0.3048 == pytest.approx(taper_ft)
    posted = scenario.work_zone.posted_speed_mph * 0.44704
    assert scenario.control.target_speed_mps == pytest.approx(posted)
