"""Why the ego drove slower than it wished: what was in its way at each moment, from what can be observed of the drive."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import groupby

import numpy as np

from wzsumo.ego import EgoRun
from wzsumo.frames import BoolArray, FloatArray, advance
from wzsumo.metrics.drive import mean_change, on_clock
from wzsumo.metrics.neighbours import neighbours_on_path
from wzsumo.road import Road
from wzsumo.vehicle import VehicleGeometry

SLOWER_MPS = 1.0  # a speed below the wished one by less is kept; the noise of a speed controller, chosen by us
REACH_S, REACH_M = 3.0, 10.0  # one ahead nearer than 3 s and 10 m is followed: HCM's percent followers count from 2.5 s
BESIDE_M = 5.0  # one whose middle is nearer across the road is in the next lane, of 12 ft and its scatter
SPEEDING_UP_MPS2 = 0.3  # an ego that gains more is not held back any longer; chosen by us
LEAST_S = 1.0  # a shorter slowing is not told


class Why(StrEnum):
    """What held the ego back."""

    AHEAD = "a vehicle ahead"
    BEND = "a bend of its path"
    BESIDE = "a vehicle in the next lane"
    TURN = "the other direction's turn"


@dataclass(frozen=True, kw_only=True)
class Slowing:
    """A time [s] in which one thing held the ego back; stations [m] on the road of its rear axle, least speed [m/s]."""

    why: Why
    start_s: float
    end_s: float
    start_m: float
    end_m: float
    least_speed_mps: float


def slowings(
    run: EgoRun,
    vehicle: VehicleGeometry,
    *,
    road: Road,
    wished: FloatArray,
    on_straights_mps: float,
    stop_line_m: float | None,
) -> list[Slowing]:
    """The slowings of a drive, in order of time.

    `wished` (n,) [m/s] are the speeds that the ego would keep at the rows of its log if no vehicle hindered it, lower before
    and in bends; `on_straights_mps` is that where its path does not bend. `stop_line_m` is the station of the line where the
    ego waits for its turn on a lane that both directions share; None: there is none.
    """
    shown = on_clock(run.log["time_s"])
    log, wished = run.log[shown], wished[shown]
    time, speed = log["time_s"].to_numpy(dtype=float), log["speed_mps"].to_numpy(dtype=float)
    if len(time) < 2:
        return []
    step = float(np.median(np.diff(time)))
    gains = mean_change(speed, window=max(1, round(0.5 / step))) / step
    held_back = (speed < on_straights_mps - SLOWER_MPS) & (gains < SPEEDING_UP_MPS2)
    ahead = neighbours_on_path(run, vehicle, road=road)
    near = (ahead.gap_ahead < REACH_M + REACH_S * speed) & (ahead.speed_ahead < on_straights_mps)
    bends = (wished < on_straights_mps - SLOWER_MPS) & (speed > wished - SLOWER_MPS)
    beside = _somebody_beside(run, time, road=road, vehicle=vehicle)
    stations, _ = road.to_sd(log[["x_m", "y_m"]])
    to_line = np.inf if stop_line_m is None else stop_line_m - stations - vehicle.axle_to_bumper_m
    turn = (to_line > -vehicle.length_m) & (to_line < REACH_M + REACH_S * speed)
    why = np.select(
        [held_back & bends, held_back & near, held_back & turn, held_back & beside],
        [Why.BEND, Why.AHEAD, Why.TURN, Why.BESIDE],
        default="",
    )
    return list(_spells(why, time, stations, speed))


def _somebody_beside(run: EgoRun, time: FloatArray, *, road: Road, vehicle: VehicleGeometry) -> BoolArray:
    """Whether (n,) a vehicle drives the ego's way in the next lane, its rear not behind the ego's rear, within REACH_S."""
    log = run.log[on_clock(run.log["time_s"])]
    poses = log[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float)
    station, offset = road.to_sd(advance(poses, vehicle.axle_to_centre_m)[:, :2])
    ticks = {round(moment * 10): row for row, moment in enumerate(time)}
    found = np.zeros(len(time), dtype=bool)
    if run.traffic.empty:
        return found
    others = run.traffic
    s, d = road.to_sd(others[["x_m", "y_m"]].to_numpy())
    rows = np.array([ticks.get(round(moment * 10), -1) for moment in others["time_s"]])
    along, across = s - station[rows], np.abs(d - offset[rows])
    same_way = np.cos(others["heading_rad"].to_numpy() - road.heading_at(s)) > 0
    reach = REACH_M + REACH_S * log["speed_mps"].to_numpy(dtype=float)[rows]
    beside = (across < BESIDE_M) & (across > (others["width_m"].to_numpy(dtype=float) + vehicle.width_m) / 2)
    counts = (rows >= 0) & same_way & beside & (along > -vehicle.length_m) & (along < reach)
    found[rows[counts]] = True
    return found


def _spells(why: FloatArray, time: FloatArray, stations: FloatArray, speed: FloatArray) -> Iterator[Slowing]:
    for name, group in groupby(range(len(why)), key=lambda row: str(why[row])):
        rows = list(group)
        if name and time[rows[-1]] - time[rows[0]] >= LEAST_S:
            yield Slowing(
                why=Why(name), start_s=float(time[rows[0]]), end_s=float(time[rows[-1]]), start_m=float(stations[rows[0]]),
                end_m=float(stations[rows[-1]]), least_speed_mps=float(speed[rows].min()),
            )  # fmt: skip
