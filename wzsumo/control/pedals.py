"""Throttle and brake as shares of what the car can do. Controller and plant both use it: the car knows its own pedals."""

from pydantic import Field

from wzsumo.spec import Spec


class PedalSpec(Spec):
    """Longitudinal acceleration of the pedals, on the level and without drag; linear in between."""

    full_throttle_mps2: float = Field(default=3.5, gt=0)  # 0-60 mph in 7.7 s, a mid-size sedan
    full_brake_mps2: float = Field(default=8.0, gt=0)  # dry asphalt, below the friction limit of 0.9 g


def acceleration_from_pedals(throttle: float, brake: float, *, spec: PedalSpec) -> float:
    """Acceleration [m/s2] of pedals in [0, 1]."""
    return throttle * spec.full_throttle_mps2 - brake * spec.full_brake_mps2


def pedal_from_acceleration(acceleration: float, *, spec: PedalSpec) -> float:
    """Pedal in [-1, 1], throttle positive, that gives an acceleration [m/s2], or comes as near to it as it can."""
    return max(-1.0, min(1.0, acceleration / (spec.full_throttle_mps2 if acceleration > 0 else spec.full_brake_mps2)))
