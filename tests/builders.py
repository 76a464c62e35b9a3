"""Inputs that many tests share, in one line each."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd
import shapely

from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap
from wzsumo.mutcd.laid_out_lanes import laid_out_lanes
from wzsumo.mutcd.layout import lay_out
from wzsumo.road import Bend, Road, RoadSpec
from wzsumo.work_zone import WorkZone, WorkZoneLayout


def paper_road(**changes: object) -> Road:
    """Three 12 ft lanes between a 12 ft left and a 10 ft right shoulder, straight along +x."""
    spec = {"lane_count": 3, "left_shoulder_ft": 12, "right_shoulder_ft": 10, "length_ft": 5000}
    return RoadSpec.model_validate(spec | changes).build()


def two_lane_road(**changes: object) -> Road:
    """A 12 ft lane in each direction between shoulders of 6 ft, straight along +x."""
    spec = {"lane_count": 1, "opposing_lane_count": 1, "left_shoulder_ft": 6, "right_shoulder_ft": 6, "length_ft": 5000}
    return RoadSpec.model_validate(spec | changes).build()


def bent_road(radius_ft: float, *, arc_ft: float = 4100, **changes: object) -> Road:
    """The paper's cross-section on a straight, a transition and an arc; a positive radius turns left."""
    alignment = (
        Bend(length_ft=500),
        Bend(length_ft=400, end_radius_ft=radius_ft),
        Bend(length_ft=arc_ft, radius_ft=radius_ft),
    )
    return paper_road(length_ft=None, alignment=alignment, **changes)


def paper_work_zone(**changes: object) -> WorkZone:
    """60 mph, left lane and left shoulder closed, the other two lanes shifted by 12 ft and 11 ft wide."""
    spec = {
        "posted_speed_mph": 60, "start_ft": 800, "closed_lanes": (2,), "closed_shoulder": "left",
        "shift_ft": 12, "shifted_lane_width_ft": 11, "work_length_ft": 650,
    }  # fmt: skip
    return WorkZone.model_validate(spec | changes)


def paper_layout(**changes: object) -> WorkZoneLayout:
    """The paper's zone on the paper's road."""
    return lay_out(paper_work_zone(**changes), paper_road())


def interior_layout() -> WorkZoneLayout:
    """The paper's zone with the middle lane of three closed and no shift."""
    return paper_layout(closed_lanes=(1,), shift_ft=0, shifted_lane_width_ft=None)


def by_turns_layout() -> WorkZoneLayout:
    """A rural road of two lanes with the right one closed: both directions take turns on the other by a signal."""
    zone = paper_work_zone(
        posted_speed_mph=45, road_type="rural", closed_lanes=(0,), closed_shoulder="right", shift_ft=0,
        shifted_lane_width_ft=None, one_lane_two_way="signal",
    )  # fmt: skip
    return lay_out(zone, two_lane_road())


def straight_traces(
    offsets_m: Sequence[float] | FloatArray, *, length_m: float = 100.0, step_m: float = 2.0, speed_mps: float = 20.0
) -> pd.DataFrame:
    """A trace table: one vehicle an offset y, along +x from 0 to length_m."""
    x = np.arange(0.0, length_m + step_m / 2, step_m)
    traces = [
        pd.DataFrame({"vehicle_id": f"v{i:03d}", "time_s": x / speed_mps, "x_m": x, "y_m": float(y), "heading_rad": 0.0,
                      "speed_mps": speed_mps})
        for i, y in enumerate(offsets_m)
    ]  # fmt: skip
    return pd.concat(traces, ignore_index=True)


def vehicle_outlines(traces: pd.DataFrame) -> npt.NDArray[np.object_]:
    """Rectangles (n,) around the centres of a trace table with length_m and width_m."""
    along = (
        np.column_stack([np.cos(traces["heading_rad"]), np.sin(traces["heading_rad"])]) * traces[["length_m"]].to_numpy() / 2
    )
    across = along[:, ::-1] * [-1, 1] * (traces["width_m"] / traces["length_m"]).to_numpy()[:, None]
    centre = traces[["x_m", "y_m"]].to_numpy()
    corners = [centre - along - across, centre + along - across, centre + along + across, centre - along + across]
    return np.asarray(shapely.polygons(np.stack(corners, axis=1)))


def to_world(pose: npt.ArrayLike, points: npt.ArrayLike) -> FloatArray:
    """World points (n, 2) of points (n, 2) given in the frame of one pose (x, y, heading)."""
    x, y, heading = np.asarray(pose, dtype=float)
    cos, sin = np.cos(heading), np.sin(heading)
    return np.asarray(points, dtype=float) @ np.array([[cos, sin], [-sin, cos]]) + (x, y)


def lane_map_of(layout: WorkZoneLayout, *, sd_m: float = 0.1) -> LaneMap:
    """The map that knows a layout exactly, as if five vehicles had shown it within an hour of 2026-06-01."""
    made = laid_out_lanes(layout, sd_m=sd_m)
    lanes = tuple(replace(lane, n_traces=5) for lane in made.lanes)
    return replace(made, lanes=lanes, n_traces=5, first_time_s=1_780_322_400.0, last_time_s=1_780_326_000.0)
