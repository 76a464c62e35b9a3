"""`wzsumo register` beside small-gicp: error and time on pairs of ray-cast scans 0.5 to 2 m and 1 to 5 degrees apart.

python analysis/benchmarks/registration.py [--pairs 12]

Three scenes on rough ground: a street (houses, parked cars, poles), a work zone (cones, cars, poles) and a guardrail with
poles. Nobody gets a first guess. small-gicp sees the full clouds, and clouds without ground by this project's SMRF.
"""

import argparse
import importlib.util
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pandas as pd

from wzsumo.frames import FloatArray
from wzsumo.lidar_mapping.registration import RegistrationResult, RegistrationStatus, compile_kernels, register
from wzsumo.lidar_mapping.smrf import SmrfSpec, ground_mask
from wzsumo.rigid import inverse, vector_from_rotation
from wzsumo.road import RoadSpec
from wzsumo.sensing import raycast
from wzsumo.sensing.lidar import Drive, LidarSpec, cast_scan
from wzsumo.sensing.scene import Scene, SceneSpec, road_scene, with_vehicles

ROAD = RoadSpec(lane_count=3, left_shoulder_ft=12, right_shoulder_ft=10, length_ft=1500).build()
BOX_COLUMNS = ("x_m", "y_m", "heading_rad", "length_m", "width_m", "height_m")


def scenes(seed: int) -> Iterator[tuple[str, Scene]]:
    """(name, scene) of each; boxes stand for houses and cars."""
    rng = np.random.default_rng(seed)
    x = np.arange(60.0, 420.0, 18.288)
    cones = pd.DataFrame({"kind": "cone_36in", "x_m": x, "y_m": 7.4, "height_m": 0.9144, "radius_m": 0.1778})
    houses = [(s, y, rng.normal(0, 0.05), rng.uniform(10, 20), 9.0, rng.uniform(5, 9))
              for s in np.arange(40.0, 420.0, 32.0) for y in (-16.0, 24.0)]  # fmt: skip
    cars = [(s + rng.uniform(0, 6), y, rng.normal(0, 0.03), 4.6, 1.8, 1.5)
            for s in np.arange(50.0, 420.0, 14.0) for y in (-2.2, 13.5) if rng.random() < 0.6]  # fmt: skip
    yield "street", with_vehicles(road_scene(ROAD, cones.iloc[:0], SceneSpec(), seed=seed), _table(houses + cars))
    yield "work zone", with_vehicles(road_scene(ROAD, cones, SceneSpec(), seed=seed), _table(cars[::4]))
    yield "guardrail", road_scene(ROAD, cones.iloc[:0], SceneSpec(guardrail="right"), seed=seed)


def _table(boxes: Sequence[tuple[float, ...]]) -> pd.DataFrame:
    return pd.DataFrame(boxes, columns=list(BOX_COLUMNS))


def pair(scene: Scene, rng: np.random.Generator, *, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(source, target, true transform from source to target) of two still scans."""
    away, turn = rng.uniform(0.5, 2.0), np.deg2rad(rng.uniform(1, 5)) * rng.choice([-1, 1])
    aim = rng.uniform(-0.5, 0.5)
    first = np.array([rng.uniform(150, 300), rng.uniform(1.0, 5.5), rng.normal(0, 0.02)])
    second = first + np.array([away * np.cos(aim), away * np.sin(aim), turn])
    poses, clouds = [], []
    for number, pose in enumerate((first, second)):
        drive = Drive(time_s=np.array([0.0, 1.0]), poses=np.tile(pose, (2, 1)))
        scan = cast_scan(scene, drive, LidarSpec(), start_s=0.0, seed=2 * seed + number)
        poses.append(drive.car_poses([0.0], scene.ground)[0] @ LidarSpec().mounting)
        clouds.append(scan.points)
    return clouds[1], clouds[0], inverse(poses[0]) @ poses[1]


def errors(found: FloatArray, truth: FloatArray) -> tuple[float, float]:
    """(translation [m], rotation [deg]) between two transforms."""
    off = inverse(truth) @ found
    return float(np.linalg.norm(off[:3, 3])), float(np.rad2deg(np.linalg.norm(vector_from_rotation(off[:3, :3]))))


def run_small_gicp(source: FloatArray, target: FloatArray) -> FloatArray:
    import small_gicp

    result = small_gicp.align(target, source, downsampling_resolution=0.25, max_correspondence_distance=2.0)
    return np.asarray(result.T_target_source)


def standing(cloud: FloatArray) -> FloatArray:
    return cloud[~ground_mask(cloud, SmrfSpec(elevation_threshold_m=0.2))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=12, help="of each scene")
    parser.add_argument("--seed", type=int, default=61)
    given = parser.parse_args()
    compile_kernels()
    raycast.compile_kernels()
    ways: dict[str, Callable[[FloatArray, FloatArray], RegistrationResult | FloatArray]] = {"wzsumo register": register}
    if importlib.util.find_spec("small_gicp"):
        ways["small-gicp, full"] = run_small_gicp
        ways["small-gicp, no ground"] = lambda source, target: run_small_gicp(standing(source), standing(target))
    else:
        print("small-gicp: not installed")
    print(f"{'scene':<12}{'':<24}{'median m':>10}{'worst m':>10}{'median deg':>12}{'worst deg':>11}{'< 10 cm':>9}{'CPU ms':>8}")
    for name, scene in scenes(given.seed):
        rng = np.random.default_rng(given.seed)
        pairs = [pair(scene, rng, seed=number) for number in range(given.pairs)]
        for way, run in ways.items():
            rows, states = [], []
            for source, target, truth in pairs:
                start = time.process_time()
                found = run(source, target)
                spent = 1000 * (time.process_time() - start)
                if isinstance(found, RegistrationResult):
                    status, transform = found.status, found.transform
                else:
                    status, transform = RegistrationStatus.CONVERGED, found
                states.append(status)
                rows.append([*errors(transform, truth), spent])
            metres, degrees, ms = np.array(rows).T
            told = {str(state): states.count(state) for state in set(states)}
            print(
                f"{name:<12}{way:<24}{np.median(metres):>10.3f}{metres.max():>10.3f}{np.median(degrees):>12.3f}"
                f"{degrees.max():>11.3f}{(metres < 0.1).sum():>6}/{len(rows)}{np.median(ms):>8.0f}"
                + (f"   {told}" if way.startswith("wzsumo") else ""),
                flush=True,
            )


if __name__ == "__main__":
    main()
