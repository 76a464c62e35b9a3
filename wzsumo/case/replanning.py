"""PathFollower: the ego's path with its controller, exchanged where a new map reaches the ego on the way."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wzsumo.behaviour.ego_outlook import EgoOutlook, path_on_road
from wzsumo.behaviour.speed_limits import SpeedLimit, limit_ceiling
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
STOP_MARGIN_M = 5.0  # from where the ego stops to ground that its map does not show free; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class NewMap:
    """A map that reaches the ego while it drives, or a doubt about the one that it has."""

    time_s: float  # of the simulation
    plan: Callable[[Pose], Plan] | None  # on that map, from a pose of the REAR AXLE to the goal; None: the map is as before
    free_until: Callable[[ReferencePath, float], float]  # station [m] up to which a path is free on it, from a station on
    doubtful: tuple[tuple[float, float], ...] = ()  # from and to [m], stations of the road at which it may be wrong


class PathFollower:
    """The path that the ego follows, with the controller on it and the outlook along it."""

    def __init__(
        self,
        path: ReferencePath,
        *,
        layout: WorkZoneLayout,
        vehicle: VehicleGeometry,
        control: ControlSection,
        doubtful_speed_mps: float = np.inf,
    ) -> None:
        self._layout, self._vehicle, self._control = layout, vehicle, control
        self._doubtful_speed_mps = doubtful_speed_mps
        self._doubtful: tuple[tuple[float, float], ...] = ()
        self._ends_at: float | None = None
        self._limits: tuple[SpeedLimit, ...] = ()
        self.controller = Controller(path, vehicle, control)
        self._take(path)

    @property
    def has_no_way_on(self) -> bool:
        """Whether the last map showed no way to the goal."""
        return self._ends_at is not None

    def outlook(self, state: EgoState) -> EgoOutlook:
        """How the ego goes on from `state` if no vehicle hinders it."""
        return EgoOutlook(
            path=self._on_road, station=self.controller.station_m, state=state, vehicle=self._vehicle,
            desired_speeds=self._desired_speeds,
        )  # fmt: skip

    def ceiling(self, state: EgoState) -> float:
        """Highest acceleration [m/s2] that doubts about the map, and the end of the way, leave to the ego."""
        return limit_ceiling(
            self._limits, station=self.controller.station_m, speed=state.speed, spec=self._control.others
        )  # fmt: skip

    def replan(self, new_map: NewMap, state: EgoState, *, time: float) -> Replan | None:
        """What came of a plan on the new map, None where that has the lanes of the one before.

        A path that was found is followed from REPLAN_AHEAD_S ahead on. Where none is, the ego drives on as far as its path
        is free on the new map.
        """
        self._doubtful = new_map.doubtful
        if new_map.plan is None:
            self._limits = self._limits_now()
            return None
        stations = self._path.arc_length
        here = self.controller.station_m
        joint = min(int(np.searchsorted(stations, here + REPLAN_AHEAD_S * state.speed)), len(stations) - 2)
        x, y, heading = map(float, self._path.poses[joint])
        plan = new_map.plan((x, y, heading))
        self._ends_at = None if plan.path is not None else new_map.free_until(self._path, here)
        if plan.path is not None:
            # The driven part stays in the path: its stations go on counting from where the ego set out.
            path = ReferencePath(poses=np.concatenate([self._path.poses[:joint], plan.path.poses]))
            self.controller.follow(path)
            self._take(path)
        self._limits = self._limits_now()
        return Replan(
            time_s=time, station_m=float(stations[joint]), status=str(plan.status), reason=plan.reason,
            plan_ms=plan.timings_ms["total"],
        )  # fmt: skip

    def _take(self, path: ReferencePath) -> None:
        self._path, self._on_road = path, path_on_road(path, layout=self._layout, vehicle=self._vehicle)
        self._desired_speeds = self.controller.speeds_at(path.arc_length)

    def _limits_now(self) -> tuple[SpeedLimit, ...]:
        """The limits along the present path for the doubts about the map, and for the end of the way."""
        along = np.maximum.accumulate(self._on_road.centres_on_road[:, 0])
        ends = [(float(a), float(b)) for a, b in np.interp(self._doubtful, along, self._path.arc_length).reshape(-1, 2)]
        limits = [SpeedLimit(start=start, end=end, speed=self._doubtful_speed_mps) for start, end in ends if start < end]
        if self._ends_at is not None:
            limits.append(SpeedLimit(start=self._ends_at - STOP_MARGIN_M, end=np.inf, speed=0.0))
        return tuple(limits)
