"""The reference of the Python package and of the command line, from the code."""

import contextlib
import inspect
import io
import os
import re
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass
from typing import Any

import pydantic

import wzsumo
from wzsumo import cli


def api_page() -> str:
    """What `import wzsumo` offers: functions, then nouns, each with its signature and docstring."""
    named = {name: getattr(wzsumo, name) for name in wzsumo.__all__}
    functions = [name for name, found in named.items() if inspect.isfunction(found)]
    lines = ["# Python", "", "`import wzsumo` offers these; each is loaded when it is first used. Lengths are in metres,",
             "angles in radians, times in seconds, where the name does not say otherwise.", "", "## Functions", ""]  # fmt: skip
    lines += ["| function | what it returns |", "|---|---|"]
    lines += [f"| [`{name}`](#{name.lower()}) | {_first_line(named[name])} |" for name in functions]
    for name in functions:
        lines += ["", f"### {name}", "", *_signature(name, named[name]), "", *_docstring(named[name])]
    lines += ["", "## Nouns", "", "| noun | what it is |", "|---|---|"]
    nouns = [name for name in named if name not in functions]
    lines += [f"| [`{name}`](#{name.lower()}) | {_first_line(named[name])} |" for name in nouns]
    for name in nouns:
        lines += ["", f"### {name}", "", *_docstring(named[name]), *_fields(named[name]), *_methods(named[name])]
    return "\n".join(lines) + "\n"


def commands_page() -> str:
    """What `wzsumo COMMAND --help` says, of every command."""
    lines = ["# Commands", "", "What each command says with `--help`. Exit codes: 0 done (a path that does not exist is a",
             "result), 1 a fault of ours, 2 bad input, told in one line.", "",
             "## wzsumo", "", "```text", _help([]), "```"]  # fmt: skip
    for name in cli.COMMANDS:
        lines += ["", f"## {name}", "", "```text", _help([name]), "```"]
    return "\n".join(lines) + "\n"


def _help(words: list[str]) -> str:
    said = io.StringIO()
    width = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = "100"
    try:
        with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
            cli.main([*words, "--help"])
    finally:
        os.environ.pop("COLUMNS") if width is None else os.environ.update(COLUMNS=width)
    return said.getvalue().rstrip()


def _first_line(found: object) -> str:
    text = (inspect.getdoc(found) or "").split("\n\n")[0]
    return _escaped(" ".join(text.split()))


def _signature(name: str, function: Any) -> Iterator[str]:
    said = inspect.signature(function)
    yield "```python"
    yield f"wzsumo.{name}("
    keyword_only = False
    for one in said.parameters.values():
        if one.kind is one.KEYWORD_ONLY and not keyword_only:
            keyword_only = True
            yield "    *,"
        yield f"    {one},"
    yield f"){f' -> {_annotation(said.return_annotation)}' if said.return_annotation is not said.empty else ''}"
    yield "```"


def _annotation(annotation: Any) -> str:
    return annotation if isinstance(annotation, str) else inspect.formatannotation(annotation).replace("typing.", "")


def _docstring(found: object) -> Iterator[str]:
    """The docstring as Markdown; examples become code."""
    text = inspect.getdoc(found) or ""
    for block in re.split(r"\n\n+", text):
        if block.lstrip().startswith(">>>"):
            yield from ("```pycon", inspect.cleandoc(block), "```", "")
        else:
            yield from (_escaped(block), "")


def _escaped(text: str) -> str:
    """Text whose brackets, stars and bars are no Markdown; code in backquotes stays."""
    parts = re.split(r"(`[^`]+`)", text)
    parts[::2] = [re.sub(r"([\[\]*_|<>$])", r"\\\1", part) for part in parts[::2]]
    return "".join(parts)


def _fields(noun: Any) -> Iterator[str]:
    """The fields of a dataclass or of a spec as a table, the members of an enumeration as a list."""
    rows: list[tuple[str, str, str]] = []
    if inspect.isclass(noun) and issubclass(noun, pydantic.BaseModel):
        rows = [
            (
                name,
                _annotation(field.annotation),
                "" if field.is_required() else repr(field.get_default(call_default_factory=True)),
            )
            for name, field in noun.model_fields.items()
        ]
    elif is_dataclass(noun):
        rows = [
            (field.name, _annotation(field.type), "" if field.default is MISSING else repr(field.default))
            for field in fields(noun)
        ]
    elif hasattr(noun, "__members__"):
        yield from (", ".join(f"`{name}`" for name in noun.__members__), "")
    if rows:
        yield from ("| field | type | default |", "|---|---|---|")
        for name, kind, default in rows:
            shown = default if len(default) <= 60 else "..."
            yield f"| `{name}` | {_code(kind)} | {_code(shown)} |"
        yield ""


def _code(text: str) -> str:
    return (
        f"`{text.replace('|', '&#124;')}`"
        if text and "|" not in text
        else f"<code>{text.replace('|', '&#124;')}</code>"
        if text
        else ""
    )


def _methods(noun: Any) -> Iterator[str]:
    """The public methods and properties that the noun itself defines, each with what it returns."""
    if not inspect.isclass(noun) or hasattr(noun, "__members__"):
        return
    for name, found in vars(noun).items():
        plain = found.__func__ if isinstance(found, classmethod | staticmethod) else found
        about = _first_line(plain) if isinstance(plain, property) or inspect.isfunction(plain) else ""
        if name.startswith("_") or not about:
            continue
        arguments = "" if isinstance(plain, property) else f"({', '.join(list(inspect.signature(plain).parameters)[1:])})"
        yield f"- `{name}{arguments}`: {about}"
