"""How maps turn out where everything is drawn at random: kinds, drivers, receivers, sampling and what is told of the road.

    python analysis/lane_map/drawn.py --first 400 --seeds 80 [--mode joined alone] --out results/drawn

A seed draws one kind of kinds.py (but `long`), 5 to 200 vehicles, one to three sorts of receivers of 0.1 to 4 m with constant,
slow and white errors, habits of drivers, a fix in 0.1 to 5 s, and, joined, an announcement up to 300 m off and a common error
of up to 2.2 m; alone no common error, for nothing tells it. Writes rows.csv in --out, a row a map as they come, and prints how
many maps are below a precision of 0.9 and an IoU of 0.7, by mode and number of traces.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from cases import Case
from drivers import Traffic
from kinds import KINDS
from lane_map_tables import table_of_drawn
from measure import row_of
from receivers import Crowd, Receiver

COUNTS = (5, 10, 20, 30, 50, 100, 200)
KEPT = ("precision", "recall", "iou", "fixes_on_free", "ece", "ece_unsure", "cpu_s", "error")
SHORT_M = 1000.0


def main() -> None:
    """Draw and map; see the module's text."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=1, help="first seed; 0 to 340 are development seeds")
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--mode", nargs="+", default=["joined", "alone"], choices=["joined", "alone"])
    parser.add_argument("--out", type=Path, default=Path("results/drawn"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    path = args.out / "rows.csv"
    known = set(pd.read_csv(path)[["seed", "mode"]].itertuples(index=False, name=None)) if path.exists() else set()
    for seed in range(args.first, args.first + args.seeds):
        for mode in args.mode:
            if (seed, mode) not in known:
                row = drawn_map(seed, joined=mode == "joined")
                pd.DataFrame([row]).to_csv(path, mode="a", header=not path.exists(), index=False)
                print(*(row[key] for key in ("seed", "mode", "kind", "n", "precision", "iou")), file=sys.stderr)
    rows = pd.read_csv(path)
    failed = rows["error"].notna()  # counts as wrong all over
    print(table_of_drawn(rows.assign(code="now", precision=rows["precision"].mask(failed, 0.0))))


def drawn_map(seed: int, *, joined: bool) -> dict[str, Any]:
    """What was drawn for a seed, and the figures of its map."""
    case, drawn = drawn_case(seed, joined=joined)
    made = row_of(case, joined=joined, method="lanes", seed=seed)
    return {"seed": seed, "mode": "joined" if joined else "alone", **drawn, **{key: made.get(key) for key in KEPT}}


def drawn_case(seed: int, *, joined: bool) -> tuple[Case, dict[str, Any]]:
    """(traces with road and truth, what was drawn as words and numbers) of a seed; alone, positions have no common error."""
    random = np.random.default_rng([seed, 777])
    kind = str(random.choice([name for name in KINDS if name != "long"]))
    n, interval_s = int(random.choice(COUNTS)), float(random.choice([0.1, 1.0, 1.0, 2.0, 3.0, 5.0]))
    receivers, traffic = _receivers(random), _traffic(random)
    offset = float(random.uniform(-2.2, 2.2)) if random.random() < 0.4 else 0.0
    told = float(random.choice([-300.0, -100.0, 100.0, 300.0])) if random.random() < 0.4 else 0.0
    length_m = KINDS[kind].layout(np.random.default_rng([seed + 5000, 99])).length
    told = told if length_m > SHORT_M else 0.0  # on a short road the zone would be announced beyond its end
    fault = str(random.choice(["jump", "stray", "half_change"])) if random.random() < 0.25 else ""
    states = bool(random.random() < 0.3)
    case = replace(KINDS[kind], traffic=traffic).case(
        n=n, seed=seed + 5000, receivers=receivers, interval_s=interval_s, announced_shift_m=told, states_accuracy=states,
        common_offset_m=offset if joined else 0.0, faults=(fault,) if fault else (),
    )  # fmt: skip
    words = " ".join(f"{share:.2f}x{one.error:.2f}m" for share, one in receivers)
    drawn = {"interval_s": interval_s, "receivers": words, "offset_m": round(offset, 2), "announced_m": told, "fault": fault}
    return case, {"kind": kind, "n": n} | drawn


def _receivers(random: np.random.Generator) -> Crowd:
    sorts, drifts_s = int(random.integers(1, 4)), float(random.choice([5.0, 20.0, 60.0, 200.0, 600.0]))
    shares = random.dirichlet(np.full(sorts, 2.0))
    found = []
    for share, constant in zip(shares, random.uniform(0.0, 0.9, sorts), strict=True):
        error = float(np.exp(random.uniform(np.log(0.1), np.log(4.0))))
        drifting, bursts = float(random.uniform(0.0, 1.0 - constant)), bool(random.random() < 0.15)
        one = Receiver(error=error, constant=float(constant), drifting=drifting, drifts_s=drifts_s, bursts=bursts)
        found.append((float(share), one))
    return tuple(found)


def _traffic(random: np.random.Generator) -> Traffic:
    wander, change = np.sort(random.uniform(0.1, 0.45, 2)), random.uniform(25.0, 120.0)
    return Traffic(
        changes_per_km=float(random.choice([0.0, 0.1, 0.3, 1.0])), lane_evenness=float(random.choice([0.8, 2.0, 4.0, 10.0])),
        ramp_share=float(random.uniform(0.1, 0.5)), speed_factor=float(random.choice([0.3, 0.7, 1.0, 1.1])),
        partial_share=float(random.choice([0.0, 0.0, 0.3, 0.6])), habit=float(random.uniform(0.05, 0.3)),
        wander=(float(wander[0]), float(wander[1])), wander_along=float(random.uniform(30.0, 150.0)),
        change=(change, change + float(random.uniform(10.0, 120.0))),
        leaves_ahead=float(random.choice([100.0, 300.0, 800.0, 1500.0])), returning_share=float(random.uniform(0.0, 1.0)),
        returns_after=float(random.choice([50.0, 300.0, 800.0])),
    )  # fmt: skip


if __name__ == "__main__":
    main()
