"""What a path comes to when it is driven exactly, without traffic: what the vehicle's outline touches, and where first."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from wzsumo.ego import Outcome
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
