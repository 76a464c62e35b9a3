"""The scans that a spinning LiDAR takes on a drive: the sensor's spec, the car's drive, and the simulated scans."""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd
from pydantic import Field, model_validator

from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray
from wzsumo.rigid import rigid, rotation_from_rpy
from wzsumo.scan import LidarScan
from wzsumo.sensing.ground import Ground
from wzsumo.sensing.raycast import NO_RETURN, cast_rays
from wzsumo.sensing.scene import Scene, with_vehicles
from wzsumo.spec import Spec

KOSCHMIEDER_CONSTANT = 3.912  # extinction coefficient [1/m] times visibility [m], at a contrast of 2 %; Koschmieder 1924


class LidarSpec(Spec):
    """One spinning LiDAR on the roof, and how well it sees.

    Its pose is given in the car's frame: origin in the middle of the REAR AXLE on the ground, x forward, y left, z up.
    """

    layers: int = Field(default=128, ge=1, le=256)  # Chen et al. 2022
    lowest_deg: float = Field(default=-25.0, ge=-90, lt=90)  # Velodyne Alpha Prime data sheet: -25 to +15 degrees
    highest_deg: float = Field(default=15.0, gt=-90, le=90)  # ibid.
    azimuth_count: int = Field(default=1800, ge=8, le=36000)  # a turn: 0.2 degrees at 10 Hz, ibid.
    rate_hz: float = Field(default=10.0, gt=0, le=50)  # turns a second, ibid.
    max_range_m: float = Field(default=120.0, gt=0)  # of dark targets; farther cones return less than one ray
    range_noise_m: float = Field(default=0.02, ge=0)  # standard deviation; ibid.: +-3 cm typical
    dropout_at_max_range: float = Field(default=0.5, ge=0, le=1)  # data sheets state the range at which 50 % return
    visibility_m: float | None = Field(default=None, gt=0)  # in fog or rain; None: clear air
    detected_share: float = Field(default=1.0, ge=0, le=1)  # of devices in a scan; Chen et al. 2022: 0.585 to 0.758
    forward_m: float = 1.4  # near the middle between the axles
    left_m: float = 0.0  # of the middle of the car
    height_m: float = Field(default=1.9, gt=0)  # roof of a mid-size sedan and a rack
    roll_deg: float = 0.0  # of the mount
    pitch_deg: float = 0.0  # of the mount
    yaw_deg: float = 0.0  # of the mount

    @model_validator(mode="after")
    def _field_has_height(self) -> "LidarSpec":
        if self.lowest_deg > self.highest_deg:
            raise ValueError(f"lowest_deg={self.lowest_deg} must not lie above highest_deg={self.highest_deg}")
        return self

    @property
    def elevation(self) -> FloatArray:
        """Elevations (layers,) [rad] from the lowest."""
        return np.deg2rad(np.linspace(self.lowest_deg, self.highest_deg, self.layers))

    @property
    def azimuth(self) -> FloatArray:
        """Azimuths (azimuth_count,) [rad], counter-clockwise from the rear: a moving scan's seam does least harm there."""
        return -np.pi + 2 * np.pi * np.arange(self.azimuth_count) / self.azimuth_count

    @property
    def mounting(self) -> FloatArray:
        """Pose (4, 4) of the sensor in the car's frame."""
        rotation = rotation_from_rpy(np.deg2rad([self.roll_deg, self.pitch_deg, self.yaw_deg]))
        return rigid(rotation, [self.forward_m, self.left_m, self.height_m])


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """Where the mapping car's REAR AXLE was: ascending times (n,) [s], poses (n, 3) x, y [m], heading [rad], linear between."""

    time_s: FloatArray
    poses: FloatArray

    def __post_init__(self) -> None:
        if self.poses.shape != (len(self.time_s), 3) or len(self.time_s) < 2:
            raise TraceError(f"a drive has times (n >= 2,) and poses (n, 3), given {self.time_s.shape} and {self.poses.shape}")
        if not (np.isfinite(self.poses).all() and np.isfinite(self.time_s).all() and (np.diff(self.time_s) > 0).all()):
            raise TraceError("a drive's times must ascend and its poses be finite; drop the rows that are not")

    def car_poses(self, time_s: npt.ArrayLike, ground: Ground) -> FloatArray:
        """Poses (m, 4, 4) of the car at times (m,) [s]. It stands on the plane of the ground: springs even out the relief."""
        t = np.asarray(time_s, dtype=float)
        x, y, heading = (np.interp(t, self.time_s, values) for values in (*self.poses.T[:2], np.unwrap(self.poses[:, 2])))
        roll, pitch = ground.tilt(heading)
        z = ground.level + ground.slope[0] * x + ground.slope[1] * y
        return rigid(rotation_from_rpy(np.stack([roll, pitch, heading], axis=-1)), np.stack([x, y, z], axis=-1))


