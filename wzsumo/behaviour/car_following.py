"""Car following, so that the ego keeps its gap instead of running into a queue, and stopping before a place.

The intelligent driver model brakes as in an emergency when someone cuts in closely at nearly its own speed. The adaptive
cruise control built on it does not: it trusts that the leader will go on accelerating as it does now.
"""

from math import inf, sqrt, tanh

from pydantic import Field

from wzsumo.ego import Leader
from wzsumo.spec import Spec

STOP_MARGIN_M = 1.0  # left to a place: where it lies is a forecast
EMERGENCY_MPS2 = -3.5  # ISO 15622: adaptive cruise control above 20 m/s brakes no harder of itself
CREEPING_MPS = 2.0  # from here jerk-limited braking to a stop takes the metre that is left to a place


class IdmSpec(Spec):
    """Parameters of the intelligent driver model: those of the adaptive cruise control in Kesting, Treiber & Helbing 2010."""

    time_gap_s: float = Field(default=1.5, gt=0)  # T, ibid., Table 1
    standstill_gap_m: float = Field(default=2.0, gt=0)  # s0, ibid.
    acceleration_mps2: float = Field(default=1.4, gt=0)  # a, ibid.
    comfortable_deceleration_mps2: float = Field(default=2.0, gt=0)  # b, ibid.
    coolness: float = Field(default=0.99, ge=0, le=1)  # c, ibid.; of the adaptive cruise control alone
    comfortable_jerk_mps3: float = Field(default=4.0, gt=0)  # ISO 15622, braking: 5 below 5 m/s, 2.5 above 20 m/s


def idm_acceleration(speed: float, *, leader: Leader, spec: IdmSpec) -> float:
    """Highest acceleration [m/s2] that the intelligent driver model allows behind `leader`; -inf where the gap is used up.

    The model's free-road term is left to the speed controller, which takes the lower of both demands (desired speed -> inf
    here): the gap in steady following is then exactly s0 + v T. Source: Treiber, Hennecke & Helbing 2000, Equations 3 and 4.
    """
    if leader.gap_m <= 0:
        return -inf
    closing = speed * (speed - leader.speed_mps) / (2 * sqrt(spec.acceleration_mps2 * spec.comfortable_deceleration_mps2))
    desired_gap = spec.standstill_gap_m + max(0.0, speed * spec.time_gap_s + closing)
    share = desired_gap / leader.gap_m
    return spec.acceleration_mps2 * (1 - share * share)  # a product goes to inf where a power would raise


def acc_acceleration(speed: float, *, leader: Leader, spec: IdmSpec) -> float:
    """Highest acceleration [m/s2] that the adaptive cruise control allows behind `leader`; -inf where the gap is used up.

    Where the IDM brakes harder than the leader's present acceleration calls for (CAH), only the share 1 - c of it and at
    most b beyond the CAH are left. Source: Kesting, Treiber & Helbing 2010.
    """
    idm = idm_acceleration(speed, leader=leader, spec=spec)
    if leader.gap_m <= 0:
        return idm
    calm, comfortable = constant_acceleration_heuristic(speed, leader=leader, spec=spec), spec.comfortable_deceleration_mps2
    if idm >= calm:
        return idm
    return (1 - spec.coolness) * idm + spec.coolness * (calm + comfortable * tanh((idm - calm) / comfortable))


def stopping_acceleration(speed: float, *, distance_m: float, spec: IdmSpec) -> float:
    """Highest acceleration [m/s2] with which the ego stops short of a place `distance_m` ahead of its bumper.

    With d = v^2 / (2 room), the constant deceleration that stops it there, it is a - (a + b) (d / b)^2: all of a far off, then
    gently less, and -b from where b is called for on. Only where even that comes too late is it -d. A vehicle that stands there
    would ask for more, for the time gap that is kept to vehicles. The square is that of the IDM's dynamic part, ibid.

    >>> stopping_acceleration(10.0, distance_m=26.0, spec=IdmSpec())  # 100 / (2 x 25) = b
    -2.0
    """
    most, comfortable = spec.acceleration_mps2, spec.comfortable_deceleration_mps2
    needed = speed**2 / (2 * max(distance_m - STOP_MARGIN_M, STOP_MARGIN_M / 2))
    if needed > comfortable or distance_m <= STOP_MARGIN_M:
        return -max(needed, comfortable)
    return most - (most + comfortable) * (needed / comfortable) ** 2


def eased(ceiling: float, *, speed: float, last: float, dt: float, spec: IdmSpec) -> float:
    """The ceiling [m/s2] that holds now where it was `last` before `dt` [s]: it moves with the comfortable jerk.

    A leader or a place that comes into view, or goes out of it, is no shock then. What calls for an emergency holds at once,
    and so does braking while creeping.

    >>> [eased(wanted, speed=20.0, last=1.0, dt=0.1, spec=IdmSpec()) for wanted in (-2.0, -6.0)]
    [0.6, -6.0]
    """
    before = min(max(last, EMERGENCY_MPS2), spec.acceleration_mps2)
    change = spec.comfortable_jerk_mps3 * dt
    free_again = ceiling >= spec.acceleration_mps2 and before + change >= spec.acceleration_mps2
    if ceiling < EMERGENCY_MPS2 or free_again or (speed < CREEPING_MPS and ceiling < last):
        return ceiling
    return min(max(ceiling, before - change), before + change)


def constant_acceleration_heuristic(speed: float, *, leader: Leader, spec: IdmSpec) -> float:
    """Acceleration [m/s2] that just avoids a crash (gap > 0) if the leader goes on as it does. Source: ibid."""
    theirs = min(leader.acceleration_mps2, spec.acceleration_mps2)
    stops_first = leader.speed_mps * (speed - leader.speed_mps) <= -2 * leader.gap_m * theirs
    if stops_first and theirs != 0:
        return speed**2 * theirs / (leader.speed_mps**2 - 2 * leader.gap_m * theirs)
    return theirs - max(speed - leader.speed_mps, 0.0) ** 2 / (2 * leader.gap_m)
