"""Queue discharge and merge positions of zones placed in a network, with the drivers fitted to the HCM.

    python analysis/placement/hcm_discharge.py --seeds 51 52 53 --out docs/results/placed_discharge.csv

A straight freeway of 4 km that netconvert makes, with more demand than the zone discharges; vehicle types and departures are
those of a scenario's own road (`drivers = "hcm"`), written as the network's routes. One row a zone and seed: discharge while
the queue stands, that of the manual, vehicles over the closed ground, quantiles of the merge positions.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path

import pandas as pd

from wzsumo.case.watch import Watch
from wzsumo.case.zone import simulate_zone
from wzsumo.scenario.scenario import Scenario, load_scenario
from wzsumo.simulation.connection import sumo_binary
from wzsumo.simulation.demand import DemandSpec, write_demand
from wzsumo.simulation.drivers import DriverSpec, hcm_drivers
from wzsumo.units import mps_from_mph

ZONES = {"2 to 1": (2, (1,), 2100.0), "3 to 2": (3, (2,), 4300.0)}  # lanes, closed ones, demand [veh/h]
SPEED_MPH, DURATION_S = 65.0, 1500.0
LENGTHS_M = (2500.0, 1500.0)  # of the edge ahead of the zone's edge, and of that
SCENARIO = """name = "placed"
seed = {seed}
[network]
net = "freeway.net.xml"
routes = ["zone.rou.xml"]
edge = "zone"
position_m = 300
left_shoulder_ft = 6
right_shoulder_ft = 10
[work_zone]
posted_speed_mph = {speed:g}
closed_lanes = {closed}
closed_shoulder = "left"
work_length_ft = 500
[simulation.demand]
duration_s = {duration:g}
[map]
resolution_m = 1.0
[route]
start_lane = 0
goal_lane = 0
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[51, 52, 53])
    parser.add_argument("--zones", nargs="+", default=list(ZONES), choices=list(ZONES))
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    rows = []
    for name in args.zones:
        for seed in args.seeds:
            with tempfile.TemporaryDirectory() as folder:
                row = {"zone": name, "seed": seed} | _measured(Path(folder), *ZONES[name], seed=seed)
            rows.append(row)
            print(row, flush=True)
            pd.DataFrame(rows).to_csv(args.out, index=False)


def _measured(folder: Path, n_lanes: int, closed: tuple[int, ...], flow: float, *, seed: int) -> dict[str, float]:
    _write_net(folder, n_lanes)
    path = folder / "scenario.toml"
    path.write_text(SCENARIO.format(seed=seed, speed=SPEED_MPH, closed=list(closed), duration=DURATION_S), encoding="utf-8")
    (folder / "zone.rou.xml").write_text("<routes/>", encoding="utf-8")
    scenario = load_scenario(path)
    rate_pcphpl = scenario.capacity().queue_discharge_pcphpl
    drivers = hcm_drivers(rate_pcphpl, open_lanes=n_lanes - len(closed))
    _write_routes(scenario, folder, flow=flow, drivers=drivers, seed=seed)
    runs = folder / "sumo"
    runs.mkdir()
    _, measures = simulate_zone(scenario, scenario.layout(), folder=runs, watch=Watch())
    summary, merges = measures.traffic.summary, measures.summary.merge_position_m
    return {
        "demand_vph": flow, "queue_discharge_vph": summary.queue_discharge_vph,
        "hcm_queue_discharge_vph": scenario.capacity().queue_discharge_all_lanes_vph, "breakdown_s": summary.breakdown_s,
        "locked_s": summary.locked_s, "n_passed": measures.summary.n_passed,
        "n_over_closed_ground": measures.summary.n_in_closed_area, "n_overlapping": summary.n_overlapping,
        **{f"merge_{name}_m": value for name, value in merges.items()},
    }  # fmt: skip


def _write_net(folder: Path, n_lanes: int) -> None:
    ahead, zone = LENGTHS_M
    nodes = "".join(f'<node id="{id_}" x="{x:g}" y="0"/>' for id_, x in zip("abc", (0.0, ahead, ahead + zone), strict=True))
    edges = "".join(
        f'<edge id="{id_}" from="{first}" to="{last}" numLanes="{n_lanes}" speed="{mps_from_mph(SPEED_MPH):.2f}" width="3.66"/>'
        for id_, first, last in (("ahead", "a", "b"), ("zone", "b", "c"))
    )
    for name, content in (("nod", f"<nodes>{nodes}</nodes>"), ("edg", f"<edges>{edges}</edges>")):
        (folder / f"freeway.{name}.xml").write_text(content, encoding="utf-8")
    plain = ["-n", str(folder / "freeway.nod.xml"), "-e", str(folder / "freeway.edg.xml")]
    options = ["--no-turnarounds", "--no-warnings", "--xml-validation", "never", "-o", str(folder / "freeway.net.xml")]
    subprocess.run([str(sumo_binary("netconvert")), *plain, *options], check=True, capture_output=True)


def _write_routes(scenario: Scenario, folder: Path, *, flow: float, drivers: DriverSpec, seed: int) -> None:
    """The demand of a road of the scenario's own, on the network's edges before they are cut."""
    with tempfile.TemporaryDirectory() as name:
        edges = scenario.write_sumo_files(Path(name)).edges
    whole = {edge.id.partition(".wz")[0]: edge for edge in reversed(edges)}
    uncut = tuple(edge.__class__(id=id_, start=edge.start, end=edge.end, lanes=edge.lanes) for id_, edge in whole.items())[::-1]
    spec = DemandSpec(flow_vph=flow, duration_s=DURATION_S, drivers=drivers)
    write_demand(uncut, folder, spec=spec, speed=mps_from_mph(SPEED_MPH), seed=seed)


if __name__ == "__main__":
    main()
