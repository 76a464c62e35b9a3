"""Conflicts of every vehicle of a fleet with every other one, from the trace table: TTC, DRAC, PET and overlap of outlines.

SUMO's own records (SSM device, collisions) measure bumper gaps along lanes. Here the outlines decide, as in `conflicts`.
"""

import numpy as np
import pandas as pd
from numba import njit

from wzsumo.frames import FloatArray, IntArray
from wzsumo.metrics.conflicts import CONFLICT_COLUMNS, straighten, with_ticks
from wzsumo.road import Road

TTC_HORIZON_S = 5.0  # longer times count as none; thresholds of conflict in use are 1.5 to 4 s (Hayward 1972 and later)
PET_HORIZON_S = 2.0  # longer times count as none; car following at a net time gap of 1 s has a PET of 1 s and is no conflict


def fleet_conflicts(
    traces: pd.DataFrame,
    *,
    dt: float,
    road: Road | None = None,
    ttc_horizon_s: float = TTC_HORIZON_S,
    pet_horizon_s: float = PET_HORIZON_S,
) -> pd.DataFrame:
    """The worst conflict of each vehicle with any other, `CONFLICT_COLUMNS`, one row per vehicle, sorted by id.

    `traces` has heading, speed, length and width on the clock k dt. A time to collision above its horizon is inf and gives
    no DRAC; a post-encroachment time above its horizon is inf. With a `road`, vehicles are assumed to follow its bends:
    collision courses are those on the straightened road.
    """
    table = with_ticks(traces, dt=dt, source="traces")
    ids, vehicle = np.unique(table["vehicle_id"].to_numpy(dtype=str), return_inverse=True)
    poses = table[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float)
    ttc, drac = _approaches(
        *_by_tick(table, vehicle, poses if road is None else straighten(poses, road)), len(ids), ttc_horizon_s
    )
    lags = _smallest_lags(*_by_tick(table, vehicle, poses)[:-1], len(ids), int(pet_horizon_s / dt + 1e-9))
    pet = np.where(lags < 0, np.inf, lags * dt)
    return pd.DataFrame(dict(zip(CONFLICT_COLUMNS, (ids, pet == 0, ttc, drac, pet), strict=True)))


def compile_kernels() -> None:
    """Compile or load the kernels of this module, so that the first real call does not wait."""
    rows = {"vehicle_id": ["a", "b"], "time_s": 0.0, "x_m": [0.0, 20.0], "y_m": 0.0, "heading_rad": 0.0}
    fleet_conflicts(pd.DataFrame(rows | {"speed_mps": [20.0, 0.0], "length_m": 5.0, "width_m": 2.0}), dt=0.1)


def _by_tick(
    table: pd.DataFrame, vehicle: IntArray, poses: FloatArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray]:
    """(vehicle numbers, first row of each tick, poses, half sizes, speeds), sorted by tick, then by x."""
    order = np.lexsort((poses[:, 0], table["tick"].to_numpy()))
    tick = table["tick"].to_numpy()[order]
    starts = np.searchsorted(tick, np.arange(tick[0], tick[-1] + 2))  # an entry for every tick, also for one without a vehicle
    halves = table[["length_m", "width_m"]].to_numpy(dtype=float)[order] / 2
    return vehicle[order], starts, poses[order], halves, table["speed_mps"].to_numpy(dtype=float)[order]


