"""Closed loop: the ego drives its path in the running SUMO traffic, and the traffic reacts to it."""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from wzsumo.behaviour.speed_plan import SpeedPlanner, plan_accelerations
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
from wzsumo.simulation.gridlock import CHECK_S
from wzsumo.simulation.session import Session, running
from wzsumo.tables import EGO_LOG_COLUMNS
from wzsumo.traffic import Traffic, traffic_trace
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

STEP_S = 0.05  # of the control: 20 commands a second
TRAFFIC_LOG_REACH_M = 100.0  # vehicles within this of the ego are logged: 4 s at 25 m/s
FOLLOWERS_LOG_PERIOD_S = 1.0  # of the log of all vehicles, which shows what the ego costs those behind it
NOT_AHEAD_M = 10.0  # a vehicle, even a truck, is beside or behind the ego if its centre is less than this before the rear axle
STANDS_MPS = 0.1  # slower, the ego stands


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What the ego drives with, and when."""

    vehicle: VehicleGeometry
    control: ControlSection
    plant: PlantSpec
    depart_s: float  # simulated time at which the ego asks to enter
    time_limit_s: float  # of the wait for room on the road, and again of the drive from the entry on
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

    Until the ego enters, the traffic is that of the fleet's own run. SUMO keeps its step: between its steps it would drive
    the others otherwise than without the ego, as with more frequent steps than actions (SUMO 1.28: a truck that stood across
    a line at the end of a taper stayed there for good). `new_maps` reach the ego in their order. One on which no path
    leads on makes it stop ahead of ground that is not free there, which ends the run.
    """
    checker, record = ContactChecker(layout, drive.vehicle), _RunRecord()
    around = files.surroundings.around if files.surroundings else ()
    step_s, options = _traffic_step_s(files), _options(files)
    n_commands = round(step_s / STEP_S)
    with running(files.config, options=options, in_window=drive.in_window, begin=files.begin, edges=around) as session:
        follower = PathFollower(
            path, layout=layout, vehicle=drive.vehicle, control=drive.control, doubtful_speed_mps=drive.doubtful_speed_mps
        )
        state = _start(path, drive)
        record.waited_s = _enter(session, state, follower, layout=layout, files=files, drive=drive)
        if not session.has_ego():
            return record.ended(Outcome.TIMED_OUT, f"no gap to enter the road within {drive.time_limit_s:g} s")
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
                may_enter = session.may_enter_shared_lane()
                if drive.control.minds_others:
                    highest = planner.ceiling(follower.outlook(state), traffic, layout=layout, may_enter=may_enter, dt=CLOCK_S)
            touched = None
            for number in range(n_commands):
                if number:
                    touched = touched or checker.contact_now(state, _moved_on(traffic, number * STEP_S))
                command = follower.controller.command(state, dt=STEP_S, ceiling=min(highest, follower.ceiling(state)))
                record.steps.append(_log_row(session.time + number * STEP_S, state, command, follower.controller))
                state = advance_ego(state, command, dt=STEP_S, vehicle=drive.vehicle, spec=drive.plant)
            bodies = bodies_in_lanes(state, drive.vehicle, _moved_on(traffic, step_s), road=layout.road, edges=files.edges)
            session.place_ego(bodies, speed=state.speed)
            _step(session)
            on_step(follower.controller.station_m)
            traffic = session.traffic()
            touched = touched or checker.contact_now(state, traffic)
            ended = touched or _ending(follower.controller, session.time - entered, drive)
            if ended:
                return record.ended(*ended)


class _RunRecord:
    """What is kept of a run while it goes on."""

    def __init__(self) -> None:
        self.steps: list[tuple[float, ...]] = []
        self.replans: list[Replan] = []
        self.waited_s = 0.0
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
            replans=tuple(self.replans), outcome=outcome, reason=reason, waited_s=self.waited_s,
        )  # fmt: skip


