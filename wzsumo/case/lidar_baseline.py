"""The LiDAR SLAM baseline: one car of the fleet drives through the zone, scans it and maps what it sees."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray, advance
from wzsumo.lidar_mapping.loam import map_drive
from wzsumo.lidar_mapping.posed_scan import PosedScan, trajectory_error_m, without_clouds
from wzsumo.lidar_mapping.slam_map import SlamMaps, build_maps
from wzsumo.scenario.scenario import Scenario
from wzsumo.scenario.sections import SlamSpec
from wzsumo.scenario.site import Site
from wzsumo.sensing.imu import read_motion
from wzsumo.sensing.lidar import Drive, cast_ahead, drive_scans
from wzsumo.sensing.scene import MIN_TRUCK_LENGTH_M, scene_of

EARLIEST_ENTRY_S = 120.0  # of the mapping car: by then the road is full of traffic, as it is for the ego; chosen by us
TRACE_END_TOLERANCE_M = (
    10.0  # the car's trace may begin so far after the ego's start and end so far before its goal; chosen by us
)
OUTLINE = ("length_m", "width_m")


@dataclass(frozen=True, kw_only=True, eq=False)
class LidarBaseline:
    """The maps of one mapping drive, and how accurately the car was localised on it."""

    maps: SlamMaps
    vehicle_id: str
    states: dict[str, int]  # number of scans by `ScanState`, which says how their pose was found
    ate_m: float  # absolute trajectory error: rms of the position error, first pose aligned
    dead_reckoning_ate_m: float
    poses: FloatArray  # (n, 4, 4) of the car at each scan: rear axle on the ground


def map_by_lidar(
    fleet: pd.DataFrame, spec: SlamSpec, *, scenario: Scenario, site: Site, on_share: Callable[[float], None]
) -> LidarBaseline:
    """The baseline's maps over the site's cells. `on_share` is called with the share of the drive that is mapped so far."""
    vehicle_id, drive = mapping_drive(fleet, scenario=scenario, site=site)
    scene = scene_of(site.layout, spec.scene, seed=scenario.seed)
    others = others_at(fleet[fleet["vehicle_id"] != vehicle_id], drive) if spec.traffic else None
    scans = cast_ahead(drive_scans(scene, drive, spec.lidar, seed=scenario.seed, vehicles_at=others))
    readings = read_motion(drive, scene.ground, spec.imu, spec.gnss, seed=scenario.seed)
    start = drive.car_poses(drive.time_s[:1], scene.ground)[0]
    log: list[PosedScan] = []
    posed = map_drive(scans, readings, spec.loam, mounting=spec.lidar.mounting, start=start)
    maps = build_maps(_logged(posed, log, on_share, drive), spec.maps, cells=site.cells)
    truth = drive.car_poses([scan.time_s for scan in log], scene.ground)
    poses, reckoned = (np.array([getattr(scan, name) for scan in log]) for name in ("pose", "dead_reckoned"))
    return LidarBaseline(
        maps=maps,
        vehicle_id=vehicle_id,
        states=dict(Counter(str(scan.state) for scan in log)),
        ate_m=_rms(trajectory_error_m(poses, truth)),
        dead_reckoning_ate_m=_rms(trajectory_error_m(reckoned, truth)),
        poses=poses,
    )


def mapping_drive(fleet: pd.DataFrame, *, scenario: Scenario, site: Site) -> tuple[str, Drive]:
    """(id, drive) of the first car that begins in the ego's lane and drives from the ego's start to its goal.

    Trucks do not count. Raises SpecError where the simulation has no such car.
    """
    road = site.layout.road
    (first, last), _ = road.to_sd([site.start[:2], site.goal[:2]])
    station, offset = road.to_sd(fleet[["x_m", "y_m"]])
    passing = fleet.assign(s=station, d=offset)
    passing = passing[(station >= first) & (station <= last) & (fleet["length_m"] < MIN_TRUCK_LENGTH_M).to_numpy()]
    right, left = road.lane_span(scenario.route.start_lane)
    for vehicle_id, trace in sorted(passing.groupby("vehicle_id"), key=lambda item: (item[1]["time_s"].min(), item[0])):
        begin, end = trace.iloc[0], trace.iloc[-1]
        whole = begin["s"] < first + TRACE_END_TOLERANCE_M and end["s"] > last - TRACE_END_TOLERANCE_M
        if begin["time_s"] >= EARLIEST_ENTRY_S and whole and right < begin["d"] < left:
            centre = trace[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float)
            poses = advance(centre, -scenario.vehicle.axle_to_centre_m)
            return str(vehicle_id), Drive(time_s=trace["time_s"].to_numpy(dtype=float), poses=poses)
    raise SpecError(
        f"slam: no car began in lane {scenario.route.start_lane} after {EARLIEST_ENTRY_S:g} s and drove through the zone; "
        "raise simulation.demand.flow_vph or simulation.demand.duration_s, or leave the LiDAR maps out"
    )


def others_at(fleet: pd.DataFrame, drive: Drive) -> Callable[[float], pd.DataFrame]:
    """A function of the time [s] that gives the vehicles then, each moved on from its last fix at constant velocity."""
    within = fleet[(fleet["time_s"] >= drive.time_s[0] - 1.0) & (fleet["time_s"] <= drive.time_s[-1])]
    table = within.sort_values("time_s", kind="stable")[
        ["time_s", "x_m", "y_m", "heading_rad", "speed_mps", *OUTLINE]
    ].to_numpy()
    times = np.ascontiguousarray(table[:, 0])

    def vehicles(time_s: float) -> pd.DataFrame:
        last = int(np.searchsorted(times, time_s + 1e-6))
        rows = table[np.searchsorted(times, times[last - 1]) : last] if last else table[:0]
        poses = advance(rows[:, 1:4], (time_s - rows[:, 0]) * rows[:, 4])
        return pd.DataFrame(np.column_stack([poses, rows[:, 5:]]), columns=["x_m", "y_m", "heading_rad", *OUTLINE])

    return vehicles


def _logged(
    posed: Iterable[PosedScan], log: list[PosedScan], on_share: Callable[[float], None], drive: Drive
) -> Iterator[PosedScan]:
    """The same scans; each is appended to `log` without its points as it passes."""
    for scan in posed:
        log.append(without_clouds(scan))
        on_share((scan.time_s - drive.time_s[0]) / (drive.time_s[-1] - drive.time_s[0]))
        yield scan


def _rms(error: FloatArray) -> float:
    return float(np.sqrt(np.mean(error**2)))
