"""The ego drives its path through the running SUMO traffic, which follows it; ends with an Outcome."""

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd

from wzsumo.control.car_following import Leader
from wzsumo.control.controller import Controller, ControlSpec
from wzsumo.control.plant import PlantSpec, advance_ego
from wzsumo.ego import Command, EgoRun, EgoState, Outcome
from wzsumo.frames import FloatArray, advance
from wzsumo.metrics.drive import on_clock
from wzsumo.path import ReferencePath
from wzsumo.simulation.files import SumoFiles
from wzsumo.simulation.session import Session, Traffic, running, traffic_trace
from wzsumo.study.giving_way import Way, route_along, whom_to_mind
from wzsumo.study.lane_intrusion import intrusions
from wzsumo.study.stop_line import stop_line_ahead
from wzsumo.study.surroundings import Surroundings
from wzsumo.tables import EGO_LOG_COLUMNS
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

STEP_S = 0.05  # 20 commands a second, each followed by moveToXY
TRAFFIC_LOG_M = 100.0  # vehicles within this of the ego are logged: 4 s at 25 m/s
INSERTION_WAIT_S = 120.0  # how long SUMO may look for a gap that a driver would enter


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What the ego drives with, and from when on."""

    vehicle: VehicleGeometry
    control: ControlSpec
    plant: PlantSpec
    depart_s: float  # simulated time at which the ego asks to enter
    time_limit_s: float


def drive_path(
    path: ReferencePath, *, layout: WorkZoneLayout, files: SumoFiles, drive: Drive, on_step: Callable[[float], None]
) -> EgoRun:
    """The run of the ego along `path` in the traffic of `files`. `on_step` is told the station [m] on the path each step.

    The other drivers act once in the scenario's step, as they do without the ego.
    """
    surroundings = Surroundings(layout, drive.vehicle)
    with running(files.config, options=_finer_steps(files)) as session:
        while session.time < drive.depart_s:
            session.step()
        state = _enter(session, path, layout=layout, files=files, drive=drive)
        if state is None:
            return _run([], [], Outcome.TIMED_OUT, f"no gap to enter the road within {INSERTION_WAIT_S:g} s")
        controller, control = Controller(path, drive.vehicle, drive.control), drive.control
        leader: Leader | None = None
        rows: list[tuple[float, ...]] = []
        seen: list[tuple[float, Traffic]] = []
        traffic, route = session.traffic(), route_along(path, layout=layout, vehicle=drive.vehicle)
        while True:
            if on_clock(session.time):  # as often as the other drivers
                way = Way(
                    route=route, station=controller.station_m, state=state, vehicle=drive.vehicle,
                    desired_speed=control.target_speed_mps, acceleration=control.idm.acceleration_mps2,
                )  # fmt: skip
                stop = stop_line_ahead(state, vehicle=drive.vehicle, layout=layout, may_enter=session.may_enter_shared_lane())
                minded = [it for it in (whom_to_mind(way, traffic, layout=layout), stop) if it]
                leader = min(minded, key=lambda it: it.gap_m, default=None)
                seen.append((session.time, traffic.near(state.x, state.y, reach_m=TRAFFIC_LOG_M)))
            command = controller.command(state, dt=STEP_S, leader=leader)
            rows.append(_log_row(session.time, state, command, controller))
            state = advance_ego(state, command, dt=STEP_S, vehicle=drive.vehicle, spec=drive.plant)
            over_lines = intrusions(state, drive.vehicle, traffic, road=layout.road, edges=files.edges)
            session.place_ego(state, drive.vehicle, intrusions=over_lines)
            session.step()
            on_step(controller.station_m)
            traffic = session.traffic()
            ended = surroundings.contact(state, traffic) or _ending(controller, session.time, drive)
            if ended:
                return _run(rows, seen, *ended)


def _run(rows: list[tuple[float, ...]], seen: list[tuple[float, Traffic]], outcome: Outcome, reason: str) -> EgoRun:
    log = pd.DataFrame(rows, columns=list(EGO_LOG_COLUMNS))
    return EgoRun(log=log, traffic=traffic_trace(seen), outcome=outcome, reason=reason)


def _finer_steps(files: SumoFiles) -> tuple[str, ...]:
    return ("--step-length", f"{STEP_S:g}", "--default.action-step-length", f"{max(files.step_length, STEP_S):g}")


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
