"""The motion prior of the mapping car: dead reckoning by wheels and gyroscope, and its error state, which GNSS and scans mend.

The error state is (translation, rotation vector) in the car's own axes, the wheel's scale and the yaw gyroscope's bias:
plus(pose, error) is the truth. A constant scale or bias does not average out as white noise does; to carry them as states
is what lets RTK or a line of cones calibrate them. Source: Sola, Deray & Atchuthan 2018, A micro Lie theory for state
estimation in robotics (errors on the right, their transport by the adjoint).
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

SCALE, BIAS = 6, 7  # places in the error state


class MotionSpec(Spec):
    """How far the prior is trusted. Standard deviations; a drive's own constants are states, the rest is noise."""

    speed_scale: float = Field(default=0.02, ge=0)  # twice what an uncalibrated wheel is off by
    gyro_bias_deg_per_s: float = Field(default=0.02, ge=0)  # twice the residual bias of an automotive MEMS unit
    along_m_per_sqrt_m: float = Field(default=0.01, gt=0)  # wheel slip and quantisation; an assumption
    aside_m_per_sqrt_m: float = Field(default=0.005, gt=0)  # side slip and heave; an assumption
    turn_deg_per_sqrt_s: float = Field(default=0.05, gt=0)  # gyroscope's random walk, widened for the car's own pitching
    attitude_deg: float = Field(default=0.5, gt=0)  # roll and pitch of the unit, mostly a constant error
    attitude_time_s: float = Field(default=10.0, gt=0)  # over which its errors are one and the same
    gnss_m: float = Field(default=0.03, gt=0)  # each horizontal axis; RTK is 1..2 cm, widened as its error lasts for a minute
    gnss_vertical_factor: float = Field(default=2.0, ge=1)  # as GNSS of a sky seen from above only


@dataclass(frozen=True, kw_only=True, eq=False)
class Prior:
    """A pose (4, 4) of the car, the covariance (8, 8) of its error state, and the drive's constants as estimated."""

    pose: FloatArray
    covariance: FloatArray
    scale: float = 0.0  # true step = measured step * (1 + scale)
    bias_rps: float = 0.0  # true yaw rate = measured rate + bias


def first_prior(pose: FloatArray, spec: MotionSpec) -> Prior:
    """The prior at a known start."""
    deviation = [1e-3] * 3 + [1e-4] * 3 + [spec.speed_scale, np.deg2rad(spec.gyro_bias_deg_per_s)]
    return Prior(pose=pose, covariance=np.diag(np.square(deviation)))


def dead_reckon(readings: MotionReadings, times: npt.ArrayLike, start: FloatArray) -> FloatArray:
    """Poses (m, 4, 4) at given times by wheels, gyroscope and attitude alone, from `start` at the first reading."""
    return poses_between(readings.time_s, reckoned_poses(readings, start), times)


def reckoned_poses(readings: MotionReadings, start: FloatArray) -> FloatArray:
    """The same (n, 4, 4) at the times of the readings."""
    return _integrated(readings, start, scale=0.0, bias=0.0)


def poses_between(known_s: FloatArray, poses: FloatArray, times: npt.ArrayLike) -> FloatArray:
    """Poses (m, 4, 4) between known ones; angles and positions linear, which is exact enough at the readings' rate."""
    at = np.asarray(times, dtype=float)
    around = slice(max(int(np.searchsorted(known_s, at.min())) - 1, 0), int(np.searchsorted(known_s, at.max())) + 2)
    angles = np.unwrap(rpy_from_rotation(poses[around, :3, :3]), axis=0)
    columns = [np.interp(at, known_s[around], column) for column in (*angles.T, *poses[around, :3, 3].T)]
    return rigid(rotation_from_rpy(np.column_stack(columns[:3])), np.column_stack(columns[3:]))


def motion_within(readings: MotionReadings, prior: Prior, times: FloatArray) -> FloatArray:
    """Motions (m, 4, 4) of the car from times[0] to each time (ascending), freed of the estimated scale and bias."""
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
    """The prior after a motion (4, 4) of the car that took `elapsed_s`, its error carried along and grown."""
    back = inverse(motion)
    transport = np.eye(8)
    transport[:3, :3] = transport[3:6, 3:6] = back[:3, :3]
    transport[:3, 3:6] = cross_matrix(back[:3, 3]) @ back[:3, :3]
    length = float(np.linalg.norm(motion[:3, 3]))
    transport[:3, SCALE] = back[:3, :3] @ motion[:3, 3]
    transport[5, BIAS] = elapsed_s
    way, turn = np.sqrt(length + 1e-3), np.deg2rad(spec.turn_deg_per_sqrt_s) * np.sqrt(elapsed_s)
    noise = [spec.along_m_per_sqrt_m * way, *[spec.aside_m_per_sqrt_m * way] * 2, turn, turn, turn, 1e-6, 1e-7]
    covariance = transport @ prior.covariance @ transport.T + np.diag(np.square(noise))
    return Prior(pose=prior.pose @ motion, covariance=covariance, scale=prior.scale, bias_rps=prior.bias_rps)


