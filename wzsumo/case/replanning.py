"""PathFollower: the ego's path with its controller, exchanged where a new map reaches the ego on the way."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wzsumo.behaviour.ego_outlook import EgoOutlook, path_on_road
from wzsumo.control.controller import Controller
from wzsumo.ego import EgoState, Replan
from wzsumo.path import ReferencePath
from wzsumo.planning.plan import Plan
from wzsumo.scenario.scenario import Pose
from wzsumo.scenario.sections import ControlSection
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

# The new path begins where the ego will be after this at its present speed, so that its look-ahead meets no kink; chosen by us.
REPLAN_AHEAD_S = 1.0


@dataclass(frozen=True, kw_only=True)
class NewMap:
    """A map that reaches the ego while it drives."""

    after_s: float  # since the ego entered the road
    plan: Callable[[Pose], Plan]  # on that map, from a pose of the REAR AXLE to the goal


class PathFollower:
    """The path that the ego follows, with the controller on it and the outlook along it."""

    def __init__(
        self, path: ReferencePath, *, layout: WorkZoneLayout, vehicle: VehicleGeometry, control: ControlSection
    ) -> None:
        self._layout, self._vehicle, self._control = layout, vehicle, control
        self.controller = Controller(path, vehicle, control)
        self._take(path)

    def outlook(self, state: EgoState) -> EgoOutlook:
        """How the ego goes on from `state` if no vehicle hinders it."""
        return EgoOutlook(
            path=self._on_road, station=self.controller.station_m, state=state, vehicle=self._vehicle,
            desired_speeds=self._desired_speeds,
        )  # fmt: skip

    def replan(self, new_map: NewMap, state: EgoState, *, time: float) -> Replan:
        """What came of a plan on the new map; where it gave a path, that path is followed from REPLAN_AHEAD_S ahead on."""
        stations = self._path.arc_length
        ahead = self.controller.station_m + REPLAN_AHEAD_S * state.speed
        joint = min(int(np.searchsorted(stations, ahead)), len(stations) - 2)
        x, y, heading = map(float, self._path.poses[joint])
        plan = new_map.plan((x, y, heading))
        if plan.path is not None:
            # The driven part stays in the path: its stations go on counting from where the ego set out.
            path = ReferencePath(poses=np.concatenate([self._path.poses[:joint], plan.path.poses]))
            self.controller.follow(path)
            self._take(path)
        return Replan(
            time_s=time, station_m=float(stations[joint]), status=str(plan.status), reason=plan.reason,
            plan_ms=plan.timings_ms["total"],
        )  # fmt: skip

    def _take(self, path: ReferencePath) -> None:
        self._path, self._on_road = path, path_on_road(path, layout=self._layout, vehicle=self._vehicle)
        self._desired_speeds = self.controller.speeds_at(path.arc_length)
