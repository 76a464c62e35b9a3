"""What the mapping car's motion sensors read on a drive: inertial unit (IMU), wheel speed and GNSS receiver."""

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
    """Errors of gyroscope, attitude and wheel speed. Defaults: an automotive MEMS unit and an uncalibrated wheel radius."""

    rate_hz: float = Field(default=100.0, gt=0, le=1000)  # readings a second; usual of such units
    gyro_noise_deg_per_sqrt_s: float = Field(default=0.01, ge=0)  # angle random walk; Xsens MTi-3: 0.007 deg/s/sqrt(Hz)
    gyro_bias_deg_per_s: float = Field(default=0.01, ge=0)  # sd over drives, left after calibration at rest; chosen by us
    attitude_noise_deg: float = Field(default=0.1, ge=0)  # sd of white noise in roll and in pitch; chosen by us
    attitude_bias_deg: float = Field(default=0.2, ge=0)  # sd over drives; Xsens MTi-3: 0.5 deg rms, noise and bias together
    speed_scale: float = Field(default=0.01, ge=0)  # sd over drives of the wheel radius, as a share of it; chosen by us
    speed_noise_mps: float = Field(default=0.05, ge=0)  # sd of white noise in each reading; chosen by us


class MappingGnssSpec(Spec):
    """GNSS errors of the mapping car. Defaults: an RTK fix. Without RTK, bias 0.5 m and noise 0.3 m are realistic."""

    rate_hz: float = Field(default=10.0, gt=0, le=100)  # fixes a second; usual of RTK receivers
    bias_m: float = Field(default=0.01, ge=0)  # sd of the slow part on each horizontal axis; RTK: 1 cm + 1 ppm
    bias_time_s: float = Field(default=60.0, gt=0)  # correlation time of the slow part; multipath lasts for minutes
    noise_m: float = Field(default=0.01, ge=0)  # sd of white noise on each horizontal axis
    vertical_factor: float = Field(default=2.0, ge=1)  # vertical over horizontal error: satellites are above only
    gaps_s: tuple[tuple[float, float], ...] = ()  # intervals without a fix, (from, to) in seconds of the drive

    @model_validator(mode="after")
    def _gaps_have_length(self) -> Self:
        for start, end in self.gaps_s:
            if end <= start:
                raise ValueError(f"gap ({start}, {end}) must end after it starts")
        return self


def read_motion(drive: Drive, ground: Ground, imu: ImuSpec, gnss: MappingGnssSpec, *, seed: int) -> MotionReadings:
    """Readings of a whole drive. Biases and the wheel's scale are drawn once for the drive."""
    rng = np.random.default_rng([seed, 2])
    time_s = _sample_times(drive, imu.rate_hz)
    step_s = 1 / imu.rate_hz
    # Rates are central differences over one step, one-sided at both ends of the drive.
    span = np.clip(time_s[:, None] + step_s * np.array([-0.5, 0.5]), drive.time_s[0], drive.time_s[-1])
    before, after = drive.car_poses(span[:, 0], ground), drive.car_poses(span[:, 1], ground)
    elapsed = (span[:, 1] - span[:, 0])[:, None]
    turn_rate = vector_from_rotation(np.swapaxes(before[:, :3, :3], 1, 2) @ after[:, :3, :3]) / elapsed
    speed = np.linalg.norm(after[:, :3, 3] - before[:, :3, 3], axis=1) / elapsed[:, 0]
    attitude = rpy_from_rotation(drive.car_poses(time_s, ground)[:, :3, :3])[:, :2]
    n = len(time_s)
    gyro_noise = np.deg2rad(imu.gyro_noise_deg_per_sqrt_s) * np.sqrt(imu.rate_hz)
    gyro = turn_rate + np.deg2rad(imu.gyro_bias_deg_per_s) * rng.standard_normal(3) + gyro_noise * rng.standard_normal((n, 3))
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
    """Times (n,) [s] at a rate, from the drive's first time to its last."""
    n = int(np.floor((drive.time_s[-1] - drive.time_s[0]) * rate_hz + 1e-6))
    return np.asarray(drive.time_s[0] + np.arange(n + 1) / rate_hz)


def _without_gaps(time_s: FloatArray, start_s: float, gaps_s: tuple[tuple[float, float], ...]) -> FloatArray:
    """The times that lie in no gap; gaps are in seconds since `start_s`."""
    kept = np.ones(len(time_s), dtype=bool)
    for start, end in gaps_s:
        kept &= (time_s - start_s < start) | (time_s - start_s > end)
    return time_s[kept]


def _gnss_error(time_s: FloatArray, spec: MappingGnssSpec, rng: np.random.Generator) -> FloatArray:
    """Errors (n, 3) [m]: a first-order Gauss-Markov process plus white noise, larger in the vertical."""
    white: FloatArray = rng.standard_normal((len(time_s), 3))
    bias, last_s = rng.standard_normal(3), float(time_s[0]) if len(time_s) else 0.0
    slow = np.empty_like(white)
    for i, now_s in enumerate(time_s):
        rho = np.exp(-(now_s - last_s) / spec.bias_time_s)
        bias = rho * bias + np.sqrt(1 - rho**2) * rng.standard_normal(3)
        slow[i], last_s = bias, now_s
    return np.asarray((spec.bias_m * slow + spec.noise_m * white) * (1.0, 1.0, spec.vertical_factor))
