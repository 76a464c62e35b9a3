"""The traffic of every zone of the library, one run each: contacts with devices and other vehicles, locks, places of merges.

    python analysis/traffic/library_traffic.py --first 151 --seeds 3 [--scenarios paper right_lane] [--times 3]

Adds a row a run to the CSV file --out, seed after seed over all zones; a run that the file has is not repeated. Prints the
file as a Markdown table, one line a zone and demand; docs/results/library_traffic.md has it. Contact and closed areas are from
outlines at every step. SUMO's teleports are switched off.
"""

import argparse
import csv
import tempfile
from pathlib import Path
from typing import Any

import pandas as pd

from wzsumo.metrics.fleet import summarise_fleet
from wzsumo.metrics.traffic import measure_traffic
from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.files import write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.simulation.trips import read_trips, trips_file

LIBRARY = Path(__file__).parents[2] / "scenarios"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/library_traffic.csv"), help="the CSV file of runs")
    parser.add_argument("--first", type=int, default=151, help="first seed")
    parser.add_argument("--seeds", type=int, default=1, help="number of seeds")
    parser.add_argument(
        "--times",
        type=float,
        default=1.0,
        help="factor on the scenarios' own demand (default 1); with 3 a queue stands wherever a lane closes",
    )
    parser.add_argument("--scenarios", nargs="+", default=sorted(path.stem for path in LIBRARY.glob("*.toml")))
    args = parser.parse_args()
    for seed in range(args.first, args.first + args.seeds):
        for name in args.scenarios:
            case = {"zone": name, "times": args.times, "seed": seed}
            if not is_done(case, args.out):
                append_row(case | measure_zone(name, seed=seed, times=args.times), args.out)
    print(table_of(pd.read_csv(args.out)))


def measure_zone(name: str, *, seed: int, times: float) -> dict[str, Any]:
    """The figures of one run of a zone with `times` its scenario's demand."""
    scenario = load_scenario(LIBRARY / f"{name}.toml", seed=seed)
    layout, simulation = scenario.layout(), scenario.zone_simulation()
    demand = simulation.demand.model_copy(update={"flow_vph": times * simulation.demand.flow_vph})
    simulation = simulation.model_copy(update={"demand": demand})
    with tempfile.TemporaryDirectory() as folder:
        files = write_sumo_files(layout, Path(folder), spec=simulation, seed=seed)
        traces = simulate_fleet(files, on_second=lambda _: None)
        trips = read_trips(trips_file(files))
    measures = measure_traffic(traces, trips, layout, dt=files.step_length, warm_up_s=demand.warm_up_s)
    fleet, summary, vehicles = summarise_fleet(traces, layout), measures.summary, measures.vehicles
    passed = vehicles["travel_time_s"].notna()
    queued = measures.minutes["time_s"] >= summary.breakdown_s
    return {
        "asked": summary.n_vehicles, "entered": fleet.n_vehicles, "waiting": summary.n_waiting,
        "in_closed_area": fleet.n_in_closed_area, "overlapping": summary.n_overlapping,
        "locked_s": summary.locked_s, "locked_station_m": summary.locked_station_m,
        "ttc_below_1.5_s": summary.n_ttc_conflicts, "pet_below_1_s": summary.n_pet_conflicts,
        "throughput_vph": round(summary.throughput_vph, 0), "mean_delay_s": round(summary.mean_delay_s, 1),
        "queue_speed_mps": round(measures.minutes.loc[queued, "upstream_speed_mps"].mean(), 1),
        "merges": summary.n_merges, **{key: round(value) for key, value in fleet.merge_position_m.items()},
        "in_closing_lane_at_taper": round((vehicles.loc[passed, "merge_position_m"] > 0).mean(), 3),
    }  # fmt: skip


def is_done(case: dict[str, Any], path: Path) -> bool:
    """Whether the file has a row of this case."""
    if not path.exists():
        return False
    with path.open(newline="") as file:
        return any(all(row[key] == str(value) for key, value in case.items()) for row in csv.DictReader(file))


def append_row(row: dict[str, Any], path: Path) -> None:
    """Append a row, with a header where the file is new."""
    columns = [*row] if "q10" in row else [*row, "q10", "q50", "q90"]
    known = path.read_text().splitlines()[0].split(",") if path.exists() else columns
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=known)
        if file.tell() == 0:
            writer.writeheader()
        writer.writerow(row)


def table_of(rows: pd.DataFrame) -> str:
    """Markdown, a line a zone and demand: sums over its seeds, and means over those whose traffic did not lock."""
    lines = [
        "| zone | demand | n | asked, entered, waiting | in the closed area | overlapping another | locked runs | TTC < 1.5 s "
        "| PET < 1 s | veh/h past the work | mean delay, s | merged at 10, 50, 90 %, m from the first merging taper's start |",
        "|---" * 12 + "|",
    ]
    for (zone, times), part in rows.groupby(["zone", "times"]):
        flowed = part[part["locked_s"].isna()]
        total, mean = part.sum(numeric_only=True), flowed.mean(numeric_only=True)
        merged = "" if flowed["q50"].isna().all() else f"{mean['q10']:.0f}, {mean['q50']:.0f}, {mean['q90']:.0f}"
        line = (
            f"| `{zone}` | {times:g} | {len(part)} | {total['asked']:.0f}, {total['entered']:.0f}, {total['waiting']:.0f} | "
            f"{total['in_closed_area']:.0f} | {total['overlapping']:.0f} | {part['locked_s'].notna().sum()} | "
            f"{total['ttc_below_1.5_s']:.0f} | {total['pet_below_1_s']:.0f} | {mean['throughput_vph']:,.0f} | "
            f"{mean['mean_delay_s']:.1f} | {merged} |"
        )
        lines.append(line.replace(" nan ", " - "))
    return "\n".join(lines)


if __name__ == "__main__":
    main()
