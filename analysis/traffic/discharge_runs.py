"""One run of a work zone until a queue has discharged for 15 minutes: `calibrate_traffic.py` repeats it over classes and seeds.

The zone is the toolkit's own (12 ft lanes, cones on the lane line, 60 mph, by day), with the toolkit's network and drivers, at
0.1 s and with sublanes of 0.45 m. Its road is short: a queue that reaches the road's start waits outside, and its discharge
does not depend on that as long as it fills the road ahead of the closing lane.
"""

import os
import tempfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import traci

from wzsumo.capacity import TRUCK_EQUIVALENT_PC, SiteSpec, ZoneCapacity, zone_capacity
from wzsumo.metrics.discharge import Discharge, bottleneck_discharge
from wzsumo.metrics.lock import LOCKED_S
from wzsumo.mutcd.layout import lay_out
from wzsumo.road import RoadSpec
from wzsumo.simulation.connection import sumo_binary
from wzsumo.simulation.demand import DemandSpec
from wzsumo.simulation.drivers import DriverSpec
from wzsumo.simulation.files import SimulationSpec, SumoFiles, write_sumo_files
from wzsumo.simulation.gridlock import CHECK_S, Gridlock
from wzsumo.units import feet_from_metres, mps_from_mph
from wzsumo.work_zone import WorkZone, WorkZoneLayout

SPEED_MPH = 60.0
LANES = {"2_to_1": (2, (1,)), "3_to_2": (3, (2,)), "3_to_1": (3, (2, 1))}
ZONE_CLASSES = tuple(f"{lanes}_{area}" for lanes in LANES for area in ("urban", "rural"))
# Demand as a share of the HCM's capacity from these times [s] on. It rises so slowly that the 15 minutes before the breakdown
# tell the capacity, and it ends so far above it that every run breaks down.
DEMAND_RAMP = ((0.0, 0.75), (480.0, 0.8), (960.0, 0.85), (1440.0, 0.9), (1920.0, 0.95), (2400.0, 1.0), (2880.0, 1.25))
LONGEST_MIN = 80
DISCHARGE_MIN = 15  # minutes that are counted, once a queue has stood for 8: the HCM means 15-minute flows
UPSTREAM_M = 320.0  # ahead of the closing lane's end, where a queue is looked for
# From the road's start to the first device. Where two lanes close, two tapers and a tangent follow, so less is enough.
APPROACH_FT = {"2_to_1": 1600.0, "3_to_2": 1600.0, "3_to_1": 1000.0}
BEYOND_FT = 300.0  # from the last device to the road's end
MINUTE_S = 60.0


def hcm(zone_class: str, *, trucks: float) -> ZoneCapacity:
    """The HCM's figures for a class of zones, such as "2_to_1_urban"."""
    total, closed = LANES[zone_class[:6]]
    site = SiteSpec(area=zone_class.rsplit("_", 1)[1])
    return zone_capacity(
        total_lanes=total, open_lanes=total - len(closed), posted_speed_mph=SPEED_MPH, truck_share=trucks, site=site
    )


def measure(
    zone_class: str,
    *,
    trucks: float,
    drivers: DriverSpec,
    seed: int,
    approach_ft: float,
    ramp: tuple[tuple[float, float], ...] = DEMAND_RAMP,
) -> dict[str, Any]:
    """One run: passenger cars past the work and speed upstream minute by minute, CPU seconds, and what SUMO counted."""
    target = hcm(zone_class, trucks=trucks)
    demand = DemandSpec(
        flow_profile=tuple((time, share * target.capacity_all_lanes_vph) for time, share in ramp),
        truck_share=trucks, drivers=drivers, duration_s=LONGEST_MIN * MINUTE_S,
    )  # fmt: skip
    layout = lay_out_class(zone_class, approach_ft=approach_ft)
    began = cpu_seconds()
    with tempfile.TemporaryDirectory() as folder:
        files = write_sumo_files(layout, Path(folder), spec=SimulationSpec(demand=demand), seed=seed)
        minutes, locked_min, statistics = run_until_discharge_is_known(files, layout)
    series = {"counts": minutes["count_pc"], "speeds_mps": minutes["upstream_speed_mps"].round(1)}
    return {
        "cpu_s": round(cpu_seconds() - began, 1), "locked_min": locked_min, **statistics,
        **{name: " ".join(f"{value:g}" for value in values) for name, values in series.items()},
    }  # fmt: skip


def flows_of(zone_class: str, *, trucks: float, counts: str, speeds_mps: str) -> dict[str, float]:
    """Target, discharge and capacity [pc/h/lane] of a run of `measure`, its drop, and how far it is off the target."""
    target = hcm(zone_class, trucks=trucks)
    minutes = pd.DataFrame({"count_pc": _numbers(counts), "upstream_speed_mps": _numbers(speeds_mps)})
    found = discharge_of(minutes)
    discharge, capacity = (flow / target.open_lanes for flow in (found.queue_discharge_per_h, found.peak_flow_per_h))
    return {
        "target": target.queue_discharge_pcphpl, "discharge": discharge, "capacity": capacity, "drop": found.drop,
        "off": discharge / target.queue_discharge_pcphpl - 1, "breakdown_min": found.breakdown_min,
        "discharge_min": found.n_discharge_min, "queue_speed_mps": minutes["upstream_speed_mps"].iloc[-DISCHARGE_MIN:].mean(),
    }  # fmt: skip


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]


