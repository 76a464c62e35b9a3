"""Queue discharge of simulated work zones beside the Highway Capacity Manual's, zone class by zone class.

    python analysis/calibrate_traffic.py measure 2_to_1_urban 3_to_2_urban --first 201 --seeds 10
    python analysis/calibrate_traffic.py measure 2_to_1_urban --first 101 --seeds 4 --tau 1.6 --accel 1.2 --truck-tau 2.6
    python analysis/calibrate_traffic.py table

`measure` runs what the toolkit runs (0.1 s, sublanes of 0.45 m, the toolkit's own network and drivers) with SUMO's plain
binary and adds a row a run to the CSV file; without --tau it measures the preset of that class. Presets were tuned on seeds
101-110 and are tested on 201-210.
"""

import argparse
import csv
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
from scipy.stats import t as student

from wzsumo.capacity import QUEUE_DISCHARGE_DROP, SiteSpec, ZoneCapacity, zone_capacity
from wzsumo.metrics.discharge import bottleneck_discharge
from wzsumo.mutcd.layout import lay_out
from wzsumo.road import RoadSpec
from wzsumo.simulation.demand import CAR, TRUCK, DemandSpec
from wzsumo.simulation.drivers import DRIVER_PRESETS, DriverSpec
from wzsumo.simulation.files import SimulationSpec, SumoFiles, write_sumo_files
from wzsumo.simulation.installation import sumo_binary
from wzsumo.units import mps_from_mph
from wzsumo.work_zone import WorkZone

SPEED_MPH = 60.0
LANES = {"2_to_1": (2, (1,)), "3_to_2": (3, (2,)), "3_to_1": (3, (2, 1))}
TRUCK_SHARES = (0.0, 0.1)
# Shares of the HCM's capacity from these times [s] on: a slow rise until the flow breaks down, then a little more than the zone
# discharges, so that the queue stands but does not reach the road's start, where waiting vehicles would be the bottleneck.
RAMP = ((0.0, 0.85), (240.0, 0.90), (480.0, 0.95), (720.0, 1.00), (960.0, 1.05), (1200.0, 1.10), (1440.0, 0.93))
RAMP_S = 3000.0
STEADY, STEADY_S = ((0.0, 1.15), (360.0, 0.93)), 1800.0  # for tuning: breaks down at once, tells the discharge alone
UPSTREAM_M = 320.0  # of the closing lane's end, where a queue is looked for
MINUTE_S = 60.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/calibration/discharge.csv"))
    commands = parser.add_subparsers(dest="command", required=True)
    measuring = commands.add_parser("measure")
    measuring.add_argument("classes", nargs="+", choices=[f"{lanes}_{area}" for lanes in LANES for area in ("urban", "rural")])
    measuring.add_argument("--trucks", type=float, nargs="+", default=list(TRUCK_SHARES))
    measuring.add_argument("--first", type=int, default=201)
    measuring.add_argument("--seeds", type=int, default=10)
    for key in ("tau", "accel", "truck-tau", "truck-accel", "sigma", "assertive"):
        measuring.add_argument(f"--{key}", type=float)
    measuring.add_argument("--steady", action="store_true", help="for tuning: breakdown at once, half an hour")
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
                profile, duration_s = (STEADY, STEADY_S) if args.steady else (RAMP, RAMP_S)
                demand = DemandSpec(drivers=drivers, truck_share=trucks, duration_s=duration_s)
                if args.merge_ahead:
                    demand = demand.model_copy(update={"merge_ahead_m": tuple(args.merge_ahead)})
                row = measure(zone_class, demand=demand, profile=profile, seed=seed)
                append_row(row, args.out)
                print(
                    {key: round(value, 3) if isinstance(value, float) else value for key, value in row.items()}, file=sys.stderr
                )