@njit(cache=True)
def _approaches(
    vehicle: IntArray, starts: IntArray, poses: FloatArray, halves: FloatArray, speed: FloatArray, n: int, horizon: float
) -> tuple[FloatArray, FloatArray]:
    """Smallest time to collision and largest DRAC of each of n vehicles. Rows are sorted by tick, then by x."""
    smallest, largest = np.full(n, np.inf), np.zeros(n)
    reach = np.sqrt(halves[:, 0] ** 2 + halves[:, 1] ** 2)
    velocity = np.empty((len(speed), 2))
    velocity[:, 0], velocity[:, 1] = speed * np.cos(poses[:, 2]), speed * np.sin(poses[:, 2])
    for block in range(len(starts) - 1):
        first, end = starts[block], starts[block + 1]
        if end - first < 2:
            continue
        v_x, longest = velocity[first:end, 0], reach[first:end].max()
        window = 2 * longest + horizon * (v_x.max() - v_x.min())
        for i in range(first, end):
            for j in range(i + 1, end):
                d_x, d_y = poses[j, 0] - poses[i, 0], poses[j, 1] - poses[i, 1]
                if d_x > window:
                    break
                w_x, w_y = velocity[j, 0] - velocity[i, 0], velocity[j, 1] - velocity[i, 1]
                relative = np.sqrt(w_x * w_x + w_y * w_y)
                if np.sqrt(d_x * d_x + d_y * d_y) - reach[i] - reach[j] > relative * horizon:
                    continue
                ttc = _time_to_touch(d_x, d_y, w_x, w_y, poses[i, 2], poses[j, 2], halves[i], halves[j])
                if ttc > horizon:
                    continue
                drac = 0.0
                if relative > 0:
                    drac = relative / (2 * ttc) if ttc > 0 else np.inf
                for row in (i, j):
                    smallest[vehicle[row]] = min(smallest[vehicle[row]], ttc)
                    largest[vehicle[row]] = max(largest[vehicle[row]], drac)
    return smallest, largest


@njit(cache=True)
def _smallest_lags(vehicle: IntArray, starts: IntArray, poses: FloatArray, halves: FloatArray, n: int, most: int) -> IntArray:
    """Smallest number of ticks between the outlines of each of n vehicles and any other at one place; -1 above `most`."""
    smallest = np.full(n, most + 1)
    reach = np.sqrt(halves[:, 0] ** 2 + halves[:, 1] ** 2)
    longest = reach.max()
    blocks = len(starts) - 1
    for lag in range(most + 1):
        for block in range(blocks - lag):
            first, end = starts[block + lag], starts[block + lag + 1]
            low = first
            for i in range(starts[block], starts[block + 1]):
                near = reach[i] + longest
                while low < end and poses[low, 0] < poses[i, 0] - 2 * longest:
                    low += 1
                for j in range(low, end):
                    d_x, d_y = poses[j, 0] - poses[i, 0], poses[j, 1] - poses[i, 1]
                    if d_x > near:
                        break
                    a, b = vehicle[i], vehicle[j]
                    if a == b or (smallest[a] <= lag and smallest[b] <= lag):
                        continue
                    if d_x * d_x + d_y * d_y > (reach[i] + reach[j]) ** 2:
                        continue
                    if _time_to_touch(d_x, d_y, 0.0, 0.0, poses[i, 2], poses[j, 2], halves[i], halves[j]) == 0:
                        smallest[a], smallest[b] = min(smallest[a], lag), min(smallest[b], lag)
    return np.where(smallest > most, -1, smallest)


@njit(cache=True)
def _time_to_touch(
    d_x: float, d_y: float, w_x: float, w_y: float, heading_a: float, heading_b: float, half_a: FloatArray, half_b: FloatArray
) -> float:
    """Time until box b, offset by d and moving by w relative to box a, touches it; 0 where they overlap, inf for never.

    The rule is that of `conflicts.box_approach`.
    """
    begins, ends = -np.inf, np.inf
    for axis in range(4):
        angle = (heading_a if axis < 2 else heading_b) + (axis % 2) * np.pi / 2
        u_x, u_y = np.cos(angle), np.sin(angle)
        reach = 0.0
        for heading, half in ((heading_a, half_a), (heading_b, half_b)):
            along, across = np.cos(heading) * u_x + np.sin(heading) * u_y, np.cos(heading) * u_y - np.sin(heading) * u_x
            reach += abs(along) * half[0] + abs(across) * half[1]
        offset, drift = d_x * u_x + d_y * u_y, w_x * u_x + w_y * u_y
        if drift == 0:
            if abs(offset) > reach:
                return np.inf
            continue
        first, second = (-reach - offset) / drift, (reach - offset) / drift
        begins, ends = max(begins, min(first, second)), min(ends, max(first, second))
    if begins > ends or ends < 0:
        return np.inf
    return max(begins, 0.0)