def drive_scans(
    scene: Scene,
    drive: Drive,
    spec: LidarSpec,
    *,
    seed: int,
    vehicles_at: Callable[[float], pd.DataFrame] | None = None,
) -> Iterator[LidarScan]:
    """Scans of a whole drive in order of time. `vehicles_at(time_s)` gives the other vehicles' table for `with_vehicles`."""
    period_s = 1 / spec.rate_hz
    for number in range(int(np.floor((drive.time_s[-1] - drive.time_s[0]) / period_s + 1e-6))):
        start_s = float(drive.time_s[0]) + number * period_s
        moment = scene if vehicles_at is None else with_vehicles(scene, vehicles_at(start_s))
        yield cast_scan(moment, drive, spec, start_s=start_s, seed=seed)


def cast_ahead(scans: Iterator[LidarScan], *, depth: int = 2) -> Iterator[LidarScan]:
    """The same scans in the same order. A thread casts up to `depth` scans ahead while the caller maps the last one."""
    with ThreadPoolExecutor(max_workers=1) as caster:
        waiting = deque(caster.submit(next, scans, None) for _ in range(depth))
        while (scan := waiting.popleft().result()) is not None:
            waiting.append(caster.submit(next, scans, None))
            yield scan


def cast_scan(scene: Scene, drive: Drive, spec: LidarSpec, *, start_s: float, seed: int) -> LidarScan:
    """The scan that begins at `start_s`. Noise and drop-out depend on the seed and on `start_s` alone."""
    offsets = np.arange(spec.azimuth_count) / spec.azimuth_count / spec.rate_hz
    poses = drive.car_poses(start_s + offsets, scene.ground) @ spec.mounting
    hits = cast_rays(scene, poses=poses, azimuth=spec.azimuth, elevation=spec.elevation, max_range=spec.max_range_m)
    rng = np.random.default_rng([seed, round(start_s * 1e6) % 2**63])
    returned = np.flatnonzero(hits.object_id != NO_RETURN)
    distance, object_id = hits.distance.ravel()[returned], hits.object_id.ravel()[returned]
    seen = rng.random(len(distance)) >= _loss_probability(distance, spec)
    if spec.detected_share < 1:
        seen &= ~np.isin(object_id, scene.device_id[rng.random(len(scene.device_id)) >= spec.detected_share])
    distance, object_id = distance[seen], object_id[seen]
    column, ring = np.divmod(returned[seen], spec.layers)
    distance = np.maximum(distance + spec.range_noise_m * rng.standard_normal(len(distance)), 0.0)
    return LidarScan(
        start_s=start_s,
        period_s=1 / spec.rate_hz,
        points=distance[:, None] * _directions(spec, column, ring),
        ring=ring.astype(np.int32),
        column=column.astype(np.int32),
        time_s=offsets[column],
        object_id=object_id,
    )


def _loss_probability(distance: FloatArray, spec: LidarSpec) -> FloatArray:
    """Probability (n,) that a return from a distance (n,) [m] is lost.

    Drop-out grows with the distance squared up to `dropout_at_max_range`. Fog attenuates the pulse on its way out and back
    (Beer-Lambert).
    """
    kept = 1 - spec.dropout_at_max_range * (distance / spec.max_range_m) ** 2
    if spec.visibility_m is not None:
        kept = kept * np.exp(-2 * KOSCHMIEDER_CONSTANT / spec.visibility_m * distance)
    return np.asarray(1 - kept)


def _directions(spec: LidarSpec, column: npt.NDArray[np.intp], ring: npt.NDArray[np.intp]) -> FloatArray:
    """Unit vectors (n, 3) of rays in the sensor's frame."""
    across = np.cos(spec.elevation)[ring]
    return np.column_stack(
        [across * np.cos(spec.azimuth)[column], across * np.sin(spec.azimuth)[column], np.sin(spec.elevation)[ring]]
    )
