"""Runs odd inputs through the command line, each in a process of its own with bounded memory and time; counts how they end.

    .venv/bin/python analysis/fuzz/fuzz.py --inputs 3000 --seed 1 --out results/fuzz

Input N of seed S is the same in every run: --only N makes it again and shows what it says. An input passes where it ends
with 0, or with 2 and a line of printable characters a mistake, within 60 s of processor time and 4 GiB of address space beyond
what the start takes, and leaves nothing half-written. Everything else is kept in OUT/failures; OUT/said.txt
has a line an input, to be read for wrong words.
"""

import argparse
import contextlib
import csv
import io
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

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
    parser.add_argument("--out", type=Path, default=Path("results/fuzz"))
    args = parser.parse_args()
    numbers = range(args.inputs) if args.only is None else [args.only]
    rows = fuzz(numbers, seed=args.seed, kind=args.kind, out=args.out, tells=args.only is not None)
    print(*(",".join(map(str, row)) for row in rows), sep="\n")
    sys.exit(any(row[1] not in {"done", "refused", "kind"} for row in rows[1:] if "total" not in row))


def fuzz(numbers: Any, *, seed: int, kind: str | None, out: Path, tells: bool = False) -> list[tuple[Any, ...]]:
    """Rows (kind, ending, inputs, largest memory MB, longest s), written to OUT/counts.csv; failures to OUT/failures."""
    load_commands()
    (out / "failures").mkdir(parents=True, exist_ok=True)
    counts: Counter[tuple[str, str]] = Counter()
    most: dict[tuple[str, str], tuple[float, float]] = {}
    with tempfile.TemporaryDirectory(prefix="fuzz-") as base:
        needed = [kind] if kind else list(KINDS)
        templates = _templates((out / "templates").resolve(), needed)
        for number in numbers:
            name = kind or _kind_of(number)
            chance = random.Random(f"{seed} {number} {name}")
            ending, said, used = _tried(name, chance, Path(base), templates)
            counts[name, ending] += 1
            before = most.get((name, ending), (0.0, 0.0))
            most[name, ending] = max(before[0], used[0]), max(before[1], used[1])
            with (out / "said.txt").open("a", encoding="utf-8", errors="replace") as file:
                file.write(f"{number} {name}, {ending}: {' '.join(said.splitlines()[2:])[-300:]}\n")
            if tells or ending not in {"done", "refused"}:
                (out / "failures" / f"{seed}_{number}.txt").write_text(
                    f"{name}: {ending}\n{said}", encoding="utf-8", errors="replace"
                )
            if tells:
                print(said)
            _written(counts, most, out)  # what is counted stays where the run is stopped
    return _written(counts, most, out)


def load_commands() -> None:
    """Load everything that commands load, once, before the processes part."""
    import wzsumo.commands.export
    import wzsumo.commands.init
    import wzsumo.commands.layout
    import wzsumo.commands.live
    import wzsumo.commands.map
    import wzsumo.commands.place
    import wzsumo.commands.report
    import wzsumo.commands.run
    import wzsumo.commands.sweep  # noqa: F401 - loaded for the processes, not used here


def _kind_of(number: int) -> str:
    """The kind of an input: each in turn, those that draw pages in every sixth turn alone: they take ten times as long."""
    turn, place = divmod(number, len(KINDS))
    name = list(KINDS)[place]
    return name if turn % 6 == 0 or name not in SLOW else "traces"


def _written(
    counts: "Counter[tuple[str, str]]", most: dict[tuple[str, str], tuple[float, float]], out: Path
) -> list[tuple[Any, ...]]:
    rows = [(name, ending, counts[name, ending], *(round(x, 1) for x in most[name, ending])) for name, ending in sorted(counts)]
    table = [("kind", "ending", "inputs", "largest_mb", "longest_s"), *rows]
    with (out / "counts.csv").open("w", newline="") as file:
        csv.writer(file).writerows(table)
    return table


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
    """(exit code or -signal, what it said on stderr, largest memory [MB]) of a command in a forked process."""
    from wzsumo.cli import main as wzsumo

    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            code = 70
            try:
                os.setsid()
                given = cwd / "stdin" if cwd is not None and (cwd / "stdin").is_file() else Path(os.devnull)
                os.dup2(os.open(given, os.O_RDONLY), 0)
                sys.stdin = io.TextIOWrapper(os.fdopen(0, "rb"))
                printed = os.devnull if cwd is None else cwd / "stdout"
                os.dup2(os.open(printed, os.O_WRONLY | os.O_CREAT), 1)
                os.dup2(said.fileno(), 2)
                sys.stdout, sys.stderr = (
                    io.TextIOWrapper(os.fdopen(1, "wb")),
                    io.TextIOWrapper(os.fdopen(2, "wb"), write_through=True),
                )
                if cwd is not None:
                    os.chdir(cwd)
                if limits:
                    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
                    resource.setrlimit(resource.RLIMIT_AS, (used + LIMIT_BYTES, used + LIMIT_BYTES))
                    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S + 5))
                    signal.alarm(10 * LIMIT_S)  # whatever waits for ever
                wzsumo(words)
            except SystemExit as ended:
                code = int(ended.code or 0)
            except BaseException:  # noqa: BLE001 - it is what is looked for
                import traceback

                traceback.print_exc()
            finally:
                with contextlib.suppress(Exception):
                    sys.stderr.flush()
                os._exit(code)
        _, status, usage = os.wait4(child, 0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        said.seek(0)
        text = said.read(200_000).decode("utf-8", "replace")
    return os.waitstatus_to_exitcode(status), text, usage.ru_maxrss / 1024


if __name__ == "__main__":
    main()
