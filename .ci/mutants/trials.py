"""Runs the tests on mutants: each in a process that parts from this one, in which the libraries are loaded already."""

import ast
import contextlib
import importlib
import json
import multiprocessing
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path

import pytest
from mutants import ROOT, Mutant
from tqdm import tqdm

# A mutant may take this much longer than the code as it is before it counts as killed.
TIMEOUT_FACTOR, TIMEOUT_EXTRA_S = 4.0, 20.0
NOT_COPIED = shutil.ignore_patterns(".git", ".venv", "results", ".mypy_cache", ".ruff_cache", ".pytest_cache", ".hypothesis")
# Loaded once, before the processes part; the package itself is loaded in each of them.
LIBRARIES = ("numba", "numpy", "pandas", "pyarrow", "pydantic", "scipy", "shapely", "sklearn", "matplotlib", "jinja2")


def killed_by(tests: Sequence[str], mutants: Sequence[Mutant], *, scratch: Path, jobs: int) -> list[tuple[Mutant, bool]]:
    """Each mutant, and whether it is killed; after Ctrl-C those that were tested by then.

    Raises SystemExit where the tests fail on the code as it is.
    """
    pristine = scratch / "as_it_is"
    shutil.copytree(ROOT, pristine, ignore=NOT_COPIED)
    sys.stderr.write(f"mutants: {len(mutants)}; first the tests of the code as it is, twice\n")
    record = scratch / "record.json"
    start = time.monotonic()
    _must_pass(_run_recorded, pristine, tests, record)
    timeout_s = TIMEOUT_EXTRA_S + TIMEOUT_FACTOR * (time.monotonic() - start)
    durations, modules = json.loads(record.read_text(encoding="utf-8"))
    for name in modules:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    _must_pass(_run_in_order, pristine, tests, durations)  # in the mutants' order and surroundings, or all would seem killed
    trees = [shutil.copytree(pristine, scratch / f"copy_{job}") for job in range(jobs)]
    trials = _Trials(tests=tests, durations=durations, pristine=pristine, free=trees, timeout_s=timeout_s)
    tested: list[tuple[Mutant, bool]] = []
    try:
        with tqdm(total=len(mutants), unit="mutant", file=sys.stderr) as progress:
            for mutant in mutants:
                tested += trials.finished(at_least=0 if trials.free else 1)
                trials.start(mutant)
                progress.update(len(tested) - progress.n)
            while trials.running:
                tested += trials.finished(at_least=1)
                progress.update(len(tested) - progress.n)
    except KeyboardInterrupt:
        trials.stop()
    return tested


@dataclass
class _Trial:
    mutant: Mutant
    tree: Path
    process: BaseProcess
    deadline: float


class _Trials:
    """The trials that run now, each in a copy of the project of its own."""

    def __init__(
        self, *, tests: Sequence[str], durations: dict[str, float], pristine: Path, free: list[Path], timeout_s: float
    ) -> None:
        self.tests, self.durations, self.pristine, self.free, self.timeout_s = tests, durations, pristine, free, timeout_s
        self.importers = importers_of(pristine)
        self.running: list[_Trial] = []

    def start(self, mutant: Mutant) -> None:
        """Test a mutant in a free copy."""
        tree = self.free.pop()
        self._put_in(mutant, tree)
        process = _start(_run_quietly, tree, self.tests, self.durations)
        self.running.append(_Trial(mutant, tree, process, time.monotonic() + self.timeout_s))

    def finished(self, *, at_least: int) -> list[tuple[Mutant, bool]]:
        """The mutants whose trials have ended, and whether each is killed; waits for so many."""
        done: list[tuple[Mutant, bool]] = []
        while True:
            for trial in list(self.running):
                if time.monotonic() > trial.deadline:
                    _kill(trial.process)
                if not trial.process.is_alive():
                    self.running.remove(trial)
                    self._take_out(trial.mutant, trial.tree)
                    self.free.append(trial.tree)
                    done.append((trial.mutant, trial.process.exitcode != 0))
            if len(done) >= at_least:
                return done
            wait([trial.process.sentinel for trial in self.running], timeout=1.0)

    def stop(self) -> None:
        """End the trials that run."""
        for trial in self.running:
            _kill(trial.process)

    def _put_in(self, mutant: Mutant, tree: Path) -> None:
        """Write a mutant, and forget the compiled kernels that may hold the code from before."""
        (tree / mutant.file).write_text(mutant.text, encoding="utf-8")
        for file in self.importers[mutant.file]:
            for kernel in _kernels(tree / file):
                kernel.unlink()

    def _take_out(self, mutant: Mutant, tree: Path) -> None:
        shutil.copy2(self.pristine / mutant.file, tree / mutant.file)
        for file in self.importers[mutant.file]:
            for kernel in _kernels(tree / file):
                kernel.unlink()
            for kernel in _kernels(self.pristine / file):
                shutil.copy2(kernel, tree / kernel.relative_to(self.pristine))


