"""The speed of the ego over the next seconds, planned among the ways of others and before stop lines.

Profiles of speed over time lead from the ego's speed and acceleration to a speed after some time, with the least integral of
squared jerk: cubic polynomials. Of all profiles the one is taken that costs least in comfort, time and room. To follow, to give
way, to stop at a line and to go on where a stop would come too late are all answers to the same question.
Sources: Werling, Ziegler, Kammel & Thrun 2010, Optimal trajectory generation for dynamic street scenarios (the profiles);
Kesting, Treiber & Helbing 2007, MOBIL (what those behind are owed); Treiber, Hennecke & Helbing 2000 (the gap ahead).
"""

from math import inf

import numpy as np

from wzsumo.behaviour.ego_outlook import EgoOutlook
from wzsumo.behaviour.speed_plan_spec import SpeedPlanSpec
from wzsumo.behaviour.ways_of_others import WaysOfOthers, ways_of_others, with_stop_line
from wzsumo.frames import FloatArray
from wzsumo.traffic import Traffic
from wzsumo.work_zone import WorkZoneLayout

TIMES_S = np.arange(0.0, 8.01, 0.25)  # Werling et al. plan 3 to 8 s ahead; more than a lane change of 4.6 s
DURATIONS_S = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.5, 8.0, 10.0, 13.0])
N_SPEEDS = 15  # target speeds, from 0 to the desired one
EMERGENCIES_MPS2 = (-4.0, -5.0, -6.0, -7.0, -8.0)  # braking at once, up to what tyres and pedals give
RELEASE_JERK_MPS3 = 2.5  # ISO 15622 above 20 m/s
TOUCH_COST = 1e4  # of a metre inside another's way for a second: more than all comfort


class SpeedPlanner:
    """Plans the ego's speed anew at each moment, from the acceleration that it planned the moment before."""

    def __init__(self, spec: SpeedPlanSpec) -> None:
        self._spec = spec
        self._last_mps2 = inf

    def ceiling(self, outlook: EgoOutlook, traffic: Traffic, *, layout: WorkZoneLayout, may_enter: bool, dt: float) -> float:
        """Highest acceleration [m/s2] until the next moment, in `dt` [s]; inf where nobody is in the way.

        `may_enter` says whether it is the ego's turn on a lane that both directions share. Where the way becomes free the
        ceiling rises by RELEASE_JERK_MPS3.
        """
        highest = self._spec.acceleration_mps2
        before = self._last_mps2 if self._last_mps2 < inf else min(max(outlook.state.acceleration, -highest), highest)
        planned = plan_accelerations(outlook, traffic, layout=layout, may_enter=may_enter, acceleration=before, spec=self._spec)
        if planned is None:
            released = self._last_mps2 + RELEASE_JERK_MPS3 * dt
            self._last_mps2 = released if released < highest else inf
            return self._last_mps2
        # The car's acceleration follows what it is asked with a lag: it is asked now what it is to have after the lag.
        self._last_mps2, asked = map(float, np.interp([dt, dt + self._spec.response_s], TIMES_S, planned))
        return asked


def plan_accelerations(
    outlook: EgoOutlook,
    traffic: Traffic,
    *,
    layout: WorkZoneLayout,
    may_enter: bool,
    acceleration: float,
    spec: SpeedPlanSpec,
) -> FloatArray | None:
    """Accelerations [m/s2] at TIMES_S of the best profile from `acceleration` on; None where nobody is in the way.

    Vehicles that are not certain to come into the way (see `ways_of_others`) make the ego brake comfortably, and no harder.
    """

    def planned_for(*, only_certain: bool) -> FloatArray | None:
        ways = ways_of_others(outlook, traffic, layout=layout, times=TIMES_S, spec=spec, only_certain=only_certain)
        return _best_accelerations(
            outlook, ways if may_enter else with_stop_line(ways, outlook, layout=layout), acceleration=acceleration, spec=spec
        )

    planned = planned_for(only_certain=False)
    least = -spec.comfortable_deceleration_mps2
    if planned is None or planned.min() >= least:
        return planned
    for_certain = planned_for(only_certain=True)
    return np.maximum(planned, least if for_certain is None else np.minimum(for_certain, least))


def _best_accelerations(
    outlook: EgoOutlook, ways: WaysOfOthers, *, acceleration: float, spec: SpeedPlanSpec
) -> FloatArray | None:
    """The same for ways of others that are known."""
    if not len(ways.enters):
        return None
    highest = _top_speed(outlook)
    of_others = np.clip(ways.speeds[np.argsort(ways.near[:, 0])[:3], -1], 0.0, highest)
    targets = np.concatenate([np.linspace(0.0, max(highest, outlook.state.speed), N_SPEEDS), of_others])
    speeds, accelerations = speed_profiles(outlook.state.speed, acceleration, targets=targets, highest=highest, spec=spec)
    places = np.cumsum((speeds + np.hstack([speeds[:, :1], speeds[:, :-1]])) / 2 * np.diff(TIMES_S, prepend=0.0), axis=1)
    room = room_costs(places, speeds, ways, spec=spec)
    if room[-1] == 0:  # the last profile is that of the ego alone
        return None
    desired = np.interp(outlook.station + places, outlook.path.stations, outlook.desired_speeds)
    cost = room + comfort_costs(speeds, accelerations, desired, acceleration=acceleration, spec=spec)
    best = int(np.argmin(cost))
    return np.asarray(accelerations[best])


