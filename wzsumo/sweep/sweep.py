"""A sweep: every case of a study that is not finished yet, each simulation of the fleet once, whatever fails on the way."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wzsumo.sweep.agenda import Agenda, Work
from wzsumo.sweep.results import write_results
from wzsumo.sweep.store import open_store
from wzsumo.sweep.study_file import Study
from wzsumo.sweep.workers import Workers

CACHE_LIMIT_MB = 2000.0  # a fleet of 15 min takes some 5 MB

Advance = Callable[[int], None]


@dataclass(frozen=True, kw_only=True)
class SweepSummary:
    """The result of a sweep, in numbers of cases."""

    n_cases: int
    n_simulations: int
    n_found: int  # finished by an earlier sweep
    n_done: int
    n_refused: int  # cases that cannot be
    n_failed: int  # cases that were lost twice
    failures: Mapping[str, int]  # reason -> number of cases
    results: Path


def run_sweep(
    study: Study,
    folder: Path,
    *,
    workers: AbstractContextManager[Workers],
    progress: Callable[[int, int], AbstractContextManager[Advance]],
    tell: Callable[[str], None],
    cache_limit_mb: float = CACHE_LIMIT_MB,
) -> SweepSummary:
    """Evaluate the cases that `folder` does not hold yet, and return their numbers. Finished cases are kept however it ends.

    `progress` is called with the numbers of finished and of all cases and gives a function, which is called with the number of
    cases of each finished batch; `tell` is called with messages for a person.
    """
    with open_store(folder, study, tell=tell, cache_limit_mb=cache_limit_mb) as store:
        rows = store.finished()
        n_found = sum(case.id in rows for case in study.cases)
        failures: dict[str, dict[str, Any]] = {}
        try:
            missing = [case for case in study.cases if case.id not in rows]
            if missing:
                with progress(n_found, len(study.cases)) as advance, workers as crew:
                    agenda = Agenda(missing, store, workers=crew.count)
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


def _carried_out(agenda: Agenda, workers: Workers) -> Iterator[list[dict[str, Any]]]:
    """The rows as they come in. One task more than there are workers is under way, so that none of them waits."""
    running: dict[Future[Any], Work] = {}
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
