"""How many traces a crowd map takes: its quality over number of traces, GNSS error and sampling interval, on SUMO fleets.

python analysis/how_many_traces.py --out results/how_many_traces [--seeds 10] [--zones straight bend ...]

Every fleet is simulated once; every row is written as it comes, so that a stopped study goes on where it was. Beside rows.csv
lie table.csv (medians and 95 % intervals), figure.png and waiting.csv: minutes until so many equipped vehicles have passed.
"""

import argparse
import itertools
import sys
from dataclasses import asdict
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from crowd_zones import ZONES, true_traces
from scipy.stats import bootstrap, gamma

from wzsumo.crowd_mapping.lane_structure import LaneStructureSpec, lane_structured_map
from wzsumo.grid import UNKNOWN, blank_grid, cells_inside
from wzsumo.metrics.map_quality import quality_of_cells
from wzsumo.sensing.equipped import choose_equipped
from wzsumo.sensing.gnss import GnssSpec, report

COUNTS = (1, 2, 3, 5, 10, 20, 30, 100)
ERRORS_M = (0.0, 0.5, 1.0, 2.0)
INTERVALS_S = (0.1, 1.0, 3.0)
KEYS = ["zone", "seed", "n_traces", "error_m", "interval_s"]
FIGURES = ["precision", "recall", "iou", "calibration_error", "calibration_error_unsure", "brier", "brier_binary"]
RESOLUTION_M = 0.254  # twice the usual cell, for speed
BINS = 20  # of p_occupied


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/how_many_traces"))
    parser.add_argument("--first", type=int, default=21, help="seeds 1-6 were looked at while the maps were built")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--zones", nargs="+", default=list(ZONES), choices=list(ZONES))
    parser.add_argument("--counts", nargs="+", type=int, default=COUNTS)
    parser.add_argument("--errors-m", nargs="+", type=float, default=ERRORS_M)
    parser.add_argument("--intervals-s", nargs="+", type=float, default=INTERVALS_S)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    path = args.out / "rows.csv"
    known = {tuple(row) for row in pd.read_csv(path)[KEYS].itertuples(index=False)} if path.exists() else set()
    for seed, zone in itertools.product(range(args.first, args.first + args.seeds), args.zones):
        cases = itertools.product(args.counts, args.errors_m, args.intervals_s)
        missing = [case for case in cases if (zone, seed, *case) not in known]
        if missing:
            judge = _Judge(zone)
            traces = true_traces(zone, seed, cache=args.out / "fleets")
            for case in missing:
                row = dict(zip(KEYS, (zone, seed, *case), strict=True)) | judge.row(traces, *case, seed=seed)
                pd.DataFrame([row]).to_csv(path, mode="a", header=not path.exists(), index=False)
                print(row, file=sys.stderr)
    rows = pd.read_csv(path)
    _table(rows).to_csv(args.out / "table.csv", index=False)
    _waiting().to_csv(args.out / "waiting.csv", index=False)
    _draw(rows, args.out / "figure.png")


class _Judge:
    """The truth of one zone on its cells."""

    def __init__(self, zone: str) -> None:
        layout = ZONES[zone].layout()
        road = layout.road
        beside = road.strip(layout.start, layout.end, -road.right_shoulder - 2.0, road.left_edge + 2.0)
        self.cells = blank_grid(beside.bounds, resolution=RESOLUTION_M, p_occupied=UNKNOWN)
        self.counted = cells_inside(self.cells, beside)
        self.drivable = cells_inside(self.cells, layout.drivable_between(layout.start, layout.end)) & self.counted

    def row(self, traces: pd.DataFrame, n: int, error_m: float, interval_s: float, *, seed: int) -> dict[str, float]:
        """Figures of the lanes map of the first n equipped vehicles."""
        chosen = choose_equipped(pd.Index(traces["vehicle_id"].unique()), penetration=1.0, seed=seed)[:n]
        gnss = GnssSpec(error_m=error_m, sampling_interval_s=interval_s)
        reported = report(traces[traces["vehicle_id"].isin(chosen)], spec=gnss, seed=seed)
        grid = lane_structured_map(reported, spec=LaneStructureSpec(), grid=self.cells, seed=seed).grid
        quality = asdict(quality_of_cells(grid.free, drivable=self.drivable, counted=self.counted))
        known = self.counted & (grid.p_occupied != UNKNOWN)
        p, occupied = grid.p_occupied[known].astype(float), ~self.drivable[known]
        unsure = (p > 0.01) & (p < 0.99)
        return quality | {
            "calibration_error": _calibration_error(p, occupied),
            "calibration_error_unsure": _calibration_error(p[unsure], occupied[unsure]),
            "brier": float(np.mean((p - occupied) ** 2)),
            "brier_binary": float(np.mean(~grid.free[known] != occupied)),
        }


