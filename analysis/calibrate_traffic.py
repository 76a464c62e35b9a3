"""Queue discharge of simulated work zones beside the Highway Capacity Manual's, zone class by zone class.

    python analysis/calibrate_traffic.py measure --first 301 --seeds 10
    python analysis/calibrate_traffic.py measure 2_to_1_urban --trucks 0 --first 101 --seeds 4 --tau 1.6 --accel 1.2
    python analysis/calibrate_traffic.py table

`measure` runs what the toolkit runs (0.1 s, sublanes of 0.45 m, the toolkit's own network and drivers) and adds a row a run to
the CSV file, seed after seed over all classes; a run that the file has is not repeated. Without --tau and the like it measures
the drivers that `drivers = "hcm"` stands for.
"""

import argparse
import csv
import os
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import traci
from scipy.stats import t as student

from wzsumo.capacity import QUEUE_DISCHARGE_DROP, TRUCK_EQUIVALENT_PC, SiteSpec, ZoneCapacity, zone_capacity
from wzsumo.metrics.discharge import Discharge, bottleneck_discharge
from wzsumo.mutcd.layout import lay_out
from wzsumo.road import RoadSpec
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.drivers import DRIVER_PRESETS
from wzsumo.simulation.files import SimulationSpec, SumoFiles, write_sumo_files
from wzsumo.simulation.installation import sumo_binary
from wzsumo.units import mps_from_mph
from wzsumo.work_zone import WorkZone, WorkZoneLayout

SPEED_MPH = 60.0
LANES = {"2_to_1": (2, (1,)), "3_to_2": (3, (2,)), "3_to_1": (3, (2, 1))}
CLASSES = tuple(f"{lanes}_{area}" for lanes in LANES for area in ("urban", "rural"))
TRUCK_SHARES = (0.0, 0.1)
# Lanes are used evenly at the road's start but for 3 to 2, where a fifth drives in the lane that closes: who reads the signs a
# mile ahead has left it. With a third in it merging breaks the traffic down below what the queue then discharges.
LANE_USE = {"3_to_2": (0.4, 0.4, 0.2)}
# Demand as a share of the HCM's capacity from these times [s] on: it rises so slowly that the 15 minutes before the breakdown
# tell the capacity, and ends far above it, so that whoever has not broken down does.
RAMP = ((0.0, 0.92), (600.0, 0.97), (1200.0, 1.02), (1800.0, 1.07), (2400.0, 1.2))
LONGEST_MIN = 65
AFTER_BREAKDOWN_MIN = 23  # 8 to settle, 15 that count: the HCM means 15-minute flows
UPSTREAM_M = 320.0  # of the closing lane's end, where a queue is looked for
# From the road's start to the first device. A queue that reaches the road's start waits outside; all that matters is that it
# fills the road ahead of the merging lane.
APPROACH_FT = {"2_to_1": 1600.0, "3_to_2": 1600.0, "3_to_1": 1000.0}  # the last has two tapers and a tangent after that
BEYOND_FT = 300.0  # from the last device to the road's end
MINUTE_S = 60.0
SETTINGS = ("tau", "accel", "truck_tau", "truck_accel", "sigma", "lc_assertive")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/calibration/discharge.csv"))
    commands = parser.add_subparsers(dest="command", required=True)
    measuring = commands.add_parser("measure")
    measuring.add_argument("classes", nargs="*", default=CLASSES, help=", ".join(CLASSES))
    measuring.add_argument("--trucks", type=float, nargs="+", default=list(TRUCK_SHARES))
    measuring.add_argument("--first", type=int, default=301)
    measuring.add_argument("--seeds", type=int, default=10)
    measuring.add_argument("--approach-ft", type=float)
    for key in SETTINGS:
        measuring.add_argument(f"--{key.replace('_', '-')}", type=float)
    measuring.add_argument("--merge-ahead", type=float, nargs=2, metavar=("NEAREST_M", "FARTHEST_M"))
    measuring.add_argument("--lane-use", type=float, nargs="+")
    commands.add_parser("table")
    args = parser.parse_args()
    if args.command == "table":
        print(discharge_table(pd.read_csv(args.out)))
        return
    for seed in range(args.first, args.first + args.seeds):
        for zone_class in args.classes:
            for trucks in args.trucks:
                measure_once(zone_class, demand=demand_of(zone_class, trucks, args), seed=seed, args=args)


