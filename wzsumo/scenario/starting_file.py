"""A scenario file to start from: one of the library, with the keys that it leaves out as comments."""

import tomllib
from collections.abc import Iterator
from typing import Any

from wzsumo.scenario.keys import Key, Section, sections_of, toml_text
from wzsumo.scenario.scenario import Scenario

OFFERED = ("gnss", "site", "map", "control")  # sections that are shown where the file has none
MAX_WORDS = 110  # characters of what a comment says
MORE = (
    "# Further sections and keys, with their defaults and sources: wzsumo schema --markdown",
    "# A line that begins with # is a comment. Take the # away to set a key, here with the value that holds without it.",
)


def starting_text(text: str, scenario: Scenario) -> str:
    """The text of a scenario's file with every key that its sections leave out as a comment: value, unit and meaning."""
    given, values = tomllib.loads(text), scenario.model_dump()
    sections = {section.name: section for section in sections_of(Scenario) if not section.repeated}
    lines: list[str] = []
    for block in _blocks(text):
        name = block[0].strip("[] ").partition("]")[0] if block[0].startswith("[") else ""
        lines += block
        if name in sections:
            lines += _left_out(sections[name], _at(given, name), _at(values, name))
        lines += [""] if name else []
    for name in OFFERED:
        if name not in given:
            lines += [f"# [{name}]", *_left_out(sections[name], {}, _at(values, name)), ""]
    return "\n".join([*lines, *MORE]) + "\n"


def _blocks(text: str) -> Iterator[list[str]]:
    """The lines of each table, the head of the file first; comments right above a table's name belong to it."""
    block: list[str] = []
    for line in text.rstrip("\n").split("\n"):
        if line.startswith("["):
            while block and not block[-1]:
                block.pop()
            yield [*block, ""] if not block or not block[0].startswith("[") else block
            block = []
        block.append(line)
    yield block


def _left_out(section: Section, given: Any, values: Any) -> Iterator[str]:
    for key in section.keys:
        if section.name and key.name not in given:
            yield _comment(key, toml_text(_at(values, key.name)))


def _comment(key: Key, value: str) -> str:
    words = key.words if len(key.words) <= MAX_WORDS else f"{key.words[:MAX_WORDS].rpartition(' ')[0]} ..."
    return f"# {f'{key.name} = {value}':<34} # {f'[{key.unit}] ' if key.unit else ''}{words}"


def _at(content: Any, dotted: str) -> Any:
    """The value at a dotted key; an empty table where there is none."""
    for part in dotted.split("."):
        content = content.get(part, {}) if isinstance(content, dict) else {}
    return content
