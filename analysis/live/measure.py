"""How many traces until a live map notices a change, and how often it alarms without one: tables in docs/results.

    nice python -m analysis.live.measure delays --n 200 --seed 1000
    nice python -m analysis.live.measure habits --traces 20000 --seed 5000

Delays are counted from the first trace after the change, for maps that 600 traces went through before,
without an alarm. A delay counts whatever the alarm's kind; `right_kind` is the share that names it.
"""

import argparse
import csv
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from analysis.live.maps import map_of_world
from analysis.live.streams import FLOW_PER_S, HABITS, Drive, World, habit_change, stream
from wzsumo.live.alarms import Alarm, Kind
from wzsumo.live.live_map import LiveMap, Step, live_map, with_trace
from wzsumo.live.trace.reading import read_trace

RESULTS = Path(__file__).parents[2] / "docs" / "results"
SETTLED, GIVEN_UP = 600, 500  # traces
RUNS_PER_MAP = 5
FIGURES = ("median_traces", "p95_traces", "missed", "right_kind", "median_min", "size_rms_m", "start_rms_m")


@dataclass(frozen=True, kw_only=True)
class Change:
    """A kind of change: what the world was and is, the kinds of alarm that name it, where it begins and ends [m]."""

    before: World
    after: World
    kinds: tuple[Kind, ...]


def changes(error: float, interval_s: float) -> dict[str, Change]:
    """All kinds at a receiver error [m] and a sampling interval [s]."""
    world = World(error=error, interval_s=interval_s)

    def to(*kinds: Kind, **after: Any) -> Change:
        return Change(before=world, after=replace(world, **after), kinds=kinds)

    found = {"lane_closed": Change(before=replace(world, closed=False), after=world, kinds=(Kind.LANE_CLOSED,))}
    for size in (0.5, 1.0, 2.0):
        found[f"moved_{size:g}_sharp"] = to(Kind.SHIFTED, shift=size)
        found[f"moved_{size:g}_over_216"] = to(Kind.SHIFTED, shift=size, ramp=216.0)
    start, end = (Kind.CLOSURE_START_MOVED, Kind.LANE_CLOSED), (Kind.CLOSURE_END_MOVED, Kind.LANE_CLOSED)
    for move in (100.0, 300.0):
        found[f"start_{move:g}_earlier"] = to(*start, closed_from=world.closed_from - move)
        found[f"end_{move:g}_later"] = to(*end, closed_to=world.closed_to + move)
        found[f"end_{move:g}_earlier"] = to(*end, Kind.LANE_OPEN, closed_to=world.closed_to - move)
        found[f"start_{move:g}_later"] = to(*start, Kind.LANE_OPEN, closed_from=world.closed_from + move)
    for share in (0.2, 0.5):
        found[f"open_again_{100 * share:.0f}"] = to(Kind.LANE_OPEN, take_up=share)
    for size in (0.5, 1.0):
        found[f"swerve_{size:g}_over_60"] = to(Kind.SHIFTED, shift=size, shift_from=1500.0, shift_to=1560.0)
    found["road_closed"] = to(Kind.ROAD_CLOSED, road_closed_at=1500.0)
    found["exit_closed"] = to(Kind.EXIT_CLOSED, exit_share=0.0)
    return found


def settled_maps(world: World, n: int, *, seed: int) -> list[LiveMap]:
    """Maps of a world that were settled without an alarm."""
    tried = (settled_map(world, seed + 31 * number) for number in range(4 * n))
    return [live for live in tried if live is not None][:n]


def settled_map(world: World, seed: int) -> LiveMap | None:
    """A live map that traces of its world went through; None where it alarmed."""
    live = live_map(map_of_world(world))
    for step in steps(live, stream(world, world, change_at=0, seed=seed), SETTLED):
        if step.alarm:
            return None
        live = step.live
    return live


def steps(live: LiveMap, drives: Iterator[Drive], n: int) -> Iterator[Step]:
    """The steps of a live map through n traces."""
    for _, drive in zip(range(n), drives, strict=False):
        reading = read_trace(live.ground, drive.station, drive.offset, drive.time, length=drive.length)
        if reading is None:
            yield Step(live=live, alarm=None, redrawn=None)
            continue
        step = with_trace(live, reading)
        live = step.live
        yield step


