"""LOAM beside dead reckoning, kiss-icp and small-gicp: error of the way, time a scan, memory; cones kept by SMRF; maps.

    python analysis/benchmarks/odometry.py [--metres 600] [--seed 61] [--scene guardrail] [--full-clouds]

Peers see the same deskewed clouds, full and without ground; small-gicp is given the dead reckoned motion as first guess,
kiss-icp keeps its own constant-velocity guess, which is how it is made. Neither can take GNSS.
"""

import argparse
import importlib.util
import resource
import time
from collections.abc import Iterator
from itertools import tee
from typing import Any, Protocol

import numpy as np
import pandas as pd

from wzsumo.frames import FloatArray
from wzsumo.grid import blank_grid
from wzsumo.lidar_mapping.loam import LoamSpec, map_drive
from wzsumo.lidar_mapping.posed_scan import PosedScan, trajectory_error_m
from wzsumo.lidar_mapping.slam_map import SlamMaps, SlamMapSpec, build_maps, compile_kernels
from wzsumo.rigid import inverse
from wzsumo.road import RoadSpec
from wzsumo.sensing import raycast
from wzsumo.sensing.imu import ImuSpec, MappingGnssSpec, read_motion
from wzsumo.sensing.lidar import Drive, LidarSpec, drive_scans
from wzsumo.sensing.scene import Scene, SceneSpec, road_scene

SPEED = 10.0
NO_FIX = MappingGnssSpec(gaps_s=((0.0, 1e9),))
SENSOR = LidarSpec()


def worlds(seed: int) -> Iterator[tuple[str, Scene, pd.DataFrame]]:
    """Cones every 60 ft beside the middle lane; the same with a guardrail on the right; the guardrail alone."""
    road = RoadSpec(lane_count=3, left_shoulder_ft=12, right_shoulder_ft=10, length_ft=3300).build()
    x = np.arange(60.0, 950.0, 18.288)
    cones = pd.DataFrame({"kind": "cone_36in", "x_m": x, "y_m": 7.4, "height_m": 0.9144, "radius_m": 0.1778})
    yield "cones", road_scene(road, cones, SceneSpec(), seed=seed), cones
    yield "cones + guardrail", road_scene(road, cones, SceneSpec(guardrail="right"), seed=seed), cones
    yield "guardrail", road_scene(road, cones.iloc[:0], SceneSpec(guardrail="right"), seed=seed), cones.iloc[:0]


def drive_of_length(metres: float) -> Drive:
    """From the right lane to the middle one at 10 m/s."""
    t = np.arange(0, metres / SPEED + 0.11, 0.1)
    x = 100 + SPEED * t
    y = 1.8 + 3.6 / (1 + np.exp(-(x - 300) / 25))
    return Drive(time_s=t, poses=np.column_stack([x, y, np.arctan(np.gradient(y, x))]))


def report(name: str, track: list[FloatArray], truth: FloatArray, spent_s: float) -> None:
    """One row; `track` are n poses (4, 4), `truth` (n, 4, 4)."""
    poses = np.array(track)
    error = trajectory_error_m(poses, truth)
    along = (inverse(truth) @ truth[0] @ inverse(poses[0]) @ poses)[:, 0, 3]
    way = np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1).sum()
    rms, rms_along, ms = np.sqrt(np.mean(error**2)), np.sqrt(np.mean(along**2)), 1000 * spent_s / len(poses)
    print(f"  {name:<34}{rms:>9.3f}{rms_along:>9.3f}{100 * error[-1] / way:>9.2f}{ms:>10.1f}", flush=True)


class Tracker(Protocol):
    """Somebody else's odometry."""

    def pose_of(self, cloud: FloatArray, reckoned: FloatArray, /) -> FloatArray:
        """Pose (4, 4) of the next cloud (n, 3), whose dead reckoned pose is (4, 4)."""


class KissIcp:
    """kiss-icp's odometry over clouds of single scans."""

    def __init__(self) -> None:
        from kiss_icp.config import load_config
        from kiss_icp.kiss_icp import KissICP

        config = load_config(None)
        config.data.deskew = False
        config.mapping.voxel_size = 0.5
        self.odometry = KissICP(config)

    def pose_of(self, cloud: FloatArray, _reckoned: FloatArray, /) -> FloatArray:
        self.odometry.register_frame(cloud, np.zeros(len(cloud)))
        return np.asarray(self.odometry.last_pose)


class SmallGicp:
    """small-gicp from scan to scan, the dead reckoned motion as first guess."""

    def __init__(self) -> None:
        self.last: tuple[FloatArray, FloatArray, FloatArray] | None = None

    def pose_of(self, cloud: FloatArray, reckoned: FloatArray, /) -> FloatArray:
        import small_gicp

        if self.last is None:
            pose = reckoned
        else:
            cloud_before, reckoned_before, pose_before = self.last
            motion = inverse(reckoned_before) @ reckoned
            if min(len(cloud), len(cloud_before)) > 20:
                options: dict[str, Any] = {"init_T_target_source": motion, "downsampling_resolution": 0.25}
                motion = np.asarray(small_gicp.align(cloud_before, cloud, **options).T_target_source)
            pose = pose_before @ motion
        self.last = cloud, reckoned, pose
        return pose


def peers(*, full_clouds: bool) -> dict[str, tuple[Tracker, bool]]:
    """Trackers by name and by whether they see the ground."""
    found: dict[str, tuple[Tracker, bool]] = {}
    known: tuple[tuple[str, str, type[KissIcp | SmallGicp]], ...] = (
        ("kiss_icp", "kiss-icp", KissIcp),
        ("small_gicp", "small-gicp + IMU", SmallGicp),
    )
    for module, name, tracker in known:
        if importlib.util.find_spec(module) is None:
            print(f"  {name}: not installed")
            continue
        found[f"{name}, without ground"] = (tracker(), False)
        if full_clouds:
            found[f"{name}, full cloud"] = (tracker(), True)
    return found


