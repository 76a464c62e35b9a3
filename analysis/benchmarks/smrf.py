"""SMRF beside pysmrf (PyPI) on made-up airborne scenes and one LiDAR scan: kappa, errors, time.

python analysis/benchmarks/smrf.py [--quick] [--save DIR]

One parameter set for all of them. Scenes are of the kinds of the ISPRS filter test (Sithole & Vosselman 2004): slopes, banks
and terraces, wide and low buildings, vegetation, bridges, low and high outliers, gaps, spacings of 0.7 to 5 m.
--save keeps each cloud (n, 3) and its truth (n,), 1 = ground, as .npy, for `wzsumo ground` and anybody's filter.
"""

import argparse
import importlib
import importlib.util
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TypeVar

import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.lidar_mapping.smrf import SmrfSpec, compile_kernels, ground_mask

SIDE = 250.0  # of a scene [m]; the ISPRS samples are 100 to 300 m wide
PULSE_NOISE = 0.05  # of a return's height [m]
Result = TypeVar("Result")


def flat(x: FloatArray, y: FloatArray) -> FloatArray:
    return 0.01 * x + 0.3 * np.sin(x / 50) * np.cos(y / 35)


def hills(x: FloatArray, y: FloatArray) -> FloatArray:
    return 8 * np.sin(x / 40) + 5 * np.cos(y / 60) + 0.04 * x


def steep(x: FloatArray, y: FloatArray) -> FloatArray:
    return 0.55 * x + 2 * np.sin(y / 18)


def terraces(x: FloatArray, y: FloatArray) -> FloatArray:
    return 3.0 * np.floor((x + 6 * np.sin(y / 30)) / 40) + 0.02 * x


def bank(x: FloatArray, y: FloatArray) -> FloatArray:
    return 12 / (1 + np.exp(-(x - 125 - 15 * np.sin(y / 40)) / 5)) + 0.02 * y


def quarry(x: FloatArray, y: FloatArray) -> FloatArray:
    return -10.0 * (np.hypot(x - 125, y - 125) < 80) - 10.0 * (np.hypot(x - 125, y - 125) < 40) + 0.1 * x


def valley(x: FloatArray, y: FloatArray) -> FloatArray:
    return 0.02 * x - 9 * np.exp(-(((y - 125) / 16) ** 2))


