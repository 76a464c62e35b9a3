"""Whom the ego follows: the vehicle ahead that is in its way, or comes into it before the ego is past."""

import numpy as np
import numpy.typing as npt

from wzsumo.control.car_following import Leader
from wzsumo.frames import FloatArray
from wzsumo.grid import BoolArray
from wzsumo.simulation.traffic import Traffic
from wzsumo.study.way import Way, half_extents
from wzsumo.work_zone import WorkZoneLayout

TOUCH_M = 0.2  # beside the ego; who is no farther off is in its way
DRIFT_S = 3.0  # of looking ahead at who is on his way in: what drivers do for no reason lasts less
_AHEAD_M = 20.0  # beyond the reach of the search: the longest vehicle's half, and the path's bends


def leader_ahead(way: Way, traffic: Traffic, *, layout: WorkZoneLayout) -> Leader | None:
    """The nearest vehicle ahead whose body reaches into the ego's way along the path, or soon will.

    Soon will who is slower and in a lane that ends, if he goes on as he does and the ego has not passed him by then. A driver
    who finds no gap there brakes hard and drifts on to the side: an ego that minds him when he is in its way has him beside it.
    """
    station, vehicle = way.station, way.vehicle
    reach = max(30.0, 6 * way.state.speed)
    first, last = np.searchsorted(way.route.stations, [station, station + reach])
    traffic = traffic.near(way.state.x, way.state.y, reach_m=reach + _AHEAD_M)
    if last - first < 2 or not traffic.ids:
        return None
    poses, poses_s = way.route.poses[first:last], way.route.stations[first:last]
    offset = traffic.poses[:, None, :2] - poses[None, :, :2]
    nearest = np.argmin(np.einsum("ijk,ijk->ij", offset, offset), axis=1)
    index = np.arange(len(traffic.ids))
    along, across = _in_frame(offset[index, nearest], poses[nearest, 2])
    turned = traffic.poses[:, 2] - poses[nearest, 2]
    half_along, half_across = half_extents(turned, traffic.lengths, traffic.widths)
    gap = poses_s[nearest] - station + along - half_along - vehicle.axle_to_bumper_m
    aside = np.abs(across) - half_across - vehicle.width_m / 2
    comes_nearer = -np.sign(across) * traffic.speeds * np.sin(turned)
    closing = way.state.speed - traffic.speeds * np.cos(turned)
    past_in = (gap + 2 * half_along + vehicle.length_m) / np.maximum(closing, 1e-9)
    soon_aside = aside - comes_nearer * np.minimum(past_in, DRIFT_S)
    drifts_in = (gap > 0) & (closing > 0) & (soon_aside < TOUCH_M) & _lane_ends(traffic, layout)
    in_way = ((aside < TOUCH_M) | drifts_in) & (along > -1.0) & (along < 5.0) & (nearest > 0) & (gap > -traffic.lengths)
    if not in_way.any():
        return None
    who = int(np.argmin(np.where(in_way, gap, np.inf)))
    return Leader(
        gap_m=float(max(gap[who], 0.0)),
        speed_mps=float(traffic.speeds[who]),
        acceleration_mps2=float(traffic.accelerations[who]),
    )


def _lane_ends(traffic: Traffic, layout: WorkZoneLayout) -> BoolArray:
    """Which vehicles (n,) are in a lane that does not run to the end of the road."""
    station, offset = layout.road.to_sd(traffic.poses[:, :2])
    ends = np.zeros(len(station), dtype=bool)
    for lane in layout.lanes:
        if lane.end < layout.road.length and not lane.opposing:
            on_it = (station >= lane.start) & (station < lane.end)
            ends |= on_it & (offset > lane.right(station)) & (offset < lane.left(station))
    return ends


def _in_frame(offsets: FloatArray, heading: npt.NDArray[np.float64]) -> tuple[FloatArray, FloatArray]:
    """Parts of offsets (..., 2) along and, positive to the left, across headings (...)."""
    cos, sin = np.cos(heading), np.sin(heading)
    return offsets[..., 0] * cos + offsets[..., 1] * sin, offsets[..., 1] * cos - offsets[..., 0] * sin
