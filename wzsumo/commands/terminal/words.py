"""Figures in words: what a command prints where nobody asked for JSON."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from wzsumo.errors import one_line
from wzsumo.units import unit_of, without_unit

MAX_SAID = 8  # of a list; --json holds all
INDENT = "  "


def lines_of(figures: Mapping[str, Any], *, indent: str = "") -> Iterator[str]:
    r"""A line a figure, its unit behind it; what a figure is made of is indented below it. What is not known is left out.

    >>> print("\n".join(lines_of({"n_traces": 5, "free_m2": 12.3456, "areas_m": {"taper": 219.456}, "frame": None})))
    traces: 5
    free: 12.3 m2
    areas:
      taper: 219 m
    """
    for key, value in figures.items():
        label, unit = one_line(without_unit(key)).removeprefix("n "), unit_of(key)
        if value is None or value in ([], (), {}, ""):
            continue
        if isinstance(value, Mapping):
            yield f"{indent}{label}:"
            within = {f"{name}_{key.rpartition('_')[2]}" if unit else name: part for name, part in value.items()}
            yield from lines_of(within, indent=indent + INDENT)
        elif _is_list(value) and any(isinstance(part, Mapping) or len(str(part)) > 40 for part in value):
            yield f"{indent}{label}:"
            yield from (f"{indent}{INDENT}{_in_words(part)}" for part in value[:MAX_SAID])
            if len(value) > MAX_SAID:
                yield f"{indent}{INDENT}and {len(value) - MAX_SAID} more"
        else:
            yield f"{indent}{label}: {_in_words(value)}{f' {unit}' if unit else ''}"


def _in_words(value: Any) -> str:
    if isinstance(value, Mapping):
        parts = ((without_unit(str(key)).removeprefix("n "), part, unit_of(str(key))) for key, part in value.items())
        return ", ".join(
            f"{one_line(key)} {_in_words(part)}{unit and f' {unit}'}" for key, part, unit in parts if part is not None
        )
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    if _is_list(value):
        return ", ".join(map(_in_words, value))
    return one_line(str(value))


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)