def embankment(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.clip((24 - np.abs(y - 125)) / 1.8, 0, 8) + flat(x, y)


@dataclass(frozen=True)
class Objects:
    """What stands on a terrain or hangs over it; trees and bushes as shares of the points."""

    houses: int = 0
    widest: float = 0.0  # [m], of the houses
    trees: float = 0.0
    bushes: float = 0.0
    bridge: bool = False
    low: int = 0  # single outliers below the ground
    clumps: int = 0  # clumps of four outliers below the ground
    high: int = 0  # single outliers above the ground
    gaps: int = 0


# Terrain, mean spacing of points [m], what stands on it; see `scene`.
SCENES: dict[str, tuple[Callable[[FloatArray, FloatArray], FloatArray], float, Objects]] = {
    "flat town, small houses": (flat, 1.0, Objects(houses=60, widest=12, trees=0.05)),
    "flat town, blocks of 40 m": (flat, 1.0, Objects(houses=12, widest=40, trees=0.05)),
    "dense survey of a town": (flat, 0.7, Objects(houses=30, widest=20, bushes=0.04)),
    "town on hills": (hills, 1.2, Objects(houses=30, widest=16, trees=0.1)),
    "houses and wood on a steep slope": (steep, 1.2, Objects(houses=15, widest=12, trees=0.25)),
    "terraces with houses": (terraces, 1.0, Objects(houses=20, widest=12, trees=0.05)),
    "river bank, bushes": (bank, 1.5, Objects(trees=0.1, bushes=0.1)),
    "quarry": (quarry, 2.5, Objects(trees=0.02)),
    "bridge over a valley": (valley, 1.2, Objects(bridge=True, houses=10, widest=15, trees=0.05)),
    "road on an embankment": (embankment, 2.5, Objects(trees=0.05, bushes=0.05)),
    "low and high outliers": (flat, 1.0, Objects(houses=20, widest=20, low=30, clumps=10, high=30)),
    "gaps in the data": (hills, 2.0, Objects(houses=10, widest=20, trees=0.1, gaps=12)),
    "open country, 3.5 m": (hills, 3.5, Objects(trees=0.1, houses=5, widest=15)),
    "open country, 5 m": (hills, 5.0, Objects(trees=0.1)),
}


def scene(name: str, seed: int) -> tuple[FloatArray, BoolArray]:
    """(points (n, 3), which are ground) of one of SCENES; shares are of all points."""
    terrain, spacing, what = SCENES[name]
    rng = np.random.default_rng([seed, list(SCENES).index(name)])
    n = int((SIDE / spacing) ** 2)
    xy = rng.uniform(0, SIDE, (n, 2))
    ground = terrain(*xy.T)
    z, is_ground = ground + rng.normal(0, PULSE_NOISE, n), np.ones(n, dtype=bool)
    for _ in range(what.houses):
        inside = _in_rectangle(xy, rng, widest=what.widest)
        if inside.any():
            z[inside], is_ground[inside] = ground[inside].max() + rng.uniform(2.5, 15) + rng.normal(0, PULSE_NOISE), False
    for share, (lowest, highest) in ((what.trees, (1.5, 18)), (what.bushes, (0.4, 1.5))):
        grown = is_ground & (rng.random(n) < share)
        z[grown] += rng.uniform(lowest, highest, grown.sum())
        is_ground &= ~grown
    if what.bridge:
        deck = terrain(xy[:, 0], np.full(n, 1e3))
        on_deck = (np.abs(xy[:, 0] - 120) < 6) & (deck - ground > 0.5)
        z[on_deck], is_ground[on_deck] = deck[on_deck] + rng.normal(0, PULSE_NOISE, on_deck.sum()), False
    middles = rng.uniform(0, SIDE, (what.gaps, 2))
    kept = np.ones(n, dtype=bool)
    for middle in middles:
        kept &= np.linalg.norm(xy - middle, axis=1) > rng.uniform(8, 20)
    points, is_ground = np.column_stack([xy, z])[kept], is_ground[kept]
    stray = _outliers(points, rng, low=what.low, clumps=what.clumps, high=what.high)
    return np.vstack([points, stray]), np.append(is_ground, np.zeros(len(stray), dtype=bool))


def _in_rectangle(xy: FloatArray, rng: np.random.Generator, *, widest: float) -> BoolArray:
    """Points in a turned rectangle somewhere, a third to all of `widest` [m] wide and up to twice as long."""
    width, turn = rng.uniform(widest / 3, widest), rng.uniform(0, np.pi)
    across = (xy - rng.uniform(0, SIDE, 2)) @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return np.asarray((np.abs(across) < (width / 2, width / 2 * rng.uniform(1, 2))).all(axis=1))


def _outliers(points: FloatArray, rng: np.random.Generator, *, low: int, clumps: int, high: int) -> FloatArray:
    """Single points and clumps of four below the ground (echoes of several reflections), single ones above (birds)."""
    one = points[rng.integers(0, len(points), low + high)] + np.array([0.3, 0.2, 0])
    one[:, 2] += np.append(-rng.uniform(2, 25, low), rng.uniform(20, 80, high))
    four = points[rng.integers(0, len(points), clumps)].repeat(4, axis=0) + rng.uniform(-0.7, 0.7, (4 * clumps, 3))
    four[:, 2] -= rng.uniform(2, 15, clumps).repeat(4)
    return np.vstack([one, four])


def lidar_scan(seed: int) -> tuple[FloatArray, BoolArray]:
    """Returns of 128 x 1800 rays from 1.9 m over a tilted road with cones."""
    rng = np.random.default_rng(seed)
    elevation, azimuth = np.meshgrid(np.deg2rad(np.linspace(-25, 15, 128)), np.linspace(0, 2 * np.pi, 1800, endpoint=False))
    slope = np.tan(elevation).ravel() - 0.02 * np.sin(azimuth).ravel()
    reach = np.divide(-1.9, slope, out=np.full_like(slope, np.inf), where=slope < -0.005)
    azimuth, reach = azimuth.ravel()[reach < 120], reach[reach < 120]
    ground = np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth), 0.02 * reach * np.sin(azimuth)])
    ground[:, 2] += rng.normal(0, 0.01, len(ground))
    feet = rng.uniform(-50, 50, (60, 2)).repeat(60, axis=0)
    height = rng.uniform(0, 0.9, len(feet))
    cones = np.column_stack([feet + rng.normal(0, 0.08, feet.shape), 0.02 * feet[:, 1] + height])
    return np.vstack([ground, cones]), np.repeat([True, False], [len(ground), len(cones)])


