"""The ego drives its path through the running SUMO traffic, which follows it; ends with an Outcome."""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wzsumo.behaviour.ceiling import AccelerationCeiling, Hindrance, hindrance_of
from wzsumo.case.replanning import Course, NewMap
from wzsumo.control.controller import Controller
from wzsumo.control.plant import PlantSpec, advance_ego
from wzsumo.ego import Command, EgoRun, EgoState, Outcome, Replan
from wzsumo.frames import FloatArray, advance
from wzsumo.metrics.contact import ContactChecker
from wzsumo.metrics.drive import on_clock
from wzsumo.path import ReferencePath
from wzsumo.scenario.sections import ControlSection
from wzsumo.simulation.ego_bodies import bodies_in_lanes
from wzsumo.simulation.files import SumoFiles
from wzsumo.simulation.session import Session, running
from wzsumo.tables import EGO_LOG_COLUMNS
from wzsumo.traffic import Traffic, traffic_trace
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

STEP_S = 0.05  # 20 commands a second, each followed by moveToXY
TRAFFIC_LOG_M = 100.0  # vehicles within this of the ego are logged: 4 s at 25 m/s
BESIDE_M = 10.0  # whose centre is less than this ahead of the ego's rear axle is beside or behind it, be it a truck
FOLLOWERS_LOG_S = 1.0  # between two looks at all vehicles, for what the ego costs those behind it
INSERTION_WAIT_S = 120.0  # how long SUMO may look for a gap that a driver would enter


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What the ego drives with, and from when on."""

    vehicle: VehicleGeometry
    control: ControlSection
    plant: PlantSpec
    depart_s: float  # simulated time at which the ego asks to enter
    time_limit_s: float
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

    The other drivers act once in the scenario's step, as they do without the ego. `new_maps` reach it in their order; one on
    which no path leads on ends the run.
    """
    checker, record = ContactChecker(layout, drive.vehicle), _Record()
    with running(files.config, options=_options(files), in_window=drive.in_window) as session:
        while session.time < drive.depart_s:
            session.step()
        state = _enter(session, path, layout=layout, files=files, drive=drive)
        if state is None:
            return record.ended(Outcome.TIMED_OUT, f"no gap to enter the road within {INSERTION_WAIT_S:g} s")
        course = Course(path, layout=layout, vehicle=drive.vehicle, control=drive.control)
        entered, arriving, traffic = session.time, deque(new_maps), session.traffic()
        ceiling, hindrance = AccelerationCeiling(drive.control), Hindrance()
        while True:
            if arriving and session.time >= entered + arriving[0].after_s:
                replan = course.replan(arriving.popleft(), state, time=session.time)
                record.replans.append(replan)
                if replan.reason:
                    return record.ended(
                        Outcome.NO_PATH, f"on the map that came after {session.time - entered:.1f} s {replan.reason}"
                    )
            if on_clock(session.time):  # as often as the other drivers
                session.allow_emergency_braking(_behind(state, traffic))
                session.resolve_gridlock(traffic)
                way = course.way(state)
                hindrance = hindrance_of(way, traffic, layout=layout, may_enter=session.may_enter_shared_lane())
                record.look_round(session.time, state, traffic)
            allowed = ceiling.next(hindrance, speed=state.speed, dt=STEP_S)
            command = course.controller.command(state, dt=STEP_S, ceiling=allowed)
            record.rows.append(_log_row(session.time, state, command, course.controller))
            state = advance_ego(state, command, dt=STEP_S, vehicle=drive.vehicle, spec=drive.plant)
            seen = bodies_in_lanes(state, drive.vehicle, traffic, road=layout.road, edges=files.edges)
            session.place_ego(seen, speed=state.speed)
            session.step()
            on_step(course.controller.station_m)
            traffic = session.traffic()
            ended = checker.contact_now(state, traffic) or _ending(course.controller, session.time, drive)
            if ended:
                return record.ended(*ended)


class _Record:
    """What is kept of a run while it goes on."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []
        self.replans: list[Replan] = []
        self._near: list[tuple[float, Traffic]] = []
        self._all: list[tuple[float, Traffic]] = []

    def look_round(self, time: float, state: EgoState, traffic: Traffic) -> None:
        """Keep the vehicles near the ego, and once a second all."""
        self._near.append((time, traffic.near(state.x, state.y, reach_m=TRAFFIC_LOG_M)))
        if not self._all or time >= self._all[-1][0] + FOLLOWERS_LOG_S - 1e-6:
            self._all.append((time, traffic))

    def ended(self, outcome: Outcome, reason: str) -> EgoRun:
        return EgoRun(
            log=pd.DataFrame(self.rows, columns=list(EGO_LOG_COLUMNS)),
            traffic=traffic_trace(self._near), followers=traffic_trace(self._all),
            replans=tuple(self.replans), outcome=outcome, reason=reason,
        )  # fmt: skip


def _behind(state: EgoState, traffic: Traffic) -> tuple[str, ...]:
    """Those who may have to brake for the ego: near, and not ahead of it."""
    near = traffic.near(state.x, state.y, reach_m=TRAFFIC_LOG_M)
    ahead = (near.poses[:, :2] - state.pose[:2]) @ np.array([np.cos(state.heading), np.sin(state.heading)])
    return tuple(name for name, is_behind in zip(near.ids, ahead < BESIDE_M, strict=True) if is_behind)


def _options(files: SumoFiles) -> tuple[str, ...]:
    """Finer steps, in which the others act as often as without the ego; no warnings, for who brakes how hard is measured."""
    action_s = max(files.step_length, STEP_S)
    return ("--step-length", f"{STEP_S:g}", "--default.action-step-length", f"{action_s:g}", "--no-warnings")


def _enter(session: Session, path: ReferencePath, *, layout: WorkZoneLayout, files: SumoFiles, drive: Drive) -> EgoState | None:
    """State of the ego once SUMO has found it a gap; None where it finds none in time."""
    x, y, heading = path.poses[0]
    bumper = advance(path.poses[0], drive.vehicle.axle_to_bumper_m)
    (station,), (offset,) = layout.road.to_sd(bumper[:2])
    edge = next(edge for edge in files.edges if edge.start <= station < edge.end)
    lane = min(range(len(edge.lanes)), key=lambda i: abs(_middle(edge.lanes[i].right, edge.lanes[i].left, station) - offset))
    speed = drive.control.target_speed_mps
    session.request_ego(drive.vehicle, edge=edge.id, lane=lane, position=station - edge.start, speed=speed)
    asked = session.time
    while not session.has_ego():
        if session.time - asked > INSERTION_WAIT_S:
            return None
        session.step()
    session.take_over_ego()
    return EgoState(x=float(x), y=float(y), heading=float(heading), speed=speed)


def _middle(right: Callable[[float], FloatArray], left: Callable[[float], FloatArray], station: float) -> float:
    return float(right(station) + left(station)) / 2


def _ending(controller: Controller, time: float, drive: Drive) -> tuple[Outcome, str] | None:
    if controller.reached_end:
        return Outcome.REACHED_GOAL, ""
    if time > drive.depart_s + drive.time_limit_s:
        return Outcome.TIMED_OUT, f"the goal was not reached within {drive.time_limit_s:g} s"
    return None


def _log_row(time: float, state: EgoState, command: Command, controller: Controller) -> tuple[float, ...]:
    return (
        time, state.x, state.y, state.heading, state.speed, state.steering, command.throttle, command.brake,
        controller.cross_track_m, controller.station_m,
    )  # fmt: skip
