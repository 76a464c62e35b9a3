"""The data with which report.html plays a drive back: the ego, the vehicles around it and the zone, as JSON."""

from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup
from shapely.geometry.base import BaseGeometry

from wzsumo.figures.drive_reasons import slowings_of
from wzsumo.figures.lane_lines import lane_lines
from wzsumo.files.result_folder import ResultFolder
from wzsumo.frames import FloatArray, advance
from wzsumo.report.page import json_block

FRAME_S = 0.2  # time between two frames, between which the page interpolates
OUTLINE_TOLERANCE_M = 0.05  # by which the simplified outlines of areas may differ from the areas
BEFORE_ZONE_M = 30.0  # the player starts where the ego is so far ahead of the zone
BRAKING_MPS2 = 0.7  # harder slowing shows brake lights: UNECE R13-H lets them light from there on


def player_data(run: ResultFolder, method: str | None) -> Markup | None:
    """JSON of the method's drive; None where nothing was driven. World frame, metres rounded to the centimetre.

    `ego` holds [x, y, heading, speed, braking] of each frame. `others` holds, for each frame, [x, y, heading, number, length,
    width, braking] of each vehicle; the number names the vehicle. Positions are of vehicle CENTRES. `slowed` holds [start, end,
    what held the ego back], seconds since the first frame.
    """
    log, traffic = (run.drive_of(method), run.drive_traffic_of(method)) if method else (None, None)
    if log is None or traffic is None or len(log) < 2 or method is None:
        return None
    log = log.assign(braking=_brakes(log["speed_mps"], log["time_s"]))[_on_frames(log["time_s"])]
    traffic = traffic.sort_values(["vehicle_id", "time_s"], kind="stable")
    braking = [_brakes(part["speed_mps"], part["time_s"]) for _, part in traffic.groupby("vehicle_id", sort=True)]
    frames_of = np.round(traffic["time_s"] / FRAME_S).astype(int)
    traffic = traffic.assign(
        frame=frames_of, number=pd.factorize(traffic["vehicle_id"])[0], braking=np.concatenate([*braking, np.empty(0)])
    )
    columns = ["x_m", "y_m", "heading_rad", "number", "length_m", "width_m", "braking"]
    by_frame = {frame: part[columns].to_numpy() for frame, part in traffic[_on_frames(traffic["time_s"])].groupby("frame")}
    centre = advance(log[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float), run.vehicle.axle_to_centre_m)
    began = float(log["time_s"].iloc[0])
    data: dict[str, Any] = {
        "frame_s": FRAME_S,
        "zone_frame": _frame_before_zone(run, centre),
        "size": [run.vehicle.length_m, run.vehicle.width_m],
        "ego": _rounded(np.column_stack([centre, log["speed_mps"], log["braking"]])),
        "others": [_rounded(by_frame.get(frame, np.empty((0, 7)))) for frame in np.round(log["time_s"] / FRAME_S).astype(int)],
        "slowed": [
            [round(each.start_s - began, 1), round(each.end_s - began, 1), str(each.why)] for each in slowings_of(run, method)
        ],
        "areas": {name: _rings(area) for name, area in run.polygons.items()},
        "lines": [
            {"kind": line.kind, "points": _rounded(run.road.to_xy(line.stations, line.offsets))} for line in lane_lines(run)
        ]
        + [
            {"kind": "stop", "points": _rounded(run.road.to_xy([each["s_m"]] * 2, [each["right_m"], each["left_m"]]))}
            for each in run.stop_lines
        ],
        "devices": _rounded(run.devices[["x_m", "y_m", "radius_m"]].to_numpy(dtype=float)),
    }
    return json_block(data)


def _brakes(speed: "pd.Series[float]", time_s: "pd.Series[float]") -> FloatArray:
    """1 where a vehicle slows down by BRAKING_MPS2 or more, over some half a second, else 0 (n,)."""
    if len(speed) < 2:
        return np.zeros(len(speed))
    window = max(1, round(0.5 / float(np.median(np.diff(time_s)))))
    gained = speed.diff(window).bfill() / (window * float(np.median(np.diff(time_s))))
    return np.asarray(gained.fillna(0.0) <= -BRAKING_MPS2, dtype=float)


def _frame_before_zone(run: ResultFolder, centre: FloatArray) -> int:
    """The last frame in which the ego is BEFORE_ZONE_M or more ahead of the zone; the first where there is none."""
    stations, _ = run.road.to_sd(centre[:, :2])
    before = np.flatnonzero(stations <= run.span[0] - BEFORE_ZONE_M)
    return int(min(before[-1], len(centre) - 2)) if len(before) else 0


def _on_frames(time_s: "pd.Series[float]") -> "pd.Series[bool]":
    """Whether times (n,) [s] are those of frames."""
    ticks = time_s / FRAME_S
    return (ticks - ticks.round()).abs() < 0.01


def _rings(area: BaseGeometry) -> list[list[list[float]]]:
    parts = getattr(area, "geoms", [area])
    return [_rounded(np.asarray(part.simplify(OUTLINE_TOLERANCE_M).exterior.coords)) for part in parts if not part.is_empty]


def _rounded(values: Any) -> list[list[float]]:
    rows: list[list[float]] = np.round(np.asarray(values, dtype=float), 2).tolist()
    return rows
