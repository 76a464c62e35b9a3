"""Which small changes of a folder's code do its tests notice? `make mutants FOLDER=wzsumo/behaviour` calls this.

Cosmic Ray makes the mutants, each with one change; every mutant is tested in a process of its own, in a copy of the project.
A mutant is killed when a test fails or runs for too long. The share killed and the survivors go to stdout and results/mutants/.

Changes made: a whole number plus and minus one; another number doubled and halved; a comparison moved at its edge and
reversed; + and -, * and /, & and |, `and` and `or`, True and False, break and continue exchanged; a minus sign, `~` or `not`
taken away; a condition reversed; a loop's body skipped.

Left out, since no test should pin them: annotations, decorators, `assert`, all that a `raise` statement or an f-string holds
(the words of messages and pages), bounds and metadata of pydantic's Field (its default is changed), `strict` of zip, blocks
under TYPE_CHECKING, and numbers below 1e-6, which only keep a division or a comparison from failing.
"""

import argparse
import ast
import contextlib
import difflib
import importlib
import json
import multiprocessing
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import pytest
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.operator import Operator
from cosmic_ray.operators.provider import OperatorProvider
from parso.python.tree import Number
from tqdm import tqdm

ROOT = Path(__file__).resolve().parent.parent
SAMPLE_SEED = 1
SMALLEST_NUMBER = 1e-6
# A mutant may take this much longer than the code as it is before it counts as killed.
TIMEOUT_FACTOR, TIMEOUT_EXTRA_S = 4.0, 20.0
NOT_COPIED = shutil.ignore_patterns(".git", ".venv", "results", ".mypy_cache", ".ruff_cache", ".pytest_cache", ".hypothesis")
# Loaded once, before the processes part; the package itself is loaded in each of them.
LIBRARIES = ("numba", "numpy", "pandas", "pyarrow", "pydantic", "scipy", "shapely", "sklearn", "matplotlib", "jinja2")
EXCHANGES = {
    "ReplaceBinaryOperator": [
        ("Add", "Sub"), ("Sub", "Add"), ("Mul", "Div"), ("Div", "Mul"), ("FloorDiv", "Mul"), ("Mod", "Mul"), ("Pow", "Mul"),
        ("BitAnd", "BitOr"), ("BitOr", "BitAnd"), ("BitXor", "BitAnd"), ("RShift", "LShift"), ("LShift", "RShift"),
    ],
    "ReplaceComparisonOperator": [
        ("Lt", "LtE"), ("Lt", "GtE"), ("LtE", "Lt"), ("LtE", "Gt"), ("Gt", "GtE"), ("Gt", "LtE"), ("GtE", "Gt"), ("GtE", "Lt"),
        ("Eq", "NotEq"), ("NotEq", "Eq"), ("Is", "IsNot"), ("IsNot", "Is"),
    ],
    "ReplaceUnaryOperator": [("Delete", "USub"), ("Delete", "Invert"), ("Delete", "Not")],
}  # fmt: skip
OTHER_CHANGES = (
    "AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd",
    "ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ZeroIterationForLoop",
)  # fmt: skip

Position = tuple[int, int]  # line from 1, column from 0


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A place where an operator can change a module: the occurrence, from 0, of what it changes."""

    file: str
    line: int
    operator: Operator
    occurrence: int


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """One changed module: its file from the project's root, the line of the change and the whole changed text."""

    file: str
    line: int
    text: str


def main() -> None:
    """Test the mutants of a folder and write the share killed and the survivors."""
    parser = argparse.ArgumentParser(description="share of small changes of the code that tests notice")
    parser.add_argument("folder", help="a folder of the package, with the folders in it, or one module: wzsumo/behaviour")
    parser.add_argument("--tests", nargs="*", default=[], help="further test folders or files")
    parser.add_argument("--sample", type=int, help="so many mutants, drawn at random with a fixed seed")
    parser.add_argument("--jobs", type=int, default=2, help="mutants tested at once")
    options = parser.parse_args()
    files = modules_of(options.folder)
    tests = [*tests_of(options.folder), *options.tests]
    candidates = [candidate for file in files for candidate in candidates_of(file)]
    random.Random(SAMPLE_SEED).shuffle(candidates)  # noqa: S311  # nothing secret is drawn
    mutants = list(islice(mutants_of(candidates), options.sample))
    with tempfile.TemporaryDirectory(prefix="mutants_") as scratch:
        killed = killed_by(tests, mutants, scratch=Path(scratch), jobs=options.jobs)
    drawn = "all" if options.sample is None else f"drawn at random from {len(candidates)} places, seed {SAMPLE_SEED}"
    report = report_of(options.folder, mutants, killed, heading=f"mutants: {drawn}; tests: {' '.join(tests)}")
    name = Path(options.folder).with_suffix("").as_posix().removeprefix("wzsumo/").replace("/", "_")
    out = ROOT / "results" / "mutants" / f"{name}.txt"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(report, encoding="utf-8")
    sys.stdout.write(report)


