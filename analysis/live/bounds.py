"""The fewest traces that any test needs to notice a change at the budget of false alarms, in docs/results/live_bounds.csv.

    python -m analysis.live.bounds

Lorden 1971: at one false alarm in G traces the delay is at least ln(G I) / I traces (ln(G) / I where I > 1), I being the
Kullback-Leibler divergence [nats] of one trace after the change from one before it. I is calculated for the generator
(`streams`), of a test that knows more than any can: which change may come, how drivers and receivers behave, and in which lane
each vehicle is. Of lanes that moved a trace is a normal vector; of closures it is a chain that changes lanes at known rates.
"""

import csv
from pathlib import Path

import numpy as np

from analysis.live.measure import changes
from analysis.live.streams import LENGTH_M, REACH_M, World
from wzsumo.frames import FloatArray

RESULTS = Path(__file__).parents[2] / "docs" / "results"
TRACES_PER_FALSE_ALARM = 20_000
SPEED_MPS = 27.0
STEP_M = 1.0
RETURN_SHARE = 0.35  # of the vehicles that go back to their lane behind a closure
IN_LEFT = 0.92 * 0.5 + 0.08 * 0.15  # of vehicles at the road's beginning
ODD_PER_M = 0.8 * 0.003 / 945  # changes onto closed ground and off it: the work's own vehicles
IN_CLOSED = 0.8 * 0.003
ENDS_PER_M = 0.005 / LENGTH_M  # traces that end on the way though nothing changed
ENDS_OVER_M = 100.0  # ahead of a closed road, over which all end


def fewest_traces(divergence: float) -> int:
    """The bound for a divergence [nats] a trace."""
    return max(1, int(np.ceil(np.log(TRACES_PER_FALSE_ALARM * min(1.0, divergence)) / divergence)))


def divergence(before: World, after: World) -> float:
    """Kullback-Leibler divergence [nats] of a trace after a change from one before it, lanes being known."""
    if after.shift:
        return _of_shift(after)
    if after.exit_share != before.exit_share:
        return -float(np.log(1 - before.exit_share))
    if after.road_closed_at is not None:
        return float(np.log(1 / ENDS_OVER_M / ENDS_PER_M))
    if after.take_up:
        q = after.take_up
        return float(q * np.log(q / IN_CLOSED) + (1 - q) * np.log((1 - q) / (1 - IN_CLOSED)))
    return _of_lanes(before, after)


def _of_shift(world: World) -> float:
    time = np.arange(0.0, LENGTH_M / SPEED_MPS, world.interval_s)
    s = SPEED_MPS * time
    corners = [world.shift_from, world.shift_from + world.ramp, world.shift_to - world.ramp, world.shift_to]
    moved = world.shift * np.interp(s, corners, [0.0, 1.0, 1.0, 0.0])
    apart = np.abs(time[:, None] - time)
    receiver = 0.8 + 0.15 * np.exp(-apart / 60.0) + 0.05 * np.eye(len(s))
    driver = 0.5 + 0.5 * np.exp(-SPEED_MPS * apart / 60.0)
    covariance = world.error**2 * receiver + world.wander**2 * driver
    return float(0.5 * moved @ np.linalg.solve(covariance, moved))


def _of_lanes(before: World, after: World) -> float:
    x = np.arange(0.0, LENGTH_M, STEP_M) + STEP_M / 2
    rates = [_rates(world, x) for world in (before, after)]
    in_left, total = IN_LEFT, 0.0
    for i in range(len(x)):
        share = (in_left, 1 - in_left)
        for side in range(2):
            was, now = rates[0][side][i], rates[1][side][i]
            total += share[side] * STEP_M * (now * np.log(now / was) - now + was)
        out, back = (1 - np.exp(-rates[1][side][i] * STEP_M) for side in range(2))
        in_left += (1 - in_left) * back - in_left * out
    return float(total)


def _rates(world: World, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Changes a metre (n,) out of the left lane, and into it."""
    out, back = np.full(len(x), world.lane_changes_per_m), np.full(len(x), world.lane_changes_per_m)
    if world.closed:
        start, end = world.closed_from, world.closed_to
        leaving, inside = (x >= start - REACH_M) & (x < start), (x >= start - REACH_M) & (x <= end)
        out[inside] = back[inside] = ODD_PER_M
        out[leaving] = 1 / np.maximum(start - x[leaving], STEP_M)
        behind = (x > end) & (x <= end + REACH_M)
        left = 1 - RETURN_SHARE * (x[behind] - end) / REACH_M
        back[behind] += RETURN_SHARE / REACH_M / left
    return out, back


def main() -> None:
    """Write the table."""
    with (RESULTS / "live_bounds.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["kind", "error_m", "interval_s", "nats_per_trace", "bound_traces"])
        for interval in (1.0, 3.0):
            for error in (0.5, 1.0, 2.0):
                for kind, change in changes(error, interval).items():
                    nats = divergence(change.before, change.after)
                    table.writerow([kind, error, interval, f"{nats:.4g}", fewest_traces(nats)])


if __name__ == "__main__":
    main()
