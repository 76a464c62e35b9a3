"""The motion prior of the mapping car: an error-state Kalman filter over wheels, gyroscope, attitude and GNSS.

The error state (8,) holds translation and rotation vector in the car's own axes, the error of the wheel's scale and that of the
yaw gyroscope's bias; plus(pose, error[:6]) is the true pose. Scale and bias are constant over a drive, so they do not average
out as white noise does; as states they are calibrated by RTK or by scans. Source: Sola, Deray & Atchuthan 2018, A micro Lie
theory for state estimation in robotics (errors on the right, propagated by the adjoint).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydantic import Field

from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray
from wzsumo.lidar_mapping.alignment import plus
from wzsumo.rigid import cross_matrix, inverse, rigid, rotation_from_rpy, rotation_from_vector, rpy_from_rotation
from wzsumo.scan import MotionReadings
from wzsumo.spec import Spec

SCALE, BIAS = 6, 7  # indices in the error state
START_SD_M, START_SD_RAD = 1e-3, 1e-4  # of the first pose, which is given
DRIFT_SD_SCALE, DRIFT_SD_BIAS_RPS = 1e-6, 1e-7  # of scale and bias from one scan to the next: hardly any, but not singular


class MotionSpec(Spec):
    """Standard deviations of the prior's sources. Scale and bias are constants of a drive, all else is noise."""

    speed_scale: float = Field(default=0.02, ge=0)  # of the wheel's scale, as a share: twice that of [slam.imu]
    gyro_bias_deg_per_s: float = Field(default=0.02, ge=0)  # of the yaw gyroscope's bias: twice that of [slam.imu]
    along_m_per_sqrt_m: float = Field(default=0.01, gt=0)  # wheel slip and quantisation; chosen by us
    aside_m_per_sqrt_m: float = Field(default=0.005, gt=0)  # side slip and heave; chosen by us
    turn_deg_per_sqrt_s: float = Field(
        default=0.05, gt=0
    )  # gyroscope: five times the random walk of [slam.imu], for the car's pitching
    attitude_deg: float = Field(default=0.5, gt=0)  # of roll and pitch, mostly constant; Xsens MTi-3: 0.5 deg rms
    attitude_time_s: float = Field(default=10.0, gt=0)  # correlation time of the attitude's error; chosen by us
    gnss_m: float = Field(default=0.03, gt=0)  # each horizontal axis; RTK is 1 to 2 cm, and its error lasts for a minute
    gnss_vertical_factor: float = Field(default=2.0, ge=1)  # vertical over horizontal error, as in [slam.gnss]


@dataclass(frozen=True, kw_only=True, eq=False)
class Prior:
    """The car's estimated pose (4, 4), the covariance (8, 8) of the error state, and the drive's estimated constants."""

    pose: FloatArray
    covariance: FloatArray
    scale: float = 0.0  # true step = measured step * (1 + scale)
    bias_rps: float = 0.0  # true yaw rate = measured rate + bias


def initial_prior(pose: FloatArray, spec: MotionSpec) -> Prior:
    """The prior at the start of a drive, whose pose (4, 4) is known."""
    deviation = [START_SD_M] * 3 + [START_SD_RAD] * 3 + [spec.speed_scale, np.deg2rad(spec.gyro_bias_deg_per_s)]
    return Prior(pose=pose, covariance=np.diag(np.square(deviation)))


def dead_reckoned_poses(readings: MotionReadings, start: FloatArray) -> FloatArray:
    """Poses (n, 4, 4) at the times of the readings by dead reckoning, from `start` (4, 4) at the first one.

    Yaw comes from the gyroscope, roll and pitch from the attitude, steps along the car's x from the wheels.
    """
    roll, pitch = readings.attitude.T
    # Yaw rate of a tilted car (ZYX angles): (q sin roll + r cos roll) / cos pitch.
    rate = (readings.gyro_rps[:, 1] * np.sin(roll) + readings.gyro_rps[:, 2] * np.cos(roll)) / np.cos(pitch)
    step_s = np.diff(readings.time_s)
    turned = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * step_s)])
    attitude = rotation_from_rpy(np.column_stack([roll, pitch, rpy_from_rotation(start[:3, :3])[2] + turned]))
    return rigid(attitude, start[:3, 3] + _travelled(readings.speed_mps, attitude, step_s))


def poses_between(known_s: FloatArray, poses: FloatArray, times: npt.ArrayLike) -> FloatArray:
    """Poses (m, 4, 4) at given times, linear in angles and positions between the poses (n, 4, 4) at times (n,) [s]."""
    at = np.asarray(times, dtype=float)
    around = slice(max(int(np.searchsorted(known_s, at.min())) - 1, 0), int(np.searchsorted(known_s, at.max())) + 2)
    angles = np.unwrap(rpy_from_rotation(poses[around, :3, :3]), axis=0)
    columns = [np.interp(at, known_s[around], column) for column in (*angles.T, *poses[around, :3, 3].T)]
    return rigid(rotation_from_rpy(np.column_stack(columns[:3])), np.column_stack(columns[3:]))


