"""The ego vehicle: its state, its command, its run and the outcome of the run."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import pandas as pd

from wzsumo.frames import FloatArray


class Outcome(StrEnum):
    """How the drive of a case ended; NO_PATH where there was no path to drive."""

    REACHED_GOAL = "REACHED_GOAL"
    STRUCK_DEVICE = "STRUCK_DEVICE"
    ENTERED_CLOSED_AREA = "ENTERED_CLOSED_AREA"
    COLLIDED = "COLLIDED"
    LEFT_PAVEMENT = "LEFT_PAVEMENT"
    NO_PATH = "NO_PATH"
    TIMED_OUT = "TIMED_OUT"


@dataclass(frozen=True, kw_only=True)
class EgoState:
    """State of the ego. Reference point: centre of the REAR AXLE, world frame."""

    x: float  # m
    y: float  # m
    heading: float  # rad, counter-clockwise from +x
    speed: float  # m/s
    steering: float = 0.0  # rad, angle of the front wheel, positive to the left
    acceleration: float = 0.0  # m/s2

    @property
    def pose(self) -> FloatArray:
        """Pose (3,) of the rear axle."""
        return np.array([self.x, self.y, self.heading])


@dataclass(frozen=True, kw_only=True)
class Command:
    """What the controller sends to the vehicle: throttle and brake in [0, 1], front-wheel steering angle [rad]."""

    throttle: float
    brake: float
    steering: float


@dataclass(frozen=True, kw_only=True)
class Replan:
    """The plan on a map that reached the ego while it drove."""

    time_s: float  # time of the simulation when the map arrived
    station_m: float  # on the path driven until then, where the new path begins
    status: str  # PlanStatus of the plan
    reason: str  # one sentence, empty where a path was found
    plan_ms: float  # time that planning took


@dataclass(frozen=True, kw_only=True, eq=False)
class EgoRun:
    """A drive of the ego: its log with `tables.EGO_LOG_COLUMNS`, one row per control step, and its outcome.

    `traffic` and `followers` are trace tables with all columns: the vehicles near the ego ten times a second, and all vehicles
    on the road once a second.
    """

    log: pd.DataFrame
    traffic: pd.DataFrame
    followers: pd.DataFrame
    replans: tuple[Replan, ...]
    outcome: Outcome
    reason: str  # one sentence, empty where the goal was reached
    waited_s: float = 0.0  # until there was room for it on the road

    @property
    def poses(self) -> FloatArray:
        """Driven poses (n, 3) of the rear axle."""
        return self.log[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float)