def _calibration_error(p: np.ndarray, occupied: np.ndarray) -> float:
    """Mean distance between what is said and what is so, over equal bins of p (Guo et al. 2017, ECE)."""
    if not len(p):
        return float("nan")
    cell = np.minimum((p * BINS).astype(int), BINS - 1)
    gap = np.bincount(cell, weights=p - occupied, minlength=BINS)
    return float(np.abs(gap).sum() / len(p))


def _table(rows: pd.DataFrame) -> pd.DataFrame:
    """Median and its 95 % bootstrap interval over zones and seeds."""
    out = []
    for key, part in rows.groupby(KEYS[2:]):
        row = dict(zip(KEYS[2:], key, strict=True)) | {"n_maps": len(part)}
        for name in FIGURES:
            values = part[name].dropna().to_numpy()
            row[name] = float(np.median(values)) if len(values) else float("nan")
            if len(values) > 1 and np.ptp(values) > 0:
                interval = bootstrap(
                    (values,), np.median, method="percentile", rng=np.random.default_rng(0)
                ).confidence_interval
                row[f"{name}_low"], row[f"{name}_high"] = interval
        out.append(row)
    return pd.DataFrame(out)


def _waiting() -> pd.DataFrame:
    """Minutes until n equipped vehicles have passed, of Poisson arrivals: median and 95 % quantile of a gamma distribution."""
    cases = itertools.product(COUNTS, (0.01, 0.02, 0.05, 0.10), (200, 500, 1000, 2000))
    return pd.DataFrame(
        {
            "n_traces": n,
            "penetration": share,
            "flow_vph": flow,
            "median_min": gamma.ppf(0.5, n, scale=60 / (share * flow)),
            "late_min": gamma.ppf(0.95, n, scale=60 / (share * flow)),
        }
        for n, share, flow in cases
    )


def _draw(rows: pd.DataFrame, path: Path) -> None:
    """IoU and precision over the number of traces, a line an error, at the interval with the most rows."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    part = rows[rows["interval_s"] == rows["interval_s"].mode()[0]]
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.8), sharey=True, layout="constrained")
    for error, colour in zip(sorted(part["error_m"].unique()), ("#000000", "#0072B2", "#E69F00", "#D55E00"), strict=False):
        of_error = part[part["error_m"] == error].groupby("n_traces")
        for axis, name in zip(axes, ("precision", "iou"), strict=True):
            middle, low, high = (of_error[name].quantile(q) for q in (0.5, 0.25, 0.75))
            axis.plot(middle.index, middle, "o-", color=colour, label=f"{error:g} m")
            axis.fill_between(middle.index, low, high, color=colour, alpha=0.15, linewidth=0)
    counts = sorted(part["n_traces"].unique())
    for axis, title in zip(axes, ("said to be free and is (precision)", "overlap with the truth (IoU)"), strict=True):
        axis.set_xscale("log")
        axis.set_xticks(counts, [str(n) for n in counts])
        axis.minorticks_off()
        axis.set(title=title, xlabel="traces", ylim=(0, 1.02))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("share")
    axes[0].legend(title="GNSS error", loc="lower right")
    n_maps = part.groupby(["n_traces", "error_m"]).size().min()
    figure.suptitle(f"median and middle half of {n_maps} maps a point, {part['zone'].nunique()} zones, one fix a "
                    f"{part['interval_s'].iloc[0]:g} s", fontsize=10)  # fmt: skip
    figure.savefig(path, dpi=120)
    plt.close(figure)


if __name__ == "__main__":
    main()
