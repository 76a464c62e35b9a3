"""The leader: the vehicle ahead that is on the ego's path, or drifts onto it from a lane that ends."""

from typing import NamedTuple

import numpy as np

from wzsumo.behaviour.ego_outlook import TOUCHING_GAP_M, EgoOutlook, half_extents
from wzsumo.ego import Leader
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.traffic import Traffic
from wzsumo.work_zone import WorkZoneLayout

REACH_S, MIN_REACH_M = 6.0, 30.0  # of the search along the path, at the ego's speed; chosen by us
LENGTH_ALLOWANCE_M = 20.0  # beyond the reach, to the centre of a vehicle whose rear is within it; half the longest, and bends
PAST_LAST_POSE_M = 5.0  # a centre may lie so far beyond the last pose of the stretch that is searched; chosen by us
DRIFT_S = 3.0  # a drift that leads onto the path within this counts; sideways moves within a lane last less; chosen by us
PASSED_SOON_S = 0.3  # a vehicle that has passed the ego within this is followed from then on, not while beside it; chosen by us


def leader_ahead(outlook: EgoOutlook, traffic: Traffic, *, layout: WorkZoneLayout) -> Leader | None:
    """The nearest vehicle ahead whose body reaches into the ego's path, or soon will; None where there is none.

    A vehicle soon will if it is in a lane that ends, slower than the ego, and drifts onto the path before the ego has passed
    it. Its driver may find no gap, brake hard and drift on: an ego that heeds it only then has it beside itself.
    """
    reach = max(MIN_REACH_M, REACH_S * outlook.state.speed)
    first, last = np.searchsorted(outlook.path.stations, [outlook.station, outlook.station + reach])
    traffic = traffic.near(outlook.state.x, outlook.state.y, reach_m=reach + LENGTH_ALLOWANCE_M)
    if last - first < 2 or not traffic.ids:
        return None
    motion = _relative_motion(outlook, traffic, stretch=slice(first, last))
    on_path = motion.side_gap < TOUCHING_GAP_M
    merging = _drifts_onto_path(motion, length=outlook.vehicle.length_m) & _in_ending_lane(traffic, layout)
    passing = (motion.gap <= 0) & (motion.gap > PASSED_SOON_S * motion.closing)
    candidate = (on_path | merging) & motion.on_stretch & (motion.gap > -traffic.lengths) & ~passing
    if not candidate.any():
        return None
    nearest = int(np.argmin(np.where(candidate, motion.gap, np.inf)))
    gap, speed, acceleration = (float(of[nearest]) for of in (motion.gap, traffic.speeds, traffic.accelerations))
    return Leader(gap_m=max(gap, 0.0), speed_mps=speed, acceleration_mps2=acceleration)


class _RelativeMotion(NamedTuple):
    """Where vehicles (n,) are from the ego, along and beside its path, and how they move there."""

    gap: FloatArray  # m, from the ego's front bumper to their rear; negative where they are beside the ego or behind it
    side_gap: FloatArray  # m, between their side and the ego's when it passes
    length: FloatArray  # m that they take up along the path
    drift: FloatArray  # m/s, sideways towards the path
    closing: FloatArray  # m/s, at which the ego comes nearer
    on_stretch: BoolArray  # whether they are beside the stretch of the path that is searched


def _relative_motion(outlook: EgoOutlook, traffic: Traffic, *, stretch: slice) -> _RelativeMotion:
    poses, stations, vehicle = outlook.path.poses[stretch], outlook.path.stations[stretch], outlook.vehicle
    offset = traffic.poses[:, None, :2] - poses[None, :, :2]
    nearest = np.argmin(np.einsum("ijk,ijk->ij", offset, offset), axis=1)
    along, across = _in_frame(offset[np.arange(len(nearest)), nearest], poses[nearest, 2])
    turned = traffic.poses[:, 2] - poses[nearest, 2]
    half_along, half_across = half_extents(turned, traffic.lengths, traffic.widths)
    return _RelativeMotion(
        gap=stations[nearest] - outlook.station + along - half_along - vehicle.axle_to_bumper_m,
        side_gap=np.abs(across) - half_across - vehicle.width_m / 2,
        length=2 * half_along,
        drift=-np.sign(across) * traffic.speeds * np.sin(turned),
        closing=outlook.state.speed - traffic.speeds * np.cos(turned),
        on_stretch=(along < PAST_LAST_POSE_M) & (nearest > 0),
    )


def _in_frame(offsets: FloatArray, heading: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Parts of offsets (..., 2) along and, positive to the left, across headings (...)."""
    cos, sin = np.cos(heading), np.sin(heading)
    return offsets[..., 0] * cos + offsets[..., 1] * sin, offsets[..., 1] * cos - offsets[..., 0] * sin


def _drifts_onto_path(motion: _RelativeMotion, *, length: float) -> BoolArray:
    """Whether slower vehicles (n,) will drift onto the path in DRIFT_S, or before an ego of a length [m] has passed them."""
    passed_in = (motion.gap + motion.length + length) / np.maximum(motion.closing, 1e-9)
    side_gap_then = motion.side_gap - motion.drift * np.minimum(passed_in, DRIFT_S)
    return np.asarray((motion.gap > 0) & (motion.closing > 0) & (side_gap_then < TOUCHING_GAP_M))


def _in_ending_lane(traffic: Traffic, layout: WorkZoneLayout) -> BoolArray:
    """Whether vehicles (n,) are in a lane that ends before the road does."""
    station, offset = layout.road.to_sd(traffic.poses[:, :2])
    ending = np.zeros(len(station), dtype=bool)
    for lane in layout.lanes:
        if lane.end < layout.road.length and not lane.opposing:
            beside = (station >= lane.start) & (station < lane.end)
            ending |= beside & (offset > lane.right(station)) & (offset < lane.left(station))
    return ending
