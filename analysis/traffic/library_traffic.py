"""The traffic of every zone of the library, one run each: contacts with devices and other vehicles, places of merges.

    python analysis/traffic/library_traffic.py --seed 81 [--scenarios paper right_lane] [--times 3]

Prints a Markdown table; docs/results/library_traffic.md has it. Contact and closed areas are from outlines at every step.
SUMO's own collisions (bumper to bumper, its minimum gap left out) and teleports are from a second run of the same files. The
CPU seconds of the files are those of network, netconvert and demand.
"""

import argparse
import os
import tempfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from wzsumo.metrics.fleet import FleetSummary, summarise_fleet
from wzsumo.metrics.traffic import measure_traffic
from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.files import SumoFiles, write_sumo_files
from wzsumo.simulation.fleet import run_to_end, simulate_fleet
from wzsumo.simulation.trips import read_trips, trips_file

LIBRARY = Path(__file__).parents[2] / "scenarios"
HEADINGS = (
    "zone", "drivers", "files, CPU s", "vehicles", "in the closed area", "overlapping another", "locked", "SUMO's collisions",
    "teleports", "mean delay, s", "merges", "at 10, 50, 90 %, m from the merging taper's start",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=81)
    parser.add_argument(
        "--times",
        type=float,
        default=1.0,
        help="factor on the scenarios' own demand (default 1); with 3 a queue stands wherever a lane closes",
    )
    parser.add_argument("--scenarios", nargs="+", default=sorted(path.stem for path in LIBRARY.glob("*.toml")))
    args = parser.parse_args()
    print("| " + " | ".join(HEADINGS) + " |\n" + "|---" * len(HEADINGS) + "|")
    for name in args.scenarios:
        print("| " + " | ".join(row_of(name, seed=args.seed, times=args.times)) + " |", flush=True)


def row_of(name: str, *, seed: int, times: float) -> list[str]:
    """The table cells of one zone, in the order of HEADINGS, with `times` its scenario's demand."""
    scenario = load_scenario(LIBRARY / f"{name}.toml", seed=seed)
    layout, simulation = scenario.layout(), scenario.zone_simulation()
    demand = simulation.demand.model_copy(update={"flow_vph": times * simulation.demand.flow_vph})
    simulation = simulation.model_copy(update={"demand": demand})
    with tempfile.TemporaryDirectory() as folder:
        began = cpu_seconds()
        files = write_sumo_files(layout, Path(folder), spec=simulation, seed=seed)
        written_s = cpu_seconds() - began
        traces = simulate_fleet(files, on_second=lambda _: None)
        trips = read_trips(trips_file(files))
        collisions, teleports = sumo_statistics(files)
    warm_up_s = simulation.demand.warm_up_s
    summary = measure_traffic(traces, trips, layout, dt=files.step_length, warm_up_s=warm_up_s).summary
    fleet = summarise_fleet(traces, layout)
    return [
        f"`{name}`", simulation.demand.drivers.name, f"{written_s:.1f}", f"{fleet.n_vehicles}", f"{fleet.n_in_closed_area}",
        f"{summary.n_overlapping}",
        "no" if np.isnan(summary.locked_s) else f"{summary.locked_s:.0f} s",
        f"{collisions}", f"{teleports}", f"{summary.mean_delay_s:.1f}", f"{summary.n_merges}",
        merge_quantiles(fleet),
    ]  # fmt: skip


def merge_quantiles(fleet: FleetSummary) -> str:
    """Where 10, 50 and 90 % of the vehicles of closing lanes have merged [m]; empty where no lane closes."""
    return ", ".join(f"{fleet.merge_position_m[key]:.0f}" for key in ("q10", "q50", "q90")) if fleet.merge_position_m else ""


def sumo_statistics(files: SumoFiles) -> tuple[int, int]:
    """(collisions, teleports) that SUMO counts in the same simulation."""
    path = files.config.parent / "statistics.xml"
    counting = ("--collision.action", "warn", "--collision.mingap-factor", "0", "--statistic-output", str(path))
    run_to_end(files, options=counting, on_second=lambda _: None)
    root = ET.parse(path).getroot()  # noqa: S314 SUMO's own file
    safety, teleports = root.findall("safety")[0], root.findall("teleports")[0]
    return int(safety.attrib["collisions"]), int(teleports.attrib["total"])


def cpu_seconds() -> float:
    """CPU time [s] of this process and of those that it waited for."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


if __name__ == "__main__":
    main()
