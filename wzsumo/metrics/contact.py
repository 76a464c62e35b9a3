"""What a path comes to when it is driven exactly, without traffic: what the vehicle's outline touches, and where first."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely
from shapely import Polygon

from wzsumo.ego import EgoState, Outcome
from wzsumo.frames import advance
from wzsumo.metrics.conflicts import boxes_overlap
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout


@dataclass(frozen=True, kw_only=True)
class PathContact:
    """The first thing that is touched along a path, and how many devices are touched on all of it."""

    outcome: Outcome
    first_contact_m: float  # arc length there; nan where nothing is touched
    n_devices_struck: int


def contact_along(poses: npt.ArrayLike, *, vehicle: VehicleGeometry, layout: WorkZoneLayout) -> PathContact:
    """Contact of rear-axle poses (n, 3), half a metre apart or less, with devices, closed area and the pavement's edges.

    Of what is touched at one pose the worst counts: a device, the closed area, the edge.
    """
    path = np.asarray(poses, dtype=float)
    corners = np.array([vehicle.outline(pose) for pose in path])
    outlines = shapely.polygons(corners)
    devices = layout.devices[["x_m", "y_m", "radius_m"]].to_numpy(dtype=float)
    discs = shapely.buffer(shapely.points(devices[:, :2]), devices[:, 2])
    at_pose, device = shapely.STRtree(discs).query(outlines, predicate="intersects")
    struck = np.zeros(len(path), dtype=bool)
    struck[at_pose] = True
    closed = layout.closed_area
    shapely.prepare(closed)
    road = layout.road
    offset = road.to_sd(corners.reshape(-1, 2))[1].reshape(-1, 4)
    beyond = ((offset < -road.right_shoulder) | (offset > road.left_edge)).any(axis=1)
    touched = {
        Outcome.STRUCK_DEVICE: struck,
        Outcome.ENTERED_CLOSED_AREA: np.asarray(shapely.intersects(closed, outlines)),
        Outcome.LEFT_PAVEMENT: beyond,
    }
    first = {outcome: int(np.argmax(there)) for outcome, there in touched.items() if there.any()}
    n_struck = len(np.unique(device))
    if not first:
        return PathContact(outcome=Outcome.REACHED_GOAL, first_contact_m=float("nan"), n_devices_struck=0)
    outcome = min(first, key=lambda it: first[it])  # the first of equals: the order above
    way = np.hypot(*np.diff(path[: first[outcome] + 1, :2], axis=0).T).sum()
    return PathContact(outcome=outcome, first_contact_m=float(way), n_devices_struck=n_struck)


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
