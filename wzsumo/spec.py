"""Spec files: TOML read into frozen pydantic models, so that a mistake is answered with file, key, what was given, the rule."""

import tomllib
from pathlib import Path
from typing import Any, TypeVar

import tomli_w
from pydantic import BaseModel, ConfigDict, ValidationError

from wzsumo.errors import SpecError

SpecT = TypeVar("SpecT", bound="Spec")


class Spec(BaseModel):
    """Part of a spec file: frozen, unknown keys refused, no infinities."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True, strict=False)


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a TOML file. Raises SpecError with the line where it is not TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file; name an existing TOML spec file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise SpecError(f"{path}: cannot be read as a text file ({error})") from None
    except tomllib.TOMLDecodeError as error:
        raise SpecError(f"{path}: not valid TOML: {error}") from None


def parse_spec(kind: type[SpecT], content: dict[str, Any], *, source: str) -> SpecT:
    """Spec of `kind` from parsed TOML. Raises SpecError naming source, key, value and rule of every mistake."""
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        raise SpecError("; ".join(_describe(kind, mistake, source=source) for mistake in error.errors())) from None


def write_toml(content: dict[str, Any], path: Path) -> None:
    """Write a dictionary as TOML; keys without a value (None) are left out."""
    path.write_text(tomli_w.dumps(_without_none(content)), encoding="utf-8")


def _without_none(content: dict[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, dict) else value for key, value in content.items() if value is not None
    }


def _describe(kind: type[BaseModel], mistake: Any, *, source: str) -> str:
    key = ".".join(str(part) for part in mistake["loc"])
    if mistake["type"] == "extra_forbidden":
        known = ", ".join(_known_keys(kind, mistake["loc"][:-1]))
        return f"{source}: {key}: unknown key (given {mistake['input']!r}); known here: {known}"
    if mistake["type"] == "missing":
        return f"{source}: {key}: missing; this key must be given"
    # A rule of our own raises ValueError: pydantic's prefix "Value error, " says nothing to the reader.
    rule = mistake["msg"].removeprefix("Value error, ")
    if isinstance(mistake["input"], dict):  # a rule over several keys names the values itself
        return f"{source}: {key + ': ' if key else ''}{rule}"
    return f"{source}: {key}={mistake['input']!r}: {rule}"


def _known_keys(kind: type[BaseModel], section: tuple[Any, ...]) -> list[str]:
    model: Any = kind
    for part in section:
        if isinstance(part, int):
            continue
        model = model.model_fields[part].annotation
        if not isinstance(model, type):  # list[Model], Model | None
            model = next((a for a in getattr(model, "__args__", ()) if isinstance(a, type) and issubclass(a, BaseModel)), None)
        if model is None:
            return []
    return sorted(model.model_fields)
