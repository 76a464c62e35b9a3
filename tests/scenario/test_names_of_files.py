"""Names of files in scenarios, studies and configurations that no file can have: one line that says where they stand."""

import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from wzsumo.errors import InputError, PlacementError
from wzsumo.placement.configuration import Configuration
from wzsumo.scenario.scenario import load_scenario
from wzsumo.sweep.study_file import load_study

NETWORKS = Path(__file__).parents[2] / "scenarios" / "networks"
NAMES = ("x" * 20_000, "y" * 300 + ".toml", "a\0b")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("key", ["net", "routes"])
def test_scenario_that_names_no_file_of_a_network_is_refused_by_its_key(tmp_path: Path, key: str, name: str) -> None:
    content: dict[str, Any] = tomllib.loads((NETWORKS / "freeway.toml").read_text())
    content["network"][key] = [name] if key == "routes" else name
    (tmp_path / "zone.toml").write_text(tomli_w.dumps(content))
    with pytest.raises(InputError, match=f"^network.{key}: .*name another file or folder$"):
        load_scenario(tmp_path / "zone.toml")


@pytest.mark.parametrize("name", NAMES)
def test_study_of_a_scenario_that_can_be_no_file_is_refused(tmp_path: Path, name: str) -> None:
    study = {"name": "s", "scenarios": [name], "methods": ["swept"], "grid": {"seed": [1]}}
    (tmp_path / "study.toml").write_text(tomli_w.dumps(study))
    with pytest.raises(InputError, match=r"^scenarios: .*name another file or folder$"):
        load_study(tmp_path / "study.toml")


def test_configuration_that_names_no_file_is_refused_in_a_short_line(tmp_path: Path) -> None:
    config = tmp_path / "c.sumocfg"
    config.write_text(f'<configuration><input><net-file value="{"x" * 20_000}"/></input></configuration>')
    with pytest.raises(PlacementError, match=r"net-file names .*which is no file") as refused:
        Configuration.read(config, net=NETWORKS / "freeway" / "freeway.net.xml")
    assert len(str(refused.value)) < 600
