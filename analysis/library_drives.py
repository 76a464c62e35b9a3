"""Is the drive safe in every zone of the library? Outcome, clearance and conflicts over scenarios, seeds, methods and speeds.

python analysis/library_drives.py --first 21 --seeds 3 --methods swept lanes --speeds 10 zone --out results/library_drives

"zone" is the posted speed; above the paper's 10 m/s the regulated pursuit and the tuned PID drive, for the paper's controllers
are made for that one speed. Rows are appended as they come: a study that was stopped goes on where it was.
"""

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import pandas as pd

from wzsumo.errors import InputError
from wzsumo.study.case import quiet_progress, run_case
from wzsumo.study.scenario import Scenario, load_scenario
from wzsumo.units import mps_from_mph

LIBRARY = Path(__file__).parents[1] / "scenarios"
PAPER_SPEED_MPS = 10.0
KEPT = ("outcome", "reason", "precision", "recall", "iou", "plan_ms", "drive_time_s", "max_cross_track_m")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", nargs="+", default=sorted(path.stem for path in LIBRARY.glob("*.toml")))
    parser.add_argument("--first", type=int, default=21)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--methods", nargs="+", default=["swept", "lanes"])
    parser.add_argument("--speeds", nargs="+", choices=["10", "zone"], default=["10"])
    parser.add_argument("--traces", type=int, help="number of traces used, instead of what each scenario says")
    parser.add_argument("--out", type=Path, default=Path("results/library_drives"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    rows_file = args.out / "rows.csv"
    done = (
        pd.read_csv(rows_file, dtype={"speed": str})
        if rows_file.exists()
        else pd.DataFrame(columns=["scenario", "seed", "speed"])
    )
    for name in args.scenarios:
        for seed in range(args.first, args.first + args.seeds):
            for speed in args.speeds:
                if ((done["scenario"] == name) & (done["seed"] == seed) & (done["speed"] == speed)).any():
                    continue
                scenario = at_speed(load_scenario(LIBRARY / f"{name}.toml", seed=seed), speed, traces=args.traces)
                rows = pd.DataFrame(
                    [{"scenario": name, "seed": seed, "speed": speed} | row for row in drives(scenario, args.methods)]
                )
                rows.to_csv(rows_file, mode="a", header=not rows_file.exists(), index=False)
                print(rows[["scenario", "seed", "speed", "method", "outcome"]].to_string(header=False), file=sys.stderr)
    summarise(pd.read_csv(rows_file, dtype={"speed": str}))


def at_speed(scenario: Scenario, speed: str, *, traces: int | None) -> Scenario:
    crowd = scenario.crowd if traces is None else scenario.crowd.model_copy(update={"used": traces})
    if speed == "10":
        control = scenario.control.model_copy(update={"target_speed_mps": PAPER_SPEED_MPS})
        return scenario.model_copy(update={"crowd": crowd, "control": control})
    wanted = mps_from_mph(scenario.work_zone.posted_speed_mph)
    fast = {"target_speed_mps": wanted, "lateral": "regulated", "longitudinal": "tuned"}
    return scenario.model_copy(update={
        "crowd": crowd,
        "control": scenario.control.model_copy(update=fast),
        "planner": scenario.planner.model_copy(update={"planned_speed_mps": wanted}),
    })  # fmt: skip


def drives(scenario: Scenario, methods: list[str]) -> list[dict[str, Any]]:
    """One row a method."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            result = run_case(scenario, Path(folder), methods=methods, progress=quiet_progress)
        except InputError as error:
            return [{"method": method, "outcome": "REFUSED", "reason": str(error)} for method in methods]
    return [
        {"method": method}
        | {name: figures[name] for name in KEPT}
        | {f"{stage}_{key}": value for stage in ("planned", "driven", "drive") for key, value in (figures[stage] or {}).items()}
        | {"n_in_closed_area": result["fleet"]["n_in_closed_area"]}
        for method, figures in result["methods"].items()
    ]


def summarise(table: pd.DataFrame) -> None:
    for (speed, method), part in table.groupby(["speed", "method"]):
        outcomes = part["outcome"].value_counts().to_dict()
        print(f"\n{method} at {'10 m/s' if speed == '10' else 'the posted speed'}, n = {len(part)}: {outcomes}")
        columns = ["driven_min_clearance_devices_m", "drive_min_ttc_s", "drive_max_drac_mps2", "max_cross_track_m"]
        print(part.groupby("scenario")[columns].agg(["min", "max"]).round(2).to_string())


if __name__ == "__main__":
    main()
