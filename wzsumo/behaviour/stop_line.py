"""The stop line where the ego waits for its turn on a lane that both directions share."""

from wzsumo.ego import EgoState
from wzsumo.frames import advance
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

BRAKING_MPS2 = 3.0  # what a driver brakes with when a light turns yellow: ITE, Traffic Engineering Handbook, 10 ft/s2


def stop_line_ahead(state: EgoState, *, vehicle: VehicleGeometry, layout: WorkZoneLayout, may_enter: bool) -> float | None:
    """How far ahead of the bumper the stop line lies [m]; None where it is passed, or it is the ego's turn, or too late."""
    if may_enter or layout.taking_turns is None:
        return None
    (station,), _ = layout.road.to_sd(advance(state.pose, vehicle.axle_to_bumper_m)[:2])
    gap = layout.taking_turns.start - float(station)
    if gap < 0 or state.speed**2 / (2 * BRAKING_MPS2) > gap + 1.0:  # whoever waits may stand with its bumper at the line
        return None
    return gap
