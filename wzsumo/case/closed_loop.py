"""Closed loop: the ego drives its path in the running SUMO traffic, and the traffic reacts to it."""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wzsumo.behaviour.speed_plan import SpeedPlanner
from wzsumo.case.replanning import NewMap, PathFollower
from wzsumo.control.controller import Controller
from wzsumo.control.plant import PlantSpec, advance_ego
from wzsumo.ego import Command, EgoRun, EgoState, Outcome, Replan
from wzsumo.frames import advance
from wzsumo.metrics.contact import ContactChecker
from wzsumo.metrics.drive import CLOCK_S, on_clock
from wzsumo.path import ReferencePath
from wzsumo.scenario.sections import ControlSection
from wzsumo.simulation.edges import edge_at
from wzsumo.simulation.ego_bodies import bodies_in_lanes
from wzsumo.simulation.files import SumoFiles
from wzsumo.simulation.session import Session, running
from wzsumo.tables import EGO_LOG_COLUMNS
from wzsumo.traffic import Traffic, traffic_trace
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

STEP_S = 0.05  # of the control: 20 commands a second, each followed by moveToXY
TRAFFIC_LOG_REACH_M = 100.0  # vehicles within this of the ego are logged: 4 s at 25 m/s
FOLLOWERS_LOG_PERIOD_S = 1.0  # of the log of all vehicles, which shows what the ego costs those behind it
NOT_AHEAD_M = 10.0  # a vehicle, even a truck, is beside or behind the ego if its centre is less than this before the rear axle
STANDS_MPS = 0.1  # slower, the ego stands
INSERTION_WAIT_S = 120.0  # how long SUMO may look for a gap that a driver would enter; chosen by us


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What the ego drives with, and when."""

    vehicle: VehicleGeometry
    control: ControlSection
    plant: PlantSpec
    depart_s: float  # simulated time at which the ego asks to enter
    time_limit_s: float  # from then on
    doubtful_speed_mps: float = np.inf  # at places at which its map may be wrong
    in_window: bool = False  # whether it is shown in sumo-gui


def drive_path(
    path: ReferencePath,
    *,
    layout: WorkZoneLayout,
    files: SumoFiles,
    drive: Drive,
    on_step: Callable[[float], None],
    new_maps: Iterable[NewMap] = (),
) -> EgoRun:
    """The run of the ego along `path` in the traffic of `files`. `on_step` is told the station [m] on the path each step.

    The other drivers act as often as they do without the ego. `new_maps` reach the ego in their order. One on which no path
    leads on makes it stop ahead of ground that is not free there, which ends the run.
    """
    checker, record = ContactChecker(layout, drive.vehicle), _RunRecord()
    around = files.surroundings.around if files.surroundings else ()
    options = _options(files)
    with running(files.config, options=options, in_window=drive.in_window, begin=files.begin, edges=around) as session:
        state = _enter(session, path, layout=layout, files=files, drive=drive)
        if state is None:
            return record.ended(Outcome.TIMED_OUT, f"no gap to enter the road within {INSERTION_WAIT_S:g} s")
        follower = PathFollower(
            path, layout=layout, vehicle=drive.vehicle, control=drive.control, doubtful_speed_mps=drive.doubtful_speed_mps
        )
        entered, maps_to_come, traffic = session.time, deque(new_maps), session.traffic()
        planner, highest = SpeedPlanner(drive.control.others), np.inf
        while True:
            while maps_to_come and session.time >= maps_to_come[0].time_s:
                replan = follower.replan(maps_to_come.popleft(), state, time=session.time)
                record.replans += [replan] if replan else []
            if follower.has_no_way_on and state.speed < STANDS_MPS:
                last = record.replans[-1]
                return record.ended(
                    Outcome.NO_PATH,
                    f"on the map that came {last.time_s - entered:.1f} s after it entered {last.reason}; it stopped",
                )
            if on_clock(session.time):
                record.look_around(session.time, state, traffic)
                session.allow_emergency_braking(_not_ahead(state, traffic))
                session.resolve_gridlock()
                may_enter = session.may_enter_shared_lane()
                if drive.control.minds_others:
                    highest = planner.ceiling(follower.outlook(state), traffic, layout=layout, may_enter=may_enter, dt=CLOCK_S)
            command = follower.controller.command(state, dt=STEP_S, ceiling=min(highest, follower.ceiling(state)))
            record.steps.append(_log_row(session.time, state, command, follower.controller))
            state = advance_ego(state, command, dt=STEP_S, vehicle=drive.vehicle, spec=drive.plant)
            bodies = bodies_in_lanes(state, drive.vehicle, traffic, road=layout.road, edges=files.edges)
            session.place_ego(bodies, speed=state.speed)
            session.step()
            on_step(follower.controller.station_m)
            traffic = session.traffic()
            ended = checker.contact_now(state, traffic) or _ending(follower.controller, session.time, drive)
            if ended:
                return record.ended(*ended)


class _RunRecord:
    """What is kept of a run while it goes on."""

    def __init__(self) -> None:
        self.steps: list[tuple[float, ...]] = []
        self.replans: list[Replan] = []
        self._near: list[tuple[float, Traffic]] = []
        self._all: list[tuple[float, Traffic]] = []

    def look_around(self, time: float, state: EgoState, traffic: Traffic) -> None:
        """Keep the vehicles near the ego, and once in FOLLOWERS_LOG_PERIOD_S all."""
        self._near.append((time, traffic.near(state.x, state.y, reach_m=TRAFFIC_LOG_REACH_M)))
        if not self._all or time >= self._all[-1][0] + FOLLOWERS_LOG_PERIOD_S - 1e-6:
            self._all.append((time, traffic))

    def ended(self, outcome: Outcome, reason: str) -> EgoRun:
        """The run that ended so."""
        return EgoRun(
            log=pd.DataFrame(self.steps, columns=list(EGO_LOG_COLUMNS)),
            traffic=traffic_trace(self._near), followers=traffic_trace(self._all),
            replans=tuple(self.replans), outcome=outcome, reason=reason,
        )  # fmt: skip


def _options(files: SumoFiles) -> tuple[str, ...]:
    """SUMO's options for the ego's finer steps, in which the other drivers act as often as without it.

    SUMO warns of hard braking, which is measured here: no warnings.
    """
    action_s = max(files.step_length, STEP_S)
    # Files that detectors of a network write are those of the ego's drive, and get a name of their own.
    prefix = ("--output-prefix", "ego.")
    return ("--step-length", f"{STEP_S:g}", "--default.action-step-length", f"{action_s:g}", "--no-warnings", *prefix)


def _enter(session: Session, path: ReferencePath, *, layout: WorkZoneLayout, files: SumoFiles, drive: Drive) -> EgoState | None:
    """State of the ego at the start of its path once SUMO has found it a gap; None where it finds none in INSERTION_WAIT_S."""
    while session.time < drive.depart_s:
        session.step()
    x, y, heading = path.poses[0]
    bumper = advance(path.poses[0], drive.vehicle.axle_to_bumper_m)
    (station,), (offset,) = layout.road.to_sd(bumper[:2])
    edge = edge_at(files.edges, station)
    lane = edge.lane_at(station, offset)
    speed = drive.control.target_speed_mps
    ahead = [e.id for e in files.edges if e.start >= edge.start]
    session.request_ego(drive.vehicle, edges=ahead, lane=lane, position=station - edge.start, speed=speed)
    requested = session.time
    while not session.has_ego():
        if session.time - requested > INSERTION_WAIT_S:
            return None
        session.step()
    session.take_over_ego()
    return EgoState(x=float(x), y=float(y), heading=float(heading), speed=speed)


def _not_ahead(state: EgoState, traffic: Traffic) -> tuple[str, ...]:
    """Ids of the vehicles near the ego, beside or behind it: their drivers may have to brake for it."""
    near = traffic.near(state.x, state.y, reach_m=TRAFFIC_LOG_REACH_M)
    ahead = (near.poses[:, :2] - state.pose[:2]) @ np.array([np.cos(state.heading), np.sin(state.heading)])
    return tuple(name for name, is_not_ahead in zip(near.ids, ahead < NOT_AHEAD_M, strict=True) if is_not_ahead)


def _log_row(time: float, state: EgoState, command: Command, controller: Controller) -> tuple[float, ...]:
    """One row of EGO_LOG_COLUMNS."""
    return (
        time, state.x, state.y, state.heading, state.speed, state.steering, command.throttle, command.brake,
        controller.cross_track_m, controller.station_m,
    )  # fmt: skip


def _ending(controller: Controller, time: float, drive: Drive) -> tuple[Outcome, str] | None:
    """How the run ends now, and why; None where it goes on."""
    if controller.reached_end:
        return Outcome.REACHED_GOAL, ""
    if time > drive.depart_s + drive.time_limit_s:
        return Outcome.TIMED_OUT, f"the goal was not reached within {drive.time_limit_s:g} s"
    return None