def _kill(process: BaseProcess) -> None:
    if process.pid and process.is_alive():
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.join()


def _must_pass(run: Callable[..., None], pristine: Path, tests: Sequence[str], argument: object) -> None:
    process = _start(run, pristine, tests, argument)
    process.join()
    if process.exitcode != 0:
        sys.exit(f"the tests must pass before mutants are tested: pytest {' '.join(tests)} ended with {process.exitcode}")


def _start(run: Callable[..., None], *arguments: object) -> BaseProcess:
    process = multiprocessing.get_context("fork").Process(target=run, args=arguments)
    process.start()
    return process


class _Order:
    """A pytest plugin: the quickest tests first, and how long each took."""

    def __init__(self, durations: dict[str, float]) -> None:
        self.durations = durations

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items.sort(key=lambda item: self.durations.get(item.nodeid, 0.0))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.durations[report.nodeid] = self.durations.get(report.nodeid, 0.0) + report.duration


def _run_pytest(tree: Path, tests: Sequence[str], plugin: _Order) -> int:
    os.chdir(tree)
    os.environ["PYTHONPATH"] = str(tree)  # for tests that start Python
    sys.path.insert(0, str(tree))
    return int(pytest.main(["-x", "-p", "no:cacheprovider", "-p", "no:xdist", *tests], plugins=[plugin]))


def _run_recorded(tree: Path, tests: Sequence[str], record: Path) -> None:
    """Run the tests of the code as it is; write the seconds that each took, and the libraries' modules that they loaded."""
    os.dup2(2, 1)
    plugin = _Order({})
    code = _run_pytest(tree, tests, plugin)
    modules = sorted(name for name in sys.modules if name.split(".")[0] in LIBRARIES)
    record.write_text(json.dumps([plugin.durations, modules]), encoding="utf-8")
    sys.stderr.flush()
    os._exit(code)


def _run_quietly(tree: Path, tests: Sequence[str], durations: dict[str, float]) -> None:
    os.setsid()
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    _run_in_order(tree, tests, durations)


def _run_in_order(tree: Path, tests: Sequence[str], durations: dict[str, float]) -> None:
    os.dup2(2, 1)
    sys.dont_write_bytecode = True  # two mutants of one second would be taken for one
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    os._exit(_run_pytest(tree, tests, _Order(dict(durations))))


def _kernels(file: Path) -> list[Path]:
    """What Numba keeps of a module's kernels: it looks whether that module has changed, not those whose kernels it calls."""
    return [path for path in (file.parent / "__pycache__").glob(f"{file.stem}.*") if path.suffix in {".nbi", ".nbc"}]


def importers_of(tree: Path) -> dict[str, set[str]]:
    """For each module's file, the files that import it, by way of others too, and itself."""
    files = {
        ".".join(path.relative_to(tree).with_suffix("").parts): path.relative_to(tree).as_posix()
        for path in (tree / "wzsumo").rglob("*.py")
    }
    direct: dict[str, set[str]] = {file: set() for file in files.values()}
    for file in files.values():
        for node in ast.walk(ast.parse((tree / file).read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                for name in (node.module, *(f"{node.module}.{alias.name}" for alias in node.names)):
                    if name in files:
                        direct[files[name]].add(file)
    reach: dict[str, set[str]] = {}
    for file in direct:
        seen, ahead = {file}, [file]
        while ahead:
            new = direct[ahead.pop()] - seen
            seen |= new
            ahead += new
        reach[file] = seen
    return reach
