"""What missing, tilted and lying devices, and poor detection, do to the strongest LiDAR map.

    python analysis/lidar_faults.py [--scenario scenarios/paper.toml] [--seeds 21] [--out results/lidar_faults.csv]
                                    [--rate-hz 10] [--azimuth-count 1800]

One SUMO fleet a seed, one mapping drive a fault. Rows are written as they come; what is there already is not run again.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from wzsumo.lidar_mapping import slam_map
from wzsumo.metrics.map_quality import quality_of_cells
from wzsumo.sensing import raycast
from wzsumo.simulation.files import write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet
from wzsumo.study.baselines import map_baselines
from wzsumo.study.case import plan_for, quiet_progress
from wzsumo.study.goals import goal_figures
from wzsumo.study.guides import nominal_guide
from wzsumo.study.scenario import load_scenario
from wzsumo.study.site import prepare_site
from wzsumo.study.slam_spec import SlamSpec

FAULTS = {
    "none": {},
    "10 % missing": {"missing_share": 0.1},
    "30 % missing": {"missing_share": 0.3},
    "30 % lying": {"lying_share": 0.3},
    "30 % tilted by 20 degrees": {"tilted_share": 0.3},
    "10 % missing, 10 % lying, 10 % tilted": {"missing_share": 0.1, "lying_share": 0.1, "tilted_share": 0.1},
    "75.8 % detected in a scan": {"detected_share": 0.758},  # the best that Chen et al. 2022 quote, of camera images
    "58.5 % detected in a scan": {"detected_share": 0.585},  # the worst
    "fog, visibility 100 m": {"visibility_m": 100.0},
}
METHOD = "slam_barrier"


def spec_with(fault, *, sensor, seed):
    """The default mapping drive with one fault, which devices it strikes drawn from the seed."""
    seeing = {key: value for key, value in fault.items() if key in {"detected_share", "visibility_m"}}
    devices = {key: value for key, value in fault.items() if key not in seeing}
    return SlamSpec.model_validate({"scene": {"faults": devices | {"seed": seed}}, "lidar": sensor | seeing})


def simulated(scenario, site):
    with tempfile.TemporaryDirectory() as folder:
        files = write_sumo_files(site.layout, Path(folder), spec=scenario.simulation, seed=scenario.seed)
        return simulate_fleet(files, on_second=lambda _: None)


def row_of(name, scenario, site, fleet, *, sensor):
    case = scenario.model_copy(update={"slam": spec_with(FAULTS[name], sensor=sensor, seed=scenario.seed)})
    baselines = map_baselines([METHOD], fleet, scenario=case, site=site, progress=quiet_progress)
    grid = baselines.maps[METHOD]
    plan = plan_for(METHOD, grid, scenario=scenario, site=site, guide=nominal_guide(site))
    goal = goal_figures(plan, lane=scenario.route.goal_lane, scenario=scenario, site=site)
    quality = quality_of_cells(grid.free, drivable=site.drivable, counted=site.counted)
    return {
        "fault": name,
        "seed": scenario.seed,
        "n_devices": len(site.layout.devices),
        "n_mapped": baselines.slam["n_devices_mapped"],
        "n_links": baselines.slam["n_links"],
        "ate_m": baselines.slam["ate_m"],
        "iou": quality.iou,
        "planned_outcome": goal["planned_outcome"],
        "closed_area_share": goal["closed_area_share"],
        "n_devices_struck": goal["n_devices_struck"],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenario", type=Path, default=Path("scenarios/paper.toml"))
    parser.add_argument("--seeds", type=int, nargs="+", default=[21])
    parser.add_argument("--out", type=Path, default=Path("results/lidar_faults.csv"))
    parser.add_argument("--rate-hz", type=float, default=10.0)
    parser.add_argument("--azimuth-count", type=int, default=1800)
    given = parser.parse_args()
    sensor = {"rate_hz": given.rate_hz, "azimuth_count": given.azimuth_count}
    slam_map.compile_kernels()
    raycast.compile_kernels()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    done = pd.read_csv(given.out) if given.out.exists() else pd.DataFrame(columns=["fault", "seed"])
    for seed in given.seeds:
        left = [name for name in FAULTS if not ((done["fault"] == name) & (done["seed"] == seed)).any()]
        if not left:
            continue
        scenario = load_scenario(given.scenario, seed=seed)
        site = prepare_site(scenario)
        fleet = simulated(scenario, site)
        for name in left:
            row = pd.DataFrame([row_of(name, scenario, site, fleet, sensor=sensor)])
            row.to_csv(given.out, mode="a", header=not given.out.exists(), index=False)
    print_table(pd.read_csv(given.out))


def print_table(rows):
    print("| fault | n | devices mapped | IoU | planned path: in the closed area | touched nothing |")
    print("|---|---|---|---|---|---|")
    for name in FAULTS:
        these = rows[rows["fault"] == name]
        if these.empty:
            continue
        arrived = (these["planned_outcome"] == "REACHED_GOAL").sum()
        n, mapped = len(these), f"{these['n_mapped'].mean():.0f} of {these['n_devices'].mean():.0f}"
        share = (
            np.nanmean(these["closed_area_share"].to_numpy(dtype=float)) if these["closed_area_share"].notna().any() else np.nan
        )
        print(f"| {name} | {n} | {mapped} | {these['iou'].mean():.3f} | {100 * share:.0f} % | {arrived} of {n} |")


if __name__ == "__main__":
    main()
