"""What bounds maps of traces alone: their IoU where parts of the map are put right by the truth.

    python analysis/how_many_traces/bounds.py --out results/how_many_bounds [--first 101] [--seeds 3] [--fleets FOLDER]

The cases are those for which `study.py` has an aim. A part of a map is told by its distance from the edge of the narrowest open
width: what lies beyond that edge is open in the tapers only. Maps of which no trace shows the closing lane stand apart, for
nobody can know from them that the lane is open ahead. Writes rows.csv into --out and prints the medians.
"""

import argparse
import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from generator import GENERATED, generated_traces
from scores import SumoZone, Truth, truth_of_generated
from study import AIMED_CASES, USUAL_INTERVAL_S, ZONES_OF_THE_STUDY, first_equipped
from zones import ZONES, true_traces

from wzsumo.crowd_mapping.lanes.lane_mapping import map_lanes
from wzsumo.frames import BoolArray
from wzsumo.grid import FREE_THRESHOLD
from wzsumo.sensing.gnss import GnssSpec, report

NEAR_EDGE_M = 0.6  # a cell this near to the true edge counts as part of the edge; chosen by us
Figures = Callable[[int, float, int], dict[str, object]]  # of (traces, error [m], seed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/how_many_bounds"))
    parser.add_argument("--first", type=int, default=101, help="first seed")
    parser.add_argument("--seeds", type=int, default=3, help="number of seeds")
    parser.add_argument(
        "--fleets", type=Path, default=Path("results/how_many_traces/fleets"), help="folder of simulated fleets"
    )
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    rows = [
        {"source": source, "zone": zone, "seed": seed, "n_traces": n, "error_m": error_m} | figures(n, error_m, seed)
        for source, zone, figures in (*_simulated(args.fleets), *_generated())
        for seed, (n, error_m) in itertools.product(range(args.first, args.first + args.seeds), AIMED_CASES)
    ]
    table = pd.DataFrame(rows)
    table.to_csv(args.out / "rows.csv", index=False)
    print(table_of(table).round(3).to_string())


def table_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Medians over all maps of a case, and the IoU of those that show the closing lane and of those that do not."""
    case = ["source", "error_m", "n_traces"]
    medians = rows.drop(columns=["zone", "seed", "shown"]).groupby(case).median()
    for shown, name in ((True, "shown"), (False, "not_shown")):
        iou = rows.loc[rows["shown"] == shown].groupby(case)["iou"].agg(["median", "size"])
        medians = medians.join(iou.add_prefix("iou_").add_suffix(f"_{name}"))
    return medians


def _simulated(fleets: Path) -> list[tuple[str, str, Figures]]:
    def figures_of(zone: str) -> Figures:
        truth, closed_left = SumoZone(zone).truth, ZONES[zone].work_zone.closed_lanes[0] > 0

        def figures(n: int, error_m: float, seed: int) -> dict[str, object]:
            true = first_equipped(true_traces(zone, seed, cache=fleets), n, seed=seed)
            spec = GnssSpec(error_m=error_m, sampling_interval_s=USUAL_INTERVAL_S)
            return bounds(truth, report(true, spec=spec, seed=seed), closed_left=closed_left)

        return figures

    return [("SUMO", zone, figures_of(zone)) for zone in ZONES_OF_THE_STUDY]


def _generated() -> list[tuple[str, str, Figures]]:
    def figures_of(name: str) -> Figures:
        zone = GENERATED[name]
        truth = truth_of_generated(zone)

        def figures(n: int, error_m: float, seed: int) -> dict[str, object]:
            traces = generated_traces(zone, n, error_m=error_m, interval_s=USUAL_INTERVAL_S, seed=seed)
            return bounds(truth, traces, closed_left=zone.closed_left)

        return figures

    return [("generator", name, figures_of(name)) for name in GENERATED]


def bounds(truth: Truth, traces: pd.DataFrame, *, closed_left: bool) -> dict[str, object]:
    """IoU of the map as it is and with parts put right, and whether its traces show a lane that closes."""
    lanes = map_lanes(traces).lanes
    free, drivable = truth.p_occupied(lanes) < FREE_THRESHOLD, truth.drivable
    narrowest = np.quantile(truth.left - truth.right, 0.05)
    inwards = truth.d - truth.right[:, None] if closed_left else truth.left[:, None] - truth.d
    tapers = inwards > narrowest + NEAR_EDGE_M
    edges = np.minimum(np.abs(inwards), np.abs(inwards - narrowest)) < NEAR_EDGE_M
    return {
        "shown": any(lanes.closed_intervals(lane) for lane in range(len(lanes.lanes))),
        "iou": _iou(free, drivable),
        "iou_true_tapers": _iou(np.where(tapers, drivable, free), drivable),
        "iou_true_edges": _iou(np.where(edges, drivable, free), drivable),
        "tapers_share": float((drivable & tapers).sum() / drivable.sum()),
    }


def _iou(free: BoolArray, drivable: BoolArray) -> float:
    return float((free & drivable).sum() / (free | drivable).sum())


if __name__ == "__main__":
    main()
