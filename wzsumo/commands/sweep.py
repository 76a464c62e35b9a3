"""The command `sweep`: runs the unfinished cases of a study and shows its progress."""

import argparse
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tqdm import tqdm

from wzsumo.commands.terminal.arguments import add_out_folder, count
from wzsumo.commands.terminal.progress import say
from wzsumo.commands.terminal.words import lines_of
from wzsumo.errors import SpecError, count_of
from wzsumo.sweep.cluster import ClusterWorkers
from wzsumo.sweep.estimate import estimate, n_cases_lacking_traces
from wzsumo.sweep.results import RESULTS, read_results
from wzsumo.sweep.store import MANIFEST
from wzsumo.sweep.study_file import Study, load_study
from wzsumo.sweep.sweep import AddFinished, run_sweep
from wzsumo.sweep.version import code_of_workers
from wzsumo.sweep.workers import LocalWorkers

MORE = """\
A study file (see scenarios/studies) names base scenarios, methods, and factors: any keys of the scenario, as a grid. Cases that
share a simulation run it once. Stop it whenever you like; the same command goes on with what is missing.
"""
PROGRESS_LINE_INTERVAL_S = 10.0  # where stderr is no terminal


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("study", type=Path, metavar="STUDY.toml", help="a study file, or the name of one of the library")
    add_out_folder(parser)
    parser.add_argument("--workers", type=count, metavar="N", help="processes (default: one a core)")
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask cluster that runs already, such as tcp://10.0.0.1:8786"
    )
    parser.add_argument("--dry-run", action="store_true", help="say how many cases and simulations, and about how long")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Numbers of cases, after running the unfinished ones of a study into a folder; with --dry-run an estimate of the work."""
    if (args.study / MANIFEST).is_file():
        raise SpecError(f"{args.study}: holds the results of a study; give the study's file, and this folder as --out")
    study = load_study(args.study)
    _say_lacks(args, study)
    cores = args.workers or len(os.sched_getaffinity(0))
    if args.dry_run:
        finished = set(read_results(args.out)["case"]) if (args.out / RESULTS).is_file() else set()
        work = estimate(study, finished=finished)
        return asdict(work) | {"workers": cores, "about_s": round(work.wall_clock_s(cores), 1)}
    pool = (
        ClusterWorkers(args.scheduler, version=code_of_workers) if args.scheduler else LocalWorkers(cores, tells=not args.quiet)
    )
    summary = run_sweep(study, args.out, workers=pool, progress=_untold if args.quiet else case_progress, tell=print_message)
    if summary.n_refused == summary.n_cases:
        reason = read_results(args.out)["reason"].iloc[0]
        raise SpecError(f"{args.study}: none of its {summary.n_cases} cases is possible, the first because: {reason}")
    for reason, n_cases in summary.failures.items():
        print_message(f"{n_cases} case(s) failed twice: {reason}")
    return asdict(summary) | {"results": str(summary.results), "failures": dict(summary.failures)}


def _say_lacks(args: argparse.Namespace, study: Study) -> None:
    """Say how many cases ask for more traces than can be expected."""
    if n_lacking := n_cases_lacking_traces(study):
        asking = (
            f"{n_lacking} of {len(study.cases)} cases ask for more traces (crowd.used) than equipped vehicles can be expected"
        )
        say(args, f"{asking} to pass; they will be refused: raise crowd.penetration or simulation.demand.duration_s")


def tell(figures: dict[str, Any], args: argparse.Namespace) -> None:
    """Print how the study stands, or with --dry-run what it takes."""
    if args.dry_run:
        work, time_s = "{n_cases} cases, {n_missing} of them missing, in {simulations}", figures["about_s"]
        took = f"some {figures['processor_s']:.0f} s of processor time, {time_s:.0f} s on {figures['workers']} processes"
        sys.stdout.write(f"{work.format(**figures, simulations=count_of(figures['n_simulations'], 'simulation'))}: {took}\n")
        return
    for line in lines_of(figures):
        sys.stdout.write(f"{line}\n")


def next_step(figures: dict[str, Any], args: argparse.Namespace) -> str:
    """The command that goes on from here; "" where there is nothing to report of."""
    if args.dry_run:
        return f"wzsumo sweep {args.study} --out {args.out}"
    return f"wzsumo report {args.out}" if figures["n_done"] else ""


def failure(figures: dict[str, Any], _args: argparse.Namespace) -> str:
    """Why the command as a whole has failed; "" where every case has a result."""
    n_failed = figures.get("n_failed", 0)
    if not n_failed:
        return ""
    return (
        f"{n_failed} of {figures['n_cases']} cases failed; the same command tries them again, `run DIR --case NAME` one alone"
    )


def print_message(line: str) -> None:
    """Print a line to stderr, above the progress bar if there is one."""
    tqdm.write(f"wzsumo: {line}", file=sys.stderr)


@contextmanager
def _untold(_finished: int, _total: int) -> Iterator[AddFinished]:
    yield lambda _count: None


@contextmanager
def case_progress(finished: int, total: int) -> Iterator[AddFinished]:
    """A progress bar on a terminal, elsewhere a line from time to time; it gives a function that takes newly finished cases."""
    if sys.stderr.isatty():
        with tqdm(total=total, initial=finished, desc="cases", unit="case", smoothing=0.1) as bar:

            def step(count: int) -> None:
                bar.update(count)

            yield step
        return
    began = last = time.monotonic()
    done = finished
    print_message(f"{done} of {total} cases finished")

    def advance(count: int) -> None:
        nonlocal done, last
        done += count
        now = time.monotonic()
        if now - last >= PROGRESS_LINE_INTERVAL_S or done == total:
            last = now
            left = (now - began) / (done - finished) * (total - done)
            print_message(f"{done} of {total} cases finished, about {left:.0f} s left")

    yield advance
