"""Whom the ego minds on its path: the vehicle ahead in its way, and those in whose way it would come.

Drivers brake for what is in their lane. They cannot for what comes into it right before them: there the ego waits.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wzsumo.control.car_following import Leader
from wzsumo.ego import EgoState
from wzsumo.frames import FloatArray, advance
from wzsumo.path import ReferencePath
from wzsumo.simulation.session import Traffic
from wzsumo.vehicle import VehicleGeometry

FORESIGHT_S = 5.0  # comfortable braking from 10 m/s at 2 m/s2
TIME_STEP_S = 0.25
SAFE_DECELERATION_MPS2 = 4.0  # asked of the driver behind; b_safe of Kesting, Treiber & Helbing 2007 (MOBIL), Table 1
REACTION_TIME_S = 1.0  # of the driver behind; SUMO's default tau
SIDE_MARGIN_M = 0.3  # the same that other drivers keep beside the ego
END_MARGIN_M = 2.0  # standstill gap of the intelligent driver model, Treiber et al. 2000
_BEHIND_M, _AHEAD_M = 150.0, 20.0  # who may come alongside within the foresight


@dataclass(frozen=True, kw_only=True, eq=False)
class Way:
    """The ego on its path: where it is and how it would go on if nobody hindered it."""

    path: ReferencePath
    station: float  # m, of the rear axle along the path
    state: EgoState
    vehicle: VehicleGeometry
    desired_speed: float  # m/s
    acceleration: float  # m/s2, with which it takes up speed


def whom_to_mind(way: Way, traffic: Traffic) -> Leader | None:
    """The nearest of the vehicle ahead and of the place where the ego must wait, None where the way is clear."""
    if not traffic.ids:
        return None
    both = (leader_ahead(way, traffic), place_to_wait(way, traffic))
    return min((it for it in both if it), key=lambda it: it.gap_m, default=None)


def leader_ahead(way: Way, traffic: Traffic) -> Leader | None:
    """The nearest vehicle ahead whose body reaches into the ego's way along the path."""
    s, station, vehicle = way.path.arc_length, way.station, way.vehicle
    reach = max(30.0, 6 * way.state.speed)
    ahead = (s >= station) & (s <= station + reach)
    if ahead.sum() < 2:
        return None
    poses, poses_s = way.path.poses[ahead], s[ahead]
    offset = traffic.poses[:, None, :2] - poses[None, :, :2]
    nearest = np.argmin(np.einsum("ijk,ijk->ij", offset, offset), axis=1)
    index = np.arange(len(traffic.ids))
    along, across = _in_frame(offset[index, nearest], poses[nearest, 2])
    gap = poses_s[nearest] - station + along - traffic.lengths / 2 - vehicle.axle_to_bumper_m
    in_way = (np.abs(across) < (traffic.widths + vehicle.width_m) / 2) & (along > -1.0) & (along < 5.0) & (nearest > 0)
    in_way &= gap > -traffic.lengths
    if not in_way.any():
        return None
    first = int(np.argmin(np.where(in_way, gap, np.inf)))
    return Leader(gap_m=float(max(gap[first], 0.0)), speed_mps=float(traffic.speeds[first]))


def place_to_wait(way: Way, traffic: Traffic) -> Leader | None:
    """The place, as a leader that stands there, where the ego would come into the way of a driver who could not yield.

    All are carried on along their headings at the speeds that they have, the ego along its path at the speed that it would
    take up. It comes into another's way when its outline reaches beside the other's body; then the other must be past, or so
    far behind that it can brake to the ego's speed with SAFE_DECELERATION_MPS2 after REACTION_TIME_S. Whoever is in the
    ego's way already follows it, or is followed.
    """
    state, vehicle = way.state, way.vehicle
    now = advance(state.pose, vehicle.axle_to_centre_m)
    along, across = _in_frame(traffic.poses[:, :2] - now[:2], np.full(len(traffic.ids), now[2]))
    half_width = (traffic.widths + vehicle.width_m) / 2
    beside = (along > -_BEHIND_M) & (along < _AHEAD_M) & (np.abs(across) > half_width)
    if not beside.any():
        return None
    others, speeds = traffic.poses[beside], traffic.speeds[beside]
    half_width, half_length = half_width[beside], (traffic.lengths[beside] + vehicle.length_m) / 2
    times = np.arange(TIME_STEP_S, FORESIGHT_S + 1e-9, TIME_STEP_S)
    stations, own_speeds = _carried_on(way, times)
    s = way.path.arc_length
    index = np.clip(np.searchsorted(s, stations), 0, len(s) - 1)
    own = advance(way.path.poses[index], vehicle.axle_to_centre_m)
    theirs = advance(np.repeat(others[:, None], len(times), axis=1), speeds[:, None] * times)
    along, across = _in_frame(theirs[..., :2] - own[None, :, :2], np.broadcast_to(own[:, 2], theirs.shape[:2]))
    in_their_way = np.abs(across) < half_width[:, None] + SIDE_MARGIN_M
    entry = np.argmax(in_their_way, axis=1)
    who = np.arange(len(others))
    gap_behind = -along[who, entry] - half_length
    closing = np.maximum(speeds - own_speeds[entry], 0.0)
    needed = END_MARGIN_M + closing * REACTION_TIME_S + closing**2 / (2 * SAFE_DECELERATION_MPS2)
    past = along[who, entry] - half_length > END_MARGIN_M
    hindered = in_their_way.any(axis=1) & ~past & (gap_behind < needed)
    if not hindered.any():
        return None
    first = int(entry[hindered].min())
    return Leader(gap_m=float(stations[first] - way.station), speed_mps=0.0)


def _carried_on(way: Way, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Stations and speeds (n,) of the ego at times (n,) if it takes up or keeps its desired speed."""
    speed, wanted = way.state.speed, max(way.desired_speed, way.state.speed)
    until = (wanted - speed) / way.acceleration
    rising = np.minimum(times, until)
    travelled = speed * rising + way.acceleration * rising**2 / 2 + wanted * np.maximum(times - until, 0.0)
    return way.station + travelled, speed + way.acceleration * rising


def _in_frame(offsets: FloatArray, heading: npt.NDArray[np.float64]) -> tuple[FloatArray, FloatArray]:
    """Parts of offsets (..., 2) along and, positive to the left, across headings (...)."""
    cos, sin = np.cos(heading), np.sin(heading)
    return offsets[..., 0] * cos + offsets[..., 1] * sin, offsets[..., 1] * cos - offsets[..., 0] * sin