def million(seed: int, *, side: float = 1000.0) -> tuple[FloatArray, BoolArray]:
    """10^6 points on hills with trees."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, side, (1_000_000, 2))
    trees = rng.random(len(xy)) < 0.15
    return np.column_stack(
        [xy, hills(*xy.T) + rng.normal(0, PULSE_NOISE, len(xy)) + trees * rng.uniform(1, 15, len(xy))]
    ), ~trees


def scores(mask: BoolArray, truth: BoolArray) -> FloatArray:
    """Type I (ground taken for object), type II (object for ground) and total error, and Cohen's kappa [%]."""
    agree = (mask == truth).mean()
    chance = mask.mean() * truth.mean() + (1 - mask.mean()) * (1 - truth.mean())
    return 100 * np.array([(~mask[truth]).mean(), mask[~truth].mean(), 1 - agree, (agree - chance) / (1 - chance)])


def timed(function: Callable[[], Result], *, runs: int) -> tuple[float, Result]:
    """(median CPU time of this process [ms], what the function returned)."""
    times = []
    for _ in range(runs):
        start = time.process_time()
        result = function()
        times.append(1000 * (time.process_time() - start))
    return statistics.median(times), result


def run_peer(peer: ModuleType, points: FloatArray, spec: SmrfSpec) -> BoolArray:
    windows = int(np.ceil(spec.window_m / spec.cell_m))
    limits = {"elevation_threshold": spec.elevation_threshold_m, "elevation_scaler": spec.elevation_scalar}
    result = peer.smrf(*points.T, cellsize=spec.cell_m, windows=windows, slope_threshold=spec.slope, **limits)
    return ~np.asarray(result[3], dtype=bool)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="without pysmrf, which takes minutes")
    parser.add_argument("--seed", type=int, default=61)
    parser.add_argument("--save", type=Path, help="a folder for the clouds")
    given = parser.parse_args()
    compile_kernels()
    peer = importlib.import_module("pysmrf") if importlib.util.find_spec("pysmrf") and not given.quick else None
    clouds = [(name, scene(name, given.seed), SmrfSpec()) for name in SCENES]
    clouds.append(("LiDAR scan, threshold 0.2 m", lidar_scan(given.seed), SmrfSpec(elevation_threshold_m=0.2)))
    clouds.append(("hills, 10^6 points", million(given.seed), SmrfSpec()))
    head = f"{'type I':>8}{'type II':>8}{'total':>8}{'kappa':>8}{'CPU ms':>9}"
    print(f"{'':<34}{'points':>9}{head}" + (f"   |{head}{'same %':>9}" if peer else ""))
    table = []
    for number, (name, (points, truth), spec) in enumerate(clouds):
        if given.save:
            given.save.mkdir(parents=True, exist_ok=True)
            np.save(given.save / f"{number:02d}_cloud.npy", points)
            np.save(given.save / f"{number:02d}_truth.npy", truth.astype(np.uint8))
        ours_ms, mask = timed(partial(ground_mask, points, spec), runs=3)
        ours = scores(mask, truth)
        row = f"{name:<34}{len(points):>9}" + "".join(f"{value:>8.2f}" for value in ours) + f"{ours_ms:>9.0f}"
        if peer and len(points) < 500_000:
            peer_ms, theirs = timed(partial(run_peer, peer, points, spec), runs=1)
            of_peer = scores(theirs, truth)
            row += "   |" + "".join(f"{value:>8.2f}" for value in of_peer)
            row += f"{peer_ms:>9.0f}{100 * (mask == theirs).mean():>9.2f}"
        else:
            of_peer = np.full(4, np.nan)
        print(row, flush=True)
        table.append([*ours, *of_peer])
    means = np.mean(table[: len(SCENES)], axis=0)
    row = f"{f'mean of the {len(SCENES)} airborne scenes':<43}" + "".join(f"{value:>8.2f}" for value in means[:4])
    print(row + (f"{'':>9}   |" + "".join(f"{value:>8.2f}" for value in means[4:]) if peer else ""))


if __name__ == "__main__":
    main()
