"""TaskQueue: the work that is left of a sweep, handed out task by task.

A task either simulates the traffic of some cases or evaluates a batch of cases whose traffic is simulated.
"""

import itertools
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Any

from wzsumo.case.map_method import Source
from wzsumo.errors import WorkersLostError
from wzsumo.sweep.evaluation.study_case import StudyCase
from wzsumo.sweep.evaluation.tasks import evaluate_cases, simulate
from wzsumo.sweep.store import ResultStore

MAX_BATCH = 32  # cases in a task: some seconds of work, which is all that a crash can cost
MIN_BATCH = 4  # each task reads the traces of the fleet again, which takes a fifth of the time of a case
# The unfinished cases are cut into at least this many tasks per worker, so that all workers end at about the same time.
TASKS_PER_WORKER = 4
# A task that takes longer than its limit is stopped. Each limit is some thirty times what the step takes on one core of 2020.
PROCESS_START_LIMIT_S = 180.0  # a new process compiles its kernels first
SIMULATION_LIMIT_S = 1800.0
CASE_LIMIT_S = 20.0
DRIVE_LIMIT_S = 240.0
LIDAR_LIMIT_S = 1800.0


@dataclass(frozen=True, kw_only=True)
class Task:
    """The cases to evaluate on a simulated fleet; a task without cases simulates the fleet."""

    simulation: str
    cases: tuple[StudyCase, ...] = ()
    is_retry: bool = False


class TaskQueue:
    """The unfinished cases of a sweep as tasks. The cases of a failed task are tried once more, each in its own task."""

    def __init__(self, cases: Iterable[StudyCase], store: ResultStore, *, workers: int) -> None:
        self.failures: dict[str, dict[str, Any]] = {}
        self._store = store
        self._workers = workers
        self._unfinished: dict[str, list[StudyCase]] = {}  # by simulation
        for case in cases:
            self._unfinished.setdefault(case.simulation, []).append(case)
        self._to_simulate = deque(self._unfinished)
        self._ready: deque[tuple[StudyCase, ...]] = deque()  # simulated cases; those of one map source form one entry
        self._retries: deque[Task] = deque()
        self._n_ready = 0  # cases in `_ready`

    def next_task(self) -> tuple[Task, Callable[..., Any], tuple[Any, ...], float] | None:
        """A task, its function, arguments and time limit [s]; None where no task can start now."""
        while (task := self._take_task()) is not None:
            fleet = self._store.simulated(task.simulation)
            if task.cases and fleet is not None:
                limit_s = PROCESS_START_LIMIT_S + sum(map(_case_limit_s, task.cases))
                return task, evaluate_cases, (fleet, task.cases), limit_s
            if task.cases:  # the file of the fleet is gone
                self._simulate_again(task.simulation)
            elif fleet is not None:
                self._make_ready(task.simulation)
            else:
                scenario = self._unfinished[task.simulation][0].scenario
                return task, simulate, (scenario,), PROCESS_START_LIMIT_S + SIMULATION_LIMIT_S
        return None

    def finish_task(self, task: Task, future: Future[Any]) -> list[dict[str, Any]]:
        """The rows of the cases that this task finished, after storing what the task returned. Raises WorkersLostError."""
        error = future.exception()
        if isinstance(error, WorkersLostError):
            raise error
        if error is not None:
            return self._retry_or_fail(task, str(error) or type(error).__name__)
        if not task.cases:
            self._store.add_simulated(task.simulation, future.result())
            self._make_ready(task.simulation)
            return []
        rows: list[dict[str, Any]] = future.result()
        self._store.add(rows)
        self._remove_finished(task)
        return rows

    def _take_task(self) -> Task | None:
        """Retries first; then a simulation where few cases are ready, so that no worker waits for one."""
        if self._retries:
            return self._retries.popleft()
        if self._to_simulate and self._n_ready < MAX_BATCH * self._workers:
            return Task(simulation=self._to_simulate.popleft())
        return self._take_batch() if self._ready else None

    def _take_batch(self) -> Task:
        """Cases of one simulation. Cases of one map source stay together, since their worker then learns from it only once."""
        n_unfinished = sum(map(len, self._unfinished.values()))
        size = min(MAX_BATCH, max(MIN_BATCH, n_unfinished // (TASKS_PER_WORKER * self._workers)))
        batch = list(self._ready.popleft())
        while len(batch) < size and self._ready and self._ready[0][0].simulation == batch[0].simulation:
            batch.extend(self._ready.popleft())
        self._n_ready -= len(batch)
        return Task(simulation=batch[0].simulation, cases=tuple(batch))

    def _make_ready(self, simulation: str) -> None:
        cases = sorted(self._unfinished[simulation], key=lambda case: case.source)
        self._ready.extend(tuple(group) for _, group in itertools.groupby(cases, key=lambda case: case.source))
        self._n_ready += len(cases)

    def _simulate_again(self, simulation: str) -> None:
        self._to_simulate.appendleft(simulation)
        self._ready = deque(cases for cases in self._ready if cases[0].simulation != simulation)
        self._n_ready = sum(map(len, self._ready))

    def _retry_or_fail(self, task: Task, reason: str) -> list[dict[str, Any]]:
        """The rows of the cases that failed for the second time; none where the task failed for the first time."""
        if not task.is_retry:
            one_by_one = [replace(task, cases=(case,), is_retry=True) for case in task.cases]
            self._retries.extend(one_by_one or [replace(task, is_retry=True)])
            return []
        cases = task.cases or tuple(self._unfinished[task.simulation])
        prefix = "" if task.cases else "simulation: "
        rows = [{"case": case.id, "status": "FAILED", "reason": prefix + reason} for case in cases]
        self.failures |= {row["case"]: row for row in rows}
        self._remove_finished(replace(task, cases=cases))
        return rows

    def _remove_finished(self, task: Task) -> None:
        finished = {case.id for case in task.cases}
        left = [case for case in self._unfinished.get(task.simulation, []) if case.id not in finished]
        self._unfinished[task.simulation] = left
        if not left:
            del self._unfinished[task.simulation]
            self._store.trim(keep=set(self._unfinished))


def _case_limit_s(case: StudyCase) -> float:
    """Time limit [s] of one case."""
    uses_lidar = case.map_method.source is Source.LIDAR
    return CASE_LIMIT_S + DRIVE_LIMIT_S * case.drive + LIDAR_LIMIT_S * uses_lidar
