"""Speed of the toolkit's simulation beside SUMO's own binary on the same files, in vehicle updates per CPU second.

    python analysis/benchmarks/traffic.py [--scenario scenarios/paper.toml] [--repeats 3]

A vehicle update is one vehicle in one step. CPU seconds are user + system of the whole step, network and demand left out. The
binary runs twice: as it is, and with the outputs that the toolkit needs (FCD of every vehicle in every step as Parquet, trips
with emissions). Runs take turns, so that a load on the machine falls on all of them.
"""

import argparse
import os
import statistics
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.connection import sumo_binary
from wzsumo.simulation.files import SumoFiles, write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.simulation.session import running
from wzsumo.simulation.trips import TRIP_OPTIONS

SEED = 21


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", type=Path, default=Path(__file__).parents[2] / "scenarios" / "paper.toml")
    parser.add_argument("--repeats", type=int, default=3)
    args = parser.parse_args()
    scenario = load_scenario(args.scenario, seed=SEED)
    with tempfile.TemporaryDirectory() as folder:
        files = write_sumo_files(scenario.layout(), Path(folder), spec=scenario.zone_simulation(), seed=SEED)
        updates = len(simulate_fleet(files, on_second=lambda _: None))
        fcd = ("--fcd-output", f"{folder}/fcd.parquet", "--fcd-output.attributes", "x,y,angle,speed,type", "--precision", "3")
        logged = (*fcd, "--tripinfo-output", f"{folder}/trips.xml", *TRIP_OPTIONS)
        ways: dict[str, Callable[[], float]] = {
            "SUMO binary": lambda: cpu_of(lambda: run_binary(files, ())),
            "libsumo, stepping only": lambda: cpu_of(lambda: step_through(files)),
            "SUMO binary, same outputs": lambda: cpu_of(lambda: run_binary(files, logged)),
            "toolkit, traces of the fleet": lambda: cpu_of(lambda: simulate_fleet(files, on_second=lambda _: None)),
        }
        cpu: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(args.repeats):
            for name, run in ways.items():
                cpu[name].append(run())
    print(f"{args.scenario.name}, seed {SEED}: {updates} vehicle updates, {args.repeats} repeats, median [least, greatest]")
    for name, spent in cpu.items():
        beside = cpu["SUMO binary, same outputs" if "traces" in name or "same" in name else "SUMO binary"]
        ratio = statistics.median(beside) / statistics.median(spent)
        print(
            f"  {name:<30} {updates / statistics.median(spent):>8.0f} updates/CPU s   "
            f"{statistics.median(spent):5.2f} s [{min(spent):.2f}, {max(spent):.2f}]   {ratio:5.0%} of the binary's speed"
        )


def step_through(files: SumoFiles) -> None:
    with running(files.config) as session:
        for _ in range(round(files.duration / files.step_length)):
            session.step()


def cpu_of(work: Callable[[], object]) -> float:
    began = cpu_seconds()
    work()
    return cpu_seconds() - began


def cpu_seconds() -> float:
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def run_binary(files: SumoFiles, options: tuple[str, ...]) -> None:
    subprocess.run([str(sumo_binary("sumo")), "-c", str(files.config), *options], check=True, capture_output=True)


if __name__ == "__main__":
    main()
