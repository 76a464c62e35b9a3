"""The reference of all keys of a kind of spec files, as a page in Markdown."""

from collections.abc import Iterator

from wzsumo.scenario.keys import Section, sections_of
from wzsumo.scenario.sections import Decides
from wzsumo.spec import Spec

HEADER = "| key | what may be given | unit | default | what it decides, and the source of the default |\n|---|---|---|---|---|"


def keys_page(kind: type[Spec], *, title: str) -> str:
    """A heading a section, with a table of its keys; a key without a default must be given unless its section is left out."""
    lines = [f"# {title}", ""]
    for section in sections_of(kind):
        lines += _section_lines(section, decides=_decides(kind, section.name))
    return "\n".join(lines).rstrip() + "\n"


def _section_lines(section: Section, *, decides: str) -> Iterator[str]:
    heading = f"[[{section.name}]]" if section.repeated else f"[{section.name}]"
    if section.name:
        yield from (f"## `{heading}`", "")
    yield section.words + (" **Must be given.**" if section.required and section.name else "")
    if decides:
        yield from ("", f"It decides {decides}.")
    yield ""
    if section.keys:
        yield HEADER
        for key in section.keys:
            default = "**required**" if key.required else f"`{key.default}`" if key.default else "left out"
            yield f"| `{key.name}` | {_cell(key.kind)} | {key.unit} | {default} | {_cell(key.words)} |"
        yield ""


def _decides(kind: type[Spec], name: str) -> str:
    """What a section at the top decides, where its model says so."""
    field = kind.model_fields.get(name)
    said = [str(part) for part in field.metadata if isinstance(part, Decides)] if field else []
    return (
        {
            "simulation": "the traffic, and so everything else",
            "reports": "the traces that make the map",
            "site": "cells, start and goal",
            "drive": "plan and drive",
            "LiDAR": "the LiDAR maps",
        }.get(said[0], "")
        if said
        else ""
    )


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
