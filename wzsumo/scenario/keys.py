"""The keys of spec files, read off the models that check them: type, unit, default, bounds, and what each decides.

What a key decides, and where its default comes from, is said in one place: the comment beside it in the model's source.
"""

import ast
import inspect
import io
import textwrap
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

import tomli_w
from pydantic.fields import FieldInfo

from wzsumo.spec import Spec, spec_in
from wzsumo.units import unit_of

# TOML's words for the types of Python.
TYPE_WORDS = {int: "whole number", float: "number", str: "text", bool: "true or false", Path: "file", NoneType: ""}
NOT_TOLD = ("fmt:", "type:", "noqa")  # comments for tools
BOUNDS = {"gt": "above", "ge": "from", "lt": "below", "le": "to"}


@dataclass(frozen=True, kw_only=True)
class Key:
    """One key of a spec file."""

    section: str  # dotted, as in simulation.demand; "" at the top
    name: str
    kind: str  # what may be given, in words
    unit: str
    default: str  # as TOML; "" where it must be given, or where leaving it out means something of its own
    required: bool
    words: str  # what it decides, with its source

    @property
    def dotted(self) -> str:
        """The key as a study names it."""
        return f"{self.section}.{self.name}" if self.section else self.name


@dataclass(frozen=True, kw_only=True)
class Section:
    """A table of a spec file, with the keys that are no tables themselves."""

    name: str  # dotted; "" at the top
    words: str
    required: bool
    repeated: bool  # a list of tables
    keys: tuple[Key, ...]


def sections_of(kind: type[Spec], *, name: str = "", required: bool = True, repeated: bool = False) -> Iterator[Section]:
    """The sections of a spec in the order of its model, each followed by those within it.

    Where a model takes a section with other defaults than the section's own, these are told.
    """
    yield from _sections(kind, None, name=name, told=_first_paragraph(kind), required=required, repeated=repeated)


def _sections(
    kind: type[Spec], default: Spec | None, *, name: str, told: str, required: bool, repeated: bool
) -> Iterator[Section]:
    words = words_of_keys(kind)
    fields = kind.model_fields
    within = {key: spec for key, field in fields.items() if (spec := spec_in(field.annotation)) and issubclass(spec, Spec)}
    keys = tuple(
        Key(
            section=name, name=key, kind=kind_in_words(field), unit=unit_of(key), required=field.is_required(),
            default=toml_text(_default(field, key, default)), words=words.get(key, ""),
        )
        for key, field in fields.items()
        if key not in within
    )  # fmt: skip
    yield Section(name=name, words=told, required=required, repeated=repeated, keys=keys)
    for key, spec in within.items():
        field = fields[key]
        given = _default(field, key, default)
        yield from _sections(
            spec, given if isinstance(given, Spec) else None, name=f"{name}.{key}".lstrip("."),
            told=" ".join(filter(None, (_first_paragraph(spec), _sentence(words.get(key, ""))))), required=field.is_required(),
            repeated=get_origin(field.annotation) is tuple,
        )  # fmt: skip


@cache
def words_of_keys(kind: type[Spec]) -> dict[str, str]:
    """What the comments in a model's source say of its keys: those on a key's own lines, and the lines right above it."""
    words = words_of_keys(kind.__base__) if kind.__base__ not in (None, Spec) and issubclass(kind.__base__, Spec) else {}
    source = textwrap.dedent(inspect.getsource(kind))
    comments = {
        token.start[0]: (token.string.lstrip("# "), token.line.lstrip().startswith("#"))
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT
    }
    (model,) = ast.parse(source).body
    assert isinstance(model, ast.ClassDef)  # noqa: S101 - the source of a class
    for node in model.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.end_lineno:
            above: list[str] = []
            line = node.lineno - 1
            while line in comments and comments[line][1]:
                above.insert(0, comments[line][0])
                line -= 1
            beside = [comments[line][0] for line in range(node.lineno, node.end_lineno + 1) if line in comments]
            own, more = _joined(beside), _joined(above)
            told = f"{own.removesuffix('.')}. {more}" if own and more else own + more
            words = words | {node.target.id: told.replace("None:", "left out:")}
    return words


def _joined(comments: list[str]) -> str:
    return " ".join(words for words in comments if not words.startswith(NOT_TOLD))


def _sentence(words: str) -> str:
    """Words of a comment as a sentence of their own."""
    return f"{words[0].upper()}{words[1:].removesuffix('.')}." if words else ""


def kind_in_words(field: FieldInfo) -> str:
    """What may be given for a key: its type and bounds in words."""
    told = _type_in_words(field.annotation)
    bounds = [
        (name, getattr(rule, name)) for rule in field.metadata for name in BOUNDS if getattr(rule, name, None) is not None
    ]
    parts = [f"{BOUNDS[name]} {bound:.10g}" if isinstance(bound, int | float) else "" for name, bound in bounds]
    return f"{told}, {' '.join(parts)}" if any(parts) else told


def _type_in_words(annotation: Any) -> str:
    origin, parts = get_origin(annotation), tuple(part for part in get_args(annotation) if part is not ...)
    if origin in (Union, UnionType):
        return " or ".join(word for part in parts if (word := _type_in_words(part)))
    if origin is Literal:
        return " or ".join(f'"{part}"' for part in parts)
    if origin is tuple and len(parts) == 1:
        return f"list of {_type_in_words(parts[0])}"
    if origin is tuple:
        return f"[{', '.join(map(_type_in_words, parts))}]"
    if origin is dict:
        return "table"
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return " or ".join(f'"{member.value}"' for member in annotation)
    return TYPE_WORDS.get(annotation, str(annotation))


def _default(field: FieldInfo, key: str, of_section: Spec | None) -> Any:
    if of_section is not None:
        return getattr(of_section, key)
    return None if field.is_required() else field.get_default(call_default_factory=True)


def toml_text(value: Any) -> str:
    """A value as TOML writes it on one line; "" for None and for a table."""
    if value is None or isinstance(value, Spec | dict):
        return ""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_text, value))}]"
    plain = value.value if isinstance(value, Enum) else str(value) if isinstance(value, Path) else value
    return tomli_w.dumps({"key": plain}).partition("= ")[2].strip()


def _first_paragraph(kind: type[Spec]) -> str:
    return " ".join((inspect.getdoc(kind) or "").partition("\n\n")[0].split())


def json_schema(kind: type[Spec]) -> dict[str, Any]:
    """The JSON Schema (2020-12) of a kind of spec files, with what each key decides as its description."""
    schema = kind.model_json_schema()
    for needed in (part.get("required", []) for part in schema.get("$defs", {}).values()):
        if "start_ft" in needed:  # of a zone on a road; a zone in a network has none
            needed.remove("start_ft")
    models = {model.__name__: model for model in _models_in(kind)}
    for name, part in [(kind.__name__, schema), *schema.get("$defs", {}).items()]:
        if name in models:
            words = words_of_keys(models[name])
            for key, described in part.get("properties", {}).items():
                if words.get(key):
                    described["description"] = words[key]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | schema


def _models_in(kind: type[Spec]) -> Iterator[type[Spec]]:
    yield kind
    for field in kind.model_fields.values():
        if (inner := spec_in(field.annotation)) and issubclass(inner, Spec):
            yield from _models_in(inner)
