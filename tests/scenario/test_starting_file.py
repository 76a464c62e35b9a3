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
