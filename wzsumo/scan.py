"""LidarScan, one turn of a spinning LiDAR; MotionReadings, the speed, IMU and GNSS of the car that carries it."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wzsumo.errors import CloudError
from wzsumo.frames import FloatArray

GROUND = 0  # object id of the ground; 1.. are the objects of the scene


@dataclass(frozen=True, kw_only=True, eq=False)
class LidarScan:
    """Returns of one turn. Each point is in the frame that the SENSOR had when it fired (x forward, y left, z up) [m].

    Returns are in the order of firing; `ring` counts layers from the lowest, `column` azimuth steps from the start of the
    turn. `object_id` is the truth, which a real sensor does not know: GROUND or the number of an object of the scene.
    """

    start_s: float  # time of the first column
    period_s: float  # time of a whole turn
    points: FloatArray  # (n, 3)
    ring: npt.NDArray[np.int32]
    column: npt.NDArray[np.int32]
    time_s: FloatArray  # (n,) from start_s
    object_id: npt.NDArray[np.int32]

    def __post_init__(self) -> None:
        n = len(self.points)
        lengths = {name: len(getattr(self, name)) for name in ("ring", "column", "time_s", "object_id")}
        if any(length != n for length in lengths.values()):
            raise CloudError(f"scan at {self.start_s} s: {n} points but {lengths}; every return needs all of them")

    @property
    def range_m(self) -> FloatArray:
        """Distances (n,) [m] from the sensor."""
        return np.asarray(np.linalg.norm(self.points, axis=1))


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionReadings:
    """Readings of the car's motion sensors. Frame: the car's (x forward, y left, z up), origin at the rear axle on the ground.

    `attitude` is roll and pitch, as in `rigid.rotation_from_rpy`. GNSS positions are of that origin, the lever arm removed.
    """

    time_s: FloatArray  # (n,)
    speed_mps: FloatArray  # (n,)
    gyro_rps: FloatArray  # (n, 3)
    attitude: FloatArray  # (n, 2) [rad]
    gnss_time_s: FloatArray  # (m,)
    gnss: FloatArray  # (m, 3) [m]


def check_cloud(points: npt.ArrayLike, *, source: str, at_least: int = 1) -> FloatArray:
    """The points (n, 3) [m] as contiguous float64. Raises CloudError, which names `source`, at the first fault."""
    if np.asarray(points).dtype.kind not in "iuf":
        raise CloudError(f"{source}: not a table of real numbers; a cloud is (n, 3): x, y, z in metres")
    cloud = np.ascontiguousarray(points, dtype=np.float64)
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise CloudError(f"{source}: an array of shape {cloud.shape} is not a cloud; give (n, 3): x, y, z in metres")
    if len(cloud) < at_least:
        raise CloudError(f"{source}: {len(cloud)} point(s); at least {at_least} needed")
    if not np.isfinite(cloud).all():
        bad = np.flatnonzero(~np.isfinite(cloud).all(axis=1))
        raise CloudError(
            f"{source}: point {bad[0]} is {cloud[bad[0]].tolist()}; every coordinate must be finite "
            f"({bad.size} of {len(cloud)} points are not; drop them)"
        )
    return cloud
