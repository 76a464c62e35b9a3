"""A sweep: every case of a study that is not finished yet, each simulation of the fleet once, whatever fails on the way."""

import itertools
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from wzsumo.study.result_store import ResultStore, open_store
from wzsumo.study.results import write_results
from wzsumo.study.study_case import StudyCase
from wzsumo.study.study_file import Study
from wzsumo.study.sweep_tasks import evaluate, simulate
from wzsumo.study.workers import Workers

BATCH = 32  # cases a task: some seconds of work, which is what a crash or a kill can cost
# Longest times before a task counts as hanging, some thirty times what they take on one core of 2020.
START_S = 180.0  # a process that compiles its kernels first
SIMULATION_S = 1800.0
CASE_S = 20.0
DRIVE_S = 240.0
CACHE_LIMIT_MB = 2000.0  # a fleet of 15 min takes some 5 MB

Advance = Callable[[int], None]


@dataclass(frozen=True, kw_only=True)
class SweepSummary:
    """What a sweep came to, in numbers of cases."""

    n_cases: int
    n_simulations: int
    n_found: int  # finished by an earlier sweep
    n_done: int
    n_refused: int  # cases that cannot be
    n_failed: int  # cases that were lost twice
    failures: Mapping[str, int]  # reason -> number of cases
    results: Path


@dataclass(frozen=True, kw_only=True)
class _Work:
    """A task: cases to evaluate or, where there are none, a simulation."""

    simulation: str
    cases: tuple[StudyCase, ...] = ()
    is_retry: bool = False


def run_sweep(
    study: Study,
    folder: Path,
    *,
    workers: AbstractContextManager[Workers],
    progress: Callable[[int, int], AbstractContextManager[Advance]],
    tell: Callable[[str], None],
    cache_limit_mb: float = CACHE_LIMIT_MB,
) -> SweepSummary:
    """Carry out what is missing of a study in `folder`; what the sweep came to. However it ends, finished cases are kept.

    `progress` is called with (finished, all) cases and gives what is told of each batch; `tell` gets a line for a person.
    """
    with open_store(folder, study, tell=tell, cache_limit_mb=cache_limit_mb) as store:
        rows = store.finished()
        n_found = sum(case.id in rows for case in study.cases)
        failures: dict[str, dict[str, Any]] = {}
        try:
            missing = [case for case in study.cases if case.id not in rows]
            if missing:
                agenda = _Agenda(missing, store)
                with progress(n_found, len(study.cases)) as advance, workers as crew:
                    for batch in _carried_out(agenda, crew):
                        rows |= {row["case"]: row for row in batch}
                        advance(len(batch))
                failures = agenda.failures
        finally:
            results = write_results(folder, study.cases, rows | failures)
    counts = Counter(rows[case.id]["status"] for case in study.cases if case.id in rows)
    return SweepSummary(
        n_cases=len(study.cases),
        n_simulations=len(study.simulations),
        n_found=n_found,
        n_done=counts["DONE"],
        n_refused=counts["REFUSED"],
        n_failed=len(failures),
        failures=Counter(str(failure["reason"]) for failure in failures.values()),
        results=results,
    )


def missing_cases(study: Study, finished: Iterable[str]) -> dict[str, list[StudyCase]]:
    """The cases that are not among the finished, by the simulation that they share."""
    done = set(finished)
    groups = {name: [case for case in cases if case.id not in done] for name, cases in study.simulations.items()}
    return {name: cases for name, cases in groups.items() if cases}


class _Agenda:
    """What is left to do. A task that fails is tried once more, its cases one by one, so that only the one at fault is lost."""

    def __init__(self, cases: Iterable[StudyCase], store: ResultStore) -> None:
        self.failures: dict[str, dict[str, Any]] = {}
        self._store = store
        self._cases: dict[str, list[StudyCase]] = {}  # by simulation, not yet finished
        for case in cases:
            self._cases.setdefault(case.simulation, []).append(case)
        self._ready: deque[_Work] = deque()
        self._to_simulate = deque(_Work(simulation=simulation) for simulation in self._cases)

    def next_task(self) -> tuple[_Work, Callable[..., Any], tuple[Any, ...], float] | None:
        """Work, its function, arguments and longest time [s]; None where nothing can be begun now."""
        while self._ready or self._to_simulate:
            work = (self._ready or self._to_simulate).popleft()
            if not work.cases and not work.is_retry and (self._store.simulated(work.simulation) is not None):
                self._ready.extend(_batches(work.simulation, self._cases[work.simulation]))
            elif not work.cases:
                return work, simulate, (self._cases[work.simulation][0].scenario,), START_S + SIMULATION_S
            elif (fleet := self._store.simulated(work.simulation)) is not None:
                limit = START_S + sum(CASE_S + DRIVE_S * case.drive for case in work.cases)
                return work, evaluate, (fleet, work.cases), limit
            else:  # its file went meanwhile
                self._to_simulate.appendleft(_Work(simulation=work.simulation))
                self._ready = deque(other for other in self._ready if other.simulation != work.simulation)
        return None

    def settle(self, work: _Work, future: Future[Any]) -> list[dict[str, Any]]:
        """Rows of the cases that are finished with this task."""
        error = future.exception()
        if error is not None:
            return self._failed(work, str(error) or type(error).__name__)
        if not work.cases:
            self._store.add_simulated(work.simulation, future.result())
            self._ready.extend(_batches(work.simulation, self._cases[work.simulation]))
            return []
        rows: list[dict[str, Any]] = future.result()
        self._store.add(rows)
        self._strike(work)
        return rows

    def _failed(self, work: _Work, reason: str) -> list[dict[str, Any]]:
        if not work.is_retry:
            alone = [replace(work, cases=(case,), is_retry=True) for case in work.cases]
            (self._ready if work.cases else self._to_simulate).extend(alone or [replace(work, is_retry=True)])
            return []
        cases = work.cases or tuple(self._cases[work.simulation])
        what = "" if work.cases else "simulation: "
        rows = [{"case": case.id, "status": "FAILED", "reason": what + reason} for case in cases]
        self.failures |= {row["case"]: row for row in rows}
        self._strike(replace(work, cases=cases))
        return rows

    def _strike(self, work: _Work) -> None:
        done = {case.id for case in work.cases}
        left = [case for case in self._cases.get(work.simulation, []) if case.id not in done]
        self._cases[work.simulation] = left
        if not left:
            del self._cases[work.simulation]
            self._store.trim(keep=set(self._cases))


def _carried_out(agenda: _Agenda, workers: Workers) -> Iterator[list[dict[str, Any]]]:
    """The rows as they come in. One task more than there are workers is under way, so that none of them waits."""
    running: dict[Future[Any], _Work] = {}
    while True:
        while len(running) <= workers.count and (task := agenda.next_task()) is not None:
            work, function, args, limit_s = task
            running[workers.start(function, *args, limit_s=limit_s)] = work
        if not running:
            return
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            if rows := agenda.settle(running.pop(future), future):
                yield rows


def _batches(simulation: str, cases: list[StudyCase]) -> Iterator[_Work]:
    """The cases in batches of about BATCH; those of one crowd stay together, for its mixture is fitted once."""
    batch: list[StudyCase] = []
    for _, crowd in itertools.groupby(sorted(cases, key=lambda case: case.crowd), key=lambda case: case.crowd):
        batch += crowd
        if len(batch) >= BATCH:
            yield _Work(simulation=simulation, cases=tuple(batch))
            batch = []
    if batch:
        yield _Work(simulation=simulation, cases=tuple(batch))
