"""The data with which report.html plays a drive back: the ego, the vehicles around it and the zone, as JSON."""

from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup
from shapely.geometry.base import BaseGeometry

from wzsumo.files.result_folder import ResultFolder
from wzsumo.frames import advance
from wzsumo.report.page import json_block

FRAME_S = 0.2  # time between two frames, between which the page interpolates
OUTLINE_TOLERANCE_M = 0.05  # by which the simplified outlines of areas may differ from the areas


def player_data(run: ResultFolder, method: str | None) -> Markup | None:
    """JSON of the method's drive; None where nothing was driven. World frame, metres rounded to the centimetre.

    `ego` holds [x, y, heading, speed] of each frame. `others` holds, for each frame, [x, y, heading, number, length, width] of
    each vehicle; the number names the vehicle. Positions are of vehicle CENTRES.
    """
    log, traffic = (run.drive_of(method), run.drive_traffic_of(method)) if method else (None, None)
    if log is None or traffic is None or len(log) < 2:
        return None
    log = log[_on_frames(log["time_s"])]
    centre = advance(log[["x_m", "y_m", "heading_rad"]].to_numpy(dtype=float), run.vehicle.axle_to_centre_m)
    ego = np.column_stack([centre, log["speed_mps"]])
    frames_of = np.round(traffic["time_s"] / FRAME_S).astype(int)
    traffic = traffic.assign(frame=frames_of, number=pd.factorize(traffic["vehicle_id"])[0])
    columns = ["x_m", "y_m", "heading_rad", "number", "length_m", "width_m"]
    by_frame = {frame: part[columns].to_numpy() for frame, part in traffic[_on_frames(traffic["time_s"])].groupby("frame")}
    frames = np.round(log["time_s"] / FRAME_S).astype(int)
    data: dict[str, Any] = {
        "frame_s": FRAME_S,
        "size": [run.vehicle.length_m, run.vehicle.width_m],
        "ego": _rounded(ego),
        "others": [_rounded(by_frame.get(frame, np.empty((0, 6)))) for frame in frames],
        "areas": {name: _rings(area) for name, area in run.polygons.items()},
        "devices": _rounded(run.devices[["x_m", "y_m", "radius_m"]].to_numpy(dtype=float)),
    }
    return json_block(data)


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