def modules_of(folder: str) -> list[str]:
    """The Python files of a folder and of the folders in it, from the project's root; of the package itself its root alone."""
    path = Path(folder)
    if path.is_absolute() or not (ROOT / path).exists() or path.parts[0] != "wzsumo":
        sys.exit(f"FOLDER={folder} must be a folder or a module of the package, such as wzsumo/behaviour")
    if path.suffix == ".py":
        return [path.as_posix()]
    found = (ROOT / path).glob("*.py") if path == Path("wzsumo") else (ROOT / path).rglob("*.py")
    return sorted(file.relative_to(ROOT).as_posix() for file in found)


def tests_of(folder: str) -> list[str]:
    """The tests that mirror a folder and the examples in its docstrings; the modules at the root have theirs in tests/base."""
    path = Path(folder)
    inside = path.relative_to("wzsumo").parent if path.suffix == ".py" else path.relative_to("wzsumo")
    mirror = Path("tests") / (inside if inside.parts else "base")
    if not (ROOT / mirror).is_dir():
        sys.exit(f"{mirror} is missing: {folder} has no tests of its own")
    examples = [file for file in modules_of(folder) if ">>> " in (ROOT / file).read_text(encoding="utf-8")]
    return [mirror.as_posix(), *examples]


# -- the mutants ----------------------------------------------------------------------------------------------------------


class ScaleNumber(Operator):  # type: ignore[misc]  # Cosmic Ray has no types
    """Doubles and halves numbers that are not whole; puts one for zero."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[Position, Position]]:
        """A position for each change of a number."""
        if isinstance(node, Number) and isinstance(ast.literal_eval(node.value), float):
            for _ in self._changed(node):
                yield node.start_pos, node.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        """The node with a change."""
        return Number(f" {self._changed(node)[index]!r}", node.start_pos)

    def _changed(self, node: Any) -> tuple[float, ...]:
        value = ast.literal_eval(node.value)
        return (2 * value, value / 2) if value else (1.0,)

    @classmethod
    def examples(cls) -> tuple[()]:
        """None."""
        return ()


class ShiftWholeNumber(OperatorProvider()["NumberReplacer"]):  # type: ignore[misc]  # Cosmic Ray has no types
    """Adds one to whole numbers and takes one from them."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[Position, Position]]:
        """A position for each change of a number."""
        if isinstance(node, Number) and isinstance(ast.literal_eval(node.value), int):
            yield from super().mutation_positions(node)


def operators() -> list[Operator]:
    """What changes the code."""
    provider = OperatorProvider()
    exchanges = [f"{kind}_{before}_{after}" for kind, pairs in EXCHANGES.items() for before, after in pairs]
    return [ScaleNumber(), ShiftWholeNumber(), *(provider[name]() for name in (*exchanges, *OTHER_CHANGES))]


def candidates_of(file: str) -> Iterator[Candidate]:
    """Every change of a module that is not left out."""
    source = (ROOT / file).read_text(encoding="utf-8")
    left_out = list(spans_left_out(source))
    nodes = list(ast_nodes(get_ast(source)))
    for operator in operators():
        places = [span for node in nodes for span in operator.mutation_positions(node)]
        for occurrence, (start, end) in enumerate(places):
            if not any(first <= start and end <= last for first, last in left_out):
                yield Candidate(file=file, line=start[0], operator=operator, occurrence=occurrence)


def mutants_of(candidates: Iterable[Candidate]) -> Iterator[Mutant]:
    """The candidates' mutants, without those that change nothing, are no Python, or came before."""
    seen = set()
    for candidate in candidates:
        source = (ROOT / candidate.file).read_text(encoding="utf-8")
        text = mutate_code(source, candidate.operator, candidate.occurrence)
        if text not in {None, source} and (candidate.file, text) not in seen and _parses(text):
            seen.add((candidate.file, text))
            yield Mutant(file=candidate.file, line=candidate.line, text=text)


def _parses(text: str) -> bool:
    try:
        ast.parse(text)
    except SyntaxError:
        return False
    return True


def spans_left_out(source: str) -> Iterator[tuple[Position, Position]]:
    """Beginning and end of each part of the code that is not changed."""
    lines = source.splitlines()

    def column(line: int, byte: int) -> int:
        return len(lines[line - 1].encode()[:byte].decode())

    for node in ast.walk(ast.parse(source)):
        for part in _parts_left_out(node):
            last_line, last_byte = part.end_lineno or part.lineno, part.end_col_offset or 0
            yield (part.lineno, column(part.lineno, part.col_offset)), (last_line, column(last_line, last_byte))


def _parts_left_out(node: ast.AST) -> Iterator[ast.expr | ast.stmt]:
    match node:
        case ast.arg(annotation=ast.expr() as part) | ast.AnnAssign(annotation=part):
            yield part
        case ast.FunctionDef(returns=returns, decorator_list=decorators):
            yield from decorators
            yield from [returns] if returns else []
        case ast.ClassDef(decorator_list=decorators):
            yield from decorators
        case ast.Raise() | ast.Assert() | ast.JoinedStr():
            yield node
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            yield node
        case ast.Call(func=ast.Name(id="Field"), keywords=keywords):
            yield from (keyword.value for keyword in keywords if keyword.arg not in {"default", "default_factory"})
        case ast.Call(func=ast.Name(id="zip"), keywords=keywords):
            yield from (keyword.value for keyword in keywords)
        case ast.Constant(value=float() as value) if 0 < value < SMALLEST_NUMBER:
            yield node
        case _:
            pass


