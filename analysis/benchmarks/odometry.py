"""LOAM beside dead reckoning, kiss-icp and small-gicp: error of the way, time a scan, memory; cones kept by SMRF; maps.

    python analysis/benchmarks/odometry.py [--metres 600] [--seed 1]

Peers see the same deskewed clouds, full and without ground; small-gicp is given the dead reckoned motion as first guess,
kiss-icp keeps its own constant-velocity guess, which is how it is made. Neither can take GNSS.
"""

import argparse
import importlib.util
import resource
import time

import numpy as np
import pandas as pd

from wzsumo.grid import blank_grid
from wzsumo.lidar_mapping.loam import LoamSpec, map_drive, trajectory_error_m
from wzsumo.lidar_mapping.slam_map import SlamMapSpec, build_maps, compile_kernels
from wzsumo.rigid import inverse
from wzsumo.road import RoadSpec
from wzsumo.sensing import raycast
from wzsumo.sensing.imu import ImuSpec, MappingGnssSpec, read_motion
from wzsumo.sensing.lidar import Drive, LidarSpec, cast_ahead, drive_scans
from wzsumo.sensing.scene import SceneSpec, road_scene

SPEED = 10.0
NO_FIX = MappingGnssSpec(gaps_s=((0.0, 1e9),))
SENSOR = LidarSpec()


def worlds(seed):
    """Cones every 60 ft beside the middle lane; the same with a guardrail on the right; the guardrail alone."""
    road = RoadSpec(lane_count=3, left_shoulder_ft=12, right_shoulder_ft=10, length_ft=3300).build()
    x = np.arange(60.0, 950.0, 18.288)
    cones = pd.DataFrame({"kind": "cone_36in", "x_m": x, "y_m": 7.4, "height_m": 0.9144, "radius_m": 0.1778})
    yield "cones", road_scene(road, cones, SceneSpec(), seed=seed), cones
    yield "cones + guardrail", road_scene(road, cones, SceneSpec(guardrail="right"), seed=seed), cones
    yield "guardrail", road_scene(road, cones.iloc[:0], SceneSpec(guardrail="right"), seed=seed), cones.iloc[:0]


def drive_of_length(metres):
    """From the right lane to the middle one at 10 m/s."""
    t = np.arange(0, metres / SPEED + 0.11, 0.1)
    x = 100 + SPEED * t
    y = 1.8 + 3.6 / (1 + np.exp(-(x - 300) / 25))
    return Drive(time_s=t, poses=np.column_stack([x, y, np.arctan(np.gradient(y, x))]))


def timed(items, spent):
    """The same items, with the seconds that each took to come added to spent[0]."""
    items = iter(items)
    while True:
        start = time.perf_counter()
        item = next(items, None)
        spent[0] += time.perf_counter() - start
        if item is None:
            return
        yield item


def report(name, poses, truth, ms):
    """One row; `poses` and `truth` (n, 4, 4)."""
    error = trajectory_error_m(np.array(poses), truth)
    along = (inverse(truth) @ truth[0] @ inverse(poses[0]) @ np.array(poses))[:, 0, 3]
    way = np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1).sum()
    rms, rms_along = np.sqrt(np.mean(error**2)), np.sqrt(np.mean(along**2))
    print(f"  {name:<34}{rms:>9.3f}{rms_along:>9.3f}{100 * error[-1] / way:>9.2f}{ms:>10.1f}")


def run_loam(scene, drive, gnss, seed, clouds=None):
    """(poses, dead reckoned poses, ms of mapping, ms of casting), and the clouds of every scan where wanted."""
    readings = read_motion(drive, scene.ground, ImuSpec(), gnss, seed=seed)
    cast_s, start = [0.0], time.perf_counter()
    scans = timed(drive_scans(scene, drive, SENSOR, seed=seed), cast_s)
    first = drive.car_poses([drive.time_s[0]], scene.ground)[0]
    poses, reckoned = [], []
    for posed in map_drive(scans, readings, LoamSpec(), mounting=SENSOR.mounting, start=first):
        poses.append(posed.pose)
        reckoned.append(posed.dead_reckoned)
        if clouds is not None:
            clouds.append((posed.cloud.astype(np.float32), posed.standing))
    n = len(poses)
    whole_s = time.perf_counter() - start
    return np.array(poses), np.array(reckoned), 1000 * (whole_s - cast_s[0]) / n, 1000 * cast_s[0] / n


def run_kiss(clouds):
    from kiss_icp.config import load_config
    from kiss_icp.kiss_icp import KissICP

    config = load_config(None)
    config.data.deskew = False
    config.mapping.voxel_size = 0.5
    odometry, poses = KissICP(config), []
    start = time.perf_counter()
    for cloud in clouds:
        odometry.register_frame(cloud.astype(float), np.zeros(len(cloud)))
        poses.append(odometry.last_pose)
    return np.array(poses), 1000 * (time.perf_counter() - start) / len(poses)


