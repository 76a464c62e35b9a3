"""What one would try first: n traces in a row beyond a threshold; its delays, in docs/results/live_naive.csv.

    nice python -m analysis.live.naive --n 200 --seed 9000

Each trace is laid on the lanes as mapped, cell by cell, each cell in the nearest lane. Five rules count traces in a row at a
cell: beyond d metres to one side of the middle of the nearest lane; not in a lane that is open; in a lane that is closed; ended
ahead of it; not at the exit that is mapped there. Each has a fifth of the budget of the live map: n is where the longest runs
in streams without a change, dirt and all, are expected to meet it (the tail that `calibrate` fits). d is the one that notices
lanes moved by 1 m first.
"""

import argparse
import csv
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.live.calibrate import BLOCK, BUDGET, threshold
from analysis.live.maps import map_of_world
from analysis.live.measure import GIVEN_UP, changes
from analysis.live.streams import Drive, World, stream
from wzsumo.frames import FloatArray, IntArray
from wzsumo.live.ground import Ground, ground_of
from wzsumo.live.trace.reading import Reading, read_trace

RESULTS = Path(__file__).parents[2] / "docs" / "results"
DISTANCES_M = (0.5, 1.0, 1.5, 2.0)
SIDE_RULES = len(DISTANCES_M)
RULES = (*(f"beyond {d:g} m" for d in DISTANCES_M), "lane not driven", "closed lane driven", "ended", "exit not taken")
WARM_UP = 100  # traces before a change, which fill the counters
CHOSEN_BY = "moved_1_sharp"
COLUMNS = (
    "kind", "error_m", "interval_s", "n", "beyond_m", "in_a_row", "median_traces", "p95_traces", "missed", "seed",
)  # fmt: skip


@dataclass(kw_only=True, eq=False)
class Counters:
    """Traces in a row (..., m) for which each rule holds at a cell."""

    beyond: IntArray  # (2 sides, distances, m)
    unused: IntArray  # (L, m)
    used: IntArray
    ended: IntArray  # (m,)
    exits: int = 0


def counters_of(ground: Ground) -> Counters:
    """Counters that no trace has come to."""
    m, n = len(ground.cells), ground.n_lanes
    return Counters(
        beyond=np.zeros((2, SIDE_RULES, m), int),
        unused=np.zeros((n, m), int),
        used=np.zeros((n, m), int),
        ended=np.zeros(m, int),
    )


def count(counters: Counters, ground: Ground, reading: Reading) -> IntArray:
    """The longest run (RULES,) after one more trace; changes the counters."""
    lane = np.clip(np.round(reading.offset / ground.width), 0, ground.n_lanes - 1)
    aside = reading.offset - ground.width * lane
    cells = np.arange(len(lane))
    for side, sign in enumerate((1, -1)):
        holds = sign * aside > np.array(DISTANCES_M)[:, None]
        counters.beyond[side] = np.where(reading.seen, np.where(holds, counters.beyond[side] + 1, 0), counters.beyond[side])
    for k in range(ground.n_lanes):
        here, seen = lane == k, reading.seen
        for runs, holds, where in ((counters.unused, ~here, ~ground.closed[k]), (counters.used, here, ground.closed[k])):
            runs[k] = np.where(seen & where, np.where(holds, runs[k] + 1, 0), runs[k])
    passed = (cells > reading.first) & (cells <= reading.last)
    left_the_lanes = not -ground.width < reading.offset[reading.last] < ground.n_lanes * ground.width
    ended = (cells > reading.last) & (cells < len(cells) - 4) & (not left_the_lanes)
    counters.ended = np.where(passed, 0, counters.ended + ended)
    station, beside, side_of = ground.gates[0] or (0.0, 0.0, 1)
    gate = int(np.searchsorted(ground.cells, station))
    if reading.first < gate and reading.found[gate : gate + 4].any():
        near = np.median(reading.offset[gate : gate + 4][reading.found[gate : gate + 4]])
        counters.exits = 0 if side_of * (near - beside / 2) > 0 else counters.exits + 1
    longest = [*counters.beyond.max(axis=(0, 2)), counters.unused.max(), counters.used.max(), counters.ended.max()]
    return np.array([*longest, counters.exits])