# -- the tests ------------------------------------------------------------------------------------------------------------


def killed_by(tests: Sequence[str], mutants: Sequence[Mutant], *, scratch: Path, jobs: int) -> list[bool]:
    """Whether each mutant is killed. Raises SystemExit where the tests fail on the code as it is."""
    pristine = scratch / "as_it_is"
    shutil.copytree(ROOT, pristine, ignore=NOT_COPIED)
    sys.stderr.write(f"mutants: {len(mutants)} in all; first the tests of the code as it is\n")
    record = scratch / "record.json"
    start = time.monotonic()
    _must_pass(_run_recorded, pristine, tests, record)
    timeout_s = TIMEOUT_EXTRA_S + TIMEOUT_FACTOR * (time.monotonic() - start)
    durations, modules = json.loads(record.read_text(encoding="utf-8"))
    for name in modules:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    _must_pass(_run_in_order, pristine, tests, durations)  # in the mutants' order and surroundings, or all would seem killed
    importers = importers_of(pristine)
    free = [shutil.copytree(pristine, scratch / f"copy_{job}") for job in range(jobs)]
    killed = [False] * len(mutants)
    pending = list(enumerate(mutants))[::-1]
    running: dict[int, tuple[BaseProcess, int, Path, float]] = {}
    with tqdm(total=len(mutants), unit="mutant", file=sys.stderr) as progress:
        while pending or running:
            while pending and free:
                number, mutant = pending.pop()
                tree = free.pop()
                _put_in(mutant, tree, importers)
                process = _start(_run_quietly, tree, tests, durations)
                running[process.sentinel] = process, number, tree, time.monotonic() + timeout_s
            wait(list(running), timeout=1.0)
            for sentinel, (process, number, tree, deadline) in list(running.items()):
                late = time.monotonic() > deadline
                if late and process.pid and process.is_alive():
                    os.killpg(process.pid, signal.SIGKILL)
                if late or not process.is_alive():
                    process.join()
                    killed[number] = process.exitcode != 0
                    del running[sentinel]
                    _take_out(mutants[number], tree, pristine, importers)
                    free.append(tree)
                    progress.update()
    return killed


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


def _put_in(mutant: Mutant, tree: Path, importers: dict[str, set[str]]) -> None:
    """Write a mutant, and forget the compiled kernels that may hold the code from before."""
    (tree / mutant.file).write_text(mutant.text, encoding="utf-8")
    for file in importers[mutant.file]:
        for kernel in _kernels(tree / file):
            kernel.unlink()


def _take_out(mutant: Mutant, tree: Path, pristine: Path, importers: dict[str, set[str]]) -> None:
    shutil.copy2(pristine / mutant.file, tree / mutant.file)
    for file in importers[mutant.file]:
        for kernel in _kernels(tree / file):
            kernel.unlink()
        for kernel in _kernels(pristine / file):
            shutil.copy2(kernel, tree / kernel.relative_to(pristine))


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


# -- the report -----------------------------------------------------------------------------------------------------------


def report_of(folder: str, mutants: Sequence[Mutant], killed: Sequence[bool], *, heading: str) -> str:
    """The share killed, in all and by module, and each survivor with its place and its change."""
    made = Counter(mutant.file for mutant in mutants)
    dead = Counter(mutant.file for mutant, gone in zip(mutants, killed, strict=True) if gone)
    lines = [f"{folder}: {_share(sum(dead.values()), len(mutants))}", heading, ""]
    lines += [f"  {file}: {_share(dead[file], made[file])}" for file in sorted(made)]
    lines += ["", "survivors:" if sum(dead.values()) < len(mutants) else "no survivors"]
    survivors = [mutant for mutant, gone in zip(mutants, killed, strict=True) if not gone]
    for mutant in sorted(survivors, key=lambda mutant: (mutant.file, mutant.line)):
        lines += [f"{mutant.file}:{mutant.line}", *(f"    {line}" for line in _change(mutant))]
    return "\n".join(lines) + "\n"


def _share(killed: int, made: int) -> str:
    return f"{killed} of {made} mutants killed" + (f" ({100 * killed / made:.1f} %)" if made else "")


def _change(mutant: Mutant) -> list[str]:
    source = (ROOT / mutant.file).read_text(encoding="utf-8")
    compared = difflib.unified_diff(source.splitlines(), mutant.text.splitlines(), n=0, lineterm="")
    return [f"{line[0]} {line[1:].strip()}" for line in compared if line[0] in "+-" and not line.startswith(("+++", "---"))]


if __name__ == "__main__":
    main()
