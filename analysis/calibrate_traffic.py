"""Queue discharge of simulated work zones beside the Highway Capacity Manual's, zone class by zone class.

    python analysis/calibrate_traffic.py measure 2_to_1_urban 3_to_2_urban --first 213 --seeds 10
    python analysis/calibrate_traffic.py measure 2_to_1_urban --first 101 --seeds 4 --tau 1.6 --accel 1.2 --truck-tau 2.6
    python analysis/calibrate_traffic.py table

`measure` runs what the toolkit runs (0.1 s, sublanes of 0.45 m, the toolkit's own network and drivers) and adds a
row a run to the CSV file; without --tau and the like it measures the preset of that class. The preset was tuned on seeds
101-104, 211 and 212 and is tested on 213-222.
"""

import argparse
import csv
import os
import sys
import tempfile
import time
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
from scipy.stats import t as student

from wzsumo.capacity import QUEUE_DISCHARGE_DROP, TRUCK_EQUIVALENT_PC, SiteSpec, ZoneCapacity, zone_capacity
from wzsumo.metrics.discharge import Discharge, bottleneck_discharge
from wzsumo.mutcd.layout import lay_out
from wzsumo.road import RoadSpec
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.drivers import DRIVER_PRESETS, DriverSpec
from wzsumo.simulation.files import SimulationSpec, SumoFiles, write_sumo_files
from wzsumo.units import mps_from_mph
from wzsumo.work_zone import WorkZone

os.environ.setdefault("LIBSUMO_AS_TRACI", "quiet")
import libsumo

SPEED_MPH = 60.0
LANES = {"2_to_1": (2, (1,)), "3_to_2": (3, (2,)), "3_to_1": (3, (2, 1))}
TRUCK_SHARES = (0.0, 0.1)
# Demand as a share of the HCM's capacity from these times [s] on. It rises so slowly that the 15 minutes before the breakdown
# tell the capacity, and stops early enough that the queue does not reach the road's start, where waiting vehicles would be the
# bottleneck instead.
RAMP = ((0.0, 0.92), (900.0, 0.97), (1500.0, 1.02), (2100.0, 1.07), (2700.0, 1.12))
LONGEST_MIN = 70
AFTER_BREAKDOWN_MIN = 23  # 8 to settle, 15 that count: the HCM means 15-minute flows
UPSTREAM_M = 320.0  # of the closing lane's end, where a queue is looked for
MINUTE_S = 60.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/calibration/discharge.csv"))
    commands = parser.add_subparsers(dest="command", required=True)
    measuring = commands.add_parser("measure")
    measuring.add_argument("classes", nargs="+", choices=[f"{lanes}_{area}" for lanes in LANES for area in ("urban", "rural")])
    measuring.add_argument("--trucks", type=float, nargs="+", default=list(TRUCK_SHARES))
    measuring.add_argument("--first", type=int, default=213)
    measuring.add_argument("--seeds", type=int, default=10)
    for key in ("tau", "accel", "truck-tau", "truck-accel", "sigma", "assertive"):
        measuring.add_argument(f"--{key}", type=float)
    measuring.add_argument("--merge-ahead", type=float, nargs=2, metavar=("NEAREST_M", "FARTHEST_M"))
    commands.add_parser("table")
    args = parser.parse_args()
    if args.command == "table":
        print(discharge_table(pd.read_csv(args.out)))
        return
    for zone_class in args.classes:
        drivers = drivers_of(zone_class, args)
        for seed in range(args.first, args.first + args.seeds):
            for trucks in args.trucks:
                demand = DemandSpec(drivers=drivers, truck_share=trucks, duration_s=LONGEST_MIN * MINUTE_S)
                if args.merge_ahead:
                    demand = demand.model_copy(update={"merge_ahead_m": tuple(args.merge_ahead)})
                row = measure(zone_class, demand=demand, seed=seed)
                append_row(row, args.out)
                print(
                    {key: round(value, 3) if isinstance(value, float) else value for key, value in row.items()}, file=sys.stderr
                )


