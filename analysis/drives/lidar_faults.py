"""What missing, tilted, lying and sparse devices, poor detection and fog do to the strongest LiDAR map, and to the drive on it.

    python analysis/drives/lidar_faults.py [--seeds 61 62 63] [--rate-hz 5] [--out results/lidar_faults]

One SUMO fleet a seed; for each fault one mapping drive, one plan on map (c), one drive along it through the traffic. Rows are
written as they come, and what is there already is not run again; table.md and figure.png lie beside them. Half the scans of
the default sensor (10 Hz) halve the time; a device is still in ten scans and more.
"""

import argparse
import sys
import tempfile
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from wzsumo.case.assessment import goal_figures, lidar_figures
from wzsumo.case.crowd import traces_over_zone
from wzsumo.case.evaluation import evaluate
from wzsumo.case.methods import METHODS
from wzsumo.case.sources import Sources
from wzsumo.case.watch import Watch
from wzsumo.case.zone import SimulatedZone
from wzsumo.ego import Outcome
from wzsumo.lidar_mapping import slam_map
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.scenario.sections import SlamSpec
from wzsumo.scenario.site import Site, prepare_site
from wzsumo.sensing import raycast
from wzsumo.simulation.files import SumoFiles, write_sumo_files
from wzsumo.simulation.fleet import simulate_fleet

FAULTS: dict[str, dict[str, float]] = {
    "none": {},
    "10 % missing": {"missing_share": 0.1},
    "30 % missing": {"missing_share": 0.3},
    "every second one missing": {"set_up_every": 2},
    "30 % lying": {"lying_share": 0.3},
    "30 % tilted by 20 degrees": {"tilted_share": 0.3},
    "10 % missing, 10 % lying, 10 % tilted": {"missing_share": 0.1, "lying_share": 0.1, "tilted_share": 0.1},
    "75.8 % detected in a scan": {"detected_share": 0.758},  # the best that Chen et al. 2022 quote, of camera images
    "58.5 % detected in a scan": {"detected_share": 0.585},  # the worst
    "fog, visibility 100 m": {"visibility_m": 100.0},
}
METHOD = "slam_barrier"
# Okabe and Ito 2008, "Color universal design"; what is not named did not happen in the zones looked at.
MARKS = {
    Outcome.REACHED_GOAL: ("#009E73", "o"),
    Outcome.ENTERED_CLOSED_AREA: ("#D55E00", "s"),
    Outcome.STRUCK_DEVICE: ("#CC79A7", "D"),
    Outcome.COLLIDED: ("#E69F00", "v"),
    Outcome.LEFT_PAVEMENT: ("#56B4E9", "^"),
    Outcome.TIMED_OUT: ("#0072B2", "P"),
    Outcome.NO_PATH: ("#000000", "X"),
}
PANELS = {
    "mapped_share": "devices in the map,\nshare of those laid out",
    "closed_gaps_share": "gaps closed between devices,\nshare of those without a fault",
    "planned_closed_share": "share of the planned path\nin the closed area",
}


def spec_with(fault: Mapping[str, float], *, seed: int, rate_hz: float) -> SlamSpec:
    """The default mapping drive with one fault; the seed draws which devices it strikes."""
    seeing = {key: value for key, value in fault.items() if key in {"detected_share", "visibility_m"}}
    devices = {key: value for key, value in fault.items() if key not in seeing}
    return SlamSpec.model_validate({"scene": {"faults": devices | {"seed": seed}}, "lidar": {"rate_hz": rate_hz} | seeing})


def row_of(
    name: str, scenario: Scenario, site: Site, files: SumoFiles, fleet: pd.DataFrame, *, rate_hz: float
) -> dict[str, Any]:
    case = scenario.model_copy(update={"slam": spec_with(FAULTS[name], seed=scenario.seed, rate_hz=rate_hz)})
    zone = SimulatedZone(
        over_zone=traces_over_zone(fleet, site.layout), whole_fleet=lambda: fleet, sumo_files=lambda: nullcontext(files),
        fleet_before=lambda: fleet,
    )  # fmt: skip
    sources = Sources(zone=zone, scenario=case, site=site, watch=Watch())
    result = evaluate(METHODS[METHOD], sources, scenario=case, site=site, watch=Watch())
    goal = goal_figures(result.plan, lane=scenario.route.goal_lane, scenario=scenario, site=site)
    drive, figures = lidar_figures(sources.lidar), result.figures
    return {
        "fault": name,
        "seed": scenario.seed,
        "n_devices": len(site.layout.devices),
        "n_mapped": drive["n_devices_mapped"],
        "n_links": drive["n_links"],
        "mapped_share": drive["n_devices_mapped"] / len(site.layout.devices),
        "ate_m": drive["ate_m"],
        "precision": figures["precision"],
        "recall": figures["recall"],
        "iou": figures["iou"],
        "planned_outcome": goal["planned_outcome"],
        "planned_closed_share": goal["closed_area_share"],
        "driven_outcome": figures["outcome"],
        "reason": figures["reason"],
    }


