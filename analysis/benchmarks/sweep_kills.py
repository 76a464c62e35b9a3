"""Kills (-9) of a sweep or of one of its workers at random moments: does the resumed table equal an undisturbed one?

python analysis/benchmarks/sweep_kills.py --kills 100
"""

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

SCENARIO = Path(__file__).parents[2] / "scenarios" / "paper.toml"
STUDY = f"""
name = "kills"
scenarios = ["{SCENARIO}"]
methods = ["swept"]
[fixed]
simulation.demand.duration_s = 150
crowd.penetration = 1.0
map.resolution_m = 0.5
mixture.k_max = 5
[grid]
seed = {{ first = 41, count = 3 }}
crowd.used = [1, 2, 3, 4, 5, 6, 7, 8]
gnss.error_m = [0.0, 0.5, 1.0, 1.5, 2.0]
"""
KILLS_A_SWEEP = 6  # on average, in the time that an undisturbed one takes
WORKER_SHARE = 0.6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    chance = random.Random(args.seed)
    with tempfile.TemporaryDirectory() as root:
        study = Path(root) / "kills.toml"
        study.write_text(STUDY)
        began = time.monotonic()
        finish(study, Path(root) / "calm")
        longest = time.monotonic() - began
        calm = (Path(root) / "calm" / "results.parquet").read_bytes()
        kills: Counter[str] = Counter()
        rounds = unequal = 0
        while kills.total() < args.kills:
            out = Path(root) / "killed"
            shutil.rmtree(out, ignore_errors=True)
            ended = False
            while not ended and kills.total() < args.kills:
                ended = disturb(study, out, gap_s=longest / KILLS_A_SWEEP, chance=chance, kills=kills)
            finish(study, out)
            rounds += 1
            unequal += (out / "results.parquet").read_bytes() != calm
            print(f"{dict(kills)}, {rounds} sweeps brought to their end, {unequal} tables differ", flush=True)
    sys.exit(unequal > 0)


def start(study: Path, out: Path) -> "subprocess.Popen[bytes]":
    command = [sys.executable, "-m", "wzsumo", "sweep", str(study), "--out", str(out), "--workers", "2"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def finish(study: Path, out: Path) -> None:
    if start(study, out).wait() != 0:
        raise SystemExit("a sweep that nobody killed did not end well")


def disturb(study: Path, out: Path, *, gap_s: float, chance: random.Random, kills: Counter[str]) -> bool:
    """Whether a sweep came to its end while it or a worker of it was killed time and again."""
    with start(study, out) as process:
        while True:
            try:
                process.wait(timeout=chance.expovariate(1 / gap_s))
                return True
            except subprocess.TimeoutExpired:
                workers = workers_of(process.pid)
                if workers and chance.random() < WORKER_SHARE:
                    kill(chance.choice(workers))
                    kills["worker"] += 1
                else:
                    kill(process.pid)
                    kills["sweep"] += 1
                    return False


def kill(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def workers_of(pid: int) -> list[int]:
    listing = subprocess.run(["ps", "-o", "pid=,args=", "--ppid", str(pid)], capture_output=True, text=True, check=False).stdout
    return [int(line.split()[0]) for line in listing.splitlines() if "spawn_main" in line]


if __name__ == "__main__":
    main()
