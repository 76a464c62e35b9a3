"""The tables of docs/method/lanes.md name every constant of the lane model, with the value that the code has."""

import ast
import importlib
import re
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "wzsumo" / "crowd_mapping" / "lanes"
PAGE = (ROOT / "docs" / "method" / "lanes.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| `(\w+)\.([A-Z_]+)` \| ([^|]+) \|(.*)\|$", flags=re.MULTILINE)


def constants_of_the_code() -> dict[tuple[str, str], object]:
    found: dict[tuple[str, str], object] = {}
    for path in sorted(FOLDER.glob("*.py")):
        module = importlib.import_module(f"wzsumo.crowd_mapping.lanes.{path.stem}")
        for statement in ast.parse(path.read_text(encoding="utf-8")).body:
            targets = statement.targets if isinstance(statement, ast.Assign) else []
            names = [node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)]
            found |= {(path.stem, name): getattr(module, name) for name in names if name.isupper()}
    return found


def told_value(text: str) -> list[float]:
    """The numbers of a cell such as `3`, `1/3000` or `(1, 0.5), (2, 0.5)`."""
    numbers = [part.split("/") for part in re.findall(r"-?[\d.]+(?:e-?\d+)?(?:/\d+)?", text)]
    return [float(number[0]) / float(number[1] if len(number) > 1 else 1) for number in numbers]


ROWS = ROW.findall(PAGE)
CODE = constants_of_the_code()


def test_every_constant_of_the_lane_model_is_on_its_page_once_and_no_other() -> None:
    told = [(module, name) for module, name, *_ in ROWS]
    assert sorted(told) == sorted(CODE)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]}.{row[1]}")
def test_value_of_a_constant_on_the_page_is_that_of_the_code(row: tuple[str, str, str, str]) -> None:
    module, name, value, _ = row
    assert told_value(value) == pytest.approx(np.asarray(CODE[module, name], dtype=float).ravel().tolist(), rel=1e-6)


def test_page_counts_its_constants_by_what_they_rest_on() -> None:
    bases = [rest.split("|")[-1].strip() for *_, rest in ROWS if rest.count("|") == 2]
    ours = sum(basis.startswith("ours") for basis in bases)
    words = r"(\d+) named constants decide the map: (\d+) are from a manual or a paper, (\d+) were chosen by us"
    counted = re.search(words, PAGE)
    assert counted is not None
    assert tuple(map(int, counted.groups())) == (len(bases), len(bases) - ours, ours)
