"""How well maps of the kinds turn out: a row a map, the maps made as `wzsumo map` makes them.

    python analysis/lane_map/measure.py --out results/lane_map [--kinds left right us101 sumo_paper] [--receivers 0.5 mixed]
        [--n 5 30] [--seeds 3] [--first 1] [--mode alone joined] [--method lanes] [--variants exact late_300 offset_1.5]

Kinds are those of kinds.py, of real vehicles where --real has them (real_traffic.py), and `sumo_...` zones of the library,
whose fleets are kept in --fleets (sumo_kinds.py). VARIANTS below are arguments of `Kind.case` by name. Seeds 1 to 80 are for
development. Writes into --out rows.csv, one row a map as they come (a study that was stopped goes on where it was), and
table.csv: medians and least values by kind, receivers, n, variant and mode, with 95 % intervals of the medians that resample
seeds. One process.
"""

import argparse
import itertools
import json
import sys
import time
import traceback
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from bars import FAULT
from cases import Case
from kinds import KINDS, Kind
from map_scores import calibration_errors, scores
from real_traffic import RealKind, real_kinds
from receivers import RECEIVERS
from sumo_kinds import NAMES, SumoKind, sumo_kinds

from wzsumo.case.methods import DEFAULT_METHOD
from wzsumo.case.traces_map import crowd_method, map_of_traces
from wzsumo.case.watch import quiet_progress
from wzsumo.crowd_mapping.cleaning.usable_traces import usable_traces
from wzsumo.errors import InputError
from wzsumo.scenario.road_before import check_on_road

