"""The whole LiDAR baseline of the paper's drive: ms a scan (cast, SMRF, LOAM, maps), CPU time of its two threads, memory.

    python analysis/benchmarks/lidar_chain.py [--seed 1]

The sensor turns ten times a second: real time is 100 ms a scan.
"""

import argparse
import os
import resource
import tempfile
import time
from pathlib import Path

from wzsumo.case.lidar_baseline import map_by_lidar
from wzsumo.lidar_mapping import slam_map
from wzsumo.scenario.scenario import load_scenario
from wzsumo.scenario.sections import SlamSpec
from wzsumo.scenario.site import prepare_site
from wzsumo.sensing import raycast
from wzsumo.simulation.fleet import simulate_fleet

PAPER = Path(__file__).parents[2] / "scenarios" / "paper.toml"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    scenario = load_scenario(PAPER, seed=parser.parse_args().seed)
    site = prepare_site(scenario)
    with tempfile.TemporaryDirectory() as folder:
        files = scenario.write_sumo_files(Path(folder))
        fleet = simulate_fleet(files, on_second=lambda _: None)
    slam_map.compile_kernels()
    raycast.compile_kernels()
    before_gib = peak_gib()
    wall, cpu, mapping = time.perf_counter(), time.process_time(), time.thread_time()
    baseline = map_by_lidar(fleet, SlamSpec(), scenario=scenario, site=site, on_share=lambda _: None)
    wall, cpu, mapping = time.perf_counter() - wall, time.process_time() - cpu, time.thread_time() - mapping
    n = len(baseline.poses)
    print(
        f"{n} scans in {wall:.1f} s: {1000 * wall / n:.0f} ms a scan (real time: 100); load {os.getloadavg()[0]:.1f} at the end"
    )
    threads = f"mapping {1000 * mapping / n:.0f}, casting {1000 * (cpu - mapping) / n:.0f}"
    print(f"CPU {1000 * cpu / n:.0f} ms a scan on two threads side by side: {threads}")
    print(f"peak memory {peak_gib():.2f} GiB, of which fleet and program {before_gib:.2f}")
    print(f"position error {baseline.ate_m:.3f} m rms, dead reckoning {baseline.dead_reckoning_ate_m:.3f} m")
    print(f"devices found {len(baseline.maps.devices)} of {len(site.layout.devices)}; scans by state {baseline.states}")


def peak_gib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


if __name__ == "__main__":
    main()
