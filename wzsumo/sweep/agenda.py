"""What is left of a sweep, handed out task by task: simulations, and batches of cases on simulated fleets."""

import itertools
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Any

from wzsumo.case.map_method import Source
from wzsumo.sweep.evaluation.study_case import StudyCase
from wzsumo.sweep.evaluation.tasks import evaluate_cases, simulate
from wzsumo.sweep.store import ResultStore

BATCH = 32  # cases a task at most: some seconds of work, which is what a crash or a kill can cost
SMALLEST_BATCH = 4  # each task reads the fleet anew, as long as a fifth of a case takes
# What is left is cut into at least as many tasks a worker, so that none of them waits long for the last of another.
TASKS_A_WORKER = 4
# Longest times before a task counts as hanging, some thirty times what they take on one core of 2020.
START_S = 180.0  # a process that compiles its kernels first
SIMULATION_S = 1800.0
CASE_S = 20.0
DRIVE_S = 240.0
LIDAR_S = 1800.0


@dataclass(frozen=True, kw_only=True)
class Work:
    """A task: cases to evaluate or, where there are none, a simulation."""

    simulation: str
    cases: tuple[StudyCase, ...] = ()
    is_retry: bool = False


class Agenda:
    """What is left to do. A task that fails is tried once more, its cases one by one, so that only the one at fault is lost."""

    def __init__(self, cases: Iterable[StudyCase], store: ResultStore, *, workers: int) -> None:
        self.failures: dict[str, dict[str, Any]] = {}
        self._store = store
        self._workers = workers
        self._unfinished: dict[str, list[StudyCase]] = {}  # by simulation
        for case in cases:
            self._unfinished.setdefault(case.simulation, []).append(case)
        self._to_simulate = deque(self._unfinished)
        self._ready: deque[tuple[StudyCase, ...]] = deque()  # the cases of one source, on a simulated fleet
        self._again: deque[Work] = deque()
        self._n_ready = 0  # cases

    def next_task(self) -> tuple[Work, Callable[..., Any], tuple[Any, ...], float] | None:
        """Work, its function, arguments and longest time [s]; None where nothing can be begun now."""
        while (work := self._next_work()) is not None:
            fleet = self._store.simulated(work.simulation)
            if work.cases and fleet is not None:
                return work, evaluate_cases, (fleet, work.cases), START_S + sum(map(_longest_s, work.cases))
            if work.cases:  # its file went meanwhile
                self._simulate_again(work.simulation)
            elif fleet is not None:
                self._make_ready(work.simulation)
            else:
                return work, simulate, (self._unfinished[work.simulation][0].scenario,), START_S + SIMULATION_S
        return None

    def settle(self, work: Work, future: Future[Any]) -> list[dict[str, Any]]:
        """Rows of the cases that are finished with this task."""
        error = future.exception()
        if error is not None:
            return self._failed(work, str(error) or type(error).__name__)
        if not work.cases:
            self._store.add_simulated(work.simulation, future.result())
            self._make_ready(work.simulation)
            return []
        rows: list[dict[str, Any]] = future.result()
        self._store.add(rows)
        self._strike(work)
        return rows

    def _next_work(self) -> Work | None:
        """Simulations come first where few cases are ready, so that no worker waits for one."""
        if self._again:
            return self._again.popleft()
        if self._to_simulate and self._n_ready < BATCH * self._workers:
            return Work(simulation=self._to_simulate.popleft())
        return self._next_batch() if self._ready else None

    def _next_batch(self) -> Work:
        """Cases of one simulation, fewer where few are left; those of one source together, for it is learned from once."""
        n_unfinished = sum(map(len, self._unfinished.values()))
        size = min(BATCH, max(SMALLEST_BATCH, n_unfinished // (TASKS_A_WORKER * self._workers)))
        batch = list(self._ready.popleft())
        while len(batch) < size and self._ready and self._ready[0][0].simulation == batch[0].simulation:
            batch.extend(self._ready.popleft())
        self._n_ready -= len(batch)
        return Work(simulation=batch[0].simulation, cases=tuple(batch))

    def _make_ready(self, simulation: str) -> None:
        cases = sorted(self._unfinished[simulation], key=lambda case: case.source)
        self._ready.extend(tuple(sharing) for _, sharing in itertools.groupby(cases, key=lambda case: case.source))
        self._n_ready += len(cases)

    def _simulate_again(self, simulation: str) -> None:
        self._to_simulate.appendleft(simulation)
        self._ready = deque(cases for cases in self._ready if cases[0].simulation != simulation)
        self._n_ready = sum(map(len, self._ready))

    def _failed(self, work: Work, reason: str) -> list[dict[str, Any]]:
        if not work.is_retry:
            alone = [replace(work, cases=(case,), is_retry=True) for case in work.cases]
            self._again.extend(alone or [replace(work, is_retry=True)])
            return []
        cases = work.cases or tuple(self._unfinished[work.simulation])
        what = "" if work.cases else "simulation: "
        rows = [{"case": case.id, "status": "FAILED", "reason": what + reason} for case in cases]
        self.failures |= {row["case"]: row for row in rows}
        self._strike(replace(work, cases=cases))
        return rows

    def _strike(self, work: Work) -> None:
        done = {case.id for case in work.cases}
        left = [case for case in self._unfinished.get(work.simulation, []) if case.id not in done]
        self._unfinished[work.simulation] = left
        if not left:
            del self._unfinished[work.simulation]
            self._store.trim(keep=set(self._unfinished))


def _longest_s(case: StudyCase) -> float:
    return CASE_S + DRIVE_S * case.drive + LIDAR_S * (case.map_method.source is Source.LIDAR)
