"""Where the ego waits for those in whose way it would come.

Drivers brake for what is in their lane. They cannot for what comes into it right before them: there the ego waits.
"""

import numpy as np
import numpy.typing as npt

from wzsumo.behaviour.car_following import STOP_MARGIN_M
from wzsumo.behaviour.way import Way, half_extents
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

FORESIGHT_S = 5.0  # at least; and as long as it takes, at the speed of now, to where it can stop braking comfortably, and more:
COMFORTABLE_DECELERATION_MPS2, EARLIER_S = 2.0, 2.0  # who first sees a place where it must brake has to brake abruptly
TIME_STEP_S = 0.25
SAFE_DECELERATION_MPS2 = 4.0  # asked of the driver behind; b_safe of Kesting, Treiber & Helbing 2007 (MOBIL), Table 1
EMERGENCY_DECELERATION_MPS2 = 9.0  # of cars, SUMO's emergencyDecel; what is left to the others when it is too late to wait
EMERGENCY_MARGIN_M = 0.5
REACTION_TIME_S = 1.0  # of the driver behind; SUMO's default tau
SIDE_MARGIN_M = 0.5  # others keep 0.3 m beside the ego, and move by 0.2 m in their lanes while they pass
END_MARGIN_M = 2.0  # standstill gap of the intelligent driver model, Treiber et al. 2000
TOUCH_M, STANDING_MPS = 0.2, 0.3  # beside or before a vehicle that stands still
LEAST_GAP_M = 0.1
LEAST_MOVE_M = 0.1  # sideways; less is no move into another's way, though the other may have come near
_BEHIND_M = 150.0  # who may come alongside within the foresight


def place_to_wait(way: Way, traffic: Traffic, *, layout: WorkZoneLayout) -> float | None:
    """How far ahead [m] the ego would come into the way of a driver who could not yield; None where the way is clear.

    The others go on with the speeds that they have and keep their places in their lanes, wherever those lead; the ego goes on
    along its path with the speed that it would take up. It comes into another's way when it moves to the side so far that
    their bodies would meet; then the other must be past, or so far behind that it can brake to the ego's speed with
    SAFE_DECELERATION_MPS2 after REACTION_TIME_S. Whoever is in the ego's way already follows it, or is followed.

    Where the ego itself would have to brake harder than that for it, it goes on before whoever can still yield in an emergency:
    an ego that brakes while it comes over is what they would run into.
    """
    traffic = traffic.near(way.state.x, way.state.y, reach_m=_BEHIND_M)
    if not traffic.ids:
        return None
    station, across = layout.road.to_sd(traffic.poses[:, :2])
    foresight = max(FORESIGHT_S, way.state.speed / (2 * COMFORTABLE_DECELERATION_MPS2) + EARLIER_S)
    times = np.arange(0.0, foresight + 1e-9, TIME_STEP_S)
    path_stations, own_speeds = _carried_on(way, times)
    own = np.column_stack([np.interp(path_stations, way.route.stations, column) for column in way.route.on_road.T])
    aside = _tracks(station, across, own[:, 0], layout=layout) - own[:, 1]
    half_width = half_extents(own[:, 2], way.vehicle.length_m, way.vehicle.width_m)[1]
    side_gap = np.abs(aside) - traffic.widths[:, None] / 2 - half_width
    reached = side_gap[:, 0] - LEAST_MOVE_M
    # Not below a least gap: an ego that may always move a little more creeps into whoever creeps beside it.
    level = np.clip(reached, LEAST_GAP_M, SIDE_MARGIN_M)
    moved_into = (side_gap < level[:, None]) & (side_gap[:, :1] > 0) & (side_gap.min(axis=1) < reached)[:, None]
    entry = np.argmax(moved_into, axis=1)
    theirs = traffic.speeds * np.cos(traffic.poses[:, 2] - layout.road.heading_at(station))  # along the road; below 0: oncoming
    ahead = (station + theirs * times[entry])[:, None] - own[:, 0]  # (n, m) of the other at its time, before the ego
    at_entry = np.take_along_axis(ahead, entry[:, None], axis=1)[:, 0]
    half_length = (traffic.lengths + way.vehicle.length_m) / 2
    closing_behind = np.maximum(theirs - own_speeds[entry], 0.0)
    closing_ahead = np.where(theirs < 0, own_speeds[entry] - theirs, 0.0)
    places = _place_of_level(path_stations, side_gap, level, entry)
    # The margin is inside the others' way: whoever creeps can always wait.
    too_late = way.state.speed**2 / (2 * SAFE_DECELERATION_MPS2) > places - way.station + STOP_MARGIN_M
    room_ahead, room_behind = (_room(closing, too_late=too_late) for closing in (closing_ahead, closing_behind))
    clear = (at_entry - half_length > room_ahead) | (-at_entry - half_length > room_behind)
    # Who stands still may be waiting for the ego: it goes on unless it would touch.
    touches = _touches(ahead, aside, own[:, 2], traffic=traffic, vehicle=way.vehicle)
    hindered = moved_into.any(axis=1) & np.where(np.abs(theirs) < STANDING_MPS, touches, ~clear)
    if not hindered.any():
        return None
    return float(places[hindered].min() - way.station)


