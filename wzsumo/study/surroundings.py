"""Surroundings: what the outline of the ego must not touch, looked at step by step."""

import numpy as np
import shapely
from shapely import Polygon

from wzsumo.ego import EgoState, Outcome
from wzsumo.frames import advance
from wzsumo.metrics.conflicts import boxes_overlap
from wzsumo.simulation.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

LONGEST_M = 40.0  # from the rear axle to the centre of any vehicle that the ego might touch


class Surroundings:
    """Devices, closed area and pavement of one layout, prepared once."""

    def __init__(self, layout: WorkZoneLayout, vehicle: VehicleGeometry) -> None:
        self._vehicle = vehicle
        self._devices = shapely.STRtree(layout.device_outlines)
        road = layout.road
        self._closed = layout.closed_area
        self._pavement = road.strip(-50.0, road.length + 50.0, -road.right_shoulder, road.left_edge)
        shapely.prepare([self._closed, self._pavement])

    def contact(self, state: EgoState, traffic: Traffic) -> tuple[Outcome, str] | None:
        """What the outline of the ego touches now and in one sentence where, the worst first; None where nothing."""
        outline = Polygon(self._vehicle.outline(state.pose))
        where = f"at ({state.x:.1f}, {state.y:.1f}) m"
        centre = advance(state.pose, self._vehicle.axle_to_centre_m)
        size = np.array([self._vehicle.length_m, self._vehicle.width_m])
        traffic = traffic.near(state.x, state.y, reach_m=LONGEST_M)
        if traffic.ids:
            sizes = np.column_stack([traffic.lengths, traffic.widths])
            hit = boxes_overlap(centre, size, traffic.poses, sizes)
            if hit.any():
                return Outcome.COLLIDED, f"the outline overlaps vehicle {traffic.ids[int(np.argmax(hit))]} {where}"
        if len(self._devices.query(outline, predicate="intersects")):
            return Outcome.STRUCK_DEVICE, f"the outline touches a channelizing device {where}"
        if shapely.intersects(self._closed, outline):
            return Outcome.ENTERED_CLOSED_AREA, f"part of the outline is in the closed area {where}"
        if not shapely.covers(self._pavement, outline):
            return Outcome.LEFT_PAVEMENT, f"part of the outline is off the pavement {where}"
        return None
