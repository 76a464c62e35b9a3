"""The pages say what the files of docs/results/ say."""

import re
from pathlib import Path

import code_parts
import markers
import pytest
import records

ROOT = Path(__file__).parents[3]
# What decides no figure by itself: the door, drawings, and the base, whose tests pin every number.
UNDECIDING = {
    "wzsumo/live/__init__.py", "wzsumo/live/stream",
    "wzsumo/__init__.py", "wzsumo/__main__.py", "wzsumo/api.py", "wzsumo/cli.py", "wzsumo/commands",
    "wzsumo/crowd_mapping/__init__.py", "wzsumo/errors.py", "wzsumo/figures", "wzsumo/frames.py",
    "wzsumo/geography.py", "wzsumo/report", "wzsumo/rigid.py",
    "wzsumo/simulation/connection.py", "wzsumo/spec.py", "wzsumo/tables.py", "wzsumo/units.py",
}  # fmt: skip


@pytest.fixture(scope="module")
def known() -> dict[str, records.Record]:
    return records.read_records()


def test_every_page_says_what_its_files_say(known: dict[str, records.Record]) -> None:
    texts = {page: page.read_text(encoding="utf-8") for page in markers.pages()}
    differing = [page.relative_to(ROOT) for page, text in texts.items() if markers.filled(text, known) != text]
    assert differing == [], "run `make numbers` and commit what it changes"


def test_every_measurement_is_quoted_and_every_data_file_belongs_to_one(known: dict[str, records.Record]) -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in markers.pages())
    quoted = {name for words in re.findall(r"<!-- (?:measured|age) ([^>]+?) -->", text) for name in words.split()}
    assert quoted == set(known)
    data = {path.name for path in records.RESULTS.iterdir() if path.suffix in {".csv", ".json"}}
    named = {name for record in known.values() for name in record.data}
    assert data == {name for name in named if name.endswith((".csv", ".json"))}


def test_ages_are_not_written_by_hand() -> None:
    for page in markers.pages():
        rest = markers.MARKER.sub("", page.read_text(encoding="utf-8"))
        if page.parent.name == "results" and page.name == "README.md":
            rest = rest.replace("> **Older than the code.**", "")
        assert not re.search(r"older than the code|not\s+yet\s+measured on", rest, flags=re.IGNORECASE), page


def test_every_module_of_the_package_is_of_one_part_of_the_code_or_decides_nothing() -> None:
    named = [*code_parts.PARTS.values(), *((name,) for name in sorted(UNDECIDING))]
    for path in (ROOT / "wzsumo").rglob("*.py"):
        module = path.relative_to(ROOT)
        parts = [names for names in named if f"-{module}" not in names and {str(module), *map(str, module.parents)} & {*names}]
        assert len(parts) == 1, module
