"""Study: scenarios, methods and factors of a TOML file, and the cases that they make; checked before anything runs."""

import itertools
import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError

from wzsumo.case.methods import METHODS
from wzsumo.errors import SpecError, check_name, did_you_mean, shown
from wzsumo.scenario.library import scenario_file, study_file
from wzsumo.scenario.scenario import FITTING_SECTIONS, Scenario, load_scenario, misfits_of
from wzsumo.spec import MAX_MISTAKES, Spec, describe_mistakes, known_keys, parse_spec, read_toml
from wzsumo.sweep.evaluation.study_case import StudyCase

MAX_CASES = 200_000  # a case takes some 5 kB and 2 ms before it begins; chosen by us
Keys = dict[str, Any]  # dotted scenario key -> value


class StudySpec(Spec):
    """The content of a study file. Factors are keys of a scenario, such as `crowd.used` or `work_zone.posted_speed_mph`."""

    name: str = Field(min_length=1, pattern=r"^[\w.-]+$")  # a result folder belongs to one study
    scenarios: tuple[str, ...] = Field(min_length=1)  # files, relative to the study file, or names of the library
    methods: tuple[str, ...] = Field(min_length=1)  # how traces become a map; every case is run with each
    drive: bool = False  # whether the ego drives its path in the traffic, which takes ten times as long
    fixed: dict[str, Any] = Field({})  # keys and their values in every case
    grid: dict[str, Any] = Field({})  # factor -> values, all of which are combined; also seed = { first = 21, count = 10 }
    combinations: tuple[dict[str, Any], ...] = ()  # sets of values that belong together; each is combined with the whole grid


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """A checked study. `content` holds the study file and its scenarios, so that a result folder needs no other file."""

    spec: StudySpec
    content: Mapping[str, Any]
    cases: tuple[StudyCase, ...]

    @property
    def factors(self) -> tuple[str, ...]:
        """Scenario keys that differ between cases, in the order of the file."""
        return tuple(self.cases[0].factors)

    @cached_property
    def simulations(self) -> dict[str, list[StudyCase]]:
        """The cases of each simulation."""
        groups: dict[str, list[StudyCase]] = {}
        for case in self.cases:
            groups.setdefault(case.simulation, []).append(case)
        return groups


def load_study(path: Path) -> Study:
    """The study of a TOML file or of the library. Raises SpecError with file, key, value and rule of every mistake."""
    path = study_file(path)
    content = read_toml(path)
    if {"work_zone", "route"} & content.keys():
        raise SpecError(f"{path}: is a scenario, not a study; run it with `wzsumo run {path} --out DIR`, or name it in a study")
    spec = parse_spec(StudySpec, content, source=str(path))
    bases = {name: load_scenario(_base(name, path.parent)).model_dump(mode="json") for name in spec.scenarios}
    return study_of({"study": content, "scenarios": bases}, source=str(path))


def _base(name: str, folder: Path) -> Path:
    """The file of a base scenario: beside the study file, else of the library."""
    beside = folder / name
    check_name(beside, named_by="scenarios")
    return beside if beside.suffix or beside.exists() else scenario_file(name)


def study_of(content: Mapping[str, Any], *, source: str) -> Study:
    """The study of `content` = {"study": file content, "scenarios": {file: content}}. Raises SpecError as `load_study` does."""
    spec = parse_spec(StudySpec, content["study"], source=source)
    fixed, grid = _flat(spec.fixed), _grid(spec.grid)
    combinations = [_flat(entry) for entry in spec.combinations]
    unknown = [name for name in spec.methods if name not in METHODS]
    mistakes = [
        f"methods: {name}: unknown{did_you_mean(name, METHODS)}; known methods: {', '.join(METHODS)}" for name in unknown
    ]
    mistakes += _wrong_factors(fixed, grid, combinations)
    n_points = math.prod(len(values) for values in grid.values() if isinstance(values, list)) * max(len(combinations), 1)
    n_cases = n_points * len(spec.scenarios) * len(spec.methods)
    if n_cases > MAX_CASES:
        mistakes.append(
            f"grid: makes {n_cases} cases or more, at most {MAX_CASES} make one study; give fewer values, or several studies"
        )
    if mistakes:
        raise SpecError(*(f"{source}: {mistake}" for mistake in mistakes[:MAX_MISTAKES]))
    points = [fixed | entry | point for entry in combinations or [{}] for point in _points(grid)]
    cases = _cases(spec, content["scenarios"], points, varied=_varied(grid, combinations), source=source)
    return Study(spec=spec, content=content, cases=cases)


def find_case(study: Study, name: str) -> StudyCase:
    """The case of a study whose name begins with `name`. Raises SpecError where no name or several names do."""
    found = [case for case in study.cases if case.id.startswith(name)] if name else []
    if len(found) == 1:
        return found[0]
    if found:
        raise SpecError(f"--case {name}: {len(found)} cases begin so, such as {found[0].id} and {found[1].id}; give more of it")
    raise SpecError(
        f"--case {name}: the study {study.spec.name} has no such case with this version of wzsumo; results.parquet lists them"
    )


def _flat(table: Mapping[str, Any], prefix: str = "") -> Keys:
    """The dotted keys of nested tables, since TOML reads `crowd.used = 5` as a table in a table."""
    flat: Keys = {}
    for key, value in table.items():
        flat |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {prefix + key: value}
    return flat


