"""The ego drives its path through the running SUMO traffic, which follows it; ends with an Outcome."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
import shapely
from shapely import Polygon

from wzsumo.control.car_following import Leader
from wzsumo.control.controller import Controller, ControlSpec
from wzsumo.control.plant import PlantSpec, advance_ego
from wzsumo.ego import Command, EgoRun, EgoState, Outcome
from wzsumo.frames import FloatArray, advance
from wzsumo.metrics.conflicts import boxes_overlap
from wzsumo.path import ReferencePath
from wzsumo.simulation.files import SumoFiles
from wzsumo.simulation.session import Session, Traffic, running
from wzsumo.tables import EGO_LOG_COLUMNS
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import WorkZoneLayout

CONTROL_STEP_S = 0.05  # 20 commands a second
FORESIGHT_S = 4.0  # how far other vehicles are carried on; a lane change at 10 m/s takes about that
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
    """The run of the ego along `path` in the traffic of `files`. `on_step` is told the station [m] on the path each step."""
    surroundings = _Surroundings(layout, drive.vehicle)
    with running(files.config) as session:
        while session.time < drive.depart_s:
            session.step()
        state = _enter(session, path, layout=layout, files=files, drive=drive)
        if state is None:
            return EgoRun(
                log=pd.DataFrame(columns=list(EGO_LOG_COLUMNS)),
                outcome=Outcome.TIMED_OUT,
                reason=f"no gap to enter the road within {INSERTION_WAIT_S:g} s",
            )
        controller = Controller(path, drive.vehicle, drive.control)
        substeps = max(1, round(files.step_length / CONTROL_STEP_S))
        dt, rows = files.step_length / substeps, []
        while True:
            traffic = session.traffic()
            ahead = _leader(state, traffic, path, controller.station_m, drive.vehicle)
            beside = _passing(state, traffic, path, controller.station_m, drive.vehicle)
            leader = min((it for it in (ahead, beside) if it), key=lambda it: it.gap_m, default=None)
            for substep in range(substeps):
                command = controller.command(state, dt=dt, leader=leader)
                rows.append(_log_row(session.time + substep * dt, state, command, controller))
                state = advance_ego(state, command, dt=dt, vehicle=drive.vehicle, spec=drive.plant)
            session.place_ego(state, drive.vehicle)
            session.step()
            on_step(controller.station_m)
            ended = surroundings.check(state, session.traffic()) or _ending(controller, session.time, drive)
            if ended:
                return EgoRun(log=pd.DataFrame(rows, columns=list(EGO_LOG_COLUMNS)), outcome=ended[0], reason=ended[1])


class _Surroundings:
    """What the ego must not touch, prepared once."""

    def __init__(self, layout: WorkZoneLayout, vehicle: VehicleGeometry) -> None:
        self._vehicle = vehicle
        self._devices = shapely.STRtree(layout.device_outlines)
        road = layout.road
        self._closed = layout.closed_area
        self._pavement = road.strip(-50.0, road.length + 50.0, -road.right_shoulder, road.left_edge)
        shapely.prepare([self._closed, self._pavement])

    def check(self, state: EgoState, traffic: Traffic) -> tuple[Outcome, str] | None:
        """What the outline of the ego touches now, the worst first."""
        outline = Polygon(self._vehicle.outline(state.pose))
        where = f"at ({state.x:.1f}, {state.y:.1f}) m"
        centre = advance(state.pose, self._vehicle.axle_to_centre_m)
        size = np.array([self._vehicle.length_m, self._vehicle.width_m])
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


def _leader(state: EgoState, traffic: Traffic, path: ReferencePath, station: float, vehicle: VehicleGeometry) -> Leader | None:
    """The nearest vehicle ahead whose body reaches into the ego's way along the path."""
    if not traffic.ids:
        return None
    reach = max(30.0, 6 * state.speed)
    s = path.arc_length
    ahead = (s >= station) & (s <= station + reach)
    if ahead.sum() < 2:
        return None
    way, way_s = path.poses[ahead], s[ahead]
    offset = traffic.poses[:, None, :2] - way[None, :, :2]
    nearest = np.argmin(np.einsum("ijk,ijk->ij", offset, offset), axis=1)
    index = np.arange(len(traffic.ids))
    heading = way[nearest, 2]
    along = offset[index, nearest, 0] * np.cos(heading) + offset[index, nearest, 1] * np.sin(heading)
    across = -offset[index, nearest, 0] * np.sin(heading) + offset[index, nearest, 1] * np.cos(heading)
    gap = way_s[nearest] - station + along - traffic.lengths / 2 - vehicle.axle_to_bumper_m
    in_way = (np.abs(across) < (traffic.widths + vehicle.width_m) / 2) & (along > -1.0) & (along < 5.0) & (nearest > 0)
    in_way &= gap > -traffic.lengths
    if not in_way.any():
        return None
    first = int(np.argmin(np.where(in_way, gap, np.inf)))
    return Leader(gap_m=float(max(gap[first], 0.0)), speed_mps=float(traffic.speeds[first]))


def _passing(state: EgoState, traffic: Traffic, path: ReferencePath, station: float, vehicle: VehicleGeometry) -> Leader | None:
    """The place where the ego's way meets that of a vehicle beside or behind it, as a leader that stands there.

    Both are carried on for FORESIGHT_S at the speeds that they have. Slowing down holds the ego's drift towards the other
    lane back until the other has passed. Vehicles that follow in the ego's own way keep their distance themselves.
    """
    if not traffic.ids:
        return None
    centre = advance(state.pose, vehicle.axle_to_centre_m)
    offset = traffic.poses[:, :2] - centre[:2]
    along = offset @ np.array([np.cos(state.heading), np.sin(state.heading)])
    across = offset @ np.array([-np.sin(state.heading), np.cos(state.heading)])
    near = (along > -60) & (along < 10) & (np.abs(across) > (traffic.widths + vehicle.width_m) / 2)
    if not near.any():
        return None
    times = np.arange(0.25, FORESIGHT_S + 0.01, 0.25)
    s = path.arc_length
    index = np.clip(np.searchsorted(s, station + state.speed * times), 0, len(s) - 1)
    ego = advance(path.poses[index], vehicle.axle_to_centre_m)
    others = advance(np.repeat(traffic.poses[near][:, None], len(times), axis=1), traffic.speeds[near][:, None] * times)
    # The ego is taken this much wider and longer, for what speeds and places are not known to.
    size = np.array([vehicle.length_m + 2.0, vehicle.width_m + 0.6])
    sizes = np.column_stack([traffic.lengths, traffic.widths])[near][:, None]
    hit = boxes_overlap(ego[None], size, others, sizes).any(axis=0)
    if not hit.any():
        return None
    return Leader(gap_m=float(state.speed * times[int(np.argmax(hit))]), speed_mps=0.0)


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