def speed_profiles(
    speed: float, acceleration: float, *, targets: FloatArray, highest: float, spec: SpeedPlanSpec
) -> tuple[FloatArray, FloatArray]:
    """Speeds and accelerations (n, k) of profiles at TIMES_S from a speed and an acceleration; the last speeds up freely.

    With the change D = v_T - v - a T, v(t) = v + a t + (3 D / T^2 + a / T) t^2 - (2 D / T + a) t^3 / T^2 reaches v_T at T with
    no acceleration left. Speeds end at 0.
    """
    target, duration = (each.ravel()[:, None] for each in np.meshgrid(targets, DURATIONS_S, indexing="ij"))
    change = target - speed - acceleration * duration
    square, cube = 3 * change / duration**2 + acceleration / duration, -(2 * change / duration + acceleration) / duration**2
    t = np.minimum(TIMES_S, duration)
    smooth = speed + acceleration * t + square * t**2 + cube * t**3
    slopes = np.where(duration > TIMES_S, acceleration + 2 * square * t + 3 * cube * t**2, 0.0)
    hard = np.broadcast_to(np.array(EMERGENCIES_MPS2)[:, None], (len(EMERGENCIES_MPS2), len(TIMES_S)))
    freely = np.minimum(acceleration + RELEASE_JERK_MPS3 * TIMES_S, spec.acceleration_mps2)
    at_once = np.vstack([hard, freely])
    means = (at_once + np.hstack([at_once[:, :1], at_once[:, :-1]])) / 2
    changed = np.cumsum(means * np.diff(TIMES_S, prepend=0.0), axis=1)
    speeds = np.maximum(np.vstack([smooth, np.minimum(speed + changed, max(highest, speed))]), 0.0)
    accelerations = np.vstack([slopes, at_once])
    return speeds, np.where((speeds <= 0) & (accelerations < 0), 0.0, accelerations)


def room_costs(places: FloatArray, speeds: FloatArray, ways: WaysOfOthers, *, spec: SpeedPlanSpec) -> FloatArray:
    """Costs (n,) of being too near to others, of profiles at places [m] and speeds [m/s] (n, k)."""
    place, speed = places[:, None, :], speeds[:, None, :]
    in_way = (place >= ways.enters[:, None]) & (place <= ways.leaves[:, None])
    ahead, behind = ways.near - place, place - ways.far  # room to the one ahead; room before the one behind
    closing_in, closed_in_on = np.maximum(speed - ways.speeds, 0.0), np.maximum(ways.speeds - speed, 0.0)
    wished = spec.standstill_gap_m + spec.time_gap_s * speed
    lacks_ahead = np.clip(1 - ahead / wished, 0.0, 1.0) ** 2
    braking = closing_in**2 / (2 * np.maximum(ahead - spec.standstill_gap_m / 2, 0.5))
    lacks_ahead += np.maximum(braking / spec.comfortable_deceleration_mps2 - 1, 0.0) ** 2
    margin = np.where(ways.speeds < 0.3, 0.2, spec.standstill_gap_m)  # one that stands may be waiting for the ego
    owed = margin + closed_in_on * spec.reaction_time_s + closed_in_on**2 / (2 * spec.safe_deceleration_mps2)
    least = 0.2 + closed_in_on * spec.reaction_time_s / 2 + closed_in_on**2 / (2 * spec.emergency_deceleration_mps2)
    lacks_behind = 5 * np.clip((owed - behind) / owed, 0.0, 1.0)
    is_behind = ahead >= 0
    in_way &= ~is_behind | (ways.near <= ways.leaves[:, None])  # the ego has left the way of one that is farther ahead
    touching = np.where(is_behind, np.maximum(0.5 - ahead, 0.0), np.maximum(least - behind, 0.0))
    lacking = np.where(is_behind, lacks_ahead, lacks_behind)
    step = TIMES_S[1] - TIMES_S[0]
    return np.asarray((np.where(in_way, spec.room_cost * lacking + TOUCH_COST * touching, 0.0)).sum(axis=(1, 2)) * step)


def comfort_costs(
    speeds: FloatArray, accelerations: FloatArray, desired: FloatArray, *, acceleration: float, spec: SpeedPlanSpec
) -> FloatArray:
    """Costs (n,) of acceleration, of jerk and of time, of profiles (n, k)."""
    step = TIMES_S[1] - TIMES_S[0]
    jerk = np.diff(np.hstack([np.full((len(speeds), 1), acceleration), accelerations[:, 1:]]), axis=1) / step
    over = np.maximum(accelerations / spec.acceleration_mps2 - 1.05, 0.0) + np.maximum(speeds - desired - 0.5, 0.0)
    late = np.maximum(desired - speeds, 0.0)
    cost = accelerations**2 + spec.delay_cost * late + 10 * over**2
    return np.asarray((cost.sum(axis=1) + spec.jerk_cost * (jerk**2).sum(axis=1)) * step)


def _top_speed(outlook: EgoOutlook) -> float:
    ahead = (outlook.path.stations >= outlook.station) & (
        outlook.path.stations <= outlook.station + 8 * outlook.state.speed + 10
    )
    return float(outlook.desired_speeds[ahead].max()) if ahead.any() else float(outlook.desired_speeds[-1])
