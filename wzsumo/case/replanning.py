"""The ego's course: the path that it follows, exchanged for another one where a new map reaches it on the way."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wzsumo.behaviour.way import Way, route_along
from wzsumo.control.controller import Controller
from wzsumo.ego import EgoState, Replan
from wzsumo.path import ReferencePath
from wzsumo.planning.plan import Plan
from wzsumo.scenario.scenario import Pose
from wzsumo.scenario.sections import ControlSection
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

# The new path begins where the ego will be so much later: until then it drives on, and its look-ahead meets no kink at once.
REPLAN_AHEAD_S = 1.0


@dataclass(frozen=True, kw_only=True)
class NewMap:
    """A map that reaches the ego while it drives."""

    after_s: float  # since the ego entered the road
    plan: Callable[[Pose], Plan]  # on that map, from a pose of the REAR AXLE to the goal


class Course:
    """The path that the ego follows, with the controller on it and what the path asks for at each step."""

    def __init__(
        self, path: ReferencePath, *, layout: WorkZoneLayout, vehicle: VehicleGeometry, control: ControlSection
    ) -> None:
        self._layout, self._vehicle, self._control = layout, vehicle, control
        self.controller = Controller(path, vehicle, control)
        self._take(path)

    def _take(self, path: ReferencePath) -> None:
        self.path, self.route = path, route_along(path, layout=self._layout, vehicle=self._vehicle)
        self._speeds = self.controller.speeds_at(path.arc_length)

    def way(self, state: EgoState) -> Way:
        """How the ego would go on from `state` if nobody hindered it."""
        return Way(
            route=self.route, station=self.controller.station_m, state=state, vehicle=self._vehicle,
            desired_speeds=self._speeds, acceleration=self._control.idm.acceleration_mps2,
        )  # fmt: skip

    def replan(self, new_map: NewMap, state: EgoState, *, time: float) -> Replan:
        """What came of a plan on the new map; where it is a path, the course goes over to it REPLAN_AHEAD_S ahead."""
        stations = self.path.arc_length
        ahead = self.controller.station_m + REPLAN_AHEAD_S * state.speed
        joint = min(int(np.searchsorted(stations, ahead)), len(stations) - 2)
        x, y, heading = map(float, self.path.poses[joint])
        plan = new_map.plan((x, y, heading))
        if plan.path is not None:
            # The way so far stays part of the path: stations along it go on counting from where the ego set out.
            path = ReferencePath(poses=np.concatenate([self.path.poses[:joint], plan.path.poses]))
            self.controller.follow(path)
            self._take(path)
        return Replan(
            time_s=time, station_m=float(stations[joint]), status=str(plan.status), reason=plan.reason,
            plan_ms=plan.timings_ms["total"],
        )  # fmt: skip
