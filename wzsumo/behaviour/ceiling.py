"""AccelerationCeiling: the highest acceleration that the leader and the place to stop leave to the ego's controller."""

from math import inf
from typing import Literal

from wzsumo.behaviour.car_following import IdmSpec, acc_acceleration, idm_acceleration, stopping_acceleration
from wzsumo.behaviour.hindrance import Hindrance
from wzsumo.spec import Spec

EMERGENCY_ACCELERATION_MPS2 = -3.5  # ISO 15622: adaptive cruise control above 20 m/s brakes no harder of itself
CREEPING_SPEED_MPS = 2.0  # below this braking with limited jerk would use up the metre that is left to a place; chosen by us


class FollowingSpec(Spec):
    """How the ego heeds the vehicle ahead and the places where it must stop."""

    car_following: Literal["none", "idm", "acc"] = "acc"  # "none": it drives as if it were alone
    idm: IdmSpec = IdmSpec()


class AccelerationCeiling:
    """The highest acceleration that a hindrance leaves to the ego; it moves with limited jerk from one step to the next."""

    def __init__(self, spec: FollowingSpec) -> None:
        self._spec = spec
        self._last_mps2 = inf

    def next(self, hindrance: Hindrance, *, speed: float, dt: float) -> float:
        """Ceiling [m/s2] for the next `dt` seconds at a speed [m/s]; infinite where nothing hinders the ego."""
        wanted = _ceiling(hindrance, speed=speed, spec=self._spec)
        self._last_mps2 = limit_jerk(wanted, speed=speed, last=self._last_mps2, dt=dt, spec=self._spec.idm)
        return self._last_mps2


def _ceiling(hindrance: Hindrance, *, speed: float, spec: FollowingSpec) -> float:
    if spec.car_following == "none":
        return inf
    ceiling = inf
    if hindrance.stop_in_m is not None:
        ceiling = stopping_acceleration(speed, distance_m=hindrance.stop_in_m, spec=spec.idm)
    if hindrance.leader is not None:
        follow = idm_acceleration if spec.car_following == "idm" else acc_acceleration
        ceiling = min(ceiling, follow(speed, leader=hindrance.leader, spec=spec.idm))
    return ceiling


def limit_jerk(ceiling: float, *, speed: float, last: float, dt: float, spec: IdmSpec) -> float:
    """The ceiling [m/s2] that holds at a speed [m/s] where `ceiling` is wanted and `last` held `dt` [s] before.

    It moves with the comfortable jerk: a leader or a place that comes into view or goes out of it gives no jolt. An emergency
    holds at once, and so does braking at creeping speed.

    >>> [limit_jerk(wanted, speed=20.0, last=1.0, dt=0.1, spec=IdmSpec()) for wanted in (-2.0, -6.0)]
    [0.6, -6.0]
    """
    before = min(max(last, EMERGENCY_ACCELERATION_MPS2), spec.acceleration_mps2)
    change = spec.comfortable_jerk_mps3 * dt
    free_again = ceiling >= spec.acceleration_mps2 and before + change >= spec.acceleration_mps2
    if ceiling < EMERGENCY_ACCELERATION_MPS2 or free_again or (speed < CREEPING_SPEED_MPS and ceiling < last):
        return ceiling
    return min(max(ceiling, before - change), before + change)