def _grid(table: Mapping[str, Any]) -> Keys:
    grid = _flat({key: value for key, value in table.items() if key != "seed"})
    seed = table.get("seed")
    if isinstance(seed, Mapping) and seed.keys() == {"first", "count"} and all(isinstance(n, int) for n in seed.values()):
        count = min(seed["count"], MAX_CASES + 1)  # of more it is not made
        seed = list(range(seed["first"], seed["first"] + count))
    return grid if seed is None else {"seed": seed} | grid


def _wrong_factors(fixed: Keys, grid: Keys, combinations: list[Keys]) -> list[str]:
    varies = bool(grid or combinations)
    mistakes = [] if varies else ["grid: empty, so nothing varies; give at least one factor, such as seed = [21, 22]"]
    for key, values in grid.items():
        if not isinstance(values, list):
            mistakes.append(f"grid.{key}={shown(values)}: must be a list of values (seed may be {{ first = 21, count = 10 }})")
        elif not values:
            mistakes.append(f"grid.{key}: an empty list makes no case; give values or leave the factor out")
        elif len({json.dumps(value, default=str) for value in values}) < len(values):
            mistakes.append(f"grid.{key}={shown(values)}: a value is there twice; give each once")
    named = [("fixed", fixed), ("grid", grid), *((f"combinations[{n}]", entry) for n, entry in enumerate(combinations))]
    mistakes += [f"{where}.{key}: {wrong}" for where, keys in named for key in keys if (wrong := _unknown_key(key))]
    for key, count in Counter([*fixed, *grid, *{key for entry in combinations for key in entry}]).items():
        if count > 1:
            mistakes.append(f"{key}: given in more than one of fixed, grid and combinations; give it in one")
    if len({frozenset(entry) for entry in combinations}) > 1:
        mistakes.append("combinations: all must give the same keys, for each is a column of the table")
    return mistakes


def _unknown_key(key: str) -> str:
    """Why a key is not one of a scenario; "" where it is one."""
    parts = key.split(".")
    if key == "name":
        return "names no factor; cases are named by their factors"
    for depth, part in enumerate(parts):
        known = known_keys(Scenario, tuple(parts[:depth]))
        if part not in known:
            section = ".".join(parts[:depth]) or "a scenario"
            return f"unknown key{did_you_mean(part, known)}; {section} has {', '.join(known) or 'no keys below it'}"
    return ""


def _varied(grid: Keys, combinations: list[Keys]) -> list[str]:
    return [*grid, *(combinations[0] if combinations else ())]


def _points(grid: Keys) -> Iterator[Keys]:
    for values in itertools.product(*grid.values()):
        yield dict(zip(grid, values, strict=True))


def _cases(
    spec: StudySpec, bases: Mapping[str, Any], points: list[Keys], *, varied: list[str], source: str
) -> tuple[StudyCase, ...]:
    parser = _ScenarioParser(source)
    cases: list[StudyCase] = []
    for base, point in itertools.product(bases.values(), points):
        if (scenario := parser.scenario(base, point)) is not None:
            factors = {key: point[key] for key in varied}
            cases += [StudyCase(scenario=scenario, method=m, drive=spec.drive, factors=factors) for m in spec.methods]
    if parser.mistakes:
        for base, point in itertools.product(bases.values(), points):  # find the mistakes that these values hid
            parser.scenario(base, {key: value for key, value in point.items() if (key, str(value)) not in parser.wrong_values})
        raise SpecError(*parser.mistakes)
    twice = len(cases) - len({case.id for case in cases})
    if twice:
        raise SpecError(f"{source}: {twice} cases are there twice; name every scenario, method and combination once")
    return tuple(cases)


class _ScenarioParser:
    """Parses the scenarios of a study. They are mostly alike, so each section, and each fit of zone and road, is checked once.

    `mistakes` keeps the order in which they were found. `wrong_values` holds (key, text) of values that break their own rule.
    """

    def __init__(self, source: str) -> None:
        self.mistakes: dict[str, None] = {}
        self.wrong_values: set[tuple[str, str]] = set()
        self._source = source
        self._sections: dict[str, Any] = {}
        self._fitting: set[str] = set()

    def scenario(self, base: Keys, point: Keys) -> Scenario | None:
        """The scenario at a point of the grid; None, after adding to `mistakes`, where it is wrong."""
        content = _with(base, _completed(point))
        texts = {key: f"{key} {json.dumps(value, default=str)}" for key, value in content.items()}
        try:
            scenario = Scenario.model_validate({key: self._sections.get(texts[key], value) for key, value in content.items()})
            self._sections |= {text: getattr(scenario, key) for key, text in texts.items()}
        except ValidationError as error:
            self.mistakes |= dict.fromkeys(f"{self._source}: {mistake}" for mistake in describe_mistakes(Scenario, error))
            self.wrong_values |= {(".".join(map(str, part["loc"])), str(part["input"])) for part in error.errors()}
            return None
        parts = scenario.model_dump_json(include=set(FITTING_SECTIONS))
        if parts in self._fitting:
            return scenario
        if misfits := misfits_of(scenario):
            self.mistakes |= dict.fromkeys(f"{self._source}: {misfit}" for misfit in misfits)
            return None
        self._fitting.add(parts)
        return scenario


def _completed(point: Keys) -> Keys:
    """The point with as many traces collected as used, unless the study gives `crowd.collected`."""
    if "crowd.used" not in point or "crowd.collected" in point:
        return point
    return point | {"crowd.collected": point["crowd.used"]}


def _with(content: Mapping[str, Any], keys: Keys) -> Keys:
    """A copy of the content with dotted keys set. The sections without a new key are shared, not copied."""
    changed = dict(content)
    for key, value in keys.items():
        first, _, rest = key.partition(".")
        changed[first] = _with(changed.get(first) or {}, {rest: value}) if rest else value
    return changed
