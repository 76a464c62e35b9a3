"""run_sweep: evaluates the cases of a study that are not finished yet. Cases that share a simulation simulate it once."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wzsumo.case.methods import refuse_unknown_to_workers
from wzsumo.sweep.results import write_results
from wzsumo.sweep.store import open_store
from wzsumo.sweep.study_file import Study
from wzsumo.sweep.task_queue import Task, TaskQueue
from wzsumo.sweep.workers import Workers

CACHE_LIMIT_MB = 2000.0  # a fleet of 15 min takes some 5 MB

AddFinished = Callable[[int], None]  # is called with the number of cases that were just finished


@dataclass(frozen=True, kw_only=True)
class SweepSummary:
    """What a sweep did, as numbers of cases."""

    n_cases: int
    n_simulations: int
    n_found: int  # finished by an earlier sweep
    n_done: int
    n_refused: int  # cases that are impossible, such as one that asks for more traces than the fleet has
    n_failed: int  # cases whose task failed twice
    failures: Mapping[str, int]  # reason -> number of cases
    results: Path


def run_sweep(
    study: Study,
    folder: Path,
    *,
    workers: AbstractContextManager[Workers],
    progress: Callable[[int, int], AbstractContextManager[AddFinished]],
    tell: Callable[[str], None],
    cache_limit_mb: float = CACHE_LIMIT_MB,
) -> SweepSummary:
    """Numbers of a study's cases, after evaluating those that `folder` does not hold yet.

    Finished cases stay in the folder even where the sweep is interrupted. `progress` is called with the number of finished
    cases and of all cases. It gives a function that is called with the number of cases of each finished batch. `tell` is
    called with each message for the user. Raises SpecError where workers do not know a method.
    """
    refuse_unknown_to_workers(case.method for case in study.cases)
    with open_store(folder, study, tell=tell, cache_limit_mb=cache_limit_mb) as store:
        rows = store.finished()
        n_found = sum(case.id in rows for case in study.cases)
        failures: dict[str, dict[str, Any]] = {}
        try:
            missing = [case for case in study.cases if case.id not in rows]
            if missing:
                with progress(n_found, len(study.cases)) as add_finished, workers as pool:
                    queue = TaskQueue(missing, store, workers=pool.count)
                    for batch in _finished_batches(queue, pool):
                        rows |= {row["case"]: row for row in batch}
                        add_finished(len(batch))
                failures = queue.failures
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


def _finished_batches(queue: TaskQueue, workers: Workers) -> Iterator[list[dict[str, Any]]]:
    """The rows of each batch once it is finished. One more task than there are workers is started, so that no worker waits."""
    running: dict[Future[Any], Task] = {}
    while True:
        while len(running) <= workers.count and (started := queue.next_task()) is not None:
            task, function, args, limit_s = started
            running[workers.start(function, *args, limit_s=limit_s)] = task
        if not running:
            return
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            if rows := queue.finish_task(running.pop(future), future):
                yield rows