def measure(zone_class: str, *, demand: DemandSpec, seed: int) -> dict:
    """One run: its discharge in passenger cars an hour and lane, and what SUMO counted."""
    target, drivers = hcm(zone_class, trucks=demand.truck_share), demand.drivers
    total, closed = LANES[zone_class[:6]]
    road = RoadSpec(lane_count=total, left_shoulder_ft=12, right_shoulder_ft=10, length_ft=8800 + 2200 * (len(closed) - 1))
    zone = WorkZone(posted_speed_mph=SPEED_MPH, start_ft=5200, closed_lanes=closed, closed_shoulder="left", work_length_ft=500)
    layout = lay_out(zone, road.build())
    flows = tuple((time, share * target.capacity_all_lanes_vph) for time, share in RAMP)
    demand = demand.model_copy(update={"flow_profile": flows})
    with tempfile.TemporaryDirectory() as folder:
        files = write_sumo_files(layout, Path(folder), spec=SimulationSpec(demand=demand), seed=seed)
        work = layout.area("activity area")
        last_open = max(edge.end for edge in files.edges if len(edge.lanes) > total - len(closed) and edge.end < work.start)
        began = time.process_time()
        minutes, statistics = run_until_discharge_is_known(
            files, work=(work.start + work.end) / 2, upstream=last_open - UPSTREAM_M
        )
        cpu_s = time.process_time() - began
    found = discharge_of(minutes)
    per_lane = {key: getattr(found, f"{key}_per_h") / target.open_lanes for key in ("queue_discharge", "peak_flow")}
    return {
        "zone_class": zone_class, "trucks": demand.truck_share, "seed": seed, "tau_s": drivers.tau_s,
        "accel_mps2": drivers.accel_mps2, "truck_tau_s": drivers.truck_tau_s, "truck_accel_mps2": drivers.truck_accel_mps2,
        "sigma": drivers.sigma, "lc_assertive": drivers.lc_assertive,
        "merge_ahead_m": "-".join(f"{m:g}" for m in demand.merge_ahead_m), "target_pcphpl": target.queue_discharge_pcphpl,
        "discharge_pcphpl": per_lane["queue_discharge"], "capacity_pcphpl": per_lane["peak_flow"],
        "breakdown_min": found.breakdown_min, "discharge_min": found.n_discharge_min,
        "queue_speed_mps": float(minutes["upstream_speed_mps"].iloc[-AFTER_BREAKDOWN_MIN + 8 :].mean()),
        "off": per_lane["queue_discharge"] / target.queue_discharge_pcphpl - 1, "drop": found.drop, "cpu_s": cpu_s,
        **statistics,
    }  # fmt: skip


def hcm(zone_class: str, *, trucks: float) -> ZoneCapacity:
    total, closed = LANES[zone_class[:6]]
    site = SiteSpec(area=zone_class.rsplit("_", 1)[1])
    return zone_capacity(
        total_lanes=total, open_lanes=total - len(closed), posted_speed_mph=SPEED_MPH, truck_share=trucks, site=site
    )


def drivers_of(zone_class: str, args: argparse.Namespace) -> DriverSpec:
    given = {
        "tau_s": args.tau, "accel_mps2": args.accel, "truck_tau_s": args.truck_tau, "truck_accel_mps2": args.truck_accel,
        "sigma": args.sigma, "lc_assertive": args.assertive,
    }  # fmt: skip
    changes = {key: value for key, value in given.items() if value is not None}
    if changes:
        return DriverSpec(**changes)
    name = f"hcm_{zone_class}"
    if name not in DRIVER_PRESETS:
        raise SystemExit(f"{zone_class}: no preset {name}; give --tau, --accel and the like")
    return DRIVER_PRESETS[name]