def delay(live: LiveMap, change: Change, seed: int) -> tuple[float, Alarm | None]:
    """(traces until the first alarm, it); infinite where none came."""
    drives = stream(change.after, change.after, change_at=0, seed=seed, start_s=live.now_s)
    for number, step in enumerate(steps(live, drives, GIVEN_UP), start=1):
        if step.alarm:
            return float(number), step.alarm
    return np.inf, None


def measure_delays(errors: list[float], intervals: list[float], *, n: int, seed: int, kinds: list[str]) -> None:
    """Write live_delays.csv, a row a cell as soon as it is measured."""
    path = RESULTS / "live_delays.csv"
    fresh = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        if fresh:
            table.writerow(["kind", "error_m", "interval_s", "n", *FIGURES, "seed"])
        for interval in intervals:
            for error in errors:
                maps: dict[World, list[LiveMap]] = {}
                for name, change in changes(error, interval).items():
                    if kinds and name not in kinds:
                        continue
                    if change.before not in maps:
                        maps[change.before] = settled_maps(change.before, max(1, n // RUNS_PER_MAP), seed=seed)
                    settled = maps[change.before]
                    runs = [delay(settled[run % len(settled)], change, seed + 100_003 + run) for run in range(n)]
                    table.writerow([name, error, interval, n, *_row(change, runs), seed])
                    file.flush()


def _row(change: Change, runs: list[tuple[float, Alarm | None]]) -> list[object]:
    delays = np.array([number for number, _ in runs])
    alarms = [alarm for _, alarm in runs if alarm]
    right = [alarm for alarm in alarms if alarm.change.kind in change.kinds]
    shifted = [alarm.change for alarm in right if alarm.change.kind is Kind.SHIFTED]  # these have a size and a place
    sizes = [(one.size_m or 0.0) - change.after.shift for one in shifted]
    starts = [(one.start_m or 0.0) - change.after.shift_from for one in shifted]
    median, late = np.quantile(delays, [0.5, 0.95], method="higher")
    return [
        f"{median:.0f}", f"{late:.0f}", int(np.isinf(delays).sum()), f"{len(right) / len(runs):.2f}",
        f"{median / FLOW_PER_S / 60:.0f}", f"{np.sqrt(np.mean(np.square(sizes))):.2f}" if sizes else "",
        f"{np.sqrt(np.mean(np.square(starts))):.0f}" if starts else "",
    ]  # fmt: skip


def measure_habits(errors: list[float], *, traces: int, seed: int) -> None:
    """Write live_false_alarms.csv: alarms of the habit's traces, which begin after 600 usual ones."""
    path = RESULTS / "live_false_alarms.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["habit", "error_m", "traces", "alarms", "alarms_per_20000", "by_kind", "seed"])
        for error in errors:
            for habit in HABITS:
                usual, world = habit_change(habit, error=error, interval_s=1.0)
                live = live_map(map_of_world(usual))
                drives = stream(usual, world, change_at=SETTLED, seed=seed)
                found = Counter(
                    str(step.alarm.change.kind)
                    for number, step in enumerate(steps(live, drives, SETTLED + traces))
                    if step.alarm and number >= SETTLED
                )
                total = sum(found.values())
                words = " ".join(f"{kind}:{count}" for kind, count in sorted(found.items()))
                table.writerow([habit, error, traces, total, f"{20_000 * total / traces:.1f}", words, seed])
                file.flush()


def main() -> None:
    """Measure delays or habits."""
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=("delays", "habits"))
    parser.add_argument("--n", type=int, default=200)
    parser.add_argument("--traces", type=int, default=20_000)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--errors", type=float, nargs="+", default=[0.5, 1.0, 2.0])
    parser.add_argument("--intervals", type=float, nargs="+", default=[1.0, 3.0])
    parser.add_argument("--kinds", nargs="+", default=[])
    args = parser.parse_args()
    if args.what == "delays":
        measure_delays(args.errors, args.intervals, n=args.n, seed=args.seed, kinds=args.kinds)
    else:
        measure_habits(args.errors, traces=args.traces, seed=args.seed)
    sys.stderr.write("done\n")


if __name__ == "__main__":
    main()
