"""Paths of known shape and drives along them."""

from typing import Any

import numpy as np

from wzsumo.control.controller import Controller
from wzsumo.control.plant import PlantSpec, advance_ego
from wzsumo.ego import EgoState
from wzsumo.frames import FloatArray
from wzsumo.path import ReferencePath
from wzsumo.scenario.sections import ControlSection
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
Columns = dict[str, FloatArray]


def late_plant(**changes: Any) -> PlantSpec:
    """A car whose commands come 0.1 s late to a steering that lags by 0.2 s and turns by at most 0.4 rad/s."""
    late = {"steering_lag_s": 0.2, "command_delay_s": 0.1, "max_steering_rate_radps": 0.4}
    return PlantSpec.model_validate(late | changes)


def straight_path(length_m: float) -> ReferencePath:
    return ReferencePath(poses=np.array([[0.0, 0.0, 0.0], [length_m, 0.0, 0.0]]))


def circle_path(radius_m: float, *, turns: float = 1.0, step: float = 0.5) -> ReferencePath:
    """Left for a positive radius, from the origin, heading +x."""
    turned = np.arange(0, turns * 2 * np.pi, step / abs(radius_m)) * np.sign(radius_m)
    return ReferencePath(
        poses=np.column_stack([radius_m * np.sin(turned), radius_m * (1 - np.cos(turned)), turned]),
    )


def work_zone_path() -> ReferencePath:
    """Merge right by 3.66 m over 219 m, shift right over 110 m, shift back: quintic steps, curvature continuous."""
    x = np.arange(0.0, 900.5, 0.5)
    y, slope = np.zeros_like(x), np.zeros_like(x)
    for start, length, offset in ((93.0, 219.0, -3.66), (373.0, 110.0, -3.66), (680.0, 110.0, 3.66)):
        u = np.clip((x - start) / length, 0, 1)
        y += offset * u**3 * (10 - 15 * u + 6 * u**2)
        slope += offset / length * 30 * u**2 * (1 - u) ** 2
    return ReferencePath(poses=np.column_stack([x, y, np.arctan(slope)]))


def curved_road_path(radius_m: float = 300.0, *, entry_m: float = 80.0) -> ReferencePath:
    """Left bend and right bend, 300 m each, with clothoids: curvature continuous."""
    step = 0.05
    s = np.arange(0.0, 900.0 + step, step)
    left = np.interp(s, [100, 100 + entry_m, 400, 400 + entry_m], [0, 1, 1, 0])
    right = np.interp(s, [500, 500 + entry_m, 800, 800 + entry_m], [0, 1, 1, 0])
    curvature = (left - right) / radius_m
    heading = np.concatenate([[0], np.cumsum((curvature[1:] + curvature[:-1]) / 2 * step)])
    mean = (heading[1:] + heading[:-1]) / 2
    x, y = (np.concatenate([[0], np.cumsum(step * along)]) for along in (np.cos(mean), np.sin(mean)))
    return ReferencePath(poses=np.column_stack([x, y, heading])[::10])


def drive(
    path: ReferencePath,
    control: ControlSection,
    plant: PlantSpec,
    *,
    speed: float,
    dt: float = 0.05,
    offset: float = 0.0,
    time_limit: float = 200.0,
) -> Columns:
    """Columns of a drive from the path's start, `offset` to its left, until its end or the time limit."""
    controller = Controller(path, CAR, control)
    x, y, heading = path.poses[0]
    state = EgoState(x=x - offset * np.sin(heading), y=y + offset * np.cos(heading), heading=heading, speed=speed)
    rows = []
    for k in range(int(time_limit / dt)):
        command = controller.command(state, dt=dt)
        rows.append((
            k * dt, controller.station_m, controller.cross_track_m, state.speed, state.steering, state.acceleration,
            command.throttle - command.brake,
        ))  # fmt: skip
        if controller.reached_end:
            break
        state = advance_ego(state, command, dt=dt, vehicle=CAR, spec=plant)
    names = ("time", "station", "cross_track", "speed", "steering", "acceleration", "pedal")
    return dict(zip(names, np.array(rows).T, strict=True))
