"""Which small changes of a folder's code do its tests notice? `make mutants FOLDER=wzsumo/behaviour` calls this.

A mutant is the code with one small change (mutants.py). Each is tested in a process of its own, in a copy of the project
(trials.py), and is killed when a test fails or runs for too long. The share killed and the survivors go to stdout and to
results/mutants/.
"""

import argparse
import difflib
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from mutants import ROOT, Mutant, candidates_of, mutants_of
from trials import killed_by

SAMPLE_SEED = 1


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
        tested = killed_by(tests, mutants, scratch=Path(scratch), jobs=options.jobs)
    drawn = "all" if options.sample is None else f"drawn at random from {len(candidates)} places, seed {SAMPLE_SEED}"
    if len(tested) < len(mutants):
        drawn += f", interrupted after {len(tested)} of {len(mutants)}"
    report = report_of(options.folder, tested, heading=f"mutants: {drawn}; tests: {' '.join(tests)}")
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


def report_of(folder: str, tested: Sequence[tuple[Mutant, bool]], *, heading: str) -> str:
    """The share killed, in all and by module, and each survivor with its place and its change."""
    made = Counter(mutant.file for mutant, _ in tested)
    dead = Counter(mutant.file for mutant, killed in tested if killed)
    survivors = sorted((mutant for mutant, killed in tested if not killed), key=lambda mutant: (mutant.file, mutant.line))
    lines = [f"{folder}: {_share(sum(dead.values()), len(tested))}", heading, ""]
    lines += [f"  {file}: {_share(dead[file], made[file])}" for file in sorted(made)]
    lines += ["", "survivors:" if survivors else "no survivors"]
    for mutant in survivors:
        lines += [f"{mutant.file}:{mutant.line}", *(f"    {line}" for line in _change(mutant))]
    return "\n".join(lines) + "\n"


def _share(killed: int, made: int) -> str:
    return f"{killed} of {made} mutants killed" + (f" ({100 * killed / made:.1f} %)" if made else "")


def _change(mutant: Mutant) -> list[str]:
    compared = difflib.unified_diff(mutant.before.splitlines(), mutant.text.splitlines(), n=0, lineterm="")
    return [f"{line[0]} {line[1:].strip()}" for line in compared if line[0] in "+-" and not line.startswith(("+++", "---"))]


if __name__ == "__main__":
    main()