def lay_out_class(zone_class: str, *, approach_ft: float) -> WorkZoneLayout:
    """A zone of a class on a road that ends soon behind it."""
    total, closed = LANES[zone_class[:6]]
    zone = WorkZone(
        posted_speed_mph=SPEED_MPH, start_ft=approach_ft, closed_lanes=closed, closed_shoulder="left", work_length_ft=200
    )
    long = RoadSpec(lane_count=total, left_shoulder_ft=12, right_shoulder_ft=10, length_ft=approach_ft + 10000)
    end_ft = feet_from_metres(lay_out(zone, long.build()).end)
    return lay_out(zone, long.model_copy(update={"length_ft": end_ft + BEYOND_FT}).build())


def run_until_discharge_is_known(files: SumoFiles, layout: WorkZoneLayout) -> tuple[pd.DataFrame, int | None, dict[str, int]]:
    """Minutes (pc past the work, speed upstream) until 15 of queue discharge are seen, and what SUMO counted.

    A run ends, too, in the minute in which a vehicle has stood for LOCKED_S; the second value is that minute.

    SUMO's own binary runs: libsumo takes 15 to 20 % longer. Vehicles that wait for each other are let go, as in the fleet's
    runs.
    """
    folder = files.config.parent
    names = write_loops(files, stations_of_loops(files, layout), folder / "loops.add.xml")
    vehicles = ET.parse(folder / "zone.rou.xml").iter("vehicle")
    trucks = {vehicle.get("id") for vehicle in vehicles if "truck" in vehicle.get("type", "")}
    options = ("--additional-files", str(folder / "loops.add.xml"), "--statistic-output", str(folder / "statistics.xml"))
    traci.start([str(sumo_binary("sumo")), "-c", str(files.config), *options, "--no-warnings"])
    api, rows, locked_min = traci.inductionloop, [], None
    gridlock = Gridlock(traci, [edge.id for edge in files.edges])
    for minute in range(1, LONGEST_MIN + 1):
        for time in np.arange((minute - 1) * MINUTE_S, minute * MINUTE_S, CHECK_S) + CHECK_S:
            traci.simulationStep(time)
            gridlock.resolve()
        ids = [id_ for loop in names["work"] for id_ in api.getLastIntervalVehicleIDs(loop)]
        seen = [(api.getLastIntervalVehicleNumber(loop), api.getLastIntervalMeanSpeed(loop)) for loop in names["upstream"]]
        count = sum(n for n, _ in seen)
        speed = sum(n * v for n, v in seen if n) / count if count else np.nan
        rows.append((len(ids) + len(trucks.intersection(ids)) * (TRUCK_EQUIVALENT_PC - 1), speed))
        minutes = pd.DataFrame(rows, columns=["count_pc", "upstream_speed_mps"])
        if any(traci.vehicle.getWaitingTime(name) > LOCKED_S for name in traci.vehicle.getIDList()):
            locked_min = minute
        if locked_min or discharge_of(minutes).n_discharge_min >= DISCHARGE_MIN:
            break
    traci.close()
    return minutes, locked_min, read_statistics(folder / "statistics.xml")


def discharge_of(minutes: pd.DataFrame) -> Discharge:
    """Breakdown, capacity and queue discharge of a run's minutes."""
    return bottleneck_discharge(minutes["count_pc"], minutes["upstream_speed_mps"], free_speed=mps_from_mph(SPEED_MPH))


def stations_of_loops(files: SumoFiles, layout: WorkZoneLayout) -> dict[str, float]:
    """Stations [m] where flow is counted and where a queue shows."""
    work, zone = layout.area("activity area"), layout.work_zone
    n_open = layout.road.own_lanes - len(zone.closed_lanes)
    last_merge = max(edge.end for edge in files.edges if len(edge.through_lanes) > n_open and edge.end < work.start)
    return {"work": (work.start + work.end) / 2, "upstream": last_merge - UPSTREAM_M}


def write_loops(files: SumoFiles, stations: dict[str, float], path: Path) -> dict[str, list[str]]:
    """Write an induction loop a lane at each station; returns their names by station."""
    root, names = ET.Element("additional"), {}
    for name, station in stations.items():
        edge = next(edge for edge in files.edges if edge.start <= station < edge.end)
        names[name] = [f"{name}_{lane}" for lane in range(len(edge.lanes))]
        for lane, id_ in enumerate(names[name]):
            place = {"lane": f"{edge.id}_{lane}", "pos": f"{station - edge.start:.2f}"}
            ET.SubElement(root, "inductionLoop", place, id=id_, period=f"{MINUTE_S:g}", file="loops.xml")
    ET.ElementTree(root).write(path)
    return names


def read_statistics(path: Path) -> dict[str, int]:
    """Vehicles, teleports and emergency manoeuvres that SUMO counted."""
    root = ET.parse(path).getroot()
    wanted = {
        "inserted": ("vehicles", "inserted"), "waiting": ("vehicles", "waiting"), "teleports": ("teleports", "total"),
        "emergency_stops": ("safety", "emergencyStops"), "emergency_braking": ("safety", "emergencyBraking"),
    }  # fmt: skip
    return {key: int(root.findall(tag)[0].attrib[name]) for key, (tag, name) in wanted.items()}


def cpu_seconds() -> float:
    """CPU time [s] of this process and of those that it waited for."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system
