"""Kills commands at random moments, by SIGKILL and SIGTERM in turn, and counts what they leave behind.

    .venv/bin/python analysis/fuzz/kills.py --kills 100 --seed 1 --out results/kills

Each command writes its result B into a folder that holds a finished result A. After the kill the folder must hold all files of
A or all of B (files that hold times of the clock are compared by their names alone), no process may be left that names the
folder, and after SIGTERM no temporary folder either. The command is then run to its end: it must give B and leave nothing else.
A sweep and a live map keep what is finished: what they hold after the kill lies between A and B. --commands may name one
several times, to be killed more often: --commands map map live place run.
"""

import argparse
import csv
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pandas as pd
from fuzz import _small_scenario, _small_study
from networks import FREEWAY, REPOSITORY
from trace_inputs import drives

from wzsumo.files.work_folder import PREFIX

# They hold times of the clock, or how often a state was written.
CLOCKED = ("result.json", "report.html", "zone.net.xml", "state.zip", "live.html")
GROWING = ("sweep", "live")
WAIT_S = 3.0  # for what a killed command had started


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=100, help="of each signal")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--commands", nargs="+", default=list(COMMANDS), choices=list(COMMANDS))
    parser.add_argument("--out", type=Path, default=Path("results/kills"))
    args = parser.parse_args()
    base = (args.out / "work").resolve()
    shutil.rmtree(base, ignore_errors=True)
    base.mkdir(parents=True)
    finished = {name: _finished(name, base) for name in dict.fromkeys(args.commands)}
    chance, counts = random.Random(args.seed), Counter[tuple[str, str, str]]()
    for number in range(2 * args.kills):
        name, sign = args.commands[number // 2 % len(args.commands)], (signal.SIGKILL, signal.SIGTERM)[number % 2]
        found = ["ended before"]
        while any("ended before" in what for what in found):  # the moment came too late: another one
            found = _trial(name, sign, base, finished[name], chance=chance)
        for what in found:
            counts[name, sign.name, what] += 1
        table = [("command", "signal", "found", "times"), *((*key, counts[key]) for key in sorted(counts))]
        with (args.out / "kills.csv").open("w", newline="") as file:
            csv.writer(file).writerows(table)
    print(*(",".join(map(str, row)) for row in table), sep="\n")


def _layout(base: Path, out: Path, variant: str) -> list[str]:
    return ["layout", _variant(base, variant), "--out", str(out)]


def _net(base: Path, out: Path, variant: str) -> list[str]:
    return ["net", _variant(base, variant), "--out", str(out)]


def _run(base: Path, out: Path, variant: str) -> list[str]:
    return ["run", _small_scenario(base), "--seed", variant, "--method", "swept", "--out", str(out)]


def _map(base: Path, out: Path, variant: str) -> list[str]:
    path = base / f"traces{variant}.csv"
    rows = [f"v{n},{t},{20 * t},{0.3 * n + 0.01 * int(variant)}" for n in range(4) for t in range(20)]
    path.write_text("vehicle_id,time_s,x_m,y_m\n" + "\n".join(rows))
    return ["map", str(path), "--out", str(out)]


def _live(base: Path, out: Path, variant: str) -> list[str]:
    """Days of traces; the second follows on the first."""
    if not (base / "live_map").exists():
        drives(random.Random(3)).to_csv(base / "before.csv", index=False)
        _ended(["map", str(base / "before.csv"), "--out", str(base / "live_map")], base)
    files = []
    for day in range(int(variant)):
        files.append(base / f"day{day}.csv")
        parts = [drives(random.Random(3)) for _ in range(30)]
        for number, part in enumerate(parts):
            part["time_s"] += 1e5 * day + 600.0 * number
        pd.concat(parts).to_csv(files[-1], index=False)
    return ["live", *map(str, files), "--map", str(base / "live_map"), "--out", str(out)]


def _place(base: Path, out: Path, variant: str) -> list[str]:
    del base
    zone = REPOSITORY / "docs" / "guide" / "place_example" / "zone.toml"
    net, routes = FREEWAY / "freeway.net.xml", FREEWAY / "freeway.rou.xml"
    at = ["--at", "m2", str(100 * int(variant))]
    return ["place", str(net), "--zone", str(zone), *at, "--routes", str(routes), "--out", str(out)]


def _report(base: Path, out: Path, variant: str) -> list[str]:
    del base, variant
    return ["report", str(out)]


def _sweep(base: Path, out: Path, variant: str) -> list[str]:
    study = Path(_small_study(base))
    kept = "seed = [1, 2]" if variant == "2" else "seed = [1]"
    study.write_text(study.read_text().replace("seed = [1, 2]", kept))
    return ["sweep", str(study), "--workers", "1", "--out", str(out)]


COMMANDS: dict[str, Callable[[Path, Path, str], list[str]]] = {
    "layout": _layout, "net": _net, "run": _run, "map": _map, "report": _report, "sweep": _sweep,
    "live": _live, "place": _place,
}  # fmt: skip


def _variant(base: Path, variant: str) -> str:
    path = base / f"paper{variant}.toml"
    text = Path(_small_scenario(base)).read_text()
    path.write_text(text.replace("work_length_ft = 650", f"work_length_ft = {600 + 50 * int(variant)}"))
    return str(path)


def _finished(name: str, base: Path) -> tuple[Path, Path, float]:
    """(folder with the finished result A, with B over A, time [s] that B takes)."""
    old, new = base / f"{name}_a", base / f"{name}_b"
    command = COMMANDS[name]
    if name == "report":
        _ended(_run(base, old, "1"), base)
    _ended(command(base, old, "1"), base)
    shutil.copytree(old, new)
    began = time.monotonic()
    _ended(command(base, new, "2"), base)
    return old, new, time.monotonic() - began


def _started(words: list[str], base: Path) -> "subprocess.Popen[bytes]":
    (base / "tmp").mkdir(exist_ok=True)
    environment = os.environ | {"TMPDIR": str(base / "tmp")}
    command = [sys.executable, "-m", "wzsumo", *words]
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _ended(words: list[str], base: Path) -> None:
    code = _started(words, base).wait()
    assert code == 0, (code, words)


def _trial(
    name: str, sign: signal.Signals, base: Path, finished: tuple[Path, Path, float], *, chance: random.Random
) -> list[str]:
    old, new, took = finished
    out = base / "trial"
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(old, out)
    words = COMMANDS[name](base, out, "2")
    process = _started(words, base)
    time.sleep(chance.uniform(0, took))
    process.send_signal(sign)
    code = process.wait()
    found = [
        "killed" if code == -signal.SIGKILL else "terminated" if code in {143, -signal.SIGTERM} else f"ended before, {code}"
    ]
    patience = time.monotonic() + (0 if sign == signal.SIGTERM else WAIT_S)
    while _processes(base) and time.monotonic() < patience:
        time.sleep(0.1)
    if _processes(base):
        found.append("PROCESS LEFT")
    if sign == signal.SIGTERM and code == 143 and (_work_folders(out) or list((base / "tmp").iterdir())):
        found.append("FOLDER LEFT")
    state = _state(out)
    if not (_is_between(state, old, new) if name in GROWING else state in (_state(old), _state(new))):
        found.append("HALF-WRITTEN")
    _ended(words, base)
    if _state(out) != _state(new):
        found.append("OTHER RESULT AFTERWARDS")
    if _work_folders(out):
        found.append("FOLDER LEFT AFTERWARDS")
    return found


def _state(folder: Path) -> dict[str, bytes]:
    """Content by name of all files but those in work folders; of those with times of the clock the name alone."""
    files = [path for path in folder.rglob("*") if path.is_file() and PREFIX not in str(path) and path.name != ".lock"]
    return {
        str(path.relative_to(folder)): b"" if path.name in CLOCKED or "batches" in path.parts else path.read_bytes()
        for path in files
    }


def _is_between(state: dict[str, bytes], old: Path, new: Path) -> bool:
    """Whether files of A are there still, those of B's too or not yet; tables and logs grow."""
    before, after = _state(old), _state(new)
    grow = {"results.parquet", "study.json", "alarms.jsonl", "versions.jsonl", "evidence.f4", "lanes.geojson"}
    kept = all(state.get(name) == content for name, content in before.items() if name not in grow)
    return (
        kept
        and before.keys() <= state.keys()
        and all(state[name] == after[name] for name in state if name not in {*before, *grow})
    )


def _work_folders(out: Path) -> list[Path]:
    return list(out.rglob(f"{PREFIX}*"))


def _processes(base: Path) -> list[str]:
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = entry.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:  # it has just ended
            continue
        if str(base) in line and int(entry.parent.name) != os.getpid() and "kills.py" not in line:
            found.append(line)
    return found


if __name__ == "__main__":
    main()
