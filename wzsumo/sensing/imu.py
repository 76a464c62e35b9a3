"""The mapping car's own motion sensors: gyroscope and attitude, wheel speed, and its GNSS receiver, RTK or not."""

from typing import Self

import numpy as np
from pydantic import Field, model_validator

from wzsumo.frames import FloatArray, wrap_angle
from wzsumo.rigid import rpy_from_rotation, vector_from_rotation
from wzsumo.scan import MotionReadings
from wzsumo.sensing.ground import Ground
from wzsumo.sensing.lidar import Drive
from wzsumo.spec import Spec


class ImuSpec(Spec):
    """Gyroscope, attitude and wheel speed. Defaults: an automotive MEMS unit and an uncalibrated wheel radius."""

    rate_hz: float = Field(default=100.0, gt=0, le=1000)
    gyro_noise_deg_per_sqrt_s: float = Field(
        default=0.01, ge=0
    )  # angle random walk, 0.6 deg/sqrt(h); Xsens MTi-3: 0.007 deg/s/sqrt(Hz)
    gyro_bias_deg_per_s: float = Field(default=0.01, ge=0)  # standard deviation, left after calibration at rest; an assumption
    attitude_noise_deg: float = Field(default=0.1, ge=0)  # roll and pitch of a vehicle-aided unit, white
    attitude_bias_deg: float = Field(default=0.2, ge=0)  # standard deviation over drives; Xsens MTi-3: 0.5 deg rms in all
    speed_scale: float = Field(default=0.01, ge=0)  # standard deviation of the wheel radius, as a share; 1 %
    speed_noise_mps: float = Field(default=0.05, ge=0)  # white, at the rate above; an assumption


class MappingGnssSpec(Spec):
    """GNSS of the mapping car. Default: an RTK fix. Without RTK take 0.5 m bias, 0.3 m noise."""

    rate_hz: float = Field(default=10.0, gt=0, le=100)
    bias_m: float = Field(default=0.01, ge=0)  # standard deviation of the slow part in each axis; RTK: 1 cm + 1 ppm
    bias_time_s: float = Field(default=60.0, gt=0)  # its correlation time; multipath, of the order of minutes
    noise_m: float = Field(default=0.01, ge=0)  # white, each horizontal axis
    vertical_factor: float = Field(default=2.0, ge=1)  # vertical error over horizontal; geometry of a sky seen from above only
    gaps_s: tuple[tuple[float, float], ...] = ()  # (from, to), seconds of the drive without a fix

    @model_validator(mode="after")
    def _gaps_have_length(self) -> Self:
        for start, end in self.gaps_s:
            if end <= start:
                raise ValueError(f"gap ({start}, {end}) must end after it starts")
        return self


def read_motion(drive: Drive, ground: Ground, imu: ImuSpec, gnss: MappingGnssSpec, *, seed: int) -> MotionReadings:
    """Readings of a whole drive; biases are drawn once for it."""
    rng = np.random.default_rng([seed, 2])
    time_s = _sample_times(drive, imu.rate_hz)
    step_s = 1 / imu.rate_hz
    middle = np.clip(time_s[:, None] + step_s * np.array([-0.5, 0.5]), drive.time_s[0], drive.time_s[-1])
    before, after = drive.car_poses(middle[:, 0], ground), drive.car_poses(middle[:, 1], ground)
    elapsed = (middle[:, 1] - middle[:, 0])[:, None]
    turn = vector_from_rotation(np.swapaxes(before[:, :3, :3], 1, 2) @ after[:, :3, :3]) / elapsed
    speed = np.linalg.norm(after[:, :3, 3] - before[:, :3, 3], axis=1) / elapsed[:, 0]
    attitude = rpy_from_rotation(drive.car_poses(time_s, ground)[:, :3, :3])[:, :2]
    n = len(time_s)
    gyro_noise = np.deg2rad(imu.gyro_noise_deg_per_sqrt_s) * np.sqrt(imu.rate_hz)
    gyro = turn + np.deg2rad(imu.gyro_bias_deg_per_s) * rng.standard_normal(3) + gyro_noise * rng.standard_normal((n, 3))
    tilt_error = imu.attitude_bias_deg * rng.standard_normal(2) + imu.attitude_noise_deg * rng.standard_normal((n, 2))
    scale = 1 + imu.speed_scale * rng.standard_normal()
    fixes_at = _without_gaps(_sample_times(drive, gnss.rate_hz), drive.time_s[0], gnss.gaps_s)
    truth = drive.car_poses(fixes_at, ground)[:, :3, 3]
    return MotionReadings(
        time_s=time_s,
        speed_mps=speed * scale + imu.speed_noise_mps * rng.standard_normal(n),
        gyro_rps=gyro,
        attitude=wrap_angle(attitude + np.deg2rad(tilt_error)),
        gnss_time_s=fixes_at,
        gnss=truth + _gnss_error(fixes_at, gnss, rng),
    )


def _sample_times(drive: Drive, rate_hz: float) -> FloatArray:
    n = int(np.floor((drive.time_s[-1] - drive.time_s[0]) * rate_hz + 1e-6))
    return np.asarray(drive.time_s[0] + np.arange(n + 1) / rate_hz)


def _without_gaps(time_s: FloatArray, start_s: float, gaps_s: tuple[tuple[float, float], ...]) -> FloatArray:
    kept = np.ones(len(time_s), dtype=bool)
    for start, end in gaps_s:
        kept &= (time_s - start_s < start) | (time_s - start_s > end)
    return time_s[kept]


def _gnss_error(time_s: FloatArray, spec: MappingGnssSpec, rng: np.random.Generator) -> FloatArray:
    """A first-order Gauss-Markov process and white noise (n, 3) [m]."""
    white: FloatArray = rng.standard_normal((len(time_s), 3))
    drift, last_s = rng.standard_normal(3), float(time_s[0]) if len(time_s) else 0.0
    slow = np.empty_like(white)
    for i, now_s in enumerate(time_s):
        kept = np.exp(-(now_s - last_s) / spec.bias_time_s)
        drift = kept * drift + np.sqrt(1 - kept**2) * rng.standard_normal(3)
        slow[i], last_s = drift, now_s
    return np.asarray((spec.bias_m * slow + spec.noise_m * white) * (1.0, 1.0, spec.vertical_factor))
