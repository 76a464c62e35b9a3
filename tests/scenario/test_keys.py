"""The reference of keys is that of the models: every key has words, and the pages and schemas in the repository are current."""

import json
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from pydantic import Field

from wzsumo.scenario.keys import json_schema, sections_of, words_of_keys
from wzsumo.scenario.keys_page import keys_page
from wzsumo.scenario.scenario import Scenario
from wzsumo.spec import Spec
from wzsumo.sweep.study_file import StudySpec

ROOT = Path(__file__).parents[2]
CURRENT = {
    "scenarios/scenario.schema.json": lambda: json.dumps(json_schema(Scenario), indent=1) + "\n",
    "scenarios/studies/study.schema.json": lambda: json.dumps(json_schema(StudySpec), indent=1) + "\n",
    "docs/guide/keys.md": lambda: keys_page(Scenario, title="Keys of a scenario"),
    "docs/guide/study_keys.md": lambda: keys_page(StudySpec, title="Keys of a study"),
}


class Base(Spec):
    low_m: float = 1.0  # from the base


class Example(Base):
    """An example."""

    # of the ground, in
    # two lines
    width_m: float = Field(2.0, gt=0, le=5)
    name: str = Field(
        min_length=1,
    )  # beside; None: no name
    bare: int | None = None


def test_words_of_a_key_are_the_comments_beside_it_and_right_above_it() -> None:
    assert words_of_keys(Example) == {
        "low_m": "from the base",
        "width_m": "of the ground, in two lines",
        "name": "beside; left out: no name",
        "bare": "",
    }
    (section,) = sections_of(Example)
    keys = {key.name: key for key in section.keys}
    assert (keys["width_m"].kind, keys["width_m"].unit, keys["width_m"].default) == ("number, above 0 to 5", "m", "2.0")
    assert (keys["name"].required, keys["bare"].required, keys["bare"].kind) == (True, False, "whole number")


@pytest.mark.parametrize("kind", [Scenario, StudySpec])
def test_every_key_says_what_it_decides(kind: type[Spec]) -> None:
    silent = [key.dotted for section in sections_of(kind) for key in section.keys if not key.words]
    assert silent == [], "write what a key decides, and its source, in a comment beside it"


@pytest.mark.parametrize("name", CURRENT)
def test_pages_and_schemas_in_the_repository_are_those_of_the_models(name: str) -> None:
    assert (ROOT / name).read_text(encoding="utf-8") == CURRENT[name](), "run `make keys` and commit what it writes"


def named_schema(path: Path) -> Any:
    """The schema that a file names in its first comments, as an editor finds it."""
    lines = path.read_text(encoding="utf-8").split("\n\n")[0].splitlines()
    (name,) = (line.removeprefix("#:schema ") for line in lines if line.startswith("#:schema "))
    return json.loads((path.parent / name).read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", sorted((ROOT / "scenarios").rglob("*.toml")), ids=lambda path: path.stem)
def test_files_of_the_library_fit_the_schema_that_they_name(path: Path) -> None:
    checker = jsonschema.Draft202012Validator(named_schema(path))
    assert [error.message for error in checker.iter_errors(tomllib.loads(path.read_text(encoding="utf-8")))] == []


def test_schema_refuses_a_wrong_key_and_takes_presets_of_drivers_and_tables() -> None:
    schema = json_schema(Scenario)
    checker = jsonschema.Draft202012Validator(schema)
    content = tomllib.loads((ROOT / "scenarios" / "paper.toml").read_text(encoding="utf-8"))
    demand = content["simulation"]["demand"]
    for drivers, right in (("hcm", True), ({"tau_s": 1.4}, True), ("hmc", False), ({"tau": 1.4}, False)):
        demand["drivers"] = drivers
        assert checker.is_valid(content) == right
    assert not checker.is_valid(content | {"crowds": {}})
    assert schema["$defs"]["CrowdSpec"]["properties"]["penetration"]["description"].startswith("share of vehicles")