def run_scene(scene: Scene, drive: Drive, truth: FloatArray, seed: int, *, full_clouds: bool) -> SlamMaps:
    """Print a row for each way to follow the drive, and return the maps of LOAM with RTK; all see the same scans."""
    start = drive.car_poses([drive.time_s[0]], scene.ground)[0]
    scans = tee(drive_scans(scene, drive, SENSOR, seed=seed))
    ways: dict[str, Iterator[PosedScan]] = {}
    for part, (name, gnss) in zip(scans, (("LOAM + IMU", NO_FIX), ("LOAM + IMU + RTK", MappingGnssSpec())), strict=True):
        readings = read_motion(drive, scene.ground, ImuSpec(), gnss, seed=seed)
        ways[name] = map_drive(part, readings, LoamSpec(), mounting=SENSOR.mounting, start=start)
    others = peers(full_clouds=full_clouds)
    poses: dict[str, list[FloatArray]] = {name: [] for name in ("dead reckoning", *ways, *others)}
    spent = dict.fromkeys(poses, 0.0)

    def followed() -> Iterator[PosedScan]:
        """The scans as LOAM with RTK poses them; everybody else goes along."""
        while True:
            now: dict[str, PosedScan] = {}
            for name, way in ways.items():  # the first one has the casting in its time
                began = time.process_time()
                next_scan = next(way, None)
                spent[name] += time.process_time() - began
                if next_scan is not None:
                    now[name] = next_scan
            if not now:
                return
            posed = now["LOAM + IMU"]
            poses["dead reckoning"].append(posed.dead_reckoned)
            for name, done in now.items():
                poses[name].append(done.pose)
            for name, (tracker, full) in others.items():
                cloud = np.ascontiguousarray(posed.cloud if full else posed.cloud[posed.standing])
                began = time.process_time()
                poses[name].append(tracker.pose_of(cloud, posed.dead_reckoned))
                spent[name] += time.process_time() - began
            yield now["LOAM + IMU + RTK"]

    low, high = drive.poses[:, 0].min(), drive.poses[:, 0].max()
    cells = blank_grid((low - 20, -20.0, high + 20, 30.0), resolution=0.2, p_occupied=0.0)
    maps = build_maps(followed(), SlamMapSpec(), cells=cells)
    spent["LOAM + IMU"] = spent["LOAM + IMU + RTK"]  # the same work, without the casting
    for name, track in poses.items():
        report(name, track, truth, spent[name])
    return maps


def kept_cones(scene: Scene, drive: Drive, seed: int, *, within: float = 60.0, every: int = 5) -> tuple[int, int]:
    """(cones seen within a range, those of them of which SMRF leaves a point) over scans of a drive."""
    from wzsumo.lidar_mapping.smrf import ground_mask

    seen = kept = 0
    for k, scan in enumerate(drive_scans(scene, drive, SENSOR, seed=seed)):
        if k % every:
            continue
        near = scan.range_m < within
        standing = ~ground_mask(scan.points[near], LoamSpec().ground)
        numbers = scan.object_id[near]
        cones = [number for number in np.unique(numbers) if number > 0 and scene.kinds[number - 1].startswith("cone")]
        seen += len(cones)
        kept += sum(bool(standing[numbers == number].any()) for number in cones)
    return seen, kept


def tell_map(maps: SlamMaps, drive: Drive, cones: pd.DataFrame) -> None:
    """Print how many of the cones passed are in the map."""
    low, high = drive.poses[:, 0].min(), drive.poses[:, 0].max()
    passed = cones[["x_m", "y_m"]].to_numpy()[(cones["x_m"] > low + 5) & (cones["x_m"] < high - 5)]
    if 0 in {len(maps.devices), len(passed)}:
        print(f"  {len(passed)} cones passed, {len(maps.devices)} devices in the map")
        return
    apart = np.linalg.norm(passed[:, None] - maps.devices[None], axis=-1)
    found, false = (apart.min(axis=1) < 0.5).sum(), (apart.min(axis=0) >= 0.5).sum()
    print(f"  {found} of {len(passed)} cones passed are in the map, within {np.median(apart.min(axis=1)):.3f} m (median)")
    print(f"  {false} other devices, {len(maps.links)} links")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--metres", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=61)
    parser.add_argument("--scene", choices=["cones", "cones + guardrail", "guardrail"], help="only this one")
    parser.add_argument("--full-clouds", action="store_true", help="give them to the peers too: a second of CPU a scan")
    given = parser.parse_args()
    compile_kernels()
    raycast.compile_kernels()
    drive = drive_of_length(given.metres)
    scans = int((drive.time_s[-1] - drive.time_s[0]) * 10 + 1e-6)
    for name, scene, cones in worlds(given.seed):
        if given.scene not in {None, name}:
            continue
        truth = drive.car_poses(np.arange(scans) * 0.1, scene.ground)
        head = f"{'ATE m':>9}{'along m':>9}{'end %':>9}{'CPU ms':>10}"
        print(f"{name}: {given.metres:.0f} m, {scans} scans, seed {given.seed}\n  {'':<34}{head}")
        maps = run_scene(scene, drive, truth, given.seed, full_clouds=given.full_clouds)
        if len(cones):
            tell_map(maps, drive, cones)
            seen, kept = kept_cones(scene, drive, given.seed)
            print(f"  cones within 60 m: {seen} sightings, {100 * kept / max(seen, 1):.1f} % keep points after SMRF")
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GiB")


if __name__ == "__main__":
    main()
