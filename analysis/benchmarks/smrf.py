"""SMRF beside pysmrf (PyPI): time and agreement of labels, on a made-up town and on one LiDAR scan.

python analysis/benchmarks/smrf.py [--quick]
"""

import importlib
import importlib.util
import statistics
import sys
import time
from functools import partial

import numpy as np

from wzsumo.lidar_mapping.smrf import SmrfSpec, compile_kernels, ground_mask


def town(seed, *, side=300.0, n=120_000):
    """Points on hills with houses and trees, and which are ground."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, side, (n, 2))
    ground = 8 * np.sin(xy[:, 0] / 40) + 5 * np.cos(xy[:, 1] / 60) + 0.04 * xy[:, 0]
    z, is_ground = ground + rng.normal(0, 0.05, n), np.ones(n, dtype=bool)
    for x, y in rng.uniform(15, side - 15, (40, 2)):
        inside = (np.abs(xy - (x, y)) < rng.uniform(4, 12, 2)).all(axis=1)
        if inside.any():
            z[inside], is_ground[inside] = ground[inside].max() + rng.uniform(3, 12), False
    trees = is_ground & (rng.random(n) < 0.15)
    z[trees] += rng.uniform(0.8, 15, trees.sum())
    return np.column_stack([xy, z]), is_ground & ~trees


def scan(seed):
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


def kappa(mask, truth):
    agree = (mask == truth).mean()
    chance = mask.mean() * truth.mean() + (1 - mask.mean()) * (1 - truth.mean())
    return 100 * (agree - chance) / (1 - chance)


def timed(function, *, runs):
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        result = function()
        times.append(1000 * (time.perf_counter() - start))
    return statistics.median(times), result


def main():
    compile_kernels()
    peer = importlib.import_module("pysmrf") if importlib.util.find_spec("pysmrf") else None
    print(f"{'cloud':<22}{'points':>9}{'ours ms':>9}{'pysmrf ms':>11}{'ratio':>8}{'same %':>8}{'kappa ours / peer':>20}")
    for name, (points, truth), spec in (
        ("town, 1 m / 18 m", town(1), SmrfSpec()),
        ("scan, threshold 0.2 m", scan(1), SmrfSpec(elevation_threshold_m=0.2)),
    ):
        ours_ms, mask = timed(partial(ground_mask, points, spec), runs=3 if "--quick" in sys.argv else 9)
        row = f"{name:<22}{len(points):>9}{ours_ms:>9.1f}"
        if peer is None or "--quick" in sys.argv:
            print(f"{row}{'not ' + ('run' if peer else 'installed'):>19}{kappa(mask, truth):>12.2f}")
            continue
        peer_ms, theirs = timed(partial(run_peer, peer, points, spec), runs=1)
        scores = f"{kappa(mask, truth):.2f} / {kappa(theirs, truth):.2f}"
        print(f"{row}{peer_ms:>11.0f}{ours_ms / peer_ms:>8.4f}{100 * (mask == theirs).mean():>8.3f}{scores:>20}")


def run_peer(peer, points, spec):
    windows = int(np.ceil(spec.window_m / spec.cell_m))
    limits = {"elevation_threshold": spec.elevation_threshold_m, "elevation_scaler": spec.elevation_scalar}
    result = peer.smrf(*points.T, cellsize=spec.cell_m, windows=windows, slope_threshold=spec.slope, **limits)
    return ~np.asarray(result[3], dtype=bool)


if __name__ == "__main__":
    main()
