"""The ego that plans its speed, as a point with the lag of its power train, among vehicles with scripted drives."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from behaviour.outlooks import CAR, LAYOUT, MIDDLE, NOBODY, together, vehicle_at

from wzsumo.behaviour.ego_outlook import EgoOutlook, path_on_road
from wzsumo.behaviour.speed_plan import SpeedPlanner
from wzsumo.behaviour.speed_plan_spec import SpeedPlanSpec
from wzsumo.ego import EgoState
from wzsumo.frames import FloatArray
from wzsumo.path import ReferencePath
from wzsumo.work_zone import WorkZoneLayout

START_X = 50.0
BOTH = (4.8 + CAR.length_m) / 2


class Other(NamedTuple):
    """A car of 4.8 m: its centre at the start, and its y and speed over time."""

    x: float
    y: Callable[[float], float]
    speed: Callable[[float], float]


class Trial(NamedTuple):
    """Time, the ego's centre, its speed and acceleration (n,), and the others' centres (n, m)."""

    time: FloatArray
    x: FloatArray
    y: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    others_x: FloatArray
    others_y: FloatArray

    @property
    def jerk_1s(self) -> float:
        return float(np.abs(self.acceleration[10:] - self.acceleration[:-10]).max())

    def gap(self, other: int = 0) -> FloatArray:
        return np.abs(self.others_x[:, other] - self.x) - BOTH

    def touches(self) -> bool:
        beside = np.abs(self.others_y - self.y[:, None]) < (1.85 + CAR.width_m) / 2
        along = np.abs(self.others_x - self.x[:, None]) < BOTH
        return bool((beside & along).any())


def drive(
    others: Sequence[Other], *, speed: float, desired: float, duration_s: float,
    y: Callable[[float], float] = lambda _x: MIDDLE, layout: WorkZoneLayout = LAYOUT, may_enter: bool = True,
) -> Trial:  # fmt: skip
    s = np.arange(0.0, 1000.0)
    xs, ys = START_X + s, np.array([y(START_X + at) for at in s])
    headings = np.arctan(np.gradient(ys, xs))
    path = path_on_road(ReferencePath(poses=np.column_stack([xs, ys, headings])), layout=layout, vehicle=CAR)
    planner, at, acceleration, dt, rows = SpeedPlanner(SpeedPlanSpec()), 0.0, 0.0, 0.1, []
    places = [other.x for other in others]
    for time in np.arange(0.0, duration_s, dt):
        vehicles = [
            vehicle_at(
                x, other.y(time), speed=other.speed(time),
                acceleration=(other.speed(time) - other.speed(time - dt)) / dt,
                heading=float(np.arctan2((other.y(time) - other.y(time - dt)) / dt, max(other.speed(time), 0.1))),
            )
            for x, other in zip(places, others, strict=True)
        ]  # fmt: skip
        heading = float(np.interp(at, path.stations, headings))
        state = EgoState(
            x=START_X + at, y=float(np.interp(at, path.stations, ys)), heading=heading, speed=speed, acceleration=acceleration
        )
        outlook = EgoOutlook(path=path, station=at, state=state, vehicle=CAR, desired_speeds=np.full(len(s), desired))
        traffic = together(*vehicles) if vehicles else NOBODY
        ceiling = planner.ceiling(outlook, traffic, layout=layout, may_enter=may_enter, dt=dt)
        rows.append(
            (time, state.x + CAR.axle_to_centre_m, state.y, speed, acceleration, places.copy(), [o.y(time) for o in others])
        )
        wanted = min(ceiling, float(np.clip(desired - speed, -2.0, 1.4)))
        for _ in range(10):
            acceleration += (wanted - acceleration) * (1 - np.exp(-0.01 / 0.3))
            faster = max(speed + acceleration * 0.01, 0.0)
            at, speed = at + (speed + faster) / 2 * 0.01, faster
        places = [x + other.speed(time) * dt for x, other in zip(places, others, strict=True)]
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return Trial(*columns)
