"""Whom the ego follows: the vehicle ahead that is in its way, or comes into it before the ego is past."""

from typing import NamedTuple

import numpy as np

from wzsumo.behaviour.way import Way, half_extents
from wzsumo.ego import Leader
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.traffic import Traffic
from wzsumo.work_zone import WorkZoneLayout

TOUCH_M = 0.2  # beside the ego; who is no farther off is in its way
DRIFT_S = 3.0  # of looking ahead at who is on his way in: what drivers do for no reason lasts less
PASSED_IN_S = 0.3  # who is past the ego so soon is followed from then on: nobody brakes with all he has for him
_AHEAD_M = 20.0  # beyond the reach of the search: the longest vehicle's half, and the path's bends


def leader_ahead(way: Way, traffic: Traffic, *, layout: WorkZoneLayout) -> Leader | None:
    """The nearest vehicle ahead whose body reaches into the ego's way along the path, or soon will.

    Soon will who is slower and in a lane that ends, if he goes on as he does and the ego has not passed him by then. A driver
    who finds no gap there brakes hard and drifts on to the side: an ego that minds him when he is in its way has him beside it.
    """
    reach = max(30.0, 6 * way.state.speed)
    first, last = np.searchsorted(way.route.stations, [way.station, way.station + reach])
    traffic = traffic.near(way.state.x, way.state.y, reach_m=reach + _AHEAD_M)
    if last - first < 2 or not traffic.ids:
        return None
    places = _places_along(way, traffic, stretch=slice(first, last))
    in_way = (places.aside < TOUCH_M) | (_drifts_in(places, length=way.vehicle.length_m) & _lane_ends(traffic, layout))
    passing = (places.gap <= 0) & (places.gap > PASSED_IN_S * places.closing)
    in_way &= places.ahead & (places.gap > -traffic.lengths) & ~passing
    if not in_way.any():
        return None
    who = int(np.argmin(np.where(in_way, places.gap, np.inf)))
    gap, speed, acceleration = (float(of[who]) for of in (places.gap, traffic.speeds, traffic.accelerations))
    return Leader(gap_m=max(gap, 0.0), speed_mps=speed, acceleration_mps2=acceleration)


class _Places(NamedTuple):
    """Where vehicles (n,) are along the ego's path, and how they move there."""

    gap: FloatArray  # m, from the ego's bumper to their rear end; below 0 they are beside it
    aside: FloatArray  # m, from the ego's side, when it passes, to theirs
    length: FloatArray  # m that they take up along the path
    towards: FloatArray  # m/s, sideways, at which they near the path
    closing: FloatArray  # m/s, at which the ego comes nearer
    ahead: BoolArray  # on the stretch of the path that was looked at


def _places_along(way: Way, traffic: Traffic, *, stretch: slice) -> _Places:
    poses, stations, vehicle = way.route.poses[stretch], way.route.stations[stretch], way.vehicle
    offset = traffic.poses[:, None, :2] - poses[None, :, :2]
    nearest = np.argmin(np.einsum("ijk,ijk->ij", offset, offset), axis=1)
    along, across = _in_frame(offset[np.arange(len(nearest)), nearest], poses[nearest, 2])
    turned = traffic.poses[:, 2] - poses[nearest, 2]
    half_along, half_across = half_extents(turned, traffic.lengths, traffic.widths)
    return _Places(
        gap=stations[nearest] - way.station + along - half_along - vehicle.axle_to_bumper_m,
        aside=np.abs(across) - half_across - vehicle.width_m / 2,
        length=2 * half_along,
        towards=-np.sign(across) * traffic.speeds * np.sin(turned),
        closing=way.state.speed - traffic.speeds * np.cos(turned),
        ahead=(along > -1.0) & (along < 5.0) & (nearest > 0),
    )


def _drifts_in(places: _Places, *, length: float) -> BoolArray:
    """Who of those whom an ego of a length [m] is catching up with will be in its way in DRIFT_S or when it is past."""
    past_in = (places.gap + places.length + length) / np.maximum(places.closing, 1e-9)
    soon_aside = places.aside - places.towards * np.minimum(past_in, DRIFT_S)
    return np.asarray((places.gap > 0) & (places.closing > 0) & (soon_aside < TOUCH_M))


def _lane_ends(traffic: Traffic, layout: WorkZoneLayout) -> BoolArray:
    """Which vehicles (n,) are in a lane that does not run to the end of the road."""
    station, offset = layout.road.to_sd(traffic.poses[:, :2])
    ends = np.zeros(len(station), dtype=bool)
    for lane in layout.lanes:
        if lane.end < layout.road.length and not lane.opposing:
            on_it = (station >= lane.start) & (station < lane.end)
            ends |= on_it & (offset > lane.right(station)) & (offset < lane.left(station))
    return ends


def _in_frame(offsets: FloatArray, heading: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Parts of offsets (..., 2) along and, positive to the left, across headings (...)."""
    cos, sin = np.cos(heading), np.sin(heading)
    return offsets[..., 0] * cos + offsets[..., 1] * sin, offsets[..., 1] * cos - offsets[..., 0] * sin
