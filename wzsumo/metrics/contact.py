"""Contacts of a vehicle's outline: with another vehicle, a device, the closed area, or ground beyond the pavement."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from wzsumo.ego import EgoState, Outcome
from wzsumo.frames import BoolArray, FloatArray, advance
from wzsumo.metrics.conflicts import boxes_overlap
from wzsumo.traffic import Traffic
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

# Largest distance from the ego's rear axle to the centre of a vehicle that it may touch. Chosen by us: a road train of 53.5 m,
# the longest in Australia, reaches 27 m from its centre.
TOUCH_REACH_M = 40.0
BEYOND_ROAD_M = 50.0  # the pavement is assumed to continue so far beyond both ends of the modelled road; chosen by us

_SENTENCES = {
    Outcome.STRUCK_DEVICE: "the outline touches a channelizing device",
    Outcome.ENTERED_CLOSED_AREA: "part of the outline is in the closed area",
    Outcome.LEFT_PAVEMENT: "part of the outline is off the pavement",
}


@dataclass(frozen=True, kw_only=True)
class PathContact:
    """The first contact of the outline along a path, and the number of devices that it touches on the whole path."""

    outcome: Outcome
    first_contact_m: float  # arc length there; nan where nothing is touched
    n_devices_struck: int


class ContactChecker:
    """Checks the outline of one vehicle against the devices, the closed area and the pavement of one layout."""

    def __init__(self, layout: WorkZoneLayout, vehicle: VehicleGeometry) -> None:
        self._vehicle = vehicle
        self._devices = shapely.STRtree(layout.device_outlines)
        road = layout.road
        self._closed = layout.closed_area
        self._pavement = road.strip(-BEYOND_ROAD_M, road.length + BEYOND_ROAD_M, -road.right_shoulder, road.left_edge)
        shapely.prepare([self._closed, self._pavement])

    def contact_now(self, state: EgoState, traffic: Traffic) -> tuple[Outcome, str] | None:
        """The contact of the vehicle in a state, with a sentence that says where; None where it touches nothing.

        Of several contacts the worst counts. From the worst: a vehicle, a device, the closed area, the pavement's edge.
        """
        where = f"at ({state.x:.1f}, {state.y:.1f}) m"
        other = self._vehicle_touched(state, traffic)
        if other is not None:
            return Outcome.COLLIDED, f"the outline overlaps vehicle {other} {where}"
        touched, _ = self._ground_contacts(state.pose[None])
        for outcome, at_pose in touched.items():
            if at_pose.any():
                return outcome, f"{_SENTENCES[outcome]} {where}"
        return None

    def contact_along(self, poses: npt.ArrayLike) -> PathContact:
        """The contact along rear-axle poses (n, 3), half a metre apart or less, driven exactly and without traffic.

        Of several contacts at one pose the worst counts, in the order of `contact_now`.
        """
        path = np.asarray(poses, dtype=float)
        touched, devices = self._ground_contacts(path)
        first = {outcome: int(np.argmax(at_pose)) for outcome, at_pose in touched.items() if at_pose.any()}
        if not first:
            return PathContact(outcome=Outcome.REACHED_GOAL, first_contact_m=float("nan"), n_devices_struck=0)
        outcome = min(first, key=lambda touching: first[touching])  # of those at the same pose min returns the first, the worst
        driven = np.hypot(*np.diff(path[: first[outcome] + 1, :2], axis=0).T).sum()
        return PathContact(outcome=outcome, first_contact_m=float(driven), n_devices_struck=len(np.unique(devices)))

    def _vehicle_touched(self, state: EgoState, traffic: Traffic) -> str | None:
        """Id of a vehicle whose outline overlaps the ego's, None where none does."""
        near = traffic.near(state.x, state.y, reach_m=TOUCH_REACH_M)
        if not near.ids:
            return None
        centre = advance(state.pose, self._vehicle.axle_to_centre_m)
        size = np.array([self._vehicle.length_m, self._vehicle.width_m])
        hit = boxes_overlap(centre, size, near.poses, np.column_stack([near.lengths, near.widths]))
        return near.ids[int(np.argmax(hit))] if hit.any() else None

    def _ground_contacts(self, poses: FloatArray) -> tuple[dict[Outcome, BoolArray], npt.NDArray[np.intp]]:
        """Whether there is a contact at poses (n,), by outcome from the worst; and the device of each contact with a device."""
        outlines = shapely.polygons(self._vehicle.outline(poses))
        at_pose, device = self._devices.query(outlines, predicate="intersects")
        struck = np.zeros(len(poses), dtype=bool)
        struck[at_pose] = True
        touched = {
            Outcome.STRUCK_DEVICE: struck,
            Outcome.ENTERED_CLOSED_AREA: np.asarray(shapely.intersects(self._closed, outlines)),
            Outcome.LEFT_PAVEMENT: ~np.asarray(shapely.covers(self._pavement, outlines)),
        }
        return touched, device
