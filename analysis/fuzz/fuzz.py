"""Runs odd inputs through the command line, each in a process of its own with bounded memory and time; counts how they end.

    .venv/bin/python analysis/fuzz/fuzz.py --inputs 3000 --seed 1 --out results/fuzz

Input N of seed S is the same in every run: --only N makes it again and shows what it says. An input passes where it ends
with 0, or with 2 and a line of printable characters a mistake, within 60 s of processor time and 4 GiB of address space beyond
what the start takes, and leaves nothing half-written. Everything else is kept in OUT/failures; OUT/said.txt
has a line an input, to be read for wrong words. The same command goes on where it was stopped, or where --minutes had gone by
(name another --out for other code): OUT/inputs_SEED.csv holds what was tried.
"""

import argparse
import contextlib
import csv
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from child import NOWHERE, load_commands, started
from inputs import KINDS, REPOSITORY
from known_answers import is_wrong, with_found
from trace_inputs import drives

LIMIT_S, LIMIT_BYTES = 60, 4 * 2**30
SLOW = ("run's folder", "study's folder")
MAX_SAID = 21 * 4200  # characters of 20 mistakes and of the line that counts the others


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=list(KINDS))
    parser.add_argument("--only", type=int)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which no further input is tried")
    parser.add_argument("--out", type=Path, default=Path("results/fuzz"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    tried = [] if args.only is not None else _tried_before(args.out, args.seed)
    done = {row.number for row in tried}
    numbers = [n for n in range(args.inputs) if n not in done] if args.only is None else [args.only]
    for row in fuzz(numbers, seed=args.seed, kind=args.kind, out=args.out, minutes=args.minutes):
        tried.append(row)
        if args.only is None:
            _write(tried, args.out, args.seed)  # what is tried stays where the run is stopped
        else:
            print((args.out / "failures" / f"{args.seed}_{row.number}.txt").read_text())
    print(*(",".join(map(str, row)) for row in _counts(tried)), sep="\n")
    sys.exit(any(row.ending not in {"done", "refused"} for row in tried))


class Tried(NamedTuple):
    """How an input ended."""

    number: int
    kind: str
    ending: str
    memory_mb: float
    took_s: float


def fuzz(numbers: Iterable[int], *, seed: int, kind: str | None, out: Path, minutes: float = float("inf")) -> Iterator[Tried]:
    """How each input ended, one after the other; what it said is added to OUT/said.txt, failures to OUT/failures."""
    load_commands()
    (out / "failures").mkdir(parents=True, exist_ok=True)
    until = time.monotonic() + 60 * minutes
    numbers = list(numbers)
    with tempfile.TemporaryDirectory(prefix="fuzz-") as base:
        templates = _templates((out / "templates").resolve(), [kind] if kind else list(KINDS))
        for number in numbers:
            if time.monotonic() > until:
                break
            name = kind or _kind_of(number)
            chance = random.Random(f"{seed} {number} {name}")
            ending, said, (memory_mb, took_s) = _tried(name, chance, Path(base), templates)
            with (out / "said.txt").open("a", encoding="utf-8", errors="replace") as file:
                file.write(f"{number} {name}, {ending}: {' '.join(said.splitlines()[2:])[-300:]}\n")
            if len(numbers) == 1 or ending not in {"done", "refused"}:
                (out / "failures" / f"{seed}_{number}.txt").write_text(
                    f"{name}: {ending}\n{said}", encoding="utf-8", errors="replace"
                )
            yield Tried(number, name, ending, round(memory_mb, 1), round(took_s, 1))


def _kind_of(number: int) -> str:
    """The kind of an input: each in turn, those that draw pages in every sixth turn alone: they take ten times as long."""
    turn, place = divmod(number, len(KINDS))
    name = list(KINDS)[place]
    return name if turn % 6 == 0 or name not in SLOW else "traces"


def _counts(tried: list[Tried]) -> list[tuple[Any, ...]]:
    """Rows (kind, ending, inputs, largest memory MB, longest s), the first with the names of the columns."""
    of: dict[tuple[str, str], list[Tried]] = {}
    for row in tried:
        of.setdefault((row.kind, row.ending), []).append(row)
    rows = [
        (*key, len(of[key]), max(row.memory_mb for row in of[key]), max(row.took_s for row in of[key])) for key in sorted(of)
    ]
    return [("kind", "ending", "inputs", "largest_mb", "longest_s"), *rows]


def _write(tried: list[Tried], out: Path, seed: int) -> None:
    for name, rows in ((f"inputs_{seed}.csv", [Tried._fields, *tried]), ("counts.csv", _counts(tried))):
        with (out / name).open("w", newline="") as file:
            csv.writer(file).writerows(rows)


def _tried_before(out: Path, seed: int) -> list[Tried]:
    """What an earlier run with this seed and folder has tried."""
    path = out / f"inputs_{seed}.csv"
    if not path.exists():
        return []
    with path.open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    return [Tried(int(row[0]), row[1], row[2], float(row[3]), float(row[4])) for row in rows]


def _templates(base: Path, kinds: list[str]) -> dict[str, Path]:
    """Folders that kinds of input begin with: a run's, a study's, a layout's; made where they are not there yet."""
    base.mkdir(exist_ok=True)
    found = {}
    made = (("run's folder", "run"), ("study's folder", "study"), ("lanes", "layout"), ("live", "stream"))
    for name, folder in made:
        target = found[name] = base / folder
        if target.exists() or name not in kinds:
            continue
        if folder == "stream":
            _make_stream(target)
            continue
        words = {
            "run": ["run", _small_scenario(base), "--method", "swept", "--out", str(target)],
            "study": ["sweep", _small_study(base), "--workers", "1", "--out", str(target)],
            "layout": ["layout", str(REPOSITORY / "scenarios" / "paper.toml"), "--out", str(target)],
        }[folder]
        code, said, _ = _in_process(words, limits=False)
        assert code == 0, said
    return found


def _make_stream(target: Path) -> None:
    """A map of traces, and the folder of a live map that took the same traces."""
    target.mkdir()
    drives(random.Random(7)).to_csv(target / "traces.csv", index=False)
    for words in (
        ["map", str(target / "traces.csv"), "--out", str(target / "map")],
        ["live", str(target / "traces.csv"), "--map", str(target / "map"), "--out", str(target / "live")],
    ):
        code, said, _ = _in_process(words, limits=False)
        assert code == 0, said


def _small_scenario(base: Path) -> str:
    text = (REPOSITORY / "scenarios" / "paper.toml").read_text()
    changes = {"duration_s": "300", "penetration": "0.5", "collected": "6"}
    lines = [
        next((f"{key} = {value}" for key, value in changes.items() if line.startswith(f"{key} =")), line)
        for line in text.splitlines()
    ]
    (base / "small.toml").write_text("\n".join(lines))
    return str(base / "small.toml")


def _small_study(base: Path) -> str:
    _small_scenario(base)
    head = 'name = "small"\nscenarios = ["small.toml"]\nmethods = ["swept", "lanes"]\n'
    (base / "study.toml").write_text(head + "[grid]\nseed = [1, 2]\ncrowd.used = [2, 5]\n")
    return str(base / "study.toml")


def _tried(kind: str, rng: random.Random, base: Path, templates: dict[str, Path]) -> tuple[str, str, tuple[float, float]]:
    """(how an input ended, what it said, (memory MB, s))."""
    folder = base / "input"
    shutil.rmtree(folder, ignore_errors=True)
    if kind in templates:
        shutil.copytree(templates[kind], folder)
    else:
        folder.mkdir()
    words = KINDS[kind](rng, folder)
    began = time.monotonic()
    code, said, memory_mb = _in_process(words, limits=True, cwd=folder)
    took = time.monotonic() - began
    told = f"{' '.join(words)[:600]}\nexit {code}, {memory_mb:.0f} MB, {took:.1f} s\n{said}"
    return _ending(code, said, folder), told, (memory_mb, took)


def _ending(code: int, said: str, folder: Path) -> str:
    if "Traceback" in said:
        return "traceback"
    if code < 0:
        return "too slow" if -code in {signal.SIGALRM, signal.SIGXCPU} else f"killed by {signal.Signals(-code).name}"
    if any(path.name.startswith((".wzsumo-unfinished", ".wzsumo-finished")) for path in folder.rglob("*")):
        return "half-written"
    if code == 0:
        figures = (folder / "stdout").read_text(errors="replace") if (folder / "expected.json").exists() else "{}"
        return "silently wrong" if is_wrong(folder, with_found(json.loads(figures)), said) else "done"
    lines = [line for line in said.splitlines() if line.startswith("wzsumo: ")]
    rest = said[said.find("wzsumo: ") :].splitlines()
    if code == 2 and lines and rest == lines and sum(map(len, lines)) < MAX_SAID and all(line.isprintable() for line in lines):
        return "refused"
    return f"exit {code}, not a line a mistake"


def _in_process(words: list[str], *, limits: bool, cwd: Path | None = None) -> tuple[int, str, float]:
    """(exit code or -signal, what it said on stderr, largest memory [MB]) of a command in a process of its own."""

    def prepare() -> None:
        if cwd is not None:
            os.chdir(cwd)
        if limits:
            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (used + LIMIT_BYTES, used + LIMIT_BYTES))
            resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S + 5))
            signal.alarm(10 * LIMIT_S)  # whatever waits for ever

    with tempfile.TemporaryFile() as said:
        given = cwd / "stdin" if cwd is not None and (cwd / "stdin").is_file() else NOWHERE
        child = started(
            words, said=said.fileno(), given=given, printed=NOWHERE if cwd is None else cwd / "stdout", prepare=prepare
        )
        _, status, usage = os.wait4(child, 0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        said.seek(0)
        text = said.read(200_000).decode("utf-8", "replace")
    return os.waitstatus_to_exitcode(status), text, usage.ru_maxrss / 1024


if __name__ == "__main__":
    main()