def runs_of(ground: Ground, counters: Counters, drives: Iterator[Drive], n: int) -> FloatArray:
    """The longest runs (n, RULES) after each of n traces."""
    found, last = np.zeros((n, len(RULES))), np.zeros(len(RULES), dtype=int)
    for number, drive in zip(range(n), drives, strict=False):
        reading = read_trace(ground, drive.station, drive.offset, drive.time, length=drive.length)
        last = last if reading is None else count(counters, ground, reading)
        found[number] = last
    return found


def numbers_for(world: World, *, traces: int, seed: int) -> FloatArray:
    """How many traces in a row (RULES,) meet the budget."""
    ground = ground_of(map_of_world(world))
    runs = runs_of(ground, counters_of(ground), stream(world, world, change_at=0, seed=seed), traces)[WARM_UP:]
    blocks = runs[: len(runs) // BLOCK * BLOCK].reshape(-1, BLOCK, len(RULES)).max(axis=1)
    share = BUDGET / (len(RULES) - SIDE_RULES + 1)
    return np.array([np.ceil(max(threshold(blocks[:, rule], rate=share, seed=seed)[0], 2.0)) for rule in range(len(RULES))])


def only(numbers: FloatArray, *, beyond: int) -> FloatArray:
    """The numbers (RULES,) with one of the distances alone."""
    others = (np.arange(len(RULES)) < SIDE_RULES) & (np.arange(len(RULES)) != beyond)
    return np.where(others, np.inf, numbers)


def delays(before: World, after: World, numbers: FloatArray, *, n: int, seed: int) -> FloatArray:
    """Traces (n,) from the change until the first rule alarms, infinite where none does."""
    ground = ground_of(map_of_world(before))
    found = np.full(n, np.inf)
    for run in range(n):
        counters = counters_of(ground)
        runs_of(ground, counters, stream(before, before, change_at=0, seed=seed + run), WARM_UP)
        drives = stream(after, after, change_at=0, seed=seed + 100_003 + run)
        for number in range(1, GIVEN_UP + 1):
            if (runs_of(ground, counters, drives, 1) >= numbers).any():
                found[run] = number
                break
    return found


def main() -> None:
    """Write the table, a row a cell as soon as it is measured."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--n", type=int, default=200)
    parser.add_argument("--traces", type=int, default=20_000, help="without a change, that set the numbers")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--errors", type=float, nargs="+", default=[0.5, 1.0, 2.0])
    parser.add_argument("--intervals", type=float, nargs="+", default=[1.0, 3.0])
    args = parser.parse_args()
    with (RESULTS / "live_naive.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for interval in args.intervals:
            for error in args.errors:
                world = World(error=error, interval_s=interval)
                numbers = numbers_for(world, traces=args.traces, seed=args.seed)
                all_kinds = changes(error, interval)
                trial = all_kinds[CHOSEN_BY]
                medians = [
                    np.median(delays(trial.before, trial.after, only(numbers, beyond=side), n=10, seed=args.seed + 50_000))
                    for side in range(SIDE_RULES)
                ]
                best = int(np.argmin(medians))
                numbers = only(numbers, beyond=best)
                words = " ".join(f"{RULES[rule]}:{number:.0f}" for rule, number in enumerate(numbers) if number < np.inf)
                for kind, change in all_kinds.items():
                    first = delays(change.before, change.after, numbers, n=args.n, seed=args.seed)
                    median, late = np.quantile(first, [0.5, 0.95], method="higher")
                    table.writerow([
                        kind, error, interval, args.n, DISTANCES_M[best], words, f"{median:.0f}", f"{late:.0f}",
                        int(np.isinf(first).sum()), args.seed,
                    ])  # fmt: skip
                    file.flush()
    sys.stderr.write("done\n")


if __name__ == "__main__":
    main()