def measure(zone_class: str, *, demand: DemandSpec, profile: tuple[tuple[float, float], ...], seed: int) -> dict:
    """One run: its discharge in passenger cars an hour and lane, and what SUMO counted. `profile`: (s, share of capacity)."""
    target, drivers = hcm(zone_class, trucks=demand.truck_share), demand.drivers
    total, closed = LANES[zone_class[:6]]
    road = RoadSpec(lane_count=total, left_shoulder_ft=12, right_shoulder_ft=10, length_ft=8800 + 2200 * (len(closed) - 1))
    zone = WorkZone(posted_speed_mph=SPEED_MPH, start_ft=5200, closed_lanes=closed, closed_shoulder="left", work_length_ft=500)
    layout = lay_out(zone, road.build())
    flows = tuple((time, share * target.capacity_all_lanes_vph) for time, share in profile)
    demand = demand.model_copy(update={"flow_profile": flows})
    with tempfile.TemporaryDirectory() as folder:
        files = write_sumo_files(layout, Path(folder), spec=SimulationSpec(demand=demand), seed=seed)
        work = layout.area("activity area")
        last_open = max(edge.end for edge in files.edges if len(edge.lanes) > total - len(closed) and edge.end < work.start)
        stations = {"work": (work.start + work.end) / 2, "upstream": last_open - UPSTREAM_M}
        minutes, statistics, cpu_s = run_sumo(files, stations)
    share = (minutes["length"] - CAR["length_m"]) / (TRUCK["length_m"] - CAR["length_m"])
    passenger_cars = minutes["count"] * (1 + share.fillna(0.0)) / target.open_lanes
    speed = minutes["speed"].unstack("station")["upstream"]
    found = bottleneck_discharge(
        passenger_cars.unstack("station")["work"],
        speed,
        free_speed=mps_from_mph(SPEED_MPH),
        last_min=demand.duration_s / MINUTE_S,
    )
    return {
        "zone_class": zone_class, "trucks": demand.truck_share, "seed": seed, "tau_s": drivers.tau_s,
        "accel_mps2": drivers.accel_mps2, "truck_tau_s": drivers.truck_tau_s, "truck_accel_mps2": drivers.truck_accel_mps2,
        "sigma": drivers.sigma, "lc_assertive": drivers.lc_assertive,
        "merge_ahead_m": "-".join(f"{m:g}" for m in demand.merge_ahead_m),
        "target_pcphpl": target.queue_discharge_pcphpl, "discharge_pcphpl": found.queue_discharge_per_h,
        "capacity_pcphpl": found.peak_flow_per_h, "drop": found.drop, "breakdown_min": found.breakdown_min,
        "upstream_speed_mps": float(speed.iloc[-15:].mean()),
        "off": found.queue_discharge_per_h / target.queue_discharge_pcphpl - 1, "cpu_s": cpu_s, **statistics,
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
    return DRIVER_PRESETS[f"hcm_{zone_class}"]


def run_sumo(files: SumoFiles, stations: dict[str, float]) -> tuple[pd.DataFrame, dict, float]:
    """Counts, mean speed and mean length by (minute, station); what SUMO counted; CPU seconds."""
    folder = files.config.parent
    root = ET.Element("additional")
    for name, station in stations.items():
        edge = next(edge for edge in files.edges if edge.start <= station < edge.end)
        for lane in range(len(edge.lanes)):
            ET.SubElement(
                root, "inductionLoop", id=f"{name}_{lane}", lane=f"{edge.id}_{lane}", pos=f"{station - edge.start:.2f}",
                period=f"{MINUTE_S:g}", file="loops.xml",
            )  # fmt: skip
    ET.ElementTree(root).write(folder / "loops.add.xml")
    command = [
        str(sumo_binary("sumo")), "-c", str(files.config), "--additional-files", str(folder / "loops.add.xml"),
        "--statistic-output", str(folder / "statistics.xml"), "--duration-log.statistics", "--no-warnings",
    ]  # fmt: skip
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    found = ET.parse(folder / "statistics.xml").getroot()  # noqa: S314 our own file
    statistics = {
        "inserted": int(found.find("vehicles").get("inserted")),
        "waiting": int(found.find("vehicles").get("waiting")),
        "emergency_braking": int(found.find("safety").get("emergencyBraking")),
        "teleports": int(found.find("teleports").get("total")),
        "collisions": int(found.find("safety").get("collisions")),
    }
    return read_loops(folder / "loops.xml"), statistics, cpu_s


def read_loops(path: Path) -> pd.DataFrame:
    rows = [
        (float(r.get("begin")) / MINUTE_S, r.get("id").rsplit("_", 1)[0], int(r.get("nVehContrib")), float(r.get("speed")),
         float(r.get("length")))
        for r in ET.parse(path).getroot().findall("interval")  # noqa: S314 our own file
    ]  # fmt: skip
    table = pd.DataFrame(rows, columns=["minute", "station", "count", "speed", "length"])
    table = table.assign(speed=table["speed"] * table["count"], length=table["length"] * table["count"])
    sums = table.groupby(["minute", "station"]).sum()
    return sums.assign(speed=sums["speed"] / sums["count"], length=sums["length"] / sums["count"])


def append_row(row: dict, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(row))
        if new:
            writer.writeheader()
        writer.writerow(row)


def discharge_table(rows: pd.DataFrame) -> str:
    """Markdown: target, mean, 95 % interval of the mean (Student), per cent off, drop, by zone class and truck share."""
    lines = [
        "| zone | trucks | n | HCM, pc/h/lane | simulated, mean [95 %] | off | capacity before | drop | emergency brakes |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for (zone_class, trucks), part in rows.groupby(["zone_class", "trucks"], sort=False):
        q = part["discharge_pcphpl"].dropna()
        half = student.ppf(0.975, len(q) - 1) * q.std() / np.sqrt(len(q)) if len(q) > 1 else np.nan
        target = part["target_pcphpl"].iloc[0]
        before = part["capacity_pcphpl"].mean()
        lines.append(
            f"| {zone_class.replace('_', ' ')} | {trucks:.0%} | {len(q)} | {target:.0f} | "
            f"{q.mean():.0f} [{q.mean() - half:.0f}, {q.mean() + half:.0f}] | {q.mean() / target - 1:+.1%} | {before:.0f} | "
            f"{1 - q.mean() / before:.1%} | {part['emergency_braking'].sum()} |"
        )
    return "\n".join([*lines, f"\nHCM: drop {QUEUE_DISCHARGE_DROP:.1%}; n: runs of one seed each that broke down."])


if __name__ == "__main__":
    main()
