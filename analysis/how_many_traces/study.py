"""How many traces a crowd map takes: its quality over number of traces, GNSS error and sampling interval, on SUMO fleets.

    python analysis/how_many_traces/study.py --out results/how_many_traces [--first 81] [--seeds 10] [--zones straight bend]

Each `lanes` map is made twice: of the traces alone, and joined to the road from before the zone (its lanes, and where the zone
is announced). Every fleet is simulated once and kept. Writes into --out: rows.csv, one row a map, as they come (a study that
was stopped goes on where it was); table.csv, medians with 95 % intervals; waiting.csv, minutes until so many equipped vehicles
have passed; how_many_traces.png and reliability.png. docs/results/ has table.csv as how_many_traces.csv and waiting.csv as
how_many_waiting.csv.
"""

import argparse
import itertools
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from figures import draw_quality, draw_reliability
from scipy.stats import bootstrap, gamma
from scores import SumoZone, calibration_errors
from zones import ZONES, true_traces

from wzsumo.crowd_mapping.lanes.lane_mapping import map_lanes
from wzsumo.sensing.equipped import choose_equipped
from wzsumo.sensing.gnss import GnssSpec, report

COUNTS = (1, 2, 3, 5, 10, 20, 30, 100)
ERRORS_M, ERRORS_ALONE_M = (0.0, 0.5, 1.0, 2.0), (0.0, 1.0, 2.0)
AIMED_COUNTS = (5, 10, 30, 100)
AIMED_CASES = ((5, 0.0), (10, 0.0), (30, 1.0), (100, 2.0))  # (traces, error [m]) for which an aim was set beforehand
USUAL_INTERVAL_S = 1.0
OTHER_INTERVALS_S, SAMPLED_COUNTS, SAMPLED_ERRORS_M = (0.1, 3.0), (5, 30), (0.0, 1.0)
PLANNED_CASES = {(5, 0.0), (30, 1.0), (100, 2.0)}  # on whose joined maps, at the usual interval, paths are planned
ZONES_OF_THE_STUDY = ("straight", "bend", "one_lane", "right_closed")
KEYS = ["zone", "seed", "n_traces", "error_m", "interval_s", "map"]
FIGURES = ["precision", "recall", "iou", "edge_error_m", "precision_even", "iou_even"]
COLUMNS = [
    *KEYS, *FIGURES, "brier", "brier_binary", "never_driven", "plan", "min_clearance_devices_m", "min_clearance_road_edge_m",
    "closed_area_share", "reliability",
]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/how_many_traces"))
    parser.add_argument("--first", type=int, default=81, help="first seed; 1-80 are development seeds")
    parser.add_argument("--seeds", type=int, default=10, help="number of seeds")
    parser.add_argument("--zones", nargs="+", default=ZONES_OF_THE_STUDY, choices=list(ZONES))
    parser.add_argument("--maps", nargs="+", default=("joined", "alone"), choices=("joined", "alone"))
    parser.add_argument(
        "--full-seeds", type=int, default=10, help="number of seeds with every case; the others have the aimed cases only"
    )
    parser.add_argument("--planned-seeds", type=int, default=3, help="number of seeds on whose maps paths are planned")
    parser.add_argument("--fleets", type=Path, help="folder of simulated fleets; default: OUT/fleets")
    parser.add_argument("--tables-only", action="store_true", help="make tables and figures of the rows that there are")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    path = args.out / "rows.csv"
    seeds = range(args.first, args.first + (0 if args.tables_only else args.seeds))
    # The aimed cases come first for all seeds: a study that was stopped has them.
    in_order = [
        (cases, seed, zone)
        for number, cases in enumerate(_groups_of_cases())
        for seed, zone in itertools.product(seeds if number == 0 else seeds[: args.full_seeds], args.zones)
    ]
    for cases, seed, zone in in_order:
        known = {tuple(row) for row in pd.read_csv(path)[KEYS].itertuples(index=False)} if path.exists() else set()
        missing = [case for case in cases if case[-1] in args.maps and (zone, seed, *case) not in known]
        if missing:
            scored = SumoZone(zone)
            fleet = true_traces(zone, seed, cache=args.fleets or args.out / "fleets")
            for case in missing:
                planned = seed < args.first + args.planned_seeds
                row = dict(zip(KEYS, (zone, seed, *case), strict=True)) | _row(scored, fleet, *case, seed=seed, planned=planned)
                pd.DataFrame([row], columns=COLUMNS).to_csv(path, mode="a", header=not path.exists(), index=False)
            print(f"{zone} {seed}: {len(missing)} maps", file=sys.stderr)
    rows = pd.read_csv(path)
    table = table_of(rows)
    table.to_csv(args.out / "table.csv", index=False)
    _waiting().to_csv(args.out / "waiting.csv", index=False)
    usual = rows[rows["interval_s"] == USUAL_INTERVAL_S]
    draw_quality(usual, args.out / "how_many_traces.png")
    draw_reliability(usual, args.out / "reliability.png")


