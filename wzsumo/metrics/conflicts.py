"""Conflicts of vehicles, from their outlines: overlap, time to collision, deceleration to avoid it, post-encroachment time.

Outlines are oriented boxes: poses (..., 3) of their CENTRES (x [m], y [m], heading [rad], world frame) and sizes (..., 2),
length and width [m]. Leading shapes broadcast. A vehicle that is not there has a NaN pose and is in conflict with nobody.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from wzsumo.errors import InputError
from wzsumo.frames import BoolArray, FloatArray, wrap_angle
from wzsumo.road import Road
from wzsumo.tables import check_traces

CONFLICT_COLUMNS = (
    "vehicle_id",
    "overlap",  # whether the outlines overlap at any time
    "min_ttc_s",  # least time to collision, inf: never on collision course
    "max_drac_mps2",  # greatest deceleration to avoid the crash, 0: never on collision course
    "pet_s",  # post-encroachment time, inf: no area that both occupied within the horizon
)
_NEEDED_COLUMNS = ("heading_rad", "speed_mps", "length_m", "width_m")


def time_to_collision(gap_m: npt.ArrayLike, rear_speed: npt.ArrayLike, front_speed: npt.ArrayLike) -> FloatArray:
    """Time [s] until the gap [m] between two vehicles in line is used up at their speeds [m/s]; inf where it does not shrink.

    Source: Hayward 1972, Near-miss determination through use of a scale of danger.
    """
    gap, closing = np.asarray(gap_m, dtype=float), np.subtract(rear_speed, front_speed, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.maximum(gap, 0.0) / closing
    return np.where((closing > 0) | (gap <= 0), np.where(gap <= 0, 0.0, time), np.inf)


def deceleration_to_avoid_crash(gap_m: npt.ArrayLike, rear_speed: npt.ArrayLike, front_speed: npt.ArrayLike) -> FloatArray:
    """Deceleration [m/s2] that brings the rear vehicle to the speed of the front one within the gap [m]; 0 where not closing.

    (v_rear - v_front)^2 / (2 gap); inf where they touch and close in. Source: Cooper & Ferguson 1976.
    """
    gap, closing = np.asarray(gap_m, dtype=float), np.subtract(rear_speed, front_speed, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = closing**2 / (2 * np.maximum(gap, 0.0))
    return np.where(closing > 0, needed, 0.0)


def boxes_overlap(poses_a: npt.ArrayLike, size_a: npt.ArrayLike, poses_b: npt.ArrayLike, size_b: npt.ArrayLike) -> BoolArray:
    """Whether box a and box b have a point in common, edges included: no side of either separates them."""
    offsets, reaches, _ = _along_box_axes(poses_a, size_a, poses_b, size_b)
    return np.asarray((np.abs(offsets) <= reaches).all(axis=-1))


class Approach(NamedTuple):
    """Conflict of two moving boxes, arrays of one shape."""

    ttc: FloatArray  # s, time to collision; 0 where they overlap, inf where the courses do not meet
    drac: FloatArray  # m/s2, deceleration to avoid the crash; 0 where the courses do not meet


def box_approach(
    poses_a: npt.ArrayLike,
    size_a: npt.ArrayLike,
    poses_b: npt.ArrayLike,
    size_b: npt.ArrayLike,
    *,
    speed_a: npt.ArrayLike,
    speed_b: npt.ArrayLike,
) -> Approach:
    """Time to collision and deceleration to avoid it of two boxes that go on with their speeds [m/s] along their headings.

    Behind one another this is Hayward's time of the bumper-to-bumper gap; crossing or side by side it is the first time at
    which the outlines touch: on each of the four axes normal to a side the boxes' shadows meet for a while, and they touch
    when the last of them meets before the first parts. DRAC is (closing speed)^2 / (2 distance) = closing speed / (2 TTC).
    """
    offsets, reaches, axes = _along_box_axes(poses_a, size_a, poses_b, size_b)
    relative = _velocity(poses_b, speed_b) - _velocity(poses_a, speed_a)
    drift = (axes * relative[..., None, :]).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        meets = (-np.sign(drift) * offsets - reaches) / np.abs(drift)
        parts = (-np.sign(drift) * offsets + reaches) / np.abs(drift)
    still, within = drift == 0, np.abs(offsets) <= reaches
    meets = np.where(still, np.where(within, -np.inf, np.inf), meets).max(axis=-1)
    parts = np.where(still, np.where(within, np.inf, -np.inf), parts).min(axis=-1)
    ttc = np.where((meets <= parts) & (parts >= 0), np.maximum(meets, 0.0), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        drac = np.where(np.isfinite(ttc), np.hypot(relative[..., 0], relative[..., 1]) / (2 * ttc), 0.0)
    return Approach(ttc=ttc, drac=np.where(np.isnan(drac), 0.0, drac))


def post_encroachment_time(
    poses_a: npt.ArrayLike, size_a: npt.ArrayLike, poses_b: npt.ArrayLike, size_b: npt.ArrayLike, *, dt: float, horizon_s: float
) -> float:
    """Post-encroachment time [s] of two tracks (n, 3) on one clock with step `dt`: the least time between the one vehicle's
    leaving a place and the other's coming to it; 0 where they overlap, inf where it is more than `horizon_s`.

    The places are those that both outlines occupy, one after the other. The least over all of them is the least lag at which
    the outline of one overlaps the outline that the other had then; so it is found to one `dt`, lag by lag, and in car
    following it is the net time gap. Source: Allen, Shin & Cooper 1978.
    """
    if not 0 < dt < np.inf:
        raise InputError(f"dt={dt} s must be the time between two rows of the tracks, above 0")
    a, b = np.asarray(poses_a, dtype=float), np.asarray(poses_b, dtype=float)
    if a.shape != b.shape or a.ndim != 2:
        raise InputError(f"tracks of shapes {a.shape} and {b.shape} must be (n, 3) on one clock; fill absences with NaN")
    for lag in range(min(int(horizon_s / dt + 1e-9), len(a) - 1) + 1):
        early, late = slice(0, len(a) - lag), slice(lag, None)
        if _meet(a[early], size_a, b[late], size_b) or _meet(a[late], size_a, b[early], size_b):
            return lag * dt
    return float("inf")


def conflicts_with_traffic(
    ego: pd.DataFrame, traffic: pd.DataFrame, *, dt: float, road: Road | None = None, horizon_s: float = 5.0
) -> pd.DataFrame:
    """Conflicts of one vehicle with every other, `CONFLICT_COLUMNS`, one row a vehicle of `traffic`, sorted by id.

    Both are trace tables with heading, speed, length and width, sampled on the clock k dt; the ego has one vehicle_id.
    On a `road` drivers follow its bends: who is on a collision course is told with the road straightened.
    `horizon_s` is the longest post-encroachment time that is looked for (5 s: beyond any threshold of conflict in use).
    """
    own, others = on_clock(ego, dt=dt, source="ego"), on_clock(traffic, dt=dt, source="traffic")
    rows = []
    for vehicle_id, other in others.groupby("vehicle_id", sort=True):
        first, last = min(own["tick"].min(), other["tick"].min()), max(own["tick"].max(), other["tick"].max())
        ticks = np.arange(first, last + 1)
        a, b = (table.set_index("tick").reindex(ticks) for table in (own, other))
        tracks = [table[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float) for table in (a, b)]
        sizes = [table[["length_m", "width_m"]].to_numpy(dtype=float)[0] for table in (own, other)]
        courses = tracks if road is None else [straightened(track, road) for track in tracks]
        near = box_approach(
            courses[0], sizes[0], courses[1], sizes[1], speed_a=a["speed_mps"].to_numpy(), speed_b=b["speed_mps"].to_numpy()
        )
        pet = post_encroachment_time(tracks[0], sizes[0], tracks[1], sizes[1], dt=dt, horizon_s=horizon_s)
        rows.append((vehicle_id, pet == 0, near.ttc.min(), near.drac.max(), pet))
    return pd.DataFrame(rows, columns=list(CONFLICT_COLUMNS))


def straightened(poses: FloatArray, road: Road) -> FloatArray:
    """Poses (n, 3) as they are when the road is laid straight: station, lateral offset and heading against the road's own.

    Speeds along it stay what they are, within the few per cent by which an outer lane is longer. NaN where a pose is.
    """
    there = np.isfinite(poses).all(axis=1)
    along = np.full_like(poses, np.nan)
    station, offset = road.to_sd(poses[there, :2])
    along[there] = np.column_stack([station, offset, wrap_angle(poses[there, 2] - road.heading_at(station))])
    return along


def on_clock(traces: pd.DataFrame, *, dt: float, source: str) -> pd.DataFrame:
    """The traces in order with a column `tick`, time_s / dt. Raises InputError where they are not on the clock."""
    table = check_traces(traces, source=source)
    missing = [name for name in _NEEDED_COLUMNS if name not in table.columns]
    if missing:
        raise InputError(f"{source}: column(s) {', '.join(missing)} missing; conflicts need {', '.join(_NEEDED_COLUMNS)}")
    table["tick"] = np.round(table["time_s"] / dt).astype(int)
    off_clock = np.abs(table["tick"] * dt - table["time_s"]) > dt / 100
    if off_clock.any() or table.duplicated(["vehicle_id", "tick"]).any():
        raise InputError(f"{source}: time_s must be multiples of dt={dt} s, one row a vehicle and time; resample the traces")
    return table


def _meet(a: FloatArray, size_a: npt.ArrayLike, b: FloatArray, size_b: npt.ArrayLike) -> bool:
    """Whether any two boxes in a row of a (n, 3) and b (n, 3) overlap; those too far apart for it are not looked at."""
    reach = (np.hypot(*np.asarray(size_a, dtype=float)) + np.hypot(*np.asarray(size_b, dtype=float))) / 2
    near = np.hypot(a[:, 0] - b[:, 0], a[:, 1] - b[:, 1]) <= reach
    return bool(near.any() and boxes_overlap(a[near], size_a, b[near], size_b).any())


def _along_box_axes(
    poses_a: npt.ArrayLike, size_a: npt.ArrayLike, poses_b: npt.ArrayLike, size_b: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Offsets (..., 4) of b's centre from a's, sums (..., 4) of half shadows, and the four axes (..., 4, 2) of the sides."""
    a, b = np.broadcast_arrays(np.asarray(poses_a, dtype=float), np.asarray(poses_b, dtype=float))
    axes = np.concatenate([_sides(a[..., 2]), _sides(b[..., 2])], axis=-2)
    offsets = (axes * (b - a)[..., None, :2]).sum(axis=-1)
    reaches = _half_shadow(axes, a[..., 2], size_a) + _half_shadow(axes, b[..., 2], size_b)
    return offsets, reaches, axes


def _sides(heading: FloatArray) -> FloatArray:
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack([np.stack([cos, sin], axis=-1), np.stack([-sin, cos], axis=-1)], axis=-2)


def _half_shadow(axes: FloatArray, heading: FloatArray, size: npt.ArrayLike) -> FloatArray:
    half = np.asarray(size, dtype=float)[..., None, :] / 2
    return np.asarray((np.abs(axes @ np.swapaxes(_sides(heading), -1, -2)) * half).sum(axis=-1))


def _velocity(poses: npt.ArrayLike, speed: npt.ArrayLike) -> FloatArray:
    heading = np.asarray(poses, dtype=float)[..., 2]
    return np.asarray(speed, dtype=float)[..., None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
