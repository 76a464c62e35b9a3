"""Ray casting beside embree (PyPI embreex, with 24-gon cones): time of a scan of 230 k rays, agreement of what was hit.

python analysis/benchmarks/raycast.py [--quick]
"""

import importlib.util
import statistics
import sys
import time
from collections.abc import Callable
from typing import TypeVar

import numba
import numpy as np
import numpy.typing as npt
import pandas as pd

from wzsumo.frames import FloatArray, IntArray
from wzsumo.road import RoadSpec
from wzsumo.sensing.ground import GroundSpec
from wzsumo.sensing.lidar import Drive, LidarSpec, cast_scan
from wzsumo.sensing.raycast import Hits, cast_rays, compile_kernels
from wzsumo.sensing.scene import Scene, SceneSpec, road_scene, with_vehicles

SIDES = 24
Result = TypeVar("Result")


def busy_zone(ground: GroundSpec) -> Scene:
    """400 cones, 20 vehicles, a guardrail of boxes on both sides, poles: all within 120 m or so of the sensor."""
    rng = np.random.default_rng(1)
    road = RoadSpec(lane_count=3, left_shoulder_ft=12, right_shoulder_ft=10, length_ft=1000).build()
    xy = np.column_stack([rng.uniform(30, 270, 400), rng.uniform(0, 14, 400)])
    cones = pd.DataFrame({"kind": "cone_36in", "x_m": xy[:, 0], "y_m": xy[:, 1], "height_m": 0.9144, "radius_m": 0.1778})
    scene = road_scene(road, cones, SceneSpec(ground=ground, guardrail="both"), seed=1)
    x = np.concatenate([np.linspace(40, 140, 10), np.linspace(160, 260, 10)])  # none overlap: coincident faces have two owners
    columns = {"x_m": x, "y_m": rng.choice([1.8, 5.5, 9.1], 20), "heading_rad": 0.0, "length_m": 4.6, "width_m": 1.8}
    return with_vehicles(scene, pd.DataFrame(columns))


def mesh_of(scene: Scene) -> tuple[npt.NDArray[np.float32], IntArray, IntArray]:
    """Vertices, triangles and the object id of each triangle; cones as SIDES-gons whose corners lie on the circle."""
    corners: list[FloatArray] = []
    faces: list[IntArray] = []
    owner: list[int] = []

    def add(points: FloatArray, triangles: npt.ArrayLike, number: int) -> None:
        rows = np.asarray(triangles)
        faces.extend(rows + sum(map(len, corners)))
        corners.append(points)
        owner.extend([number] * len(rows))

    turn = 2 * np.pi * np.arange(SIDES) / SIDES
    circle = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(SIDES)])
    k, after = np.arange(SIDES), (np.arange(SIDES) + 1) % SIDES
    mantle = np.vstack([np.column_stack([k, after, after + SIDES]), np.column_stack([k, after + SIDES, k + SIDES])])
    lids = np.vstack([np.column_stack([after, k, np.full(SIDES, 2 * SIDES)]), np.column_stack([k, after, np.full(SIDES, -1)])])
    lids[SIDES:, :2] += SIDES
    lids[SIDES:, 2] = 2 * SIDES + 1
    number = 0
    for number, (x, y, z, _, _, _, height, foot, top) in enumerate(scene.frusta, start=1):
        base, tip = np.array([x, y, z]), np.array([x, y, z + height])
        add(np.vstack([base + foot * circle, tip + top * circle, [base], [tip]]), np.vstack([mantle, lids]), number)
    sides = [[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5]]
    sides += [[2, 3, 7], [2, 7, 6], [0, 6, 4], [0, 2, 6], [1, 5, 7], [1, 7, 3]]
    signs = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    for offset, box in enumerate(scene.boxes, start=1):
        local = signs * box[3:6]
        c, s = box[6:8]
        turned = np.column_stack([local[:, 0] * c - local[:, 1] * s, local[:, 0] * s + local[:, 1] * c, local[:, 2]])
        add(turned + box[:3], sides, number + offset)
    square = np.array([(a, b) for a in (-2000.0, 2000.0) for b in (-2000.0, 2000.0)])
    z = scene.ground.level + square @ np.array(scene.ground.slope)
    add(np.column_stack([square, z]), [[0, 1, 3], [0, 3, 2]], 0)
    return np.vstack(corners).astype(np.float32), np.array(faces), np.array(owner)