def motion_within(readings: MotionReadings, prior: Prior, times: FloatArray) -> FloatArray:
    """Motions (m, 4, 4) of the car from times[0] to each of the ascending times, corrected by the estimated scale and bias."""
    first, last = np.searchsorted(readings.time_s, [times[0] - 0.5, times[-1] + 0.5])
    if last - first < 2:
        raise TraceError(
            f"no motion readings from {times[0]:.2f} s to {times[-1]:.2f} s; they span "
            f"{readings.time_s[0]:.2f}..{readings.time_s[-1]:.2f} s: give readings for the whole drive"
        )
    first = max(first, int(np.searchsorted(readings.time_s, times[0], side="right")) - 2)
    inside = slice(min(first, last - 2), min(int(np.searchsorted(readings.time_s, times[-1])) + 2, last))
    part = MotionReadings(
        time_s=readings.time_s[inside],
        speed_mps=readings.speed_mps[inside],
        gyro_rps=readings.gyro_rps[inside],
        attitude=readings.attitude[inside],
        gnss_time_s=np.empty(0),
        gnss=np.empty((0, 3)),
    )
    poses = _by_gyroscope(part, scale=prior.scale, bias=prior.bias_rps)
    at = poses_between(part.time_s, poses, times)
    return inverse(at[0]) @ at


def predict(prior: Prior, motion: FloatArray, *, elapsed_s: float, spec: MotionSpec) -> Prior:
    """The prior after a motion (4, 4) of the car that took `elapsed_s`: its errors are propagated, and noise is added."""
    back = inverse(motion)
    propagation = np.eye(8)
    propagation[:3, :3] = propagation[3:6, 3:6] = back[:3, :3]
    propagation[:3, 3:6] = cross_matrix(back[:3, 3]) @ back[:3, :3]
    length = float(np.linalg.norm(motion[:3, 3]))
    propagation[:3, SCALE] = back[:3, :3] @ motion[:3, 3]
    propagation[5, BIAS] = elapsed_s
    root_length, turn = np.sqrt(length + 1e-3), np.deg2rad(spec.turn_deg_per_sqrt_s) * np.sqrt(elapsed_s)
    noise = [spec.along_m_per_sqrt_m * root_length, *[spec.aside_m_per_sqrt_m * root_length] * 2, turn, turn, turn]
    noise += [DRIFT_SD_SCALE, DRIFT_SD_BIAS_RPS]
    covariance = propagation @ prior.covariance @ propagation.T + np.diag(np.square(noise))
    return Prior(pose=prior.pose @ motion, covariance=covariance, scale=prior.scale, bias_rps=prior.bias_rps)


def kalman_update(prior: Prior, *, jacobian: FloatArray, residual: FloatArray, noise: FloatArray) -> Prior:
    """The prior after a measurement: residual (k,) = jacobian (k, 8) error + noise of covariance (k, k)."""
    innovation = jacobian @ prior.covariance @ jacobian.T + noise
    gain = np.linalg.solve(innovation, jacobian @ prior.covariance).T
    return corrected(prior, gain @ residual, (np.eye(8) - gain @ jacobian) @ prior.covariance)


def corrected(prior: Prior, error: FloatArray, covariance: FloatArray) -> Prior:
    """The prior with an estimated error (8,) added and a new covariance (8, 8)."""
    return Prior(
        pose=plus(prior.pose, error[:6]),
        covariance=(covariance + covariance.T) / 2,
        scale=prior.scale + float(error[SCALE]),
        bias_rps=prior.bias_rps + float(error[BIAS]),
    )


def with_gnss(prior: Prior, position: FloatArray, spec: MotionSpec) -> Prior:
    """The prior after a GNSS position (3,) [m] of the car's origin."""
    jacobian = np.zeros((3, 8))
    jacobian[:, :3] = prior.pose[:3, :3]
    noise = np.diag(np.square([spec.gnss_m, spec.gnss_m, spec.gnss_m * spec.gnss_vertical_factor]))
    return kalman_update(prior, jacobian=jacobian, residual=position - prior.pose[:3, 3], noise=noise)


def with_attitude(prior: Prior, attitude: FloatArray, *, elapsed_s: float, spec: MotionSpec) -> Prior:
    """The prior after a reading of roll and pitch (2,) [rad], `elapsed_s` after the last one."""
    # Successive errors are correlated. A larger deviation gives all readings of one correlation time the weight of one reading.
    deviation = np.deg2rad(spec.attitude_deg) * np.sqrt(max(spec.attitude_time_s / max(elapsed_s, 1e-3), 1.0))
    jacobian = np.zeros((2, 8))
    jacobian[0, 3] = jacobian[1, 4] = 1.0  # small tilts: roll and pitch turn about the car's own x and y
    residual = attitude - rpy_from_rotation(prior.pose[:3, :3])[:2]
    return kalman_update(prior, jacobian=jacobian, residual=residual, noise=np.eye(2) * deviation**2)


def _by_gyroscope(readings: MotionReadings, *, scale: float, bias: float) -> FloatArray:
    """Poses (n, 4, 4) from the identity on, with the attitude by the gyroscope alone: that is smooth within a scan."""
    step_s = np.diff(readings.time_s)
    rate = readings.gyro_rps + np.array([0.0, 0.0, bias])
    turns = rotation_from_vector((rate[1:] + rate[:-1]) / 2 * step_s[:, None])
    rotations = [np.eye(3)]
    for turn in turns:
        rotations.append(rotations[-1] @ turn)
    attitude = np.array(rotations)
    return rigid(attitude, _travelled(readings.speed_mps * (1 + scale), attitude, step_s))


def _travelled(speed: FloatArray, attitude: FloatArray, step_s: FloatArray) -> FloatArray:
    """Positions (n, 3) from the origin on, moving along the x axis of attitudes (n, 3, 3) at speeds (n,) (trapezoidal rule)."""
    ahead = attitude[:, :, 0]
    steps = ((speed[1:] + speed[:-1]) / 2 * step_s)[:, None] * (ahead[1:] + ahead[:-1]) / 2
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
