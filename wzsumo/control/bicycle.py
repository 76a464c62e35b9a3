"""Motion of the body over one short step: the kinematic bicycle and the dynamic single track. Reference: the REAR AXLE."""

from math import atan, cos, sin, tan, tanh
from typing import NamedTuple

from pydantic import Field

from wzsumo.spec import Spec

GRAVITY_MPS2 = 9.80665  # standard gravity, ISO 80000-3
_ROLLING_SPEED_MPS = 1.0  # slower wheels are taken to roll where they point: slip angles divide by the speed; chosen by us


class SingleTrackSpec(Spec):
    """Dynamic single track with the parameters of a passenger sedan. Source: Rajamani 2012, Vehicle Dynamics and Control."""

    yaw_inertia_kgm2: float = Field(default=2873.0, gt=0)  # ibid.
    front_share: float = Field(default=0.41, gt=0, lt=1)  # front axle to centre of gravity over wheelbase, 1.10 / 2.68 m, ibid.
    front_stiffness_nprad: float = Field(default=160e3, gt=0)  # both wheels of the axle, 2 x 80 kN/rad, ibid.
    rear_stiffness_nprad: float = Field(default=160e3, gt=0)  # ibid.
    friction: float = Field(default=0.9, gt=0)  # dry asphalt


class Motion(NamedTuple):
    """Pose of the rear axle (m, m, rad), its lateral speed [m/s, positive to the left] and the yaw rate [rad/s]."""

    x: float
    y: float
    heading: float
    lateral_speed: float
    yaw_rate: float


def kinematic_step(motion: Motion, *, speed: float, steering: float, h: float, wheelbase_m: float) -> Motion:
    """Motion after `h` seconds of constant speed and steering with wheels that do not slip: an exact arc."""
    return _moved(motion, speed=speed, lateral_speed=0.0, yaw_rate=speed * tan(steering) / wheelbase_m, h=h)


def single_track_step(
    motion: Motion, *, speed: float, steering: float, h: float, wheelbase_m: float, mass_kg: float, spec: SingleTrackSpec
) -> Motion:
    """Motion after `h` seconds of constant speed and steering with tyres that slip sideways.

    Lateral forces grow with the slip angle and saturate at the axle's share of friction (tanh). Side forces do not slow the car
    down, and the steering angle is taken to be small. The step is backward Euler in (lateral speed of the centre of gravity,
    yaw rate) with stiffnesses at the slip before the step, stable at any speed. Source: Rajamani 2012, Section 2.3.
    """
    if speed < _ROLLING_SPEED_MPS:
        return kinematic_step(motion, speed=speed, steering=steering, h=h, wheelbase_m=wheelbase_m)
    front, rear = spec.front_share * wheelbase_m, (1 - spec.front_share) * wheelbase_m
    sideways = motion.lateral_speed + rear * motion.yaw_rate  # of the centre of gravity
    slope_front = (sideways + front * motion.yaw_rate) / speed
    slope_rear = (sideways - rear * motion.yaw_rate) / speed
    grip = spec.friction * mass_kg * GRAVITY_MPS2
    c_front = spec.front_stiffness_nprad * _force_share(
        (atan(slope_front) - steering) * spec.front_stiffness_nprad / (grip * (1 - spec.front_share))
    )
    c_rear = spec.rear_stiffness_nprad * _force_share(atan(slope_rear) * spec.rear_stiffness_nprad / (grip * spec.front_share))
    # The slip angle atan(slope) - steering is replaced by its chord through the origin: the step is then a linear system.
    k_front, k_rear = c_front * _chord(slope_front) / speed, c_rear * _chord(slope_rear) / speed
    turn = front * k_front - rear * k_rear
    a11, a12 = mass_kg / h + k_front + k_rear, mass_kg * speed + turn
    a21, a22 = turn, spec.yaw_inertia_kgm2 / h + front**2 * k_front + rear**2 * k_rear
    b1 = mass_kg / h * sideways + c_front * steering
    b2 = spec.yaw_inertia_kgm2 / h * motion.yaw_rate + front * c_front * steering
    determinant = a11 * a22 - a12 * a21
    yaw_rate = (a11 * b2 - a21 * b1) / determinant
    lateral_speed = (b1 * a22 - b2 * a12) / determinant - rear * yaw_rate
    return _moved(motion, speed=speed, lateral_speed=lateral_speed, yaw_rate=yaw_rate, h=h)


def _moved(motion: Motion, *, speed: float, lateral_speed: float, yaw_rate: float, h: float) -> Motion:
    # The integral of a rotating velocity: the chord of the arc, along the mean heading.
    half_turn = yaw_rate * h / 2
    chord = h * (sin(half_turn) / half_turn if abs(half_turn) > 1e-12 else 1.0)
    mean = motion.heading + half_turn
    return Motion(
        x=motion.x + chord * (speed * cos(mean) - lateral_speed * sin(mean)),
        y=motion.y + chord * (speed * sin(mean) + lateral_speed * cos(mean)),
        heading=motion.heading + yaw_rate * h,
        lateral_speed=lateral_speed,
        yaw_rate=yaw_rate,
    )


def _force_share(load: float) -> float:
    """Share of the linear tyre force that is left at a load (slip x stiffness / friction): tanh(load) / load."""
    return tanh(load) / load if abs(load) > 1e-6 else 1.0


def _chord(slope: float) -> float:
    return atan(slope) / slope if abs(slope) > 1e-6 else 1.0