def timed(function: Callable[[], Result], *, runs: int) -> tuple[float, float, Result]:
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        result = function()
        times.append(1000 * (time.perf_counter() - start))
    return statistics.median(times), min(times), result


def main() -> None:
    compile_kernels()
    runs = 5 if "--quick" in sys.argv else 25
    spec = LidarSpec()
    drive = Drive(time_s=np.array([0.0, 10.0]), poses=np.array([[150.0, 5.5, 0], [150.0, 5.5, 0]]))
    moving = Drive(time_s=np.array([0.0, 10.0]), poses=np.array([[0.0, 5.5, 0], [300.0, 5.5, 0]]))
    smooth = busy_zone(GroundSpec(road_roughness_m=0, verge_roughness_m=0))
    rough = busy_zone(GroundSpec())

    def cast(scene: Scene, poses: FloatArray) -> Hits:
        return cast_rays(scene, poses=poses, azimuth=spec.azimuth, elevation=spec.elevation, max_range=spec.max_range_m)

    rays, threads = spec.layers * spec.azimuth_count, numba.get_num_threads()
    print(f"{rays} rays, {len(smooth.frusta)} frusta, {len(smooth.boxes)} boxes, {threads} thread(s)")
    print(f"{'case':<38}{'median ms':>10}{'best ms':>9}")
    poses = drive.car_poses(np.zeros(spec.azimuth_count), smooth.ground) @ spec.mounting
    ours_ms, best, hits = timed(lambda: cast(smooth, poses), runs=runs)
    print(f"{'smooth plane, standing still':<38}{ours_ms:>10.1f}{best:>9.1f}")
    along = moving.car_poses(5.0 + np.arange(spec.azimuth_count) / 18000, rough.ground) @ spec.mounting
    rough_ms, best, _ = timed(lambda: cast(rough, along), runs=runs)
    print(f"{'rough ground, moving at 30 m/s':<38}{rough_ms:>10.1f}{best:>9.1f}")
    scan_ms, best, scan = timed(lambda: cast_scan(rough, moving, spec, start_s=5.0, seed=1), runs=runs)
    print(f"{'the same with noise, drop-out, points':<38}{scan_ms:>10.1f}{best:>9.1f}   {len(scan.points)} returns")
    if importlib.util.find_spec("embreex") is None:
        print("embreex: not installed (pip install embreex)")
        return
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    start = time.perf_counter()
    vertices, faces, owner = mesh_of(smooth)
    world = rtcore_scene.EmbreeScene()
    TriangleMesh(world, vertices, faces.astype(np.int32))
    origin = np.tile(poses[0, :3, 3], (hits.distance.size, 1)).astype(np.float32)
    across = np.cos(spec.elevation)
    forward, left = across * np.cos(spec.azimuth)[:, None], across * np.sin(spec.azimuth)[:, None]
    local = np.stack([forward, left, np.broadcast_to(np.sin(spec.elevation), forward.shape)], axis=-1).reshape(-1, 3)
    direction = np.ascontiguousarray(local @ poses[0, :3, :3].T, dtype=np.float32)
    reach = np.full(len(origin), spec.max_range_m, dtype=np.float32)
    build_ms = 1000 * (time.perf_counter() - start)
    peer_ms, best, result = timed(lambda: world.run(origin, direction, dists=reach, output=True), runs=runs)
    name, ratio = f"embree, smooth plane, {SIDES}-gons", ours_ms / peer_ms
    print(
        f"{name:<38}{peer_ms:>10.1f}{best:>9.1f}   ratio ours / embree {ratio:.2f}; its scene takes {build_ms:.0f} ms to build"
    )
    triangle = np.asarray(result["primID"]).reshape(hits.object_id.shape)
    theirs = np.where(triangle >= 0, owner[triangle], -1)
    same = theirs == hits.object_id
    apart = np.abs(np.asarray(result["tfar"]).reshape(same.shape) - hits.distance)[same & (theirs >= 0)]
    print(f"same object id: {100 * same.mean():.4f} %; difference of range: median {np.median(apart):.1e} m, "
          f"99.9 % {np.quantile(apart, 0.999):.1e} m")  # fmt: skip


if __name__ == "__main__":
    main()