def demand_of(zone_class: str, trucks: float, args: argparse.Namespace) -> DemandSpec:
    """The demand of a run: rising over the HCM's capacity, with the drivers that the command line changes."""
    target = hcm(zone_class, trucks=trucks)
    units = {key: f"{key}{'_s' if 'tau' in key else '_mps2' if 'accel' in key else ''}" for key in SETTINGS}
    changes = {units[key]: value for key in SETTINGS if (value := getattr(args, key)) is not None}
    drivers = DRIVER_PRESETS[f"hcm_{zone_class}"].model_copy(update=changes)
    more = {"lane_use": tuple(args.lane_use) if args.lane_use else LANE_USE.get(zone_class[:6], ())}
    if args.merge_ahead:
        more["merge_ahead_m"] = tuple(args.merge_ahead)
    flows = tuple((time, share * target.capacity_all_lanes_vph) for time, share in RAMP)
    return DemandSpec(flow_profile=flows, drivers=drivers, truck_share=trucks, duration_s=LONGEST_MIN * MINUTE_S, **more)


def measure_once(zone_class: str, *, demand: DemandSpec, seed: int, args: argparse.Namespace) -> None:
    drivers = demand.drivers
    approach_ft = args.approach_ft or APPROACH_FT[zone_class[:6]]
    case = {
        "zone_class": zone_class, "trucks": demand.truck_share, "seed": seed, "tau_s": drivers.tau_s,
        "accel_mps2": drivers.accel_mps2, "truck_tau_s": drivers.truck_tau_s, "truck_accel_mps2": drivers.truck_accel_mps2,
        "sigma": drivers.sigma, "lc_assertive": drivers.lc_assertive,
        "merge_ahead_m": "-".join(f"{m:g}" for m in demand.merge_ahead_m),
        "lane_use": "-".join(f"{share:g}" for share in demand.lane_use) or "even", "approach_ft": approach_ft,
    }  # fmt: skip
    if is_done(case, args.out):
        return
    row = case | measure(zone_class, demand=demand, seed=seed, approach_ft=approach_ft)
    append_row(row, args.out)
    print({key: round(value, 3) if isinstance(value, float) else value for key, value in row.items()}, file=sys.stderr)


def measure(zone_class: str, *, demand: DemandSpec, seed: int, approach_ft: float) -> dict:
    """One run: its discharge in passenger cars an hour and lane, and what SUMO counted."""
    target = hcm(zone_class, trucks=demand.truck_share)
    layout = lay_out_class(zone_class, approach_ft=approach_ft)
    began = cpu_seconds()
    with tempfile.TemporaryDirectory() as folder:
        files = write_sumo_files(layout, Path(folder), spec=SimulationSpec(demand=demand), seed=seed)
        minutes, statistics = run_until_discharge_is_known(files, layout)
    found = discharge_of(minutes)
    per_lane = {key: getattr(found, f"{key}_per_h") / target.open_lanes for key in ("queue_discharge", "peak_flow")}
    return {
        "target_pcphpl": target.queue_discharge_pcphpl, "discharge_pcphpl": per_lane["queue_discharge"],
        "capacity_pcphpl": per_lane["peak_flow"], "breakdown_min": found.breakdown_min, "discharge_min": found.n_discharge_min,
        "queue_speed_mps": float(minutes["upstream_speed_mps"].iloc[-AFTER_BREAKDOWN_MIN + 8 :].mean()),
        "off": per_lane["queue_discharge"] / target.queue_discharge_pcphpl - 1, "drop": found.drop,
        "cpu_s": cpu_seconds() - began, "counts": " ".join(f"{n:g}" for n in minutes["count_pc"]), **statistics,
    }  # fmt: skip


