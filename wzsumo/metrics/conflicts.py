"""Conflicts of vehicles by their outlines: overlap, time to collision, deceleration to avoid it, post-encroachment time.

Outlines are oriented boxes: poses (..., 3) of their CENTRES (x [m], y [m], heading [rad], world frame) and sizes (..., 2),
length and width [m]. Leading shapes broadcast. A vehicle that is absent has a NaN pose and no conflict.
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
    "min_ttc_s",  # smallest time to collision, inf: never on a collision course
    "max_drac_mps2",  # largest deceleration to avoid the crash, 0: never on a collision course
    "pet_s",  # post-encroachment time, inf: no place that both occupied within the horizon
)
EGO_PET_HORIZON_S = 5.0  # longer post-encroachment times count as none; above any threshold in use; chosen by us
_NEEDED_COLUMNS = ("heading_rad", "speed_mps", "length_m", "width_m")


def boxes_overlap(poses_a: npt.ArrayLike, size_a: npt.ArrayLike, poses_b: npt.ArrayLike, size_b: npt.ArrayLike) -> BoolArray:
    """Whether box a and box b have a point in common, edges included: no side of either box separates them."""
    offsets, reaches, _ = _project_on_sides(poses_a, size_a, poses_b, size_b)
    return np.asarray((np.abs(offsets) <= reaches).all(axis=-1))


class Approach(NamedTuple):
    """Conflict of two moving boxes, arrays of one shape."""

    ttc: FloatArray  # s, time to collision; 0 where they overlap, inf where they are not on a collision course
    drac: FloatArray  # m/s2, deceleration to avoid the crash; 0 where they are not on a collision course


def box_approach(
    poses_a: npt.ArrayLike,
    size_a: npt.ArrayLike,
    poses_b: npt.ArrayLike,
    size_b: npt.ArrayLike,
    *,
    speed_a: npt.ArrayLike,
    speed_b: npt.ArrayLike,
) -> Approach:
    """Time to collision and deceleration to avoid it of two boxes that keep their speeds [m/s] along their headings.

    The time to collision is the first time at which the outlines touch. On each of the four axes normal to a side the
    projections of the boxes overlap for a while; the boxes touch when the last of the four overlaps begins before the first
    ends. In one lane this is bumper-to-bumper gap / closing speed (Hayward 1972, Near-miss determination through use of a
    scale of danger). DRAC = (closing speed)^2 / (2 gap) = closing speed / (2 TTC) (Cooper & Ferguson 1976).
    """
    offsets, reaches, axes = _project_on_sides(poses_a, size_a, poses_b, size_b)
    relative = _velocity(poses_b, speed_b) - _velocity(poses_a, speed_a)
    drift = (axes * relative[..., None, :]).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        begins = (-np.sign(drift) * offsets - reaches) / np.abs(drift)
        ends = (-np.sign(drift) * offsets + reaches) / np.abs(drift)
    still, within = drift == 0, np.abs(offsets) <= reaches
    begins = np.where(still, np.where(within, -np.inf, np.inf), begins).max(axis=-1)
    ends = np.where(still, np.where(within, np.inf, -np.inf), ends).min(axis=-1)
    ttc = np.where((begins <= ends) & (ends >= 0), np.maximum(begins, 0.0), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        drac = np.where(np.isfinite(ttc), np.hypot(relative[..., 0], relative[..., 1]) / (2 * ttc), 0.0)
    return Approach(ttc=ttc, drac=np.where(np.isnan(drac), 0.0, drac))


def post_encroachment_time(
    poses_a: npt.ArrayLike, size_a: npt.ArrayLike, poses_b: npt.ArrayLike, size_b: npt.ArrayLike, *, dt: float, horizon_s: float
) -> float:
    """Post-encroachment time [s] of two tracks (n, 3) on one clock with step `dt` [s]; inf where it is above `horizon_s`.

    It is the least time between one vehicle's leaving a place and the other's coming to it, 0 where they overlap. The least
    over all places is the least lag at which the outline of one vehicle overlaps the outline that the other had so much
    earlier; it is found lag by lag, to one `dt`. In car following it is the net time gap. Source: Allen, Shin & Cooper 1978.
    """
    if not 0 < dt < np.inf:
        raise InputError(f"dt={dt} s must be the time between two rows of the tracks, above 0")
    a, b = np.asarray(poses_a, dtype=float), np.asarray(poses_b, dtype=float)
    if a.shape != b.shape or a.ndim != 2:
        raise InputError(f"tracks of shapes {a.shape} and {b.shape} must be (n, 3) on one clock; fill absences with NaN")
    for lag in range(min(int(horizon_s / dt + 1e-9), len(a) - 1) + 1):
        early, late = slice(0, len(a) - lag), slice(lag, None)
        if _any_overlap(a[early], size_a, b[late], size_b) or _any_overlap(a[late], size_a, b[early], size_b):
            return lag * dt
    return float("inf")


def conflicts_with_traffic(ego: pd.DataFrame, traffic: pd.DataFrame, *, dt: float, road: Road | None = None) -> pd.DataFrame:
    """Conflicts of one vehicle with every other, `CONFLICT_COLUMNS`, one row per vehicle of `traffic`, sorted by id.

    Both are trace tables with heading, speed, length and width, sampled on the clock k dt; the ego has one vehicle_id.
    With a `road`, vehicles are assumed to follow its bends: collision courses are those on the straightened road.
    """
    own, others = with_ticks(ego, dt=dt, source="ego"), with_ticks(traffic, dt=dt, source="traffic")
    rows = []
    for vehicle_id, other in others.groupby("vehicle_id", sort=True):
        first, last = min(own["tick"].min(), other["tick"].min()), max(own["tick"].max(), other["tick"].max())
        ticks = np.arange(first, last + 1)
        a, b = (table.set_index("tick").reindex(ticks) for table in (own, other))
        tracks = [table[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float) for table in (a, b)]
        sizes = [table[["length_m", "width_m"]].to_numpy(dtype=float)[0] for table in (own, other)]
        courses = tracks if road is None else [straighten(track, road) for track in tracks]
        approach = box_approach(
            courses[0], sizes[0], courses[1], sizes[1], speed_a=a["speed_mps"].to_numpy(), speed_b=b["speed_mps"].to_numpy()
        )
        pet = post_encroachment_time(tracks[0], sizes[0], tracks[1], sizes[1], dt=dt, horizon_s=EGO_PET_HORIZON_S)
        rows.append((vehicle_id, pet == 0, approach.ttc.min(), approach.drac.max(), pet))
    return pd.DataFrame(rows, columns=list(CONFLICT_COLUMNS))


def straighten(poses: FloatArray, road: Road) -> FloatArray:
    """Poses (n, 3) on the straightened road: station, lateral offset, heading relative to the road; NaN where a pose is NaN.

    Speeds are kept, an error of the few percent by which an outer lane is longer than the reference line.
    """
    present = np.isfinite(poses).all(axis=1)
    straight = np.full_like(poses, np.nan)
    station, offset = road.to_sd(poses[present, :2])
    straight[present] = np.column_stack([station, offset, wrap_angle(poses[present, 2] - road.heading_at(station))])
    return straight


def with_ticks(traces: pd.DataFrame, *, dt: float, source: str) -> pd.DataFrame:
    """The sorted traces with a column `tick`, time_s / dt. Raises InputError where times are no multiples of dt."""
    table = check_traces(traces, source=source)
    missing = [name for name in _NEEDED_COLUMNS if name not in table.columns]
    if missing:
        raise InputError(f"{source}: column(s) {', '.join(missing)} missing; conflicts need {', '.join(_NEEDED_COLUMNS)}")
    table["tick"] = np.round(table["time_s"] / dt).astype(int)
    off_clock = np.abs(table["tick"] * dt - table["time_s"]) > dt / 100  # times are written to a few digits
    if off_clock.any() or table.duplicated(["vehicle_id", "tick"]).any():
        raise InputError(f"{source}: time_s must be multiples of dt={dt} s, one row a vehicle and time; resample the traces")
    return table


def _any_overlap(a: FloatArray, size_a: npt.ArrayLike, b: FloatArray, size_b: npt.ArrayLike) -> bool:
    """Whether the boxes overlap in any row of a (n, 3) and b (n, 3). Rows whose boxes are too far apart are skipped."""
    reach = (np.hypot(*np.asarray(size_a, dtype=float)) + np.hypot(*np.asarray(size_b, dtype=float))) / 2
    near = np.hypot(a[:, 0] - b[:, 0], a[:, 1] - b[:, 1]) <= reach
    return bool(near.any() and boxes_overlap(a[near], size_a, b[near], size_b).any())


def _project_on_sides(
    poses_a: npt.ArrayLike, size_a: npt.ArrayLike, poses_b: npt.ArrayLike, size_b: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Projections on the four axes (..., 4, 2) along the sides of the boxes, and these axes.

    Offsets (..., 4) of b's centre from a's, and the sums (..., 4) of the boxes' half extents.
    """
    a, b = np.broadcast_arrays(np.asarray(poses_a, dtype=float), np.asarray(poses_b, dtype=float))
    axes = np.concatenate([_sides(a[..., 2]), _sides(b[..., 2])], axis=-2)
    offsets = (axes * (b - a)[..., None, :2]).sum(axis=-1)
    reaches = _half_extents(axes, a[..., 2], size_a) + _half_extents(axes, b[..., 2], size_b)
    return offsets, reaches, axes


def _sides(heading: FloatArray) -> FloatArray:
    """Unit vectors (..., 2, 2) along the two sides of a box: ahead and to the left."""
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack([np.stack([cos, sin], axis=-1), np.stack([-sin, cos], axis=-1)], axis=-2)


def _half_extents(axes: FloatArray, heading: FloatArray, size: npt.ArrayLike) -> FloatArray:
    """Half of the length (..., 4) of a box's projection on each axis."""
    half = np.asarray(size, dtype=float)[..., None, :] / 2
    return np.asarray((np.abs(axes @ np.swapaxes(_sides(heading), -1, -2)) * half).sum(axis=-1))


def _velocity(poses: npt.ArrayLike, speed: npt.ArrayLike) -> FloatArray:
    heading = np.asarray(poses, dtype=float)[..., 2]
    return np.asarray(speed, dtype=float)[..., None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
