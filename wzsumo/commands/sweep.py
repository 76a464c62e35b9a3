"""What `wzsumo sweep` does, and how it tells a person."""

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tqdm import tqdm

from wzsumo.sweep.cluster import ClusterWorkers
from wzsumo.sweep.estimate import estimate
from wzsumo.sweep.results import RESULTS, read_results
from wzsumo.sweep.study_case import code_version
from wzsumo.sweep.study_file import load_study
from wzsumo.sweep.sweep import Advance, run_sweep
from wzsumo.sweep.workers import LocalWorkers

LINE_EVERY_S = 10.0  # where progress goes to a file


def sweep_study(
    study_file: Path, out: Path, *, workers: int | None = None, scheduler: str | None = None, dry_run: bool = False
) -> dict[str, Any]:
    """Run what is missing of a study into `out`, or only say how much that is; figures of it."""
    study = load_study(study_file)
    cores = workers or len(os.sched_getaffinity(0))
    if dry_run:
        finished = set(read_results(out)["case"]) if (out / RESULTS).is_file() else set()
        work = estimate(study, finished=finished)
        return asdict(work) | {"workers": cores, "about_s": round(work.wall_clock_s(cores), 1)}
    crew = ClusterWorkers(scheduler, version=code_version) if scheduler else LocalWorkers(cores)
    summary = run_sweep(study, out, workers=crew, progress=case_progress, tell=tell)
    for reason, count in summary.failures.items():
        tell(f"{count} case(s) failed twice: {reason}")
    return asdict(summary) | {"results": str(summary.results), "failures": dict(summary.failures)}


def tell(line: str) -> None:
    """Write a line to stderr, above a progress bar where there is one."""
    tqdm.write(f"wzsumo: {line}", file=sys.stderr)


@contextmanager
def case_progress(finished: int, total: int) -> Iterator[Advance]:
    """A bar with the time left on a terminal, else a line now and then; its value is told of cases as they are finished."""
    if sys.stderr.isatty():
        with tqdm(total=total, initial=finished, desc="cases", unit="case", smoothing=0.1) as bar:

            def step(count: int) -> None:
                bar.update(count)

            yield step
        return
    began = last = time.monotonic()
    done = finished
    tell(f"{done} of {total} cases finished")

    def advance(count: int) -> None:
        nonlocal done, last
        done += count
        now = time.monotonic()
        if now - last >= LINE_EVERY_S or done == total:
            last = now
            left = (now - began) / (done - finished) * (total - done)
            tell(f"{done} of {total} cases finished, about {left:.0f} s left")

    yield advance
