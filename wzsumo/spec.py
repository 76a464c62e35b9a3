"""Spec files: TOML read into frozen pydantic models. An error names the file, the key, the value given and the rule."""

import tomllib
from pathlib import Path
from typing import Any, TypeVar

import tomli_w
from pydantic import BaseModel, ConfigDict, ValidationError

from wzsumo.errors import SpecError

MAX_SEED = 2**31 - 1  # SUMO reads its seed as a signed whole number of 32 bits, and drops a larger one

SpecT = TypeVar("SpecT", bound="Spec")


class Spec(BaseModel):
    """A section of a spec file: frozen, without unknown keys, infinities or nan."""

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
        raise SpecError("; ".join(f"{source}: {mistake}" for mistake in describe_mistakes(kind, error))) from None


def describe_mistakes(kind: type[BaseModel], error: ValidationError) -> list[str]:
    """Key, value and rule of every mistake that was found in a spec of `kind`."""
    return [_describe(kind, mistake) for mistake in error.errors()]


def write_toml(content: dict[str, Any], path: Path) -> None:
    """Write a dictionary as TOML; keys without a value (None) are left out, at any depth."""
    path.write_text(tomli_w.dumps(_without_none(content)), encoding="utf-8")


def known_keys(kind: type[BaseModel], section: tuple[Any, ...]) -> list[str]:
    """The keys of the section to which the keys `section` lead; none where they lead to a plain value."""
    model: Any = kind
    for part in section:
        if isinstance(part, int):
            continue
        model = _spec_in(model.model_fields[part].annotation)
        if model is None:
            return []
    return sorted(model.model_fields)


def _without_none(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _without_none(value) for key, value in content.items() if value is not None}
    return [_without_none(value) for value in content] if isinstance(content, list | tuple) else content


def _describe(kind: type[BaseModel], mistake: Any) -> str:
    key = ".".join(str(part) for part in mistake["loc"])
    if mistake["type"] == "extra_forbidden":
        known = ", ".join(known_keys(kind, mistake["loc"][:-1]))
        return f"{key}: unknown key (given {mistake['input']!r}); known here: {known}"
    if mistake["type"] == "missing":
        return f"{key}: missing; this key must be given"
    # The package's own rules raise ValueError, and pydantic puts "Value error, " before their messages.
    rule = mistake["msg"].removeprefix("Value error, ")
    if isinstance(mistake["input"], dict):  # the message of a rule over several keys names their values
        return f"{key + ': ' if key else ''}{rule}"
    return f"{key}={mistake['input']!r}: {rule}"


def _spec_in(annotation: Any) -> type[BaseModel] | None:
    """The model in list[Model], Model | None or Model itself."""
    candidates = (annotation, *getattr(annotation, "__args__", ()))
    return next((a for a in candidates if isinstance(a, type) and issubclass(a, BaseModel)), None)
