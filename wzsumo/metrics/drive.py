"""Figures of a drive: its conflicts with the traffic around it, its accelerations, its standstills."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd

from wzsumo.ego import EgoRun
from wzsumo.frames import BoolArray, FloatArray, advance, wrap_angle
from wzsumo.metrics.conflicts import conflicts_with_traffic
from wzsumo.road import Road
from wzsumo.vehicle import VehicleGeometry

CLOCK_S = 0.1  # time step of the log of the surrounding traffic
SMOOTHING_S = 0.5  # accelerations and jerk are means over this time, since rounding shows in single steps; chosen by us
STANDSTILL_MPS = 0.1  # an ego slower than this stands; SUMO's "halting" threshold (SUMO docs, TraCI, "Halting Number")


@dataclass(frozen=True, kw_only=True)
class DriveMeasures:
    """Figures of one drive. Without a conflict TTC and PET are inf and DRAC is 0."""

    min_ttc_s: float  # time to collision with any vehicle
    max_drac_mps2: float  # deceleration rate to avoid a crash, of the ego or of the other vehicle
    min_pet_s: float  # post-encroachment time; in car following it is the net time gap
    max_lateral_acceleration_mps2: float
    max_braking_mps2: float
    max_jerk_mps3: float  # along the path
    stopped_s: float  # time below 0.1 m/s
    mean_speed_mps: float


def measure_drive(run: EgoRun, vehicle: VehicleGeometry, *, road: Road | None = None) -> DriveMeasures:
    """The figures of a run with at least two rows in its log. With a `road`, all vehicles are assumed to follow its bends."""
    log = run.log
    time, speed = log["time_s"].to_numpy(dtype=float), log["speed_mps"].to_numpy(dtype=float)
    step = float(np.median(np.diff(time)))
    window = max(1, round(SMOOTHING_S / step))
    acceleration = mean_change(speed, window=window) / step
    turned = np.concatenate([[0.0], np.cumsum(wrap_angle(np.diff(log["heading_rad"])))])
    yaw_rate = mean_change(turned, window=window) / step
    jerk = mean_change(acceleration, window=window) / step
    conflicts = None
    if len(run.traffic):
        conflicts = conflicts_with_traffic(_ego_trace(run, vehicle), run.traffic, dt=CLOCK_S, road=road)
    return DriveMeasures(
        min_ttc_s=float(conflicts["min_ttc_s"].min()) if conflicts is not None else np.inf,
        max_drac_mps2=float(conflicts["max_drac_mps2"].max()) if conflicts is not None else 0.0,
        min_pet_s=float(conflicts["pet_s"].min()) if conflicts is not None else np.inf,
        max_lateral_acceleration_mps2=float(np.abs(yaw_rate * speed).max()),
        max_braking_mps2=float(max(-acceleration.min(), 0.0)),
        max_jerk_mps3=float(np.abs(jerk).max()),
        stopped_s=float((speed < STANDSTILL_MPS).sum() * step),
        mean_speed_mps=float(speed.mean()),
    )


def on_clock(time_s: npt.ArrayLike) -> BoolArray:
    """Whether times [s] are times of the log of the surrounding traffic."""
    ticks = np.asarray(time_s, dtype=float) / CLOCK_S
    return np.asarray(np.abs(ticks - np.round(ticks)) < 0.01)


def _ego_trace(run: EgoRun, vehicle: VehicleGeometry) -> pd.DataFrame:
    """The ego as a trace of its CENTRE at the times of the traffic's log."""
    log = run.log[on_clock(run.log["time_s"])]
    centre = advance(log[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float), vehicle.axle_to_centre_m)
    return pd.DataFrame({
        "vehicle_id": "ego", "time_s": (log["time_s"] / CLOCK_S).round() * CLOCK_S, "x_m": centre[:, 0], "y_m": centre[:, 1],
        "heading_rad": centre[:, 2], "speed_mps": log["speed_mps"], "length_m": vehicle.length_m, "width_m": vehicle.width_m,
    })  # fmt: skip


def mean_change(values: FloatArray, *, window: int) -> FloatArray:
    """Mean change per step of values (n,), over `window` steps around each value; the window is cut off at both ends."""
    at = np.arange(len(values))
    after, before = np.minimum(at + (window + 1) // 2, len(values) - 1), np.maximum(at - window // 2, 0)
    return np.asarray((values[after] - values[before]) / np.maximum(after - before, 1))
