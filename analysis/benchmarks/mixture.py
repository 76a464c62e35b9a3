"""Speed and likelihood of the mixture against scikit-learn on one core, on traces through a work zone.

Run: python analysis/benchmarks/mixture.py [--full]. Medians of 5 runs (scikit-learn's sweep: 1). `--full` lets scikit-learn
sweep K = 1..30 with n_init = 3 as well, which takes it minutes.
"""

import argparse
import statistics
import time
import warnings
from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

from wzsumo.crowd_mapping.mixture.expectation_maximisation import Components, run_em, to_block_axes
from wzsumo.crowd_mapping.mixture.mixture import mixture_of
from wzsumo.crowd_mapping.mixture.point_blocks import block_points
from wzsumo.crowd_mapping.mixture.selection import sweep_mixtures
from wzsumo.frames import FloatArray

ITERATIONS = 10


def zone_points(traces: int, *, seed: int) -> FloatArray:
    """Points of traces over 657 m: half start in a lane that merges right, then all shift right by 3 m."""
    random = np.random.default_rng(seed)
    points = []
    for _ in range(traces):
        s = np.arange(0, 657, 2.2) + random.uniform(0, 2.2)
        closed, merge, length = random.random() < 0.5, random.uniform(0, 170), random.uniform(60, 100)
        ramp = np.clip((s - merge) / length, 0, 1)
        shift = np.clip((s - 260) / 110, 0, 1)
        d = 3.66 * closed * (1 - ramp**2 * (3 - 2 * ramp)) - 3.05 * shift**2 * (3 - 2 * shift)
        wander = 0.01 * np.cumsum(random.standard_normal(len(s))) + 0.2 * random.standard_normal()
        points.append(np.column_stack([s, d + wander]))
    return np.vstack(points)


def seconds(work: Callable[[], object], *, runs: int) -> float:
    taken = []
    for _ in range(runs):
        begun = time.perf_counter()
        work()
        taken.append(time.perf_counter() - begun)
    return statistics.median(taken)


def iteration_row(traces: int, k: int) -> None:
    from sklearn.mixture import GaussianMixture

    points = zone_points(traces, seed=traces)
    start = sweep_mixtures(points, k_max=k).mixtures[-1]
    blocks = block_points(points)
    components = to_block_axes(blocks, Components(start.weights, start.means, start.covariances))
    ours = seconds(lambda: run_em(blocks, components, reg_covar=1e-6, tol=0.0, max_iterations=ITERATIONS), runs=5)
    model = GaussianMixture(
        k, weights_init=start.weights, means_init=start.means, precisions_init=np.linalg.inv(start.covariances),
        init_params="random_from_data", tol=0.0, max_iter=ITERATIONS, random_state=0,
    )  # fmt: skip
    theirs = seconds(lambda: model.fit(points), runs=5 if traces <= 30 else 1)
    # Both end with one more pass for the likelihood.
    passes = ITERATIONS + 1
    ended = run_em(blocks, components, reg_covar=1e-6, tol=0.0, max_iterations=ITERATIONS)
    gap = np.abs(mixture_of(blocks, ended).means - model.means_)
    print(
        f"{traces:6d} {len(points):7d} {k:3d} {1e3 * ours / passes:9.2f} {1e3 * theirs / passes:9.2f} {theirs / ours:6.1f}"
        f" {gap.max():9.1e}"
    )


def sweep_row(traces: int, *, full: bool) -> None:
    points = zone_points(traces, seed=traces)
    ours = seconds(lambda: sweep_mixtures(points, k_max=30), runs=5)
    best = sweep_mixtures(points, k_max=30).best("bic")
    line = f"{traces:6d} {len(points):7d} {ours:7.2f} {best.n_components:3d} {best.bic:12.0f}"
    if full and traces <= 30:
        from sklearn.mixture import GaussianMixture

        begun = time.perf_counter()
        bics = [GaussianMixture(k, n_init=3, random_state=0).fit(points).bic(points) for k in range(1, 31)]
        line += f" {time.perf_counter() - begun:8.1f} {1 + int(np.argmin(bics)):3d} {min(bics):12.0f}"
    print(line)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="let scikit-learn sweep as well (minutes)")
    full = parser.parse_args().full
    warnings.simplefilter("ignore")  # scikit-learn warns that ten iterations do not converge
    begun = time.perf_counter()
    sweep_mixtures(zone_points(1, seed=0), k_max=3)
    print(f"compile or load: {time.perf_counter() - begun:.1f} s")
    try:
        import sklearn

        print(f"scikit-learn {sklearn.__version__}, one thread each; ms per EM iteration, ratio, largest difference of a mean")
        print("traces  points   K      ours   sklearn  ratio  |dmean|")
        with threadpool_limits(1):
            for traces in (30, 300):
                for k in (5, 15, 30):
                    iteration_row(traces, k)
    except ImportError:
        print("scikit-learn: not installed")
    print("sweep K = 1..30: seconds, best K by BIC, BIC; scikit-learn n_init = 3 beside it with --full")
    with threadpool_limits(1):
        for traces in (5, 30, 300):
            sweep_row(traces, full=full)


if __name__ == "__main__":
    main()