def run_small_gicp(clouds, reckoned):
    import small_gicp

    poses = [reckoned[0]]
    start = time.perf_counter()
    for k in range(1, len(clouds)):
        guess = inverse(reckoned[k - 1]) @ reckoned[k]
        if min(len(clouds[k]), len(clouds[k - 1])) > 20:
            pair = clouds[k - 1].astype(float), clouds[k].astype(float)
            guess = small_gicp.align(*pair, init_T_target_source=guess, downsampling_resolution=0.25).T_target_source
        poses.append(poses[-1] @ guess)
    return np.array(poses), 1000 * (time.perf_counter() - start) / len(poses)


def run_peers(clouds, truth, reckoned):
    for name, chosen in (("without ground", [c[s] for c, s in clouds]), ("full cloud", [c for c, _ in clouds])):
        if importlib.util.find_spec("kiss_icp"):
            report(f"kiss-icp, {name}", *_with_truth(run_kiss(chosen), truth))
        if importlib.util.find_spec("small_gicp"):
            report(f"small-gicp + IMU, {name}", *_with_truth(run_small_gicp(chosen, reckoned), truth))
    for peer in ("kiss_icp", "small_gicp"):
        if importlib.util.find_spec(peer) is None:
            print(f"  {peer}: not installed")


def _with_truth(result, truth):
    return result[0], truth, result[1]


def kept_cones(scene, drive, seed, *, within=60.0, every=5):
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
        kept += sum(standing[numbers == number].any() for number in cones)
    return seen, kept


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--metres", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    compile_kernels()
    raycast.compile_kernels()
    drive = drive_of_length(given.metres)
    scans = int((drive.time_s[-1] - drive.time_s[0]) * 10 + 1e-6)
    for name, scene, cones in worlds(given.seed):
        truth = drive.car_poses(np.arange(scans) * 0.1, scene.ground)
        print(f"{name}: {given.metres:.0f} m, {scans} scans\n  {'':<34}{'ATE m':>9}{'along m':>9}{'end %':>9}{'ms/scan':>10}")
        clouds = []
        poses, reckoned, ms, cast_ms = run_loam(scene, drive, NO_FIX, given.seed, clouds)
        report("dead reckoning", reckoned, truth, 0.0)
        report("LOAM + IMU", poses, truth, ms)
        run_peers(clouds, truth, reckoned)
        poses, _, ms, _ = run_loam(scene, drive, MappingGnssSpec(), given.seed)
        report("LOAM + IMU + RTK", poses, truth, ms)
        print(f"  casting {cast_ms:.1f} ms a scan")
        if len(cones):
            seen, kept = kept_cones(scene, drive, given.seed)
            print(f"  cones within 60 m: {seen} sightings, {100 * kept / max(seen, 1):.1f} % keep points after SMRF")
            print_maps(scene, drive, cones, given.seed)
    print(
        f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GiB (clouds kept for the peers included)"
    )


def print_maps(scene, drive, cones, seed):
    """Time of the whole chain, and how many of the cones passed are found and joined."""
    readings = read_motion(drive, scene.ground, ImuSpec(), MappingGnssSpec(), seed=seed)
    first = drive.car_poses([drive.time_s[0]], scene.ground)[0]
    scans = cast_ahead(drive_scans(scene, drive, SENSOR, seed=seed))
    low, high = drive.poses[:, 0].min(), drive.poses[:, 0].max()
    start = time.perf_counter()
    posed = map_drive(scans, readings, LoamSpec(), mounting=SENSOR.mounting, start=first)
    cells = blank_grid((low - 20, -20.0, high + 20, 30.0), resolution=0.2, p_occupied=0.0)
    maps = build_maps(posed, SlamMapSpec(), cells=cells)
    ms = 1000 * (time.perf_counter() - start) / (10 * (drive.time_s[-1] - drive.time_s[0]))
    passed = cones[["x_m", "y_m"]].to_numpy()[(cones["x_m"] > low + 5) & (cones["x_m"] < high - 5)]
    apart = (
        np.linalg.norm(passed[:, None] - maps.devices[None], axis=-1)
        if len(maps.devices)
        else np.full((len(passed), 1), np.inf)
    )
    found, false = (apart.min(axis=1) < 0.5).sum(), len(maps.devices) - (apart.min(axis=0) < 0.5).sum()
    print(f"  whole chain (cast, SMRF, LOAM, maps): {ms:.0f} ms a scan on two threads")
    print(f"  {found} of {len(passed)} cones passed are in the map, within {np.median(apart.min(axis=1)):.3f} m (median)")
    print(f"  {false} other devices, {len(maps.links)} links")


if __name__ == "__main__":
    main()
