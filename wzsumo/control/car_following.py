"""Car following: the intelligent driver model, so that the ego keeps its gap instead of running into a queue."""

from dataclasses import dataclass
from math import isfinite, sqrt

from pydantic import Field

from wzsumo.errors import InputError
from wzsumo.spec import Spec


class IdmSpec(Spec):
    """Parameters of the intelligent driver model: those of the adaptive cruise control in Kesting, Treiber & Helbing 2010."""

    time_gap_s: float = Field(default=1.5, gt=0)  # T, ibid., Table 1
    standstill_gap_m: float = Field(default=2.0, gt=0)  # s0, ibid.
    acceleration_mps2: float = Field(default=1.4, gt=0)  # a, ibid.
    comfortable_deceleration_mps2: float = Field(default=2.0, gt=0)  # b, ibid.


@dataclass(frozen=True, kw_only=True)
class Leader:
    """The vehicle ahead on the ego's way."""

    gap_m: float  # front bumper of the ego to rear bumper of the leader; 0 or less: they touch
    speed_mps: float  # along the ego's way

    def __post_init__(self) -> None:
        if not (isfinite(self.gap_m) and isfinite(self.speed_mps)):
            raise InputError(
                f"a leader of gap_m={self.gap_m}, speed_mps={self.speed_mps} must be finite; give None for no leader"
            )


def following_acceleration(speed: float, *, leader: Leader, spec: IdmSpec) -> float:
    """Highest acceleration [m/s2] that the intelligent driver model allows behind `leader`; -inf where the gap is used up.

    The model's free-road term is left to the speed controller, which takes the lower of both demands (desired speed -> inf
    here): the gap in steady following is then exactly s0 + v T. Source: Treiber, Hennecke & Helbing 2000, Equations 3 and 4.
    """
    if leader.gap_m <= 0:
        return -float("inf")
    closing = speed * (speed - leader.speed_mps) / (2 * sqrt(spec.acceleration_mps2 * spec.comfortable_deceleration_mps2))
    desired_gap = spec.standstill_gap_m + max(0.0, speed * spec.time_gap_s + closing)
    return spec.acceleration_mps2 * (1 - (desired_gap / leader.gap_m) ** 2)
