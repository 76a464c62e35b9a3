"""Kills commands at random moments, by SIGKILL and SIGTERM in turn, and counts what they leave behind.

    .venv/bin/python analysis/fuzz/kills.py --kills 100 --seed 1 --minutes 30 --out results/kills

Each command writes its result B into a folder that holds a finished result A. After the kill the folder must hold all files of
A or all of B (files that hold times of the clock are compared by their names alone), no process may be left that names the
folder, and after SIGTERM no temporary folder either. The command is then run to its end: it must give B and leave nothing else.
A sweep and a live map keep what is finished: what they hold after the kill lies between A and B. --commands may name one
several times, to be killed more often: --commands map map live place run. A kill while the files of a result move to their
place is made good by the next command that looks (see wzsumo/files/placing.py), and is counted as such.
Commands run in processes that part from this one, which has loaded all modules: kills hit their work, not their start.
"""

import argparse
import csv
import os
import random
import shutil
import signal
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pandas as pd
from child import load_commands, started
from networks import FREEWAY, REPOSITORY
from trace_inputs import drives

from wzsumo.files.placing import FINISHED, settle
from wzsumo.files.work_folder import PREFIX

# They hold times of the clock, or how often a state was written.
CLOCKED = ("result.json", "report.html", "state.zip", "live.html")
GROWING = ("sweep", "live")
TIMED = ("batches", "simulations")  # of a sweep: their files hold how long each took, and are called by their content
WAIT_S = 3.0  # for what a killed command had started
MARK = "WZSUMO_KILLS"  # a variable of the environment of whatever a command starts
SCENARIO = """
name = "short"
seed = 1
road = {lane_count = 2, left_shoulder_ft = 8, right_shoulder_ft = 8, length_ft = 1700}
gnss = {error_m = 0.0, sampling_interval_s = 0.5}
crowd = {penetration = 1.0, collected = 2, used = 2}
control = {target_speed_mps = 10.0}
[work_zone]
posted_speed_mph = 25
start_ft = 700
closed_lanes = [0]
work_length_ft = 100
[simulation.demand]
flow_vph = 600
duration_s = 80
warm_up_s = 20
[route]
start_lane = 1
start_before_zone_m = 40
goal_lane = 1
goal_after_zone_m = 20
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=100, help="of each signal")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which no further kill begins")
    parser.add_argument("--commands", nargs="+", default=list(COMMANDS), choices=list(COMMANDS))
    parser.add_argument("--out", type=Path, default=Path("results/kills"))
    args = parser.parse_args()
    base = (args.out / "work").resolve()
    shutil.rmtree(base, ignore_errors=True)
    (base / "tmp").mkdir(parents=True)
    os.environ |= {"TMPDIR": str(base / "tmp"), MARK: str(os.getpid())}
    load_commands()
    until = time.monotonic() + 60 * args.minutes
    finished = {name: _finished(name, base) for name in dict.fromkeys(args.commands)}
    chance, counts = random.Random(args.seed), Counter[tuple[str, str, str]]()
    table: list[tuple[object, ...]] = []
    for number in range(2 * args.kills):
        if time.monotonic() > until:
            break
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
    return ["run", str(_scenario(base)), "--seed", variant, "--method", "swept", "--out", str(out)]


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
    files = [base / f"day{day}.csv" for day in range(int(variant))]
    for day, file in enumerate(files):
        if not file.exists():  # so many that most of the time goes by while traces are taken
            parts = [drives(random.Random(3)) for _ in range(400)]
            for number, part in enumerate(parts):
                part["time_s"] += 1e6 * day + 600.0 * number
            pd.concat(parts).to_csv(file, index=False)
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
    study, seeds = base / "study.toml", [1, 2][: int(variant)]
    head = f'name = "short"\nscenarios = ["{_scenario(base).name}"]\nmethods = ["swept"]\n'
    study.write_text(f"{head}[grid]\nseed = {seeds}\ncrowd.used = [1, 2]\n")
    return ["sweep", str(study), "--workers", "1", "--out", str(out)]


COMMANDS: dict[str, Callable[[Path, Path, str], list[str]]] = {
    "layout": _layout, "net": _net, "run": _run, "map": _map, "report": _report, "sweep": _sweep,
    "live": _live, "place": _place,
}  # fmt: skip


def _variant(base: Path, variant: str) -> str:
    path = base / f"short{variant}.toml"
    path.write_text(SCENARIO.replace("work_length_ft = 100", f"work_length_ft = {100 + 20 * int(variant)}"))
    return str(path)


def _scenario(base: Path) -> Path:
    (base / "short.toml").write_text(SCENARIO)
    return base / "short.toml"


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


def _started(words: list[str], base: Path) -> int:
    """The number of a process that runs a command and writes what it says to BASE/said.txt."""
    with (base / "said.txt").open("wb") as told:
        return started(words, said=told.fileno())


def _code(process: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def _ended(words: list[str], base: Path) -> None:
    code = _code(_started(words, base))
    assert code == 0, (code, words, (base / "said.txt").read_text(errors="replace")[-2000:])


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
    os.kill(process, sign)
    code = _code(process)
    found = [
        "killed" if code == -signal.SIGKILL else "terminated" if code in {143, -signal.SIGTERM} else f"ended before, {code}"
    ]
    patience = time.monotonic() + (0 if sign == signal.SIGTERM else WAIT_S)
    while _processes() and time.monotonic() < patience:
        time.sleep(0.1)
    if _processes():
        found.append("PROCESS LEFT")
    if sign == signal.SIGTERM and code == 143 and (_work_folders(out) or list((base / "tmp").iterdir())):
        found.append("FOLDER LEFT")
    if list(out.glob(f"{FINISHED}*")):
        found.append("killed between two files")
        settle(out)
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
    files = [
        path for path in folder.rglob("*")
        if path.is_file() and PREFIX not in str(path) and path.name != ".lock" and path.parent.name not in TIMED
    ]  # fmt: skip
    return {str(path.relative_to(folder)): b"" if path.name in CLOCKED else path.read_bytes() for path in files}


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


def _processes() -> list[int]:
    """Processes that commands have started and that live still."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/environ"):
        try:
            marked = f"{MARK}={os.getpid()}".encode() in entry.read_bytes().split(b"\0")
        except OSError:  # it has just ended, or is somebody else's
            continue
        if marked:
            found.append(int(entry.parent.name))
    return found


if __name__ == "__main__":
    main()
