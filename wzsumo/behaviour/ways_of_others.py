"""Where and when other vehicles are in the ego's way: an interval on its path for each of them at each time ahead."""

from typing import NamedTuple

import numpy as np

from wzsumo.behaviour.ego_outlook import EgoOutlook, half_extents
from wzsumo.behaviour.speed_plan_spec import SpeedPlanSpec
from wzsumo.frames import BoolArray, FloatArray, advance
from wzsumo.traffic import Traffic
from wzsumo.work_zone import WorkZoneLayout

PATH_STEP_M = 1.0  # of the places on the path that are looked at; a quarter of a vehicle
REACH_M = 250.0  # of the path, and of vehicles: 8 s at 30 m/s
DRIFT_S = 3.0  # for which a driver in a lane that ends is taken to drift on sideways; a move within a lane lasts less
BRAKING_LASTS_S = 2.0  # for which a braking vehicle is taken to brake on, then to keep its speed. Chosen by us

# With which drivers brake when a light turns yellow: ITE, Traffic Engineering Handbook, 10 ft/s2.
YELLOW_DECELERATION_MPS2 = 3.0
STOP_MARGIN_M = 1.0  # of the standstill gap: the ego stops one metre before the line; chosen by us


class WaysOfOthers(NamedTuple):
    """The ways of m vehicles at times (k,), in metres of path ahead of the ego's rear axle.

    The ego is in the way of a vehicle where it is between `enters` and `leaves` (m,); there it must be short of `near` (m, k),
    its tail, or beyond `far` (m, k), its nose, both lengths taken off. `speeds` (m, k) [m/s] are along the path.
    """

    enters: FloatArray
    leaves: FloatArray
    near: FloatArray
    far: FloatArray
    speeds: FloatArray


def ways_of_others(
    outlook: EgoOutlook,
    traffic: Traffic,
    *,
    layout: WorkZoneLayout,
    times: FloatArray,
    spec: SpeedPlanSpec,
    only_certain: bool = False,
) -> WaysOfOthers:
    """The ways of the vehicles near the ego that it is in, or comes into.

    Drivers keep their speed; one who brakes goes on braking for BRAKING_LASTS_S; one from the other side waits at the stop line
    of a lane that both share. They keep their place in their lane, wherever it leads, or move on to its middle where they move
    there; in a lane that ends, a slower driver ahead who drifts to one side drifts on for DRIFT_S. This is not certain before
    its side is over the lane's line, as it may be lining up there to wait for a gap: `only_certain` leaves it out. One behind
    who comes over to the ego's lane minds the ego. A vehicle is in the way where less than the side margin is left between the
    two sides; one that drives beside the ego with less is in the way where it comes nearer by 0.1 m. A vehicle behind is in the
    way where the ego comes nearer to its way by the margin: less is within a lane, and it sees the ego. One in whose way the
    ego is already follows it and is left out.
    """
    traffic = traffic.near(outlook.state.x, outlook.state.y, reach_m=REACH_M)
    places = np.arange(0.0, REACH_M, PATH_STEP_M)
    path = outlook.path
    ego_s, ego_d, turned = (np.interp(outlook.station + places, path.stations, column) for column in path.centres_on_road.T)
    beyond = np.maximum(outlook.station + places - path.stations[-1], 0.0)  # the path goes on along the road beyond its end
    ego_s = np.maximum.accumulate(ego_s + beyond) + 1e-6 * places
    stations, offsets = layout.road.to_sd(traffic.poses[:, :2]) if traffic.ids else (np.empty(0), np.empty(0))
    headings = traffic.poses[:, 2] - layout.road.heading_at(stations)
    speed = traffic.speeds * np.cos(headings)
    half_length = (traffic.lengths + outlook.vehicle.length_m) / 2
    arrives = places / max(outlook.state.speed, 1.0)
    drift = traffic.speeds * np.sin(headings)
    may_come_over = (stations - half_length > ego_s[0]) & (speed < outlook.state.speed)
    may_come_over &= _in_ending_lane(stations, offsets, layout)
    if only_certain:
        may_come_over &= ~_in_ending_lane(stations, offsets + np.sign(drift) * traffic.widths / 2, layout)
    drift = np.where(may_come_over, drift, 0.0)
    half_width = half_extents(turned, outlook.vehicle.length_m, outlook.vehicle.width_m)[1] + traffic.widths[:, None] / 2
    by_then = speed[:, None] * arrives
    aside = _offsets_in_lane(stations, offsets, np.tan(headings), at=ego_s, driven=by_then, layout=layout) - ego_d
    moved = drift[:, None] * np.clip(arrives, 0.0, DRIFT_S)
    crossed = np.sign(aside + moved) != np.sign(aside)
    gap = np.where(crossed, 0.0, np.minimum(np.abs(aside + moved), np.abs(aside))) - half_width
    margin = np.clip(gap[:, :1] - 0.1, 0.1, spec.side_margin_m) if gap.size else gap
    in_way = gap < np.where(gap[:, :1] > 0, margin, 0.1)
    follows = in_way[:, 0] & (stations < ego_s[0]) if in_way.size else np.zeros(len(stations), dtype=bool)
    behind = stations + half_length < ego_s[0]
    in_way &= ~behind[:, None] | (gap[:, :1] - gap > spec.side_margin_m)
    kept = in_way.any(axis=1) & ~follows
    braking = np.minimum(traffic.accelerations, 0.0)[:, None] * np.minimum(times, BRAKING_LASTS_S)
    speeds = np.where(speed[:, None] > 0, np.maximum(speed[:, None] + braking, 0.0), speed[:, None])
    steps = np.diff(times, prepend=0.0)
    driven = np.cumsum((speeds + np.hstack([speed[:, None], speeds[:, :-1]])) / 2 * steps, axis=1)
    centre = _short_of_their_line(stations, stations[:, None] + driven, traffic.lengths / 2, layout=layout)
    tail, nose = (centre + sign * half_length[:, None] for sign in (-1, 1))
    return WaysOfOthers(
        enters=places[np.argmax(in_way, axis=1)][kept] if kept.any() else np.empty(0),
        leaves=places[in_way.shape[1] - 1 - np.argmax(in_way[:, ::-1], axis=1)][kept] if kept.any() else np.empty(0),
        near=_on_path(tail, ego_s, places)[kept],
        far=_on_path(nose, ego_s, places)[kept],
        speeds=speeds[kept],
    )