def _traffic_step_s(files: SumoFiles) -> float:
    """SUMO's step [s]: that of the fleet's own run, but not beyond CLOCK_S; a finer one than that is the control's."""
    return CLOCK_S if files.step_length >= CLOCK_S else STEP_S


def _options(files: SumoFiles) -> tuple[str, ...]:
    """SUMO's options for the ego's drive, in which the other drivers act as often as without it.

    SUMO warns of hard braking, which is measured here: no warnings.
    """
    step_s = _traffic_step_s(files)
    # Files that detectors of a network write are those of the ego's drive, and get a name of their own.
    options = ("--step-length", f"{step_s:g}", "--no-warnings", "--output-prefix", "ego.")
    if files.step_length == step_s:
        return options
    return (*options, "--default.action-step-length", f"{max(files.step_length, step_s):g}")


def _step(session: Session) -> None:
    """Advance SUMO by a step; vehicles that wait for each other are let go as often as in the fleet's own run."""
    session.step()
    checks = session.time / CHECK_S
    if abs(checks - round(checks)) < 1e-6:
        session.resolve_gridlock()


def _moved_on(traffic: Traffic, duration_s: float) -> Traffic:
    """The traffic after a part of a step in which all keep speed and heading."""
    x, y, heading = traffic.poses.T
    driven = traffic.speeds * duration_s
    return replace(traffic, poses=np.column_stack([x + driven * np.cos(heading), y + driven * np.sin(heading), heading]))


def _start(path: ReferencePath, drive: Drive) -> EgoState:
    x, y, heading = map(float, path.poses[0])
    return EgoState(x=x, y=y, heading=heading, speed=drive.control.target_speed_mps)


def _enter(
    session: Session, start: EgoState, follower: PathFollower, *, layout: WorkZoneLayout, files: SumoFiles, drive: Drive
) -> float:
    """Let the ego enter at its start when the time has come; how long [s] it waited for room, and in vain after its time limit.

    It asks to be let in at a moment from which it need not brake harder than is comfortable for those ahead. SUMO then looks
    for a gap in its lane that those behind can put up with.
    """
    bumper = advance(start.pose, drive.vehicle.axle_to_bumper_m)
    (station,), (offset,) = layout.road.to_sd(bumper[:2])
    edge = edge_at(files.edges, station)
    ahead = [e.id for e in files.edges if e.start >= edge.start]
    while session.time < drive.depart_s:
        _step(session)
    asked, requested = session.time, False
    while not session.has_ego() and session.time - asked <= drive.time_limit_s:
        if not requested and not _would_brake_hard(session, start, follower, layout=layout, drive=drive):
            lane, position = edge.lane_at(station, offset), station - edge.start
            session.request_ego(drive.vehicle, edges=ahead, lane=lane, position=position, speed=start.speed)
            requested = True
        _step(session)
    if session.has_ego():
        session.take_over_ego()
    return session.time - asked


def _would_brake_hard(
    session: Session, start: EgoState, follower: PathFollower, *, layout: WorkZoneLayout, drive: Drive
) -> bool:
    """Whether an ego that were now at its start would brake harder than is comfortable within the time that it plans."""
    spec = drive.control.others
    if not drive.control.minds_others:
        return False
    may_enter = session.may_enter_shared_lane()
    planned = plan_accelerations(
        follower.outlook(start), session.traffic(), layout=layout, may_enter=may_enter, acceleration=0.0, spec=spec
    )
    return planned is not None and float(planned.min()) < -spec.comfortable_deceleration_mps2


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


def _ending(controller: Controller, driven_s: float, drive: Drive) -> tuple[Outcome, str] | None:
    """How the run ends now, and why; None where it goes on."""
    if controller.reached_end:
        return Outcome.REACHED_GOAL, ""
    if driven_s > drive.time_limit_s:
        return Outcome.TIMED_OUT, f"the goal was not reached within {drive.time_limit_s:g} s"
    return None