def hcm(zone_class: str, *, trucks: float) -> ZoneCapacity:
    total, closed = LANES[zone_class[:6]]
    site = SiteSpec(area=zone_class.rsplit("_", 1)[1])
    return zone_capacity(
        total_lanes=total, open_lanes=total - len(closed), posted_speed_mph=SPEED_MPH, truck_share=trucks, site=site
    )


def lay_out_class(zone_class: str, *, approach_ft: float) -> WorkZoneLayout:
    """A zone of that class, with cones on the lane line, whose road ends soon behind it."""
    total, closed = LANES[zone_class[:6]]
    zone = WorkZone(
        posted_speed_mph=SPEED_MPH, start_ft=approach_ft, closed_lanes=closed, closed_shoulder="left", work_length_ft=200
    )
    long = RoadSpec(lane_count=total, left_shoulder_ft=12, right_shoulder_ft=10, length_ft=approach_ft + 10000)
    end_ft = lay_out(zone, long.build()).end / 0.3048
    return lay_out(zone, long.model_copy(update={"length_ft": end_ft + BEYOND_FT}).build())


def run_until_discharge_is_known(files: SumoFiles, layout: WorkZoneLayout) -> tuple[pd.DataFrame, dict]:
    """Minutes (pc past the work, speed upstream) up to 23 minutes after the breakdown, and what SUMO counted.

    SUMO's own binary runs and is asked once a simulated minute: libsumo takes 15 to 20 % longer.
    """
    folder = files.config.parent
    work, open_lanes = layout.area("activity area"), len(files.edges[-1].lanes) - len(layout.work_zone.closed_lanes)
    last_open = max(edge.end for edge in files.edges if len(edge.lanes) > open_lanes and edge.end < work.start)
    stations = {"work": (work.start + work.end) / 2, "upstream": last_open - UPSTREAM_M}
    names = write_loops(files, stations, folder / "loops.add.xml")
    vehicles = ET.parse(folder / "zone.rou.xml").iter("vehicle")  # noqa: S314 our own file
    trucks = {vehicle.get("id") for vehicle in vehicles if "truck" in vehicle.get("type")}
    options = ("--additional-files", str(folder / "loops.add.xml"), "--statistic-output", str(folder / "statistics.xml"))
    traci.start([str(sumo_binary("sumo")), "-c", str(files.config), *options, "--no-warnings"])
    api, rows = traci.inductionloop, []
    for minute in range(1, LONGEST_MIN + 1):
        traci.simulationStep(minute * MINUTE_S)
        ids = [id_ for loop in names["work"] for id_ in api.getLastIntervalVehicleIDs(loop)]
        seen = [(api.getLastIntervalVehicleNumber(loop), api.getLastIntervalMeanSpeed(loop)) for loop in names["upstream"]]
        count = sum(n for n, _ in seen)
        speed = sum(n * v for n, v in seen if n) / count if count else np.nan
        rows.append((len(ids) + len(trucks.intersection(ids)) * (TRUCK_EQUIVALENT_PC - 1), speed))
        minutes = pd.DataFrame(rows, columns=["count_pc", "upstream_speed_mps"])
        if minute >= discharge_of(minutes).breakdown_min + AFTER_BREAKDOWN_MIN:
            break
    traci.close()
    return minutes, read_statistics(folder / "statistics.xml")


def read_statistics(path: Path) -> dict[str, int]:
    root = ET.parse(path).getroot()  # noqa: S314 SUMO's own file
    wanted = {
        "inserted": ("vehicles", "inserted"), "waiting": ("vehicles", "waiting"), "teleports": ("teleports", "total"),
        "emergency_stops": ("safety", "emergencyStops"), "emergency_braking": ("safety", "emergencyBraking"),
    }  # fmt: skip
    return {key: int(root.find(tag).get(name)) for key, (tag, name) in wanted.items()}


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


def is_done(case: dict, path: Path) -> bool:
    if not path.exists():
        return False
    with path.open(newline="") as file:
        return any(all(row[key] == str(value) for key, value in case.items()) for row in csv.DictReader(file))


def append_row(row: dict, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(row))
        if new:
            writer.writeheader()
        writer.writerow(row)


def cpu_seconds() -> float:
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


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