VARIANTS: dict[str, dict[str, Any]] = {
    "exact": {},
    "early_100": {"announced_shift_m": -100.0},
    "early_300": {"announced_shift_m": -300.0},
    "late_100": {"announced_shift_m": 100.0},
    "late_300": {"announced_shift_m": 300.0},
    "offset_1": {"common_offset_m": 1.0},
    "offset_1.5": {"common_offset_m": 1.5},
    "offset_2": {"common_offset_m": 2.0},
    "road_5m_off": {"road_offset_m": 5.0},
    "jump": {"faults": ("jump",)},
    "stray": {"faults": ("stray",)},
    "half_change": {"faults": ("half_change",)},
    "truck_1": {"faults": ("truck1",)},
    "truck_2": {"faults": ("truck2",)},
    "stated": {"states_accuracy": True},
    "sampled_100Hz": {"interval_s": 0.01},
    "sampled_10Hz": {"interval_s": 0.1},
    "sampled_3s": {"interval_s": 3.0},
    "sampled_10s": {"interval_s": 10.0},
    "sampled_30s": {"interval_s": 30.0},
}
AnyKind = Kind | RealKind | SumoKind
KEYS = ["kind", "receivers", "n", "variant", "seed", "mode", "method"]
FIGURES = ["precision", "recall", "iou", "fixes_on_free", "fixes_on_occupied", "ece", "ece_unsure", "unsure_share"]
SAID = {"fixes_on_free_share": "said_on_free", "fixes_on_occupied_share": "said_on_occupied"}  # by the map of its own fixes
COLUMNS = [*KEYS, *FIGURES, *SAID.values(), "n_used", "cpu_s", "open_lanes", "warnings", "error", "reliability"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/lane_map"))
    parser.add_argument("--kinds", nargs="+", default=list(KINDS))
    parser.add_argument("--real", type=Path, default=Path("results/real"), help="folder of trips of real vehicles")
    parser.add_argument("--fleets", type=Path, default=Path("results/fleets"), help="folder of SUMO's fleets")
    parser.add_argument("--receivers", nargs="+", default=["0.5", "mixed"], choices=list(RECEIVERS))
    parser.add_argument("--n", nargs="+", type=int, default=[5, 10, 30, 100])
    parser.add_argument("--seeds", type=int, default=3, help="number of seeds")
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--mode", nargs="+", default=["alone", "joined"], choices=["alone", "joined"])
    parser.add_argument("--variants", nargs="+", default=["exact"], choices=list(VARIANTS))
    parser.add_argument("--method", default=DEFAULT_METHOD)
    parser.add_argument("--tables-only", action="store_true", help="make the table of the rows that there are")
    args = parser.parse_args()
    kinds = kinds_named(args.kinds, real=args.real, fleets=args.fleets)
    args.out.mkdir(parents=True, exist_ok=True)
    path = args.out / "rows.csv"
    if not args.tables_only:
        seeds = range(args.first, args.first + args.seeds)
        wanted = itertools.product(seeds, args.kinds, args.receivers, args.n, args.variants)
        measure(path, wanted, kinds=kinds, modes=args.mode, method=args.method)
    table = table_of(pd.read_csv(path, dtype={"receivers": str}))
    table.to_csv(args.out / "table.csv", index=False)
    print(table[[*GROUP, "maps", "failed", "precision", "precision_least", "iou", "iou_least"]].to_string(index=False))


def kinds_named(names: Iterable[str], *, real: Path, fleets: Path) -> dict[str, AnyKind]:
    """The kinds of these names. Raises ValueError with all names where there is none."""
    known: dict[str, AnyKind] = {**KINDS, **real_kinds(real)}
    if any(name.startswith("sumo_") for name in names):
        known |= sumo_kinds(fleets)
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(f"kinds {unknown}: unknown; known are {', '.join(known)} and sumo_{', sumo_'.join(NAMES)}")
    return {name: known[name] for name in names}


def measure(
    path: Path,
    wanted: Iterable[tuple[int, str, str, int, str]],
    *,
    kinds: Mapping[str, AnyKind],
    modes: Iterable[str],
    method: str,
) -> None:
    """Append to the rows at `path` those that are not there yet; `wanted` are (seed, kind, receivers, n, variant)."""
    there = pd.read_csv(path, dtype={"receivers": str}) if path.exists() else pd.DataFrame(columns=COLUMNS)
    if list(there) != COLUMNS:  # written by another version of this script
        there.reindex(columns=COLUMNS).to_csv(path, index=False)
    known = set(there[KEYS].itertuples(index=False, name=None))
    for seed, kind, receivers, n, variant in wanted:
        keys = {mode: (kind, receivers, n, variant, seed, mode, method) for mode in modes}
        missing = {mode: key for mode, key in keys.items() if key not in known}
        if not missing:
            continue
        case = kinds[kind].case(n=n, seed=seed, receivers=receivers, **VARIANTS[variant])
        for mode, key in missing.items():
            row = dict(zip(KEYS, key, strict=True)) | row_of(case, joined=mode == "joined", method=method, seed=seed)
            pd.DataFrame([row], columns=COLUMNS).to_csv(path, mode="a", header=not path.exists(), index=False)
            precision, iou = row.get("precision", np.nan), row.get("iou", np.nan)
            print(f"{'/'.join(map(str, key))}: P {precision:.3f} IoU {iou:.3f} {row.get('error', '')}", file=sys.stderr)


def row_of(case: Case, *, joined: bool, method: str, seed: int) -> dict[str, Any]:
    """The figures of the map of a case, or the text of the error where there is none.

    A refusal of the input and a fault of ours both count as a failed map; the latter's text begins with `fault: `.
    """
    before = case.before() if joined else None
    start = time.process_time()
    try:
        usable = usable_traces(case.traces, source="traces").traces
        if before:
            check_on_road(usable, before, source="traces", road_source="road")
        made = map_of_traces(
            usable,
            crowd_method(method, road=None),
            source="traces",
            seed=seed,
            resolution_m=case.resolution_m,
            before=before,
            progress=quiet_progress,
        )
    except InputError as error:
        return {"error": str(error), "cpu_s": time.process_time() - start}
    except Exception:  # noqa: BLE001 - a study counts the crashes of a method instead of ending with the first
        text = FAULT + traceback.format_exc(limit=-2).replace("\n", " | ")
        return {"error": text, "cpu_s": time.process_time() - start}
    cpu_s = time.process_time() - start
    learned = made.figures
    return scores(made.grid, case.drivable, case.scored, usable) | {
        "n_used": usable["vehicle_id"].nunique(),
        "cpu_s": cpu_s,
        "open_lanes": learned.get("open_lanes"),
        "warnings": " | ".join(map(str, learned.get("warnings", []))),
        **{column: learned.get(key) for key, column in SAID.items()},
    }


GROUP = ["kind", "receivers", "n", "variant", "mode", "method"]


def table_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Medians by group with 95 % intervals over seeds and least values; a failed map counts as precision 0 and IoU 0."""
    out = []
    for key, part in rows.groupby(GROUP, sort=False):
        failed = part["error"].notna()
        row: dict[str, object] = dict(zip(GROUP, key, strict=True)) | {"maps": len(part), "failed": int(failed.sum())}
        for name in ("precision", "iou"):
            # A map without free ground has no precision: nothing that it frees is wrong.
            values = part[name].mask(failed, 0.0).fillna(1.0).to_numpy()
            low, high = _interval_of_median(values)
            row |= {name: np.median(values), f"{name}_least": values.min(), f"{name}_low": low, f"{name}_high": high}
        row |= {name: part[name].median() for name in ("fixes_on_free", "fixes_on_occupied", "ece", "ece_unsure", "cpu_s")}
        row |= dict(zip(("ece_zone", "ece_unsure_zone"), _calibration_of(part["reliability"]), strict=True))
        out.append(row)
    return pd.DataFrame(out).round(4)


def _calibration_of(texts: pd.Series) -> tuple[float, float]:
    """Expected calibration errors, over all cells and over unsure ones, of the maps of a group together."""
    sums = [json.loads(text) for text in texts.dropna()]
    return calibration_errors(np.sum(sums, axis=0)) if sums else (float("nan"), float("nan"))


def _interval_of_median(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> tuple[float, float]:
    """95 % bootstrap interval of the median; a group has one map a seed, so resampled maps are resampled seeds."""
    drawn = np.random.default_rng(0).choice(values, (2000, len(values)))
    low, high = np.quantile(np.median(drawn, axis=1), [0.025, 0.975])
    return float(low), float(high)


if __name__ == "__main__":
    main()