def update(prior: Prior, *, jacobian: FloatArray, residual: FloatArray, noise: FloatArray) -> Prior:
    """The prior after a measurement: residual (k,) = measured - expected = jacobian (k, 8) error + noise (k, k)."""
    innovation = jacobian @ prior.covariance @ jacobian.T + noise
    gain = np.linalg.solve(innovation, jacobian @ prior.covariance).T
    return corrected(prior, gain @ residual, (np.eye(8) - gain @ jacobian) @ prior.covariance)


def corrected(prior: Prior, error: FloatArray, covariance: FloatArray) -> Prior:
    """The prior with an estimated error (8,) taken out and a new covariance."""
    return Prior(
        pose=plus(prior.pose, error[:6]),
        covariance=(covariance + covariance.T) / 2,
        scale=prior.scale + float(error[SCALE]),
        bias_rps=prior.bias_rps + float(error[BIAS]),
    )


def with_gnss(prior: Prior, position: FloatArray, spec: MotionSpec) -> Prior:
    """The prior after a GNSS position (3,) of the car's origin."""
    jacobian = np.zeros((3, 8))
    jacobian[:, :3] = prior.pose[:3, :3]
    noise = np.diag(np.square([spec.gnss_m, spec.gnss_m, spec.gnss_m * spec.gnss_vertical_factor]))
    return update(prior, jacobian=jacobian, residual=position - prior.pose[:3, 3], noise=noise)


def with_attitude(prior: Prior, attitude: FloatArray, *, elapsed_s: float, spec: MotionSpec) -> Prior:
    """The prior after roll and pitch (2,) [rad] of the inertial unit, whose errors last: each reading counts for little."""
    deviation = np.deg2rad(spec.attitude_deg) * np.sqrt(max(spec.attitude_time_s / max(elapsed_s, 1e-3), 1.0))
    jacobian = np.zeros((2, 8))
    jacobian[0, 3] = jacobian[1, 4] = 1.0  # small tilts: roll and pitch turn about the car's own x and y
    residual = attitude - rpy_from_rotation(prior.pose[:3, :3])[:2]
    return update(prior, jacobian=jacobian, residual=residual, noise=np.eye(2) * deviation**2)


def _integrated(readings: MotionReadings, start: FloatArray, *, scale: float, bias: float) -> FloatArray:
    """Poses (n, 4, 4): yaw by the gyroscope, roll and pitch as the unit gives them, steps along the car's x."""
    roll, pitch = readings.attitude.T
    # Yaw rate of a tilted car (ZYX angles): (q sin roll + r cos roll) / cos pitch.
    rate = (readings.gyro_rps[:, 1] * np.sin(roll) + (readings.gyro_rps[:, 2] + bias) * np.cos(roll)) / np.cos(pitch)
    step_s = np.diff(readings.time_s)
    yaw = rpy_from_rotation(start[:3, :3])[2] + _summed((rate[1:] + rate[:-1]) / 2 * step_s)
    turn = rotation_from_rpy(np.column_stack([roll, pitch, yaw]))
    speed = readings.speed_mps * (1 + scale)
    ahead = turn[:, :, 0]
    steps = ((speed[1:] + speed[:-1]) / 2 * step_s)[:, None] * (ahead[1:] + ahead[:-1]) / 2
    return rigid(turn, start[:3, 3] + np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]))


def _by_gyroscope(readings: MotionReadings, *, scale: float, bias: float) -> FloatArray:
    """Poses (n, 4, 4) from the identity: attitude by the gyroscope alone, smooth within a scan."""
    step_s = np.diff(readings.time_s)
    rate = readings.gyro_rps + np.array([0.0, 0.0, bias])
    turns = rotation_from_vector((rate[1:] + rate[:-1]) / 2 * step_s[:, None])
    pose = [np.eye(3)]
    for turn in turns:
        pose.append(pose[-1] @ turn)
    attitude = np.array(pose)
    speed = readings.speed_mps * (1 + scale)
    ahead = attitude[:, :, 0]
    steps = ((speed[1:] + speed[:-1]) / 2 * step_s)[:, None] * (ahead[1:] + ahead[:-1]) / 2
    return rigid(attitude, np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]))


def _summed(steps: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(steps)])