def _touches(
    ahead: FloatArray, aside: FloatArray, turned: FloatArray, *, traffic: Traffic, vehicle: VehicleGeometry
) -> BoolArray:
    """Whether the ego comes to touch others (n,) who are so far ahead and aside (n, m) of its centre at m places.

    It is turned (m,) from the road, along which they stand: of what lies beside them its nearest part counts.
    """
    half_length = traffic.lengths[:, None] / 2
    towards = np.sign(aside) * np.tan(turned)  # how much nearer its side comes with each metre to the front
    farthest = np.minimum(ahead + half_length, vehicle.length_m / 2)
    hindmost = np.maximum(ahead - half_length, -vehicle.length_m / 2)
    gap = np.abs(aside) - (traffic.widths[:, None] + vehicle.width_m) / 2 - np.maximum(towards * farthest, towards * hindmost)
    return np.asarray(((gap < TOUCH_M) & (hindmost - farthest < TOUCH_M)).any(axis=1))


def _place_of_level(stations: FloatArray, side_gap: FloatArray, level: FloatArray, entry: npt.NDArray[np.intp]) -> FloatArray:
    """Stations (n,) at which side gaps (n, m) at `stations` (m,) fall to their levels (n,), the step before `entry` (n,).

    Between the two times of a step: with whole steps the place would come nearer as the ego slows down.
    """
    which, before = np.arange(len(entry)), np.maximum(entry - 1, 0)
    from_gap, to_gap = side_gap[which, before], side_gap[which, entry]
    share = np.clip((from_gap - level) / np.maximum(from_gap - to_gap, 1e-9), 0.0, 1.0)
    return np.asarray(stations[before] + share * (stations[entry] - stations[before]))


def _room(closing: FloatArray, *, too_late: BoolArray) -> FloatArray:
    """Room (n,) [m] that drivers need who close in at speeds (n,) [m/s]: to react, and to brake to the ego's speed."""
    margin = np.where(too_late, EMERGENCY_MARGIN_M, END_MARGIN_M)
    braking = np.where(too_late, EMERGENCY_DECELERATION_MPS2, SAFE_DECELERATION_MPS2)
    return np.asarray(margin + closing * REACTION_TIME_S + closing**2 / (2 * braking))


def _tracks(station: FloatArray, across: FloatArray, at: FloatArray, *, layout: WorkZoneLayout) -> FloatArray:
    """Lateral offsets (n, m) at stations `at` (m,) of vehicles (n,) that keep their places in their lanes."""
    here = np.array([lane.right(station) + lane.left(station) for lane in layout.lanes]) / 2
    there = np.array([lane.right(at) + lane.left(at) for lane in layout.lanes]) / 2
    lane = np.argmin(np.abs(here - across), axis=0)
    beside = across - here[lane, np.arange(len(across))]
    return np.asarray(there[lane] + beside[:, None])


def _carried_on(way: Way, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Stations on the path and speeds (m,) of the ego at times (m,) if it takes up the speeds that it desires on its way."""
    route = way.route.stations
    stations = np.append(way.station, route[route > way.station])
    squares, gone = way.state.speed**2, stations - way.station
    rising, falling = squares + 2 * way.acceleration * gone, squares - 2 * COMFORTABLE_DECELERATION_MPS2 * gone
    desired = np.interp(stations, route, way.desired_speeds) ** 2
    speeds = np.sqrt(np.minimum(rising, np.maximum(np.maximum(desired, falling), 0.0)))
    # Under constant acceleration the mean speed of a stretch is that of its ends.
    passed = np.append(0.0, np.cumsum(2 * np.diff(stations) / np.maximum(speeds[:-1] + speeds[1:], 1e-6)))
    return np.interp(times, passed, stations), np.interp(times, passed, speeds)
