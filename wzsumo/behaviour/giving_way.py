"""Giving way: where the ego waits because a driver could not brake for it.

Drivers brake for what is in their lane. They cannot brake for what moves into it right before them: the ego waits for them.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wzsumo.behaviour.car_following import STOP_MARGIN_M
from wzsumo.behaviour.ego_outlook import TOUCHING_GAP_M, EgoOutlook, half_extents
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

OTHERS_REACH_M = 150.0  # vehicles farther off are left out: they are not alongside within the foresight; chosen by us
MIN_FORESIGHT_S = 5.0  # chosen by us
COMFORTABLE_DECELERATION_MPS2 = 2.0  # of the ego: b of `IdmSpec`
BRAKING_NOTICE_S = 2.0  # from seeing a yield point to where comfortable braking for it begins; chosen by us
TIME_STEP_S = 0.25  # of the forecast; chosen by us
SIDE_MARGIN_M = 0.5  # others keep 0.3 m beside the ego, and move by 0.2 m in their lanes while they pass
MIN_SIDE_GAP_M = 0.1  # the margin shrinks with the gap of now, but not below this; set on our simulated traffic
MIN_SIDEWAYS_MOVE_M = 0.1  # a gap that shrinks by less is no move into another vehicle's way; set on our simulated traffic
REACTION_TIME_S = 1.0  # of other drivers; SUMO's default tau
SAFE_DECELERATION_MPS2 = 4.0  # asked of other drivers; b_safe of Kesting, Treiber & Helbing 2007 (MOBIL), Table 1
GAP_MARGIN_M = 2.0  # between bumpers; standstill gap of the intelligent driver model, Treiber et al. 2000
EMERGENCY_DECELERATION_MPS2 = 9.0  # asked of other drivers where it is too late to wait; of cars, SUMO's emergencyDecel
EMERGENCY_GAP_MARGIN_M = 0.5  # between bumpers, where it is too late to wait; chosen by us
STANDING_SPEED_MPS = 0.3  # slower vehicles count as standing; chosen by us


def yield_point_ahead(outlook: EgoOutlook, traffic: Traffic, *, layout: WorkZoneLayout) -> float | None:
    """Distance [m] from the ego to the point where it would enter the way of a driver who could not yield; None: no such point.

    The others are taken to keep their speeds and their places in their lanes, wherever those lead; the ego goes on as its
    outlook says. It enters another vehicle's way where it moves sideways so far that their bodies would meet. By then the other
    vehicle must be past, or so far off that its driver can brake to the ego's speed with SAFE_DECELERATION_MPS2 after
    REACTION_TIME_S. A vehicle that is in the ego's way already follows it, or is followed.

    Where the ego itself would have to brake harder than SAFE_DECELERATION_MPS2, it goes on before every driver who can yield in
    an emergency: an ego that stops halfway into a lane is run into. A vehicle that stands may be waiting for the ego: the ego
    goes on unless it would touch it.
    """
    traffic = traffic.near(outlook.state.x, outlook.state.y, reach_m=OTHERS_REACH_M)
    if not traffic.ids:
        return None
    others = _others_on_road(traffic, layout=layout)
    ego = _ego_forecast(outlook)
    offset = _offsets_in_lane(others, at=ego.on_road[:, 0], layout=layout) - ego.on_road[:, 1]  # (n, m) m, left of the ego
    entries = _entries(ego, offset, traffic=traffic, vehicle=outlook.vehicle)
    at_entry = others.stations + others.speeds * ego.times[entries.steps]
    distance = at_entry[:, None] - ego.on_road[:, 0]  # (n, m) m, from the ego at each time to the others when it enters
    too_late = _too_late_to_wait(outlook, entries)
    lengths = traffic.lengths + outlook.vehicle.length_m
    can_yield = _can_yield(distance, others.speeds, ego, entries, lengths=lengths, emergency=too_late)
    touched = _touched(distance, offset, turned=ego.on_road[:, 2], traffic=traffic, vehicle=outlook.vehicle)
    standing = np.abs(others.speeds) < STANDING_SPEED_MPS
    hindered = entries.happen & np.where(standing, touched, ~can_yield)
    if not hindered.any():
        return None
    return float(entries.path_stations[hindered].min() - outlook.station)


class _OthersOnRoad(NamedTuple):
    """The centres of other vehicles (n,) on the road."""

    stations: FloatArray  # m
    offsets: FloatArray  # m, lateral
    speeds: FloatArray  # m/s along the road; negative: oncoming


class _EgoForecast(NamedTuple):
    """The ego at times (m,) from now if no vehicle hinders it."""

    times: FloatArray  # s
    path_stations: FloatArray  # m, of the rear axle
    speeds: FloatArray  # m/s
    on_road: FloatArray  # (m, 3) of its CENTRE: station [m], lateral offset [m] and heading [rad] on the road


class _Entries(NamedTuple):
    """Where the ego enters the ways of other vehicles (n,)."""

    happen: BoolArray  # whether it does; where not, the rest has no meaning
    steps: npt.NDArray[np.intp]  # index of the first forecast time at which it has entered
    path_stations: FloatArray  # m, of its rear axle where it enters, between two forecast times


def _others_on_road(traffic: Traffic, *, layout: WorkZoneLayout) -> _OthersOnRoad:
    stations, offsets = layout.road.to_sd(traffic.poses[:, :2])
    speeds = traffic.speeds * np.cos(traffic.poses[:, 2] - layout.road.heading_at(stations))
    return _OthersOnRoad(stations=stations, offsets=offsets, speeds=speeds)


def _ego_forecast(outlook: EgoOutlook) -> _EgoForecast:
    """The ego over the foresight: what its braking distance takes at its present speed and BRAKING_NOTICE_S, or the minimum."""
    foresight = max(MIN_FORESIGHT_S, outlook.state.speed / (2 * COMFORTABLE_DECELERATION_MPS2) + BRAKING_NOTICE_S)
    times = np.arange(0.0, foresight + 1e-9, TIME_STEP_S)
    path_stations, speeds = _driven_at(times, outlook)
    path = outlook.path
    on_road = np.column_stack([np.interp(path_stations, path.stations, column) for column in path.centres_on_road.T])
    return _EgoForecast(times=times, path_stations=path_stations, speeds=speeds, on_road=on_road)


def _driven_at(times: FloatArray, outlook: EgoOutlook) -> tuple[FloatArray, FloatArray]:
    """Path stations (m,) [m] and speeds (m,) [m/s] of the ego at times (m,) [s] if it takes up its desired speeds.

    Over a distance d its v^2 rises by at most 2 a d, with the outlook's acceleration, and falls by at most 2 b d, braking
    comfortably.
    """
    path_stations = outlook.path.stations
    stations = np.append(outlook.station, path_stations[path_stations > outlook.station])
    squares, driven = outlook.state.speed**2, stations - outlook.station
    highest = squares + 2 * outlook.acceleration * driven
    lowest = squares - 2 * COMFORTABLE_DECELERATION_MPS2 * driven
    desired = np.interp(stations, path_stations, outlook.desired_speeds) ** 2
    speeds = np.sqrt(np.minimum(highest, np.maximum(np.maximum(desired, lowest), 0.0)))
    # Under constant acceleration the mean speed between two stations is the mean of the speeds there.
    arrival = np.append(0.0, np.cumsum(2 * np.diff(stations) / np.maximum(speeds[:-1] + speeds[1:], 1e-6)))
    return np.interp(times, arrival, stations), np.interp(times, arrival, speeds)


def _offsets_in_lane(others: _OthersOnRoad, *, at: FloatArray, layout: WorkZoneLayout) -> FloatArray:
    """Lateral offsets (n, m) [m] of vehicles (n,) at stations `at` (m,) [m] if they keep their places in their lanes."""
    middles_here = np.array([lane.right(others.stations) + lane.left(others.stations) for lane in layout.lanes]) / 2
    middles_there = np.array([lane.right(at) + lane.left(at) for lane in layout.lanes]) / 2
    lane = np.argmin(np.abs(middles_here - others.offsets), axis=0)
    from_middle = others.offsets - middles_here[lane, np.arange(len(others.offsets))]
    return np.asarray(middles_there[lane] + from_middle[:, None])


def _entries(ego: _EgoForecast, offset: FloatArray, *, traffic: Traffic, vehicle: VehicleGeometry) -> _Entries:
    """Where the ego enters the ways of vehicles whose centres lie `offset` (n, m) [m] beside its own at the forecast times.

    It enters where the side gap between the bodies falls to SIDE_MARGIN_M; where the gap is smaller already, to a little less
    than now. The level has a lower bound: an ego that may always move a little more would creep into a vehicle that creeps
    beside it. No vehicle that the ego already overlaps sideways counts.
    """
    half_width = half_extents(ego.on_road[:, 2], vehicle.length_m, vehicle.width_m)[1]
    side_gap = np.abs(offset) - traffic.widths[:, None] / 2 - half_width
    after_move = side_gap[:, 0] - MIN_SIDEWAYS_MOVE_M
    level = np.clip(after_move, MIN_SIDE_GAP_M, SIDE_MARGIN_M)
    moves_nearer = side_gap.min(axis=1) < after_move
    entered = (side_gap < level[:, None]) & (side_gap[:, :1] > 0) & moves_nearer[:, None]
    steps = np.argmax(entered, axis=1)
    path_stations = _stations_at_level(ego.path_stations, side_gap, level, steps)
    return _Entries(happen=entered.any(axis=1), steps=steps, path_stations=path_stations)


def _stations_at_level(
    path_stations: FloatArray, side_gap: FloatArray, level: FloatArray, steps: npt.NDArray[np.intp]
) -> FloatArray:
    """Path stations (n,) [m] where side gaps (n, m) fall to their levels (n,), linear over the time step before `steps` (n,).

    At the forecast times alone the yield point would come nearer as the ego slows down.
    """
    which, before = np.arange(len(steps)), np.maximum(steps - 1, 0)
    from_gap, to_gap = side_gap[which, before], side_gap[which, steps]
    share = np.clip((from_gap - level) / np.maximum(from_gap - to_gap, 1e-9), 0.0, 1.0)
    return np.asarray(path_stations[before] + share * (path_stations[steps] - path_stations[before]))


def _too_late_to_wait(outlook: EgoOutlook, entries: _Entries) -> BoolArray:
    """Whether (n,) the ego would have to brake harder than SAFE_DECELERATION_MPS2 to stop before it enters.

    It may stop as much as STOP_MARGIN_M inside another vehicle's way: an ego that creeps can always wait.
    """
    braking_distance = outlook.state.speed**2 / (2 * SAFE_DECELERATION_MPS2)
    return np.asarray(braking_distance > entries.path_stations - outlook.station + STOP_MARGIN_M)


def _can_yield(
    distance: FloatArray, speeds: FloatArray, ego: _EgoForecast, entries: _Entries, *, lengths: FloatArray, emergency: BoolArray
) -> BoolArray:
    """Whether drivers (n,) are past when the ego enters their ways, or have the gap that they need behind it or before it.

    `distance` (n, m) [m] is from the ego's centre to theirs, `lengths` (n,) [m] both bodies together; `emergency` (n,) says for
    which drivers the emergency values of margin and braking hold.
    """
    from_ego = np.take_along_axis(distance, entries.steps[:, None], axis=1)[:, 0]
    ego_speeds = ego.speeds[entries.steps]
    closing_behind = np.maximum(speeds - ego_speeds, 0.0)
    closing_ahead = np.where(speeds < 0, ego_speeds - speeds, 0.0)
    half_lengths = lengths / 2
    clear_ahead = from_ego - half_lengths > _gap_needed(closing_ahead, emergency=emergency)
    clear_behind = -from_ego - half_lengths > _gap_needed(closing_behind, emergency=emergency)
    return np.asarray(clear_ahead | clear_behind)


def _gap_needed(closing: FloatArray, *, emergency: BoolArray) -> FloatArray:
    """Gap (n,) [m] that a driver closing in at `closing` (n,) [m/s] needs.

    It is a margin, the reaction distance and the distance of braking to the ego's speed.
    """
    margin = np.where(emergency, EMERGENCY_GAP_MARGIN_M, GAP_MARGIN_M)
    braking = np.where(emergency, EMERGENCY_DECELERATION_MPS2, SAFE_DECELERATION_MPS2)
    return np.asarray(margin + closing * REACTION_TIME_S + closing**2 / (2 * braking))


def _touched(
    distance: FloatArray, offset: FloatArray, *, turned: FloatArray, traffic: Traffic, vehicle: VehicleGeometry
) -> BoolArray:
    """Whether the ego touches vehicles (n,) whose centres lie at `distance` and `offset` (n, m) [m] from its own at m times.

    The ego is turned by `turned` (m,) [rad] from the road, the others stand along it. Of the ego's side the part counts that
    lies beside the other vehicle and is nearest to it.
    """
    half_length = traffic.lengths[:, None] / 2
    nearer_per_m = np.sign(offset) * np.tan(turned)  # by so much the ego's side comes nearer with each metre towards its front
    front = np.minimum(distance + half_length, vehicle.length_m / 2)  # of what lies side by side, from the ego's centre
    rear = np.maximum(distance - half_length, -vehicle.length_m / 2)
    side_gap = (
        np.abs(offset) - (traffic.widths[:, None] + vehicle.width_m) / 2 - np.maximum(nearer_per_m * front, nearer_per_m * rear)
    )
    return np.asarray(((side_gap < TOUCHING_GAP_M) & (rear - front < TOUCHING_GAP_M)).any(axis=1))
