"""Studies, and workers that carry tasks out at once, for tests of sweeps."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import pyarrow as pa

from wzsumo.files.output import parquet_bytes
from wzsumo.scenario.scenario import Scenario
from wzsumo.spec import read_toml
from wzsumo.sweep.evaluation.study_case import StudyCase
from wzsumo.sweep.study_file import Study, study_of
from wzsumo.sweep.sweep import AddFinished, SweepSummary, run_sweep

PAPER = Path(__file__).parents[1] / "scenarios" / "paper.toml"
FLEET = parquet_bytes(pa.table({"x_m": [1.0]}))


def simulate(scenario: Scenario) -> bytes:
    """What stands for a simulation in the tests of sweeps."""
    del scenario
    return FLEET


def evaluate_cases(fleet: bytes, cases: Sequence[StudyCase]) -> list[dict[str, Any]]:
    """One row a case, its IoU a hundredth of the seed."""
    assert fleet == FLEET
    return [{"case": case.id, "status": "DONE", "iou": case.scenario.seed / 100, "case_cpu_s": 0.1} for case in cases]


def a_study(
    *,
    fixed: Mapping[str, Any] | None = None,
    name: str = "trial",
    methods: Sequence[str] = ("swept",),
    drive: bool = False,
    combinations: Sequence[Mapping[str, Any]] = (),
    **grid: Any,
) -> Study:
    """A study of the paper's scenario; the factors are written as in `crowd__used=[1, 2]`."""
    factors = {key.replace("__", "."): values for key, values in (grid or {"seed": [21, 22]}).items()}
    content = {"name": name, "scenarios": ["paper.toml"], "methods": list(methods), "drive": drive, "grid": factors}
    content |= {"fixed": fixed or {}, "combinations": list(combinations)}
    return study_of({"study": content, "scenarios": {"paper.toml": read_toml(PAPER)}}, source="trial.toml")


class AtOnce:
    """Workers that carry out a task when it is started, in this process; what it raises is in its future."""

    def __init__(self, count: int = 2, *, tells: bool = False) -> None:
        self.count, self.tells = count, tells
        self.started: list[tuple[str, Any]] = []

    def start(self, function: Callable[..., Any], *args: Any, limit_s: float) -> Future[Any]:
        assert limit_s > 0
        self.started.append((function.__name__, args))
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args))
        except RuntimeError as error:
            future.set_exception(error)
        return future

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None


@contextmanager
def no_progress(finished: int, total: int) -> Iterator[AddFinished]:
    del finished, total
    yield lambda _count: None


def sweep(study: Study, folder: Path, workers: Any = None, **options: Any) -> tuple[SweepSummary, list[str]]:
    """(summary, lines told) of a sweep without a word on the terminal."""
    lines: list[str] = []
    summary = run_sweep(study, folder, workers=workers or AtOnce(), progress=no_progress, tell=lines.append, **options)
    return summary, lines