def run_seed(seed: int, given: argparse.Namespace, done: pd.DataFrame) -> None:
    left = [name for name in FAULTS if not ((done["fault"] == name) & (done["seed"] == seed)).any()]
    if not left:
        return
    scenario = load_scenario(given.scenario, seed=seed)
    site = prepare_site(scenario)
    with tempfile.TemporaryDirectory() as folder:
        files = write_sumo_files(site.layout, Path(folder), spec=scenario.zone_simulation(), seed=seed)
        fleet = simulate_fleet(files, on_second=lambda _: None)
        for name in left:
            row, path = row_of(name, scenario, site, files, fleet, rate_hz=given.rate_hz), given.out / "rows.csv"
            pd.DataFrame([row]).to_csv(path, mode="a", header=not path.exists(), index=False)
            print(f"seed {seed}, {name}: {row['driven_outcome']}", file=sys.stderr)


def table_of(rows: pd.DataFrame) -> str:
    """Markdown: means over the seeds, and how many of the plans and drives went well."""
    columns = ["fault", "n", "devices found", "gaps closed", "IoU [least, most]", "path in closed area"]
    columns += ["plan touches nothing", "drive reached the goal"]
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    for name in FAULTS:
        these = rows[rows["fault"] == name]
        if these.empty:
            continue
        n, share = len(these), these["planned_closed_share"].dropna()
        lines.append(
            f"| {name} | {n} | {these['n_mapped'].mean():.0f} of {these['n_devices'].mean():.0f} "
            f"| {these['n_links'].mean():.0f} "
            f"| {these['iou'].mean():.3f} [{these['iou'].min():.3f}, {these['iou'].max():.3f}] "
            f"| {f'{100 * share.mean():.0f} %' if len(share) else '-'} "
            f"| {(these['planned_outcome'] == Outcome.REACHED_GOAL).sum()} of {n} "
            f"| {(these['driven_outcome'] == Outcome.REACHED_GOAL).sum()} of {n} |"
        )
    return "\n".join(lines) + "\n"


def draw(rows: pd.DataFrame) -> Figure:
    """A dot a seed, by fault and by how the drive ended."""
    figure = Figure(figsize=(10.5, 4.6), dpi=150, layout="constrained")
    panels = figure.subplots(1, len(PANELS), sharey=True)
    rows = rows.assign(closed_gaps_share=rows["n_links"] / (rows["n_devices"] - 1))
    place = {name: -number for number, name in enumerate(FAULTS)}
    seeds = sorted(rows["seed"].unique())
    aside = {
        seed: 0.18 * (number - (len(seeds) - 1) / 2) for number, seed in enumerate(seeds)
    }  # dots of equal value stay apart
    for axes, (column, label) in zip(panels, PANELS.items(), strict=True):
        for outcome, (colour, marker) in MARKS.items():
            these = rows[rows["driven_outcome"] == outcome]
            style = {"color": colour, "marker": marker, "s": 26, "label": outcome.replace("_", " ").lower(), "zorder": 3}
            if len(these):
                axes.scatter(these[column].fillna(0.0), these["fault"].map(place) + these["seed"].map(aside), **style)
        axes.set(xlabel=label, xlim=(-0.03, 1.08), yticks=list(place.values()), yticklabels=list(place))
        axes.grid(axis="x", color="#DDDDDD")
    labelled = {text: handle for axes in panels for handle, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    title = f"drive on map (c), seeds {', '.join(map(str, seeds))}:"
    figure.legend(labelled.values(), labelled, title=title, loc="outside upper center", ncols=6, frameon=False, fontsize=9)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenario", type=Path, default=Path("scenarios/paper.toml"))
    parser.add_argument("--seeds", type=int, nargs="+", default=[61, 62, 63])
    parser.add_argument("--rate-hz", type=float, default=5.0, help="turns of the LiDAR a second")
    parser.add_argument("--out", type=Path, default=Path("results/lidar_faults"))
    given = parser.parse_args()
    slam_map.compile_kernels()
    raycast.compile_kernels()
    given.out.mkdir(parents=True, exist_ok=True)
    kept = given.out / "rows.csv"
    done = pd.read_csv(kept) if kept.exists() else pd.DataFrame(columns=["fault", "seed"])
    for seed in given.seeds:
        run_seed(seed, given, done)
    rows = pd.read_csv(kept)
    (given.out / "table.md").write_text(table_of(rows))
    draw(rows).savefig(given.out / "figure.png")
    print(table_of(rows))


if __name__ == "__main__":
    main()
