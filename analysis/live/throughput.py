"""CPU time and memory of `wzsumo live` for a trace, in docs/results/live_throughput.csv.

    nice python -m analysis.live.throughput --traces 20000 40000 --seed 77

Traces of the generator, without a change, in .parquet files of 2,000 each, replayed by the command in a process of its own.
Seconds are of CPU; those of a million are scaled from the difference of the two numbers, which leaves out what a start costs.
`peak_mb` is the largest resident memory, and `steps_ms` the mean CPU of decoding and of the rest of a step, measured apart.
"""

import argparse
import csv
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd

from analysis.live.maps import map_of_world
from analysis.live.streams import World, stream
from wzsumo.files.lanes import LanesFile, write_lanes
from wzsumo.live.live_map import live_map, with_trace
from wzsumo.live.trace.decoding import draw_ways
from wzsumo.live.trace.reading import read_trace

RESULTS = Path(__file__).parents[2] / "docs" / "results"
IN_A_FILE = 2000
APART = 2000  # traces whose steps are timed
MILLION = 1_000_000


def write_traces(folder: Path, n: int, *, seed: int) -> None:
    """Write n traces, and the map that they belong to."""
    world = World()
    lanes = map_of_world(world)
    write_lanes(LanesFile(lanes=lanes, frame=None, utc=False), folder)
    drives = stream(world, world, change_at=0, seed=seed)
    for first in range(0, n, IN_A_FILE):
        parts = []
        for number in range(first, min(first + IN_A_FILE, n)):
            drive = next(drives)
            points = lanes.axis.to_xy(drive.station, drive.offset)
            parts.append(pd.DataFrame({
                "vehicle_id": f"t{number:07d}", "time_s": drive.time, "x_m": points[:, 0], "y_m": points[:, 1],
                "length_m": drive.length,
            }))  # fmt: skip
        pd.concat(parts, ignore_index=True).to_parquet(folder / f"traces{first // IN_A_FILE:05d}.parquet")


def replay(folder: Path, n: int) -> tuple[float, float]:
    """(CPU time [s], peak memory [MB]) of a replay of the first n traces in a process of its own."""
    files = sorted(folder.glob("traces*.parquet"))[: n // IN_A_FILE]
    with tempfile.TemporaryDirectory() as out:
        words = ["live", *map(str, files), "--map", str(folder), "--out", out]
        process = subprocess.Popen([sys.executable, "-m", "wzsumo", *words], stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, words)
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def steps_ms(*, seed: int) -> tuple[float, float]:
    """(CPU [ms] of decoding a trace, of the rest of its step)."""
    world = World()
    live = live_map(map_of_world(world))
    decoding, all_of_it = 0.0, 0.0
    for number, drive in zip(range(2 * APART), stream(world, world, change_at=0, seed=seed), strict=False):
        reading = read_trace(live.ground, drive.station, drive.offset, drive.time, length=drive.length)
        if reading is None:
            continue
        began = time.process_time()
        draw_ways(live.ground, reading, walk=live.usual_walk, receivers=live.receivers, seed=number)
        middle = time.process_time()
        live = with_trace(live, reading).live
        if number >= APART:  # kernels are compiled, habits settled
            decoding += middle - began
            all_of_it += time.process_time() - middle
    return 1000 * decoding / APART, 1000 * (all_of_it - decoding) / APART


def main() -> None:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--traces", type=int, nargs=2, default=[20_000, 40_000], help="multiples of 2,000")
    parser.add_argument("--seed", type=int, required=True)
    args = parser.parse_args()
    decoding, rest = steps_ms(seed=args.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_traces(folder, max(args.traces), seed=args.seed)
        (few_s, few_mb), (many_s, many_mb) = (replay(folder, n) for n in sorted(args.traces))
    a_trace = (many_s - few_s) / (max(args.traces) - min(args.traces))
    rows = [
        ("traces", min(args.traces), max(args.traces)), ("cpu_s", f"{few_s:.1f}", f"{many_s:.1f}"),
        ("peak_mb", f"{few_mb:.0f}", f"{many_mb:.0f}"), ("ms_per_trace", f"{1000 * a_trace:.2f}", ""),
        ("minutes_per_million", f"{MILLION * a_trace / 60:.1f}", ""), ("decoding_ms", f"{decoding:.2f}", ""),
        ("rest_of_step_ms", f"{rest:.2f}", ""), ("seed", args.seed, ""),
    ]  # fmt: skip
    with (RESULTS / "live_throughput.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([("what", "fewer", "more"), *rows])
    sys.stderr.write(f"{rows} {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss}\n")


if __name__ == "__main__":
    main()
