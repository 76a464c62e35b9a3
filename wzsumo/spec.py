"""Spec files: TOML read into frozen pydantic models. An error names the file, the key, the value given and the rule."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin

import tomli_w
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from wzsumo.errors import MAX_SHOWN, SpecError, check_file, did_you_mean, one_line, reading, shown

MAX_SEED = 2**31 - 1  # SUMO reads its seed as a signed whole number of 32 bits, and drops a larger one

MAX_TOML_BYTES = 20e6  # some 500,000 points of a road
MAX_MISTAKES = 20  # that a message lists

SpecT = TypeVar("SpecT", bound="Spec")


class Spec(BaseModel):
    """A section of a spec file: frozen, without unknown keys, infinities or nan."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True, strict=False)

    @model_validator(mode="before")
    @classmethod
    def _numbers_are_no_texts_and_no_truth_values(cls, content: Any) -> Any:
        """Pydantic would take "3" for 3 and true for 1."""
        if isinstance(content, dict):
            for name in _number_keys(cls) & content.keys():
                if (wrong := _no_number(content[name])) is not None:
                    raise ValueError(f"{name}={shown(wrong)}: must be a number, without quotes")
        return content


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a TOML file. Raises SpecError with the line where it is not TOML."""
    remedy = "name a TOML spec file"
    check_file(path, error=SpecError, remedy=remedy, max_bytes=MAX_TOML_BYTES)
    with reading(path, error=SpecError, remedy=remedy):
        text = path.read_text(encoding="utf-8-sig")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError also for a date or a whole number that Python refuses
        reason = "nested too deeply" if isinstance(error, RecursionError) else one_line(str(error), limit=MAX_SHOWN)
        raise SpecError(f"{path}: not valid TOML: {reason}") from None


def parse_spec(kind: type[SpecT], content: dict[str, Any], *, source: str) -> SpecT:
    """Spec of `kind` from parsed TOML. Raises SpecError naming source, key, value and rule of every mistake."""
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        raise SpecError(*(f"{source}: {mistake}" for mistake in describe_mistakes(kind, error))) from None
    except RecursionError:
        raise SpecError(f"{source}: nested too deeply") from None


def describe_mistakes(kind: type[BaseModel], error: ValidationError) -> list[str]:
    """Key, value and rule of the mistakes that were found in a spec of `kind`; of very many the first ones."""
    found = error.errors()
    more = [f"and {len(found) - MAX_MISTAKES} more mistakes"] if len(found) > MAX_MISTAKES else []
    return [_describe(kind, mistake) for mistake in found[:MAX_MISTAKES]] + more


def write_toml(content: dict[str, Any], path: Path) -> None:
    """Write a dictionary as TOML; keys without a value (None) are left out, at any depth."""
    path.write_text(tomli_w.dumps(_without_none(content)), encoding="utf-8")


def known_keys(kind: type[BaseModel], section: tuple[Any, ...]) -> list[str]:
    """The keys of the section to which the keys `section` lead; none where they lead to a plain value."""
    model: Any = kind
    for part in section:
        if isinstance(part, int):
            continue
        model = spec_in(model.model_fields[part].annotation)
        if model is None:
            return []
    return sorted(model.model_fields)


@cache
def _number_keys(kind: type[BaseModel]) -> frozenset[str]:
    """The keys of a section that hold numbers, or lists of numbers, and nothing else."""
    return frozenset(name for name, key in kind.model_fields.items() if _leaves(key.annotation) <= {int, float, type(None)})


def _leaves(annotation: Any) -> set[Any]:
    """The types in tuple[int, ...], float | None or int itself."""
    parts = [part for part in get_args(annotation) if part is not ...]
    return set().union(*map(_leaves, parts)) if parts and get_origin(annotation) is not Literal else {annotation}


def _no_number(value: Any) -> Any:
    """The first text or truth value in a value or a list; None where there is none."""
    if isinstance(value, list | tuple):
        return next((wrong for each in value if (wrong := _no_number(each)) is not None), None)
    return value if isinstance(value, str | bool) else None


def _without_none(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _without_none(value) for key, value in content.items() if value is not None}
    return [_without_none(value) for value in content] if isinstance(content, list | tuple) else content


def _describe(kind: type[BaseModel], mistake: Any) -> str:
    key = one_line(".".join(str(part) for part in mistake["loc"]), limit=MAX_SHOWN)
    if mistake["type"] == "extra_forbidden":
        known = known_keys(kind, mistake["loc"][:-1])
        near = did_you_mean(str(mistake["loc"][-1]), known)
        return f"{key}: unknown key (given {shown(mistake['input'])}){near}; known here: {', '.join(known)}"
    if mistake["type"] == "missing":
        return f"{key}: missing; this key must be given"
    # The package's own rules raise ValueError, and pydantic puts "Value error, " before their messages.
    rule = mistake["msg"].removeprefix("Value error, ")
    if isinstance(mistake["input"], dict):  # the message of a rule over several keys names their values
        return f"{key + ': ' if key else ''}{rule}"
    return f"{key}={shown(mistake['input'])}: {rule}"


def spec_in(annotation: Any) -> type[BaseModel] | None:
    """The model in list[Model], Model | None or Model itself."""
    candidates = (annotation, *getattr(annotation, "__args__", ()))
    return next((a for a in candidates if isinstance(a, type) and issubclass(a, BaseModel)), None)
