"""Speeds that the ego keeps along its path for what its map says: slow where it is doubtful, none where no way leads on."""

from dataclasses import dataclass
from math import inf

from wzsumo.behaviour.speed_plan_spec import SpeedPlanSpec

HOLD_MPS2 = -1.0  # at the end of the way, and where the ego is faster than the limit of the stretch that it is on
BRAKES_FROM = 0.7  # of the comfortable deceleration, from where on it brakes for a limit ahead: no sooner, and smoothly then


@dataclass(frozen=True, kw_only=True)
class SpeedLimit:
    """No faster than `speed` [m/s] from `start` to `end` [m] along the path of the rear axle; 0: the way ends at `start`."""

    start: float
    end: float
    speed: float


def limit_ceiling(limits: tuple[SpeedLimit, ...], *, station: float, speed: float, spec: SpeedPlanSpec) -> float:
    """Highest acceleration [m/s2] that keeps all limits, from a station [m] at a speed [m/s]; inf where none is near.

    Ahead of a limit it is that of constant braking to the limit's start, (u^2 - v^2) / 2 d, once this is as much as
    BRAKES_FROM of the comfortable deceleration. For the end of the way it may be as much as tyres give, for a slow stretch no
    more than is comfortable: the ego then comes into it faster.
    """
    ceiling = inf
    for limit in limits:
        if station >= limit.end or (speed <= limit.speed and station < limit.start):
            continue
        ahead = limit.start - station
        if (ahead > 0 and limit.speed > 0) or ahead > 0.5:
            wanted = (limit.speed**2 - speed**2) / (2 * ahead)
            if limit.speed > 0:
                wanted = max(wanted, -spec.comfortable_deceleration_mps2)
            if wanted <= -BRAKES_FROM * spec.comfortable_deceleration_mps2:
                ceiling = min(ceiling, wanted)
        elif limit.speed == 0:
            ceiling = min(ceiling, HOLD_MPS2 - speed**2)
        else:
            ceiling = min(ceiling, max(limit.speed - speed, -spec.comfortable_deceleration_mps2))
    return ceiling
