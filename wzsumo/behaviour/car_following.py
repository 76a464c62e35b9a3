"""Car following, and stopping at a place: the highest acceleration that each leaves to the ego.

The intelligent driver model (IDM) brakes as in an emergency when a vehicle cuts in closely at nearly the ego's speed. The
adaptive cruise control (ACC) that is built on it does not: it takes the leader to keep its present acceleration.
"""

from math import inf, sqrt, tanh

from pydantic import Field

from wzsumo.ego import Leader
from wzsumo.spec import Spec

STOP_MARGIN_M = 1.0  # left between the bumper and a place to stop, which is known from a forecast; chosen by us


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

    Where the IDM brakes harder than the constant-acceleration heuristic (CAH) calls for, the ACC takes the share 1 - c of the
    IDM's demand, and brakes by at most about b beyond the CAH. Source: Kesting, Treiber & Helbing 2010.
    """
    idm = idm_acceleration(speed, leader=leader, spec=spec)
    if leader.gap_m <= 0:
        return idm
    calm, comfortable = constant_acceleration_heuristic(speed, leader=leader, spec=spec), spec.comfortable_deceleration_mps2
    if idm >= calm:
        return idm
    return (1 - spec.coolness) * idm + spec.coolness * (calm + comfortable * tanh((idm - calm) / comfortable))


def constant_acceleration_heuristic(speed: float, *, leader: Leader, spec: IdmSpec) -> float:
    """Acceleration [m/s2] that just avoids a crash (gap > 0) if the leader keeps its acceleration.

    Source: Kesting, Treiber & Helbing 2010.
    """
    of_leader = min(leader.acceleration_mps2, spec.acceleration_mps2)
    stops_first = leader.speed_mps * (speed - leader.speed_mps) <= -2 * leader.gap_m * of_leader
    if stops_first and of_leader != 0:
        return speed**2 * of_leader / (leader.speed_mps**2 - 2 * leader.gap_m * of_leader)
    return of_leader - max(speed - leader.speed_mps, 0.0) ** 2 / (2 * leader.gap_m)


def stopping_acceleration(speed: float, *, distance_m: float, spec: IdmSpec) -> float:
    """Highest acceleration [m/s2] with which the ego stops STOP_MARGIN_M before a place `distance_m` ahead of its bumper.

    With d = v^2 / (2 distance), the constant deceleration that stops it there, it is a - (a + b) (d / b)^2: all of a far off,
    then gently less, and -b where d reaches b. Where d is above b, it is -d. A standing leader in that place would call for
    earlier braking, for the time gap that is kept to vehicles. The square is that of the IDM's interaction term (Treiber et al.
    2000).

    >>> stopping_acceleration(10.0, distance_m=26.0, spec=IdmSpec())  # 100 / (2 x 25) = b
    -2.0
    """
    highest, comfortable = spec.acceleration_mps2, spec.comfortable_deceleration_mps2
    needed = speed**2 / (2 * max(distance_m - STOP_MARGIN_M, STOP_MARGIN_M / 2))
    if needed > comfortable or distance_m <= STOP_MARGIN_M:
        return -max(needed, comfortable)
    return highest - (highest + comfortable) * (needed / comfortable) ** 2
