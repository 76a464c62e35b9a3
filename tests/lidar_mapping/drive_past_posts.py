"""A car on an arc among posts, in closed form: its scans, its motion readings and its true poses."""

from collections.abc import Callable, Iterable

import numpy as np
import numpy.typing as npt

from wzsumo.frames import FloatArray
from wzsumo.lidar_mapping.loam import LoamSpec, map_drive
from wzsumo.lidar_mapping.posed_scan import PosedScan
from wzsumo.rigid import rigid, rotation_from_rpy
from wzsumo.scan import LidarScan, MotionReadings

AZIMUTH = -np.pi + 2 * np.pi * np.arange(900) / 900
ELEVATION = np.deg2rad(np.linspace(-22, 4, 40))
MOUNT = rigid(np.eye(3), [0.0, 0.0, 1.9])
POSTS = np.array([(x, y) for x in range(-30, 90, 13) for y in (-7.0, 6.0)]) + np.linspace(0, 3, 20)[:, None] * (1, 0.3)
RADIUS, HEIGHT = 0.15, 1.6


def scan_of_posts(pose: FloatArray, *, start_s: float, seed: int, posts: FloatArray = POSTS, noise: float = 0.01) -> LidarScan:
    """A scan of a car that stands at a pose (4, 4): flat ground z = 0 and upright cylinders, in closed form."""
    rng = np.random.default_rng(seed)
    sensor = pose @ MOUNT
    column, ring = (grid.ravel() for grid in np.meshgrid(np.arange(900), np.arange(40), indexing="ij"))
    across = np.cos(ELEVATION)[ring]
    local = np.column_stack([across * np.cos(AZIMUTH)[column], across * np.sin(AZIMUTH)[column], np.sin(ELEVATION)[ring]])
    d = local @ sensor[:3, :3].T
    with np.errstate(divide="ignore"):
        t = np.where(d[:, 2] < 0, -sensor[2, 3] / d[:, 2], np.inf)
    hit = np.zeros(len(t), dtype=np.int32)
    for number, post in enumerate(posts, start=1):
        away = post - sensor[:2, 3]
        a, b = (d[:, :2] ** 2).sum(axis=1), d[:, :2] @ away
        root = b**2 - a * (away @ away - RADIUS**2)
        near = (b - np.sqrt(np.maximum(root, 0))) / a
        z = sensor[2, 3] + near * d[:, 2]
        front = (root > 0) & (near > 0) & (near < t) & (z > 0) & (z < HEIGHT)
        t, hit = np.where(front, near, t), np.where(front, number, hit)
    kept = t < 60
    points = (t + noise * rng.standard_normal(len(t)))[kept, None] * local[kept]
    return LidarScan(
        start_s=start_s,
        period_s=0.1,
        points=points,
        ring=ring[kept].astype(np.int32),
        column=column[kept].astype(np.int32),
        time_s=np.zeros(kept.sum()),
        object_id=hit[kept],
    )


def readings_of(
    seconds: float, *, scale: float = 1.0, gyro_bias: float = 0.0, fixes: bool = False
) -> tuple[MotionReadings, Callable[[npt.ArrayLike], FloatArray]]:
    """Readings of a car on an arc, exact but for a wheel's scale and a gyroscope's bias; its true poses by time."""
    speed, yaw_rate = 8.0, 0.05
    t = np.arange(0, seconds + 0.005, 0.01)

    def truth(time: npt.ArrayLike) -> FloatArray:
        heading = yaw_rate * np.asarray(time)
        xy = speed / yaw_rate * np.stack([np.sin(heading), 1 - np.cos(heading)], axis=-1)
        zero = np.zeros_like(heading)
        return rigid(
            rotation_from_rpy(np.stack([zero, zero, heading], axis=-1)), np.stack([xy[..., 0], xy[..., 1], zero], axis=-1)
        )

    fix_s = np.arange(0, seconds, 0.1) if fixes else np.empty(0)
    readings = MotionReadings(
        time_s=t,
        speed_mps=np.full(len(t), speed * scale),
        gyro_rps=np.tile([0, 0, yaw_rate + gyro_bias], (len(t), 1)),
        attitude=np.zeros((len(t), 2)),
        gnss_time_s=fix_s,
        gnss=truth(fix_s)[:, :3, 3].reshape(-1, 3),
    )
    return readings, truth


def arc_scans(truth: Callable[[npt.ArrayLike], FloatArray], count: int, *, posts: FloatArray = POSTS) -> list[LidarScan]:
    """Scans of a car that stands still at each of its true poses, 0.1 s apart: as scans of a moving car are after deskewing."""
    return [scan_of_posts(truth(k * 0.1), start_s=k * 0.1, seed=k, posts=posts) for k in range(count)]


def drive(scans: Iterable[LidarScan], readings: MotionReadings, spec: LoamSpec | None = None) -> list[PosedScan]:
    """The posed scans of a drive that starts at the world's origin."""
    return list(map_drive(scans, readings, spec or LoamSpec(), mounting=MOUNT, start=np.eye(4)))
