"""The two figures of `study.py`: quality over the number of traces, and reliability of the probabilities."""

import json
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd

COLOURS = ("#000000", "#0072B2", "#E69F00", "#D55E00")  # Okabe and Ito 2008; by error, the same in every panel
TITLES = {"joined": "joined to the map of before", "alone": "traces alone"}


def draw_quality(rows: pd.DataFrame, path: Path) -> None:
    """Draw IoU over the number of traces, a line an error, of maps joined to the map of before and of traces alone."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    colours = dict(zip(sorted(rows["error_m"].unique()), COLOURS, strict=False))
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.8), sharey=True, layout="constrained")
    counts = sorted(rows["n_traces"].unique())
    for axis, (which, title) in zip(axes, TITLES.items(), strict=True):
        part = rows[rows["map"] == which]
        for error in sorted(part["error_m"].unique()):
            by_count = part[part["error_m"] == error].groupby("n_traces")["iou"]
            axis.plot(by_count.median(), "o-", color=colours[error], label=f"{error:g} m", markersize=4)
            low, high = by_count.quantile(0.25), by_count.quantile(0.75)
            axis.fill_between(low.index, low, high, color=colours[error], alpha=0.13, linewidth=0)
        axis.set_xscale("log")
        axis.set_xticks(counts, [str(n) for n in counts])
        axis.minorticks_off()
        axis.set(title=title, xlabel="traces", xlim=(0.9, 1.1 * counts[-1]), ylim=(0, 1))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("overlap with the truth (IoU)")
    axes[0].legend(title="GNSS error", loc="lower right")
    n_maps = rows.groupby(["map", "n_traces", "error_m"]).size()
    sizes = sorted({n_maps.min(), n_maps.max()})
    figure.suptitle(
        f"median and middle half of {' to '.join(map(str, sizes))} maps a point ({rows['zone'].nunique()} SUMO zones, "
        "one fix a second)",
        fontsize=10,
    )
    figure.savefig(path, dpi=120)
    plt.close(figure)


def draw_reliability(rows: pd.DataFrame, path: Path) -> None:
    """Draw the share of occupied cells over the probability that the map says, of all maps of an error together."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    colours = dict(zip(sorted(rows["error_m"].unique()), COLOURS, strict=False))
    figure, axes = plt.subplots(1, 2, figsize=(9, 4.4), sharey=True, layout="constrained")
    for axis, (which, title) in zip(axes, TITLES.items(), strict=True):
        part = rows[(rows["map"] == which) & (rows["n_traces"] >= 5)]
        axis.plot([0, 1], [0, 1], color="0.6", linewidth=1)
        for error in sorted(part["error_m"].unique()):
            sums = np.sum([json.loads(one) for one in part.loc[part["error_m"] == error, "reliability"]], axis=0)
            axis.plot(sums[1] / sums[0], sums[2] / sums[0], "o-", color=colours[error], label=f"{error:g} m", markersize=4)
        axis.set(title=title, xlabel="p(occupied) that the map says", xlim=(0, 1), ylim=(0, 1), aspect="equal")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("share of these cells that is occupied")
    axes[0].legend(title="GNSS error", loc="upper left")
    figure.suptitle("maps of 5 to 100 traces, fresh seeds, cells of which anything is known", fontsize=10)
    figure.savefig(path, dpi=120)
    plt.close(figure)
