"""The acceleration that other vehicles and stop lines leave to the ego: one ceiling for the controller."""

from dataclasses import dataclass
from math import inf
from typing import Literal

from wzsumo.behaviour.car_following import IdmSpec, acc_acceleration, eased, idm_acceleration, stopping_acceleration
from wzsumo.behaviour.giving_way import place_to_wait
from wzsumo.behaviour.leaders import leader_ahead
from wzsumo.behaviour.stop_line import stop_line_ahead
from wzsumo.behaviour.way import Way
from wzsumo.ego import Leader
from wzsumo.spec import Spec
from wzsumo.traffic import Traffic
from wzsumo.work_zone import WorkZoneLayout


class FollowingSpec(Spec):
    """How the ego minds the vehicle ahead and the places where it must stop."""

    car_following: Literal["none", "idm", "acc"] = "acc"  # "none": it drives as if it were alone
    idm: IdmSpec = IdmSpec()


@dataclass(frozen=True, kw_only=True)
class Hindrance:
    """What keeps the ego from driving as it would alone."""

    leader: Leader | None = None
    stop_in_m: float | None = None  # from the front bumper to the place that it may not pass now; None: there is none


def hindrance_of(way: Way, traffic: Traffic, *, layout: WorkZoneLayout, may_enter: bool) -> Hindrance:
    """The leader, and the nearer of the place to give way at and the stop line.

    `may_enter` says whether it is the ego's turn on a lane that both directions share.
    """
    places = (
        place_to_wait(way, traffic, layout=layout),
        stop_line_ahead(way.state, vehicle=way.vehicle, layout=layout, may_enter=may_enter),
    )
    stop_in_m = min((place for place in places if place is not None), default=None)
    return Hindrance(leader=leader_ahead(way, traffic, layout=layout), stop_in_m=stop_in_m)


class AccelerationCeiling:
    """The highest acceleration that a hindrance leaves; it remembers the last one, from which it moves with a limited jerk."""

    def __init__(self, spec: FollowingSpec) -> None:
        self._spec = spec
        self._last_mps2 = inf

    def next(self, hindrance: Hindrance, *, speed: float, dt: float) -> float:
        """Ceiling [m/s2] for the next `dt` seconds at a speed [m/s]; infinite where nothing hinders the ego."""
        wanted = _ceiling(hindrance, speed=speed, spec=self._spec)
        self._last_mps2 = eased(wanted, speed=speed, last=self._last_mps2, dt=dt, spec=self._spec.idm)
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
