"""Thresholds of the live map's charts from a budget of false alarms, written to wzsumo/live/charts/thresholds.json.

    nice python -m analysis.live.calibrate [--traces 20000] [--seed 1]

Streams without a change, with the usual dirt (see `streams`), run through charts that never alarm. The loudest evidence in
blocks of 250 traces has an exponential tail, since cumulative sums drift down; its rate beyond the 60 % quantile is fitted, and
the threshold is where it meets the family's share of the budget. Blocks are drawn again, with replacement, for the deviation.
That a fit must confirm evidence about the shape is left out, so those thresholds err to the safe side.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np

from analysis.live.maps import map_of_world
from analysis.live.streams import World, stream
from wzsumo.frames import FloatArray
from wzsumo.live.charts.findings import Family
from wzsumo.live.live_map import findings, live_map, with_evidence
from wzsumo.live.trace.reading import read_trace

BUDGET = 1 / 20_000  # false alarms a trace, all families together
ERRORS_M, INTERVALS_S = (0.5, 1.0, 2.0), (1.0, 3.0)
BLOCK, RUN = 250, 4000  # traces
TAIL_FROM = 0.6
RESAMPLED = 300
OUT = Path(__file__).parents[2] / "wzsumo" / "live" / "charts" / "thresholds.json"


def block_maxima(error: float, interval_s: float, *, traces: int, seed: int) -> dict[Family, FloatArray]:
    """The loudest evidence of each family in each block of a number of traces, in runs that each begin with a new map."""
    world = World(error=error, interval_s=interval_s)
    found: dict[Family, list[float]] = {family: [] for family in Family}
    for run in range(traces // RUN):
        live = live_map(map_of_world(world))
        loudest = dict.fromkeys(Family, 0.0)
        for number, drive in zip(range(RUN), stream(world, world, change_at=0, seed=seed + 7919 * run), strict=False):
            reading = read_trace(live.ground, drive.station, drive.offset, drive.time, length=drive.length)
            if reading is not None:
                live = with_evidence(live, reading)
                for family, finding in findings(live).items():
                    loudest[family] = max(loudest[family], finding.evidence)
            if number % BLOCK == BLOCK - 1:
                for family in Family:
                    found[family].append(loudest[family])
                loudest = dict.fromkeys(Family, 0.0)
    return {family: np.array(values) for family, values in found.items()}


def threshold(maxima: FloatArray, *, rate: float, seed: int) -> tuple[float, float, float]:
    """(threshold, its standard deviation, mean excess) [nats] beyond which `rate` alarms a trace are expected."""
    random = np.random.default_rng(seed)
    drawn = [_threshold(random.choice(maxima, len(maxima)), rate)[0] for _ in range(RESAMPLED)]
    value, excess = _threshold(maxima, rate)
    return value, float(np.std(drawn)), excess


def _threshold(maxima: FloatArray, rate: float) -> tuple[float, float]:
    start = float(np.quantile(maxima, TAIL_FROM))
    beyond = maxima[maxima > start]
    if not beyond.size:
        return start, 0.0
    excess = float(np.mean(beyond - start))
    return start + excess * float(np.log(beyond.size / len(maxima) / (BLOCK * rate))), excess


def main() -> None:
    """Calibrate, and write the file."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--traces", type=int, default=20_000, help="a cell of receiver error and sampling interval")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    share = BUDGET / len(Family)
    families: dict[str, list[dict[str, float]]] = {family.value: [] for family in Family}
    for error in ERRORS_M:
        cells = [block_maxima(error, interval, traces=args.traces, seed=args.seed) for interval in INTERVALS_S]
        for family in Family:
            of_cells = [threshold(cell[family], rate=share, seed=args.seed) for cell in cells]
            value, sd, excess = max(of_cells)
            families[family.value].append({"threshold": round(value, 2), "sd": round(sd, 2), "mean_excess": round(excess, 3)})
            sys.stderr.write(f"{error} m {family}: {of_cells}\n")
    content = {
        "command": f"python -m analysis.live.calibrate --traces {args.traces} --seed {args.seed}",
        "budget_per_trace": BUDGET, "share_per_family": share, "receiver_errors_m": list(ERRORS_M),
        "sampling_intervals_s": list(INTERVALS_S), "traces_per_cell": args.traces // RUN * RUN, "families": families,
    }  # fmt: skip
    OUT.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
