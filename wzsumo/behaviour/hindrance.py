"""Hindrance: the leader ahead and the place where the ego must stop."""

from dataclasses import dataclass

from wzsumo.behaviour.car_following import STOP_MARGIN_M
from wzsumo.behaviour.ego_outlook import EgoOutlook
from wzsumo.behaviour.giving_way import yield_point_ahead
from wzsumo.behaviour.leaders import leader_ahead
from wzsumo.ego import EgoState, Leader
from wzsumo.frames import advance
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

YELLOW_DECELERATION_MPS2 = (
    3.0  # with which drivers brake when a light turns yellow: ITE, Traffic Engineering Handbook, 10 ft/s2
)


@dataclass(frozen=True, kw_only=True)
class Hindrance:
    """What keeps the ego from driving as it would alone."""

    leader: Leader | None = None
    stop_in_m: float | None = None  # from the front bumper to the place that it may not pass now; None: no such place


def hindrance_ahead(outlook: EgoOutlook, traffic: Traffic, *, layout: WorkZoneLayout, may_enter: bool) -> Hindrance:
    """The leader, and the nearer of the yield point and the stop line.

    `may_enter` says whether it is the ego's turn on a lane that both directions share.
    """
    stops = (
        yield_point_ahead(outlook, traffic, layout=layout),
        stop_line_ahead(outlook.state, vehicle=outlook.vehicle, layout=layout, may_enter=may_enter),
    )
    stop_in_m = min((distance for distance in stops if distance is not None), default=None)
    return Hindrance(leader=leader_ahead(outlook, traffic, layout=layout), stop_in_m=stop_in_m)


def stop_line_ahead(state: EgoState, *, vehicle: VehicleGeometry, layout: WorkZoneLayout, may_enter: bool) -> float | None:
    """Distance [m] from the front bumper to the stop line of a lane that both directions share; None where the ego may go on.

    It may where there is no such lane, it is the ego's turn, the line is passed, or the ego would have to brake harder than
    YELLOW_DECELERATION_MPS2. It may need STOP_MARGIN_M more than the gap: an ego that creeps up to the line goes on waiting.
    """
    if may_enter or layout.taking_turns is None:
        return None
    (station,), _ = layout.road.to_sd(advance(state.pose, vehicle.axle_to_bumper_m)[:2])
    gap = layout.taking_turns.start - float(station)
    if gap < 0 or state.speed**2 / (2 * YELLOW_DECELERATION_MPS2) > gap + STOP_MARGIN_M:
        return None
    return gap