def _groups_of_cases() -> list[list[tuple[int, float, float, str]]]:
    """Cases (traces, error [m], interval [s], joined or alone) in groups, of which the first is made for all seeds."""
    joined = list(itertools.product(COUNTS, ERRORS_M, (USUAL_INTERVAL_S,), ("joined",)))
    aimed = [case for case in joined if case[0] in AIMED_COUNTS and case[1] in ERRORS_ALONE_M]
    aimed += [(n, error_m, USUAL_INTERVAL_S, "alone") for n, error_m in AIMED_CASES]
    alone = list(itertools.product(COUNTS, ERRORS_ALONE_M, (USUAL_INTERVAL_S,), ("alone",)))
    sampled = list(itertools.product(SAMPLED_COUNTS, SAMPLED_ERRORS_M, OTHER_INTERVALS_S, ("joined",)))
    return [aimed, joined, sampled, alone]


def _row(
    scored: SumoZone, fleet: pd.DataFrame, n: int, error_m: float, interval_s: float, which: str, *, seed: int, planned: bool
) -> dict[str, object]:
    """The figures of the `lanes` map of the first n equipped vehicles."""
    true = first_equipped(fleet, n, seed=seed)
    reported = report(true, spec=GnssSpec(error_m=error_m, sampling_interval_s=interval_s), seed=seed)
    lanes = map_lanes(reported, before=scored.before if which == "joined" else None).lanes
    plan = planned and which == "joined" and interval_s == USUAL_INTERVAL_S and (n, error_m) in PLANNED_CASES
    return scored.truth.row(lanes) | {"never_driven": scored.never_driven(true)} | (scored.planned(lanes) if plan else {})


def first_equipped(fleet: pd.DataFrame, n: int, *, seed: int) -> pd.DataFrame:
    """The true traces of the first n equipped vehicles of a fleet."""
    chosen = choose_equipped(pd.Index(fleet["vehicle_id"].unique()), penetration=1.0, seed=seed)[:n]
    return fleet[fleet["vehicle_id"].isin(chosen)]


def table_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Medians over zones and seeds with 95 % bootstrap intervals over maps; calibration over all maps of a row together."""
    out = []
    for key, part in rows.groupby(KEYS[2:]):
        row = dict(zip(KEYS[2:], key, strict=True)) | {"n_maps": len(part)}
        for name in FIGURES:
            values = part[name].dropna().to_numpy()
            row[name] = float(np.median(values)) if len(values) else float("nan")
            if len(values) > 1 and np.ptp(values) > 0:
                drawn = bootstrap((values,), np.median, method="percentile", rng=np.random.default_rng(0))
                row[f"{name}_low"], row[f"{name}_high"] = drawn.confidence_interval
        row["calibration_error"], row["calibration_error_unsure"] = calibration_errors(part["reliability"])
        row |= {name: part[name].mean() for name in ("brier", "brier_binary", "never_driven") if name in part}
        out.append(row | (_plans_of(part) if "plan" in part else {}))
    return pd.DataFrame(out)


def _plans_of(part: pd.DataFrame) -> dict[str, object]:
    """What became of the paths that were planned on the maps of a row."""
    plans = part.dropna(subset=["plan"])
    return {
        "n_plans": len(plans),
        "n_paths": int(plans["closed_area_share"].notna().sum()),
        "paths_in_closed_area": int((plans["closed_area_share"] > 0).sum()),
        "least_clearance_m": plans["min_clearance_devices_m"].min(),
    }


def _waiting() -> pd.DataFrame:
    """Minutes until n equipped vehicles have passed: with Poisson arrivals the quantiles of a gamma distribution."""
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


if __name__ == "__main__":
    main()
