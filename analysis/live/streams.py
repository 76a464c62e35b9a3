"""Streams of traces along a zone in closed form, with a change at a stated trace: they share nothing with `wzsumo.live`.

A road of 2.7 km has two lanes of 3.6 m; the left one is closed from 1080 m to 2025 m. Drivers in it leave over the 400 m ahead,
and some return behind. A receiver's error is a bias for a whole trace (80 % of the variance), a Gauss-Markov series of 60 s
(15 %) and white noise (5 %). Dirt, in every stream: 1 % of receivers err three times as much, 1 % of fixes four times, 0.3 % of
vehicles are the work's own and drive on the closed ground, 1 % of traces begin or end on the way. A tenth leaves at an exit.
Habits make the dirt worse, without a change of the zone.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from wzsumo.frames import FloatArray

LENGTH_M, WIDTH_M, LANES = 2700.0, 3.6, 2
CLOSED_FROM_M, CLOSED_TO_M = 1080.0, 2025.0
EXIT_AT_M, EXIT_SLOPE, EXIT_LENGTH_M = 600.0, 0.08, 300.0
REACH_M = 400.0  # over which drivers leave a lane that ends, and return to one that begins
FLOW_PER_S = 0.012  # of traces: 1,700 vehicles an hour, of which 2.5 % report


@dataclass(frozen=True, kw_only=True)
class World:
    """The zone as it stands, and the drivers on it. All lengths in metres."""

    closed: bool = True  # the left lane, between closed_from and closed_to
    closed_from: float = CLOSED_FROM_M
    closed_to: float = CLOSED_TO_M
    take_up: float = 0.0  # share of drivers that use the closed lane though it is closed
    shift: float = 0.0  # of all lanes between shift_from and shift_to, to the left
    shift_from: float = CLOSED_FROM_M
    shift_to: float = CLOSED_TO_M
    ramp: float = 20.0  # length over which a shift comes and goes
    exit_share: float = 0.1
    partial_share: float = 0.01  # of traces that begin or end on the way
    road_closed_at: float | None = None  # traces end there
    passing_share: float = 1.0  # of traces that still come at all
    # habits
    error: float = 1.0
    interval_s: float = 1.0
    wander: float = 0.25
    lane_changes_per_m: float = 1 / 3000  # to each side
    left_share: float = 0.5
    bad_receivers: float = 0.01
    bad_factor: float = 3.0
    work_vehicles: float = 0.003
    rate_factor: float = 1.0
    trucks: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """One trace: stations and offsets (n,) [m] from the road's right edge, times (n,) [s], length of the vehicle [m]."""

    station: FloatArray
    offset: FloatArray
    time: FloatArray
    length: float


def stream(before: World, after: World, *, change_at: int, seed: int, start_s: float = 0.0) -> Iterator[Drive]:
    """Traces without end, in the order in which vehicles leave; from number `change_at` on they drive in the world `after`."""
    random = np.random.default_rng(seed)
    time, number = start_s, 0
    while True:
        world = after if number >= change_at else before
        time += random.exponential(1 / (FLOW_PER_S * world.rate_factor * max(world.passing_share, 1e-9)))
        yield drive(world, random, time)
        number += 1


