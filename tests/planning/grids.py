"""Benchmark maps: a lane closure with a shift on 900 m of road, straight, turned or bent, as corridor or as cones alone.

Road coordinates: s along the road, d to the left. Left lane 13.2..16.8, right lane 9.6..13.2, 3.6 m of shoulder on either side;
stations of tapers follow MUTCD lengths at 60 mph (240, 720, 360, 650, 360, 100 ft with a tangent of 60 m).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import OccupancyGrid

LENGTH_M, WIDTH_M = 900.0, 30.0
START_S, GOAL_S, LANE_D = 10.0, 880.0, 15.0
DEVICE_LINE = ((20.0, 93.0, 313.0, 373.0, 482.0, 680.0, 790.0, 821.0), (20.4, 16.8, 13.2, 13.2, 9.6, 9.6, 13.2, 16.8))
OPEN_EDGE = ((373.0, 482.0, 680.0, 790.0), (9.6, 6.0, 6.0, 9.6))
CHANNELIZER_M, HOLE_S, DEAD_END_S = 0.5, (205.0, 217.0), 470.0
CONE_SPACING_M, CONE_RADIUS_M = 60 * 0.3048, 0.3

Pose = tuple[float, float, float]
Kind = Literal["corridor", "corridor_without_bait", "cones"]


@dataclass(frozen=True, kw_only=True)
class Alignment:
    """Where (s, d) lies in the world: the line d = 0 starts at the origin under `angle`, straight or bent to the left."""

    angle: float = 0.0
    radius_m: float | None = None

    def pose(self, s: float, d: float) -> Pose:
        if self.radius_m is None:
            x, y, turn = s, d, 0.0
        else:
            turn = s / self.radius_m
            x, y = (self.radius_m - d) * float(np.sin(turn)), self.radius_m - (self.radius_m - d) * float(np.cos(turn))
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        heading = float(np.arctan2(np.sin(turn + self.angle), np.cos(turn + self.angle)))
        return float(cos * x - sin * y), float(sin * x + cos * y), heading

    def to_sd(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        along, left = cos * x + sin * y, cos * y - sin * x
        if self.radius_m is None:
            return along, left
        turn = np.arctan2(along, self.radius_m - left)
        return np.where(turn < -0.5, turn + 2 * np.pi, turn) * self.radius_m, self.radius_m - np.hypot(
            along, self.radius_m - left
        )


def work_zone_grid(
    *,
    resolution: float = 0.25,
    kind: Kind = "corridor",
    alignment: Alignment | None = None,
) -> tuple[OccupancyGrid, Pose, Pose]:
    """Map, start and goal (rear axle): both lie in the left lane, which is closed between them."""
    road = alignment or Alignment()
    edge = [road.pose(s, d)[:2] for s in np.arange(0, LENGTH_M + 1, 5) for d in (0.0, WIDTH_M)]
    low = np.floor(np.min(edge, axis=0) / resolution) * resolution
    cols, rows = np.ceil((np.max(edge, axis=0) - low) / resolution - 1e-6).astype(int)
    occupied = np.empty((rows, cols), dtype=np.float32)
    x = low[0] + (np.arange(cols) + 0.5) * resolution
    for first in range(0, rows, 256):
        y = low[1] + (np.arange(first, min(first + 256, rows)) + 0.5) * resolution
        occupied[first : first + 256] = ~_free(*road.to_sd(x[None, :], y[:, None]), kind)
    grid = OccupancyGrid(p_occupied=occupied, resolution=resolution, origin=(float(low[0]), float(low[1])))
    return grid, road.pose(START_S, LANE_D), road.pose(GOAL_S, LANE_D)


def _free(s: FloatArray, d: FloatArray, kind: str) -> BoolArray:
    on_map = (s >= 0) & (s <= LENGTH_M)
    if kind == "cones":
        at = np.arange(DEVICE_LINE[0][0], DEVICE_LINE[0][-1], CONE_SPACING_M)
        # The nearest cone is one of two neighbours: the line is almost parallel to the road.
        index = np.clip(np.floor((s - at[0]) / CONE_SPACING_M).astype(int), 0, len(at) - 2)
        line = np.interp(at, *DEVICE_LINE)
        near = [np.hypot(s - at[i], d - line[i]) <= CONE_RADIUS_M for i in (index, index + 1)]
        return np.asarray(on_map & (d > 6.0) & (d < 20.4) & ~near[0] & ~near[1])
    line = np.interp(s, *DEVICE_LINE, right=20.4)
    free = (d > np.interp(s, *OPEN_EDGE)) & (d < line)
    if kind == "corridor":
        closed_lane = (s > 93.0) & (s < DEAD_END_S) & (d > line + CHANNELIZER_M) & (d < 16.8)
        hole = (s > HOLE_S[0]) & (s < HOLE_S[1]) & (d >= line) & (d < 16.8)
        free = free | closed_lane | hole
    return np.asarray(on_map & free)
