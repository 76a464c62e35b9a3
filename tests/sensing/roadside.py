"""A straight road, a line of cones on it and a drive past them."""

import numpy as np
import pandas as pd

from wzsumo.road import Road, RoadSpec
from wzsumo.sensing.ground import GroundSpec
from wzsumo.sensing.lidar import Drive

SMOOTH = GroundSpec(grade_pct=2.0, cross_slope_pct=2.0, road_roughness_m=0.0, verge_roughness_m=0.0)
LEVEL = GroundSpec(grade_pct=0, cross_slope_pct=0, road_roughness_m=0, verge_roughness_m=0)


def straight_road(length_ft: float = 700) -> Road:
    """Two 12 ft lanes, the left edge of the pavement at y = 9.14 m, the right one at y = -3.05 m."""
    return RoadSpec(lane_count=2, left_shoulder_ft=6, right_shoulder_ft=10, length_ft=length_ft).build()


def cone_line(n: int = 12, kind: str = "cone_36in") -> pd.DataFrame:
    """Devices every 10 m from x = 20 m on."""
    return pd.DataFrame({"kind": kind, "x_m": 20.0 + 10 * np.arange(n), "y_m": 7.5, "height_m": 0.914, "radius_m": 0.178})


def steady_drive(speed: float = 10.0, seconds: float = 6.0, yaw_rate: float = 0.0) -> Drive:
    """A drive from (20, 1.8) along +x, turning at a constant rate."""
    t = np.linspace(0, seconds, 301)
    heading = yaw_rate * t
    step = np.column_stack([np.cos(heading), np.sin(heading)]) * speed * (t[1] - t[0])
    xy = np.array([20.0, 1.8]) + np.vstack([[0.0, 0.0], np.cumsum(step[:-1], axis=0)])
    return Drive(time_s=t, poses=np.column_stack([xy, heading]))