def drive(world: World, random: np.random.Generator, start_s: float) -> Drive:  # noqa: C901 - one story, told in order
    """What one vehicle reports."""
    truck = world.trucks or random.random() < 0.08
    speed = random.normal(25.0 if truck else 27.0, 1.5)
    time = np.arange(random.uniform(0, world.interval_s), LENGTH_M / speed, world.interval_s)
    s = speed * time
    n = len(s)
    works = random.random() < world.work_vehicles
    lane = 1 if random.random() < (0.15 if truck else world.left_share) else 0
    position = np.full(n, float(lane))
    where, goes = 0.0, lane
    gets_out = world.closed and not works
    uses_closed = random.random() < world.take_up
    leave_at = world.closed_from - REACH_M * random.random() if gets_out and not uses_closed else np.inf
    return_at = world.closed_to + REACH_M * random.random() if random.random() < 0.35 and world.closed else np.inf
    if uses_closed and not works:  # it changes into the reopened lane where that begins, unless it is there
        return_at = world.closed_from + REACH_M * random.random() if world.closed else np.inf
    while True:
        free = where + random.exponential(1 / world.lane_changes_per_m)
        in_zone = world.closed and world.closed_from - REACH_M <= free <= world.closed_to
        if goes == 1 and leave_at >= where and leave_at <= free:
            at, to = leave_at, 0
        elif goes == 0 and return_at >= where and return_at <= free:
            at, to = return_at, 1
        elif free > LENGTH_M:
            break
        elif in_zone or (truck and goes == 0):
            where = free
            continue
        else:
            at, to = free, 1 - goes
        t = np.clip((s - at) / random.uniform(60.0, 110.0), 0.0, 1.0)
        position += (to - goes) * t * t * (3 - 2 * t)
        goes, where = to, at + 110.0
    if works and random.random() < 0.8:
        t = np.clip((s - world.closed_from) / 80.0, 0.0, 1.0)
        position = (1 - t) * position + t
    moved = world.shift * np.interp(
        s, [world.shift_from, world.shift_from + world.ramp, world.shift_to - world.ramp, world.shift_to], [0.0, 1.0, 1.0, 0.0]
    )
    offset = (position + 0.5) * WIDTH_M + moved + _wander(world, s, random)
    kept = np.ones(n, dtype=bool)
    if random.random() < world.exit_share:
        offset = (0.5 * WIDTH_M) - np.maximum(0.0, s - EXIT_AT_M) * EXIT_SLOPE + _wander(world, s, random)
        kept = s < EXIT_AT_M + EXIT_LENGTH_M
    if random.random() < world.partial_share:
        cut = random.uniform(0, LENGTH_M)
        kept &= (s < cut) if random.random() < 0.5 else (s > cut)
    scale = world.error * (world.bad_factor if random.random() < world.bad_receivers else 1.0)
    offset = offset + scale * _error(n, world.interval_s, random) + 0.0
    wild = random.random(n) < 0.01
    offset = offset + wild * random.normal(0.0, 4 * world.error, n)
    s = s + scale * np.sqrt(0.8) * random.standard_normal()
    if world.road_closed_at is not None:
        kept &= s < world.road_closed_at - random.uniform(0, 100)
    return Drive(station=s[kept], offset=offset[kept], time=start_s + time[kept], length=12.0 if truck else 4.6)


def _wander(world: World, s: FloatArray, random: np.random.Generator) -> FloatArray:
    """A driver's offset (n,) [m]: a habit for the whole way and a Gauss-Markov series of 60 m, of equal variance."""
    rho = np.exp(-(s[1] - s[0]) / 60.0) if len(s) > 1 else 0.0
    series = lfilter([np.sqrt(1 - rho**2)], [1.0, -rho], random.standard_normal(len(s) + 8))[8:]
    return np.asarray(world.wander * np.sqrt(0.5) * (random.standard_normal() + series))


def _error(n: int, interval_s: float, random: np.random.Generator) -> FloatArray:
    """A receiver's error (n,) of unit variance."""
    rho = np.exp(-interval_s / 60.0)
    first = random.standard_normal()
    noise = np.sqrt(1 - rho**2) * random.standard_normal(n)
    noise[0] = first
    slow = lfilter([1.0], [1.0, -rho], noise)
    return np.asarray(
        np.sqrt(0.8) * random.standard_normal() + np.sqrt(0.15) * slow + np.sqrt(0.05) * random.standard_normal(n)
    )


HABITS = {
    "usual": World(),
    "rain": World(wander=0.5),
    "night": World(left_share=0.2, rate_factor=0.1),
    "trucks_only": World(trucks=True),
    "bad_receivers": World(bad_receivers=0.05, bad_factor=10.0),
    "understated": World(error=1.5),
    "lane_changes": World(lane_changes_per_m=4 / 3000),
    "work_vehicles": World(work_vehicles=0.02),
}


def habit_change(name: str, *, error: float, interval_s: float) -> tuple[World, World]:
    """(the usual world, the same zone with a habit), for a receiver error [m] and a sampling interval [s]."""
    usual = World(error=error, interval_s=interval_s)
    habit = HABITS[name]
    return usual, replace(habit, error=error * habit.error, interval_s=interval_s)