def with_stop_line(ways: WaysOfOthers, outlook: EgoOutlook, *, layout: WorkZoneLayout) -> WaysOfOthers:
    """The ways, and one that stands from the stop line of a lane on that both directions share.

    The line counts where the ego has not passed it, and can stop at it with YELLOW_DECELERATION_MPS2; STOP_MARGIN_M may lack:
    an ego that creeps up to the line goes on waiting.
    """
    if layout.taking_turns is None:
        return ways
    state, n = outlook.state, ways.near.shape[1]
    (station,), _ = layout.road.to_sd(advance(state.pose, outlook.vehicle.axle_to_bumper_m)[:2])
    gap = layout.taking_turns.start - float(station)
    if gap < 0 or state.speed**2 / (2 * YELLOW_DECELERATION_MPS2) > gap + STOP_MARGIN_M:
        return ways
    return WaysOfOthers(
        enters=np.append(ways.enters, 0.0), leaves=np.append(ways.leaves, np.inf),
        near=np.vstack([ways.near, np.full((1, n), gap + STOP_MARGIN_M)]), far=np.vstack([ways.far, np.full((1, n), np.inf)]),
        speeds=np.vstack([ways.speeds, np.zeros((1, n))]),
    )  # fmt: skip


def _short_of_their_line(
    stations: FloatArray, driven: FloatArray, half_length: FloatArray, *, layout: WorkZoneLayout
) -> FloatArray:
    """Stations (m, k) [m] of centres; one who comes from the other side waits at the stop line of a lane that both share."""
    if layout.taking_turns is None:
        return driven
    waiting = layout.taking_turns.end + half_length
    comes = (stations >= waiting) & (driven[:, -1] < stations)
    return np.where(comes[:, None], np.maximum(driven, waiting[:, None]), driven)


def _on_path(stations: FloatArray, ego_s: FloatArray, places: FloatArray) -> FloatArray:
    """Places on the path [m] beside stations of the road; before and beyond the path metre by metre."""
    inside = np.interp(stations, ego_s, places)
    return inside + np.minimum(stations - ego_s[0], 0.0) + np.maximum(stations - ego_s[-1], 0.0)


def _offsets_in_lane(
    stations: FloatArray, offsets: FloatArray, slopes: FloatArray, *, at: FloatArray, driven: FloatArray, layout: WorkZoneLayout
) -> FloatArray:
    """Lateral offsets (m, n) [m] at stations `at` (n,), which they reach after `driven` (m, n) [m], of vehicles (m,) in lanes.

    They keep their places, but those whose slope (m,) against the road leads to the middle of their lane go on until they are
    there.
    """
    here, next_, there = (_middles(layout, of) for of in (stations, stations + 1.0, at))
    lane, each = np.argmin(np.abs(here - offsets), axis=0), np.arange(len(offsets))
    off = (offsets - here[lane, each])[:, None]
    later = off + (slopes - next_[lane, each] + here[lane, each])[:, None] * driven
    settled = np.where(off > 0, np.clip(later, 0.0, off), np.clip(later, off, 0.0))
    return np.asarray(there[lane] + settled)


def _middles(layout: WorkZoneLayout, stations: FloatArray) -> FloatArray:
    """Offsets (lanes, n) [m] of the middles of all lanes at stations (n,)."""
    return np.array([lane.right(stations) + lane.left(stations) for lane in layout.lanes]) / 2


def _in_ending_lane(stations: FloatArray, offsets: FloatArray, layout: WorkZoneLayout) -> BoolArray:
    """Whether points (m,) are in a lane that ends before the road does."""
    ending = np.zeros(len(stations), dtype=bool)
    for lane in layout.lanes:
        if lane.end < layout.road.length and not lane.opposing:
            beside = (stations >= lane.start) & (stations < lane.end)
            ending |= beside & (offsets > lane.right(stations)) & (offsets < lane.left(stations))
    return ending