def run_until_discharge_is_known(files: SumoFiles, *, work: float, upstream: float) -> tuple[pd.DataFrame, dict]:
    """Minutes (pc past the work, speed upstream) up to 23 minutes after the breakdown, and what SUMO counted."""
    loops = files.config.parent / "loops.add.xml"
    names = write_loops(files, {"work": work, "upstream": upstream}, loops)
    vehicles = ET.parse(files.config.parent / "zone.rou.xml").iter("vehicle")  # noqa: S314 our own file
    trucks = {vehicle.get("id") for vehicle in vehicles if "truck" in vehicle.get("type")}
    libsumo.start(["sumo", "-c", str(files.config), "--additional-files", str(loops), "--no-warnings"])
    api, rows, inserted, braking = libsumo.inductionloop, [], 0, set()
    for minute in range(1, LONGEST_MIN + 1):
        for _ in range(round(MINUTE_S / files.step_length)):
            libsumo.simulationStep()
            braking.update(libsumo.simulation.getEmergencyStoppingVehiclesIDList())
            inserted += libsumo.simulation.getDepartedNumber()
        ids = [id_ for loop in names["work"] for id_ in api.getLastIntervalVehicleIDs(loop)]
        seen = [(api.getLastIntervalVehicleNumber(loop), api.getLastIntervalMeanSpeed(loop)) for loop in names["upstream"]]
        count = sum(n for n, _ in seen)
        speed = sum(n * v for n, v in seen if n) / count if count else np.nan
        rows.append((len(ids) + len(trucks.intersection(ids)) * (TRUCK_EQUIVALENT_PC - 1), speed))
        minutes = pd.DataFrame(rows, columns=["count_pc", "upstream_speed_mps"])
        if minute >= discharge_of(minutes).breakdown_min + AFTER_BREAKDOWN_MIN:
            break
    statistics = {
        "inserted": inserted,
        "waiting": len(libsumo.simulation.getPendingVehicles()),
        "emergency_stops": len(braking),
        "teleports": libsumo.simulation.getStartingTeleportNumber(),
    }
    libsumo.close()
    return minutes, statistics


def discharge_of(minutes: pd.DataFrame) -> Discharge:
    return bottleneck_discharge(minutes["count_pc"], minutes["upstream_speed_mps"], free_speed=mps_from_mph(SPEED_MPH))


def write_loops(files: SumoFiles, stations: dict[str, float], path: Path) -> dict[str, list[str]]:
    """Write an induction loop a lane at each station; their names."""
    root, names = ET.Element("additional"), {}
    for name, station in stations.items():
        edge = next(edge for edge in files.edges if edge.start <= station < edge.end)
        names[name] = [f"{name}_{lane}" for lane in range(len(edge.lanes))]
        for lane, id_ in enumerate(names[name]):
            position = f"{station - edge.start:.2f}"
            ET.SubElement(
                root, "inductionLoop", id=id_, lane=f"{edge.id}_{lane}", pos=position, period=f"{MINUTE_S:g}", file="loops.xml"
            )
    ET.ElementTree(root).write(path)
    return names


def append_row(row: dict, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(row))
        if new:
            writer.writeheader()
        writer.writerow(row)


def discharge_table(rows: pd.DataFrame) -> str:
    """Markdown by zone class and truck share: target, mean with its 95 % interval (Student), per cent off, capacity, drop."""
    lines = [
        "| zone | trucks | n | HCM, pc/h/lane | simulated, mean [95 %] | off | capacity (n) | drop | emergency stops |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for (zone_class, trucks), part in rows.groupby(["zone_class", "trucks"], sort=False):
        discharge, target = part["discharge_pcphpl"].dropna(), part["target_pcphpl"].iloc[0]
        both = part.dropna(subset=["discharge_pcphpl", "capacity_pcphpl"])
        capacity = both["capacity_pcphpl"].mean()
        lines.append(
            f"| {zone_class.replace('_', ' ')} | {trucks:.0%} | {len(discharge)} | {target:.0f} | "
            f"{_mean_with_interval(discharge)} | {discharge.mean() / target - 1:+.1%} | {capacity:.0f} ({len(both)}) | "
            f"{1 - both['discharge_pcphpl'].mean() / capacity:.1%} | {part['emergency_stops'].sum()} |"
        )
    return "\n".join([*lines, "", f"n: runs of one seed each that broke down. HCM: drop {QUEUE_DISCHARGE_DROP:.1%}."])


def _mean_with_interval(values: pd.Series) -> str:
    if len(values) < 2:
        return f"{values.mean():.0f}"
    half = student.ppf(0.975, len(values) - 1) * values.std() / np.sqrt(len(values))
    return f"{values.mean():.0f} [{values.mean() - half:.0f}, {values.mean() + half:.0f}]"


if __name__ == "__main__":
    main()
