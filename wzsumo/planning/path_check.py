"""Contact, clearance and p(occupied) of the exact outline along a path, in metres from the map's lower-left corner."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.path import ReferencePath
from wzsumo.planning.footprint import Body, columns_crossed, pose_is_free, rows_crossed
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.planning_field import from_corner, terrain_on
from wzsumo.planning.terrain import Terrain
from wzsumo.vehicle import VehicleGeometry


@dataclass(frozen=True, kw_only=True)
class Exposure:
    """Clearance and p(occupied) of the outline along a path."""

    min_clearance_m: float  # from the outline to the nearest blocked cell or the map's edge; at most the limit of measurement
    max_p_occupied: float  # largest p(occupied) of a cell that the outline touches; 1 beyond the map
    risk_m: float  # integral along the path of the largest p(occupied) under the outline


def exposure_along(poses: FloatArray, *, max_p_occupied: float, terrain: Terrain, body: Body, limit_m: float) -> Exposure:
    """The exposure of a body along poses (n, 3)."""
    p_under = _max_p_under(poses, terrain, body)
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    return Exposure(
        min_clearance_m=_min_clearance(poses, max_p_occupied, terrain, body, limit_m),
        max_p_occupied=float(p_under.max()),
        risk_m=float(np.sum(steps * (p_under[1:] + p_under[:-1]) / 2)),
    )


def free_until(
    path: ReferencePath, grid: OccupancyGrid, *, start_m: float, vehicle: VehicleGeometry, spec: PlannerSpec
) -> float:
    """Station [m] along the path up to which, from `start_m` on, the body touches no blocked cell of the map."""
    terrain, body = terrain_on(grid, vehicle=vehicle, spec=spec, guide=None)
    first = min(int(np.searchsorted(path.arc_length, start_m)), len(path.poses) - 2)
    poses = np.array([from_corner(grid, (float(x), float(y), float(h))) for x, y, h in path.poses[first:]])
    touching = np.flatnonzero(touching_poses(poses, 0.0, terrain, body))
    return float(path.arc_length[-1] if not touching.size else path.arc_length[first + max(int(touching[0]) - 1, 0)])


def poses_through(points: FloatArray, *, ends: FloatArray) -> FloatArray:
    """Poses (n, 3) at points (n, 2), headed along the chord between the neighbours; `ends` (2,) are the headings there."""
    chords = points[2:] - points[:-2]
    headings = np.concatenate([ends[:1], np.arctan2(chords[:, 1], chords[:, 0]), ends[1:]])
    return np.column_stack([points, headings])


def touching_poses(poses: FloatArray, sweep_margin: float, terrain: Terrain, body: Body) -> BoolArray:
    """At which poses (n, 3) the body, wider by `sweep_margin` times the curvature there, touches a blocked cell (n,)."""
    return _touching(poses, sweep_margin * np.abs(ReferencePath(poses=poses).curvature), terrain, body)


@njit(cache=True, error_model="numpy")
def _touching(poses: FloatArray, margins: FloatArray, terrain: Terrain, body: Body) -> BoolArray:
    touching = np.empty(len(poses), dtype=np.bool_)
    for i in range(len(poses)):
        x, y, heading = poses[i, 0], poses[i, 1], poses[i, 2]
        touching[i] = not pose_is_free(terrain.distance, terrain.resolution, body, x, y, heading, margins[i])
    return touching


@njit(cache=True, error_model="numpy")
def cost_along(poses: FloatArray, terrain: Terrain) -> float:
    """Cost of a path: length times multiplier at the axle, infinite off the map."""
    rows, cols = terrain.multiplier.shape
    total = 0.0
    for i in range(1, len(poses)):
        d_x, d_y = poses[i, 0] - poses[i - 1, 0], poses[i, 1] - poses[i - 1, 1]
        row, col = math.floor(poses[i, 1] / terrain.resolution) + 1, math.floor(poses[i, 0] / terrain.resolution) + 1
        if not (0 <= row < rows and 0 <= col < cols):
            return math.inf
        total += math.sqrt(d_x * d_x + d_y * d_y) * terrain.multiplier[row, col]
    return total


@njit(cache=True, error_model="numpy")
def _max_p_under(poses: FloatArray, terrain: Terrain, body: Body) -> FloatArray:
    """Largest p (n,) of the cells that the outline touches at each pose; 1 where it leaves the map."""
    p_occupied, resolution = terrain.p_occupied, terrain.resolution
    rows, cols = p_occupied.shape
    rear, front, half_width = body.rear, body.front, body.half_width
    largest = np.zeros(len(poses))
    for i in range(len(poses)):
        x, y, cos, sin = poses[i, 0], poses[i, 1], math.cos(poses[i, 2]), math.sin(poses[i, 2])
        first, last = rows_crossed(y, cos, sin, rear, front, half_width, resolution)
        for row in range(first, last + 1):
            left, right = columns_crossed(x, y, cos, sin, rear, front, half_width, resolution, row)
            if row < 0 or row >= rows or left < 0 or right >= cols:
                largest[i] = 1.0
                break
            for col in range(left, right + 1):
                largest[i] = max(largest[i], p_occupied[row, col])
    return largest


@njit(cache=True, error_model="numpy")
def _min_clearance(poses: FloatArray, max_p_occupied: float, terrain: Terrain, body: Body, limit_m: float) -> float:
    """Least distance [m] of the outline from a blocked cell, at most `limit_m`.

    The pose whose discs are nearest comes first: its distance leaves few other poses to be looked at.
    """
    p_occupied, resolution, best = terrain.p_occupied, terrain.resolution, limit_m
    rows, cols = p_occupied.shape
    bounds = np.full(len(poses), math.inf)
    for i in range(len(poses)):
        x, y, cos, sin = poses[i, 0], poses[i, 1], math.cos(poses[i, 2]), math.sin(poses[i, 2])
        for offset in body.disc_offsets:
            row, col = math.floor((y + sin * offset) / resolution), math.floor((x + cos * offset) / resolution)
            inside = 0 <= row < rows and 0 <= col < cols
            away = terrain.distance[row, col] if inside else 0.0
            bounds[i] = min(bounds[i], away - body.disc_radius - resolution * 0.7072)
    for i in np.argsort(bounds):
        if bounds[i] >= best:
            break
        x, y, cos, sin = poses[i, 0], poses[i, 1], math.cos(poses[i, 2]), math.sin(poses[i, 2])
        # Cells that the outline would touch if it were larger by the least distance so far on all sides.
        rear, front, half_width = body.rear - best, body.front + best, body.half_width + best
        first, last = rows_crossed(y, cos, sin, rear, front, half_width, resolution)
        for row in range(first, last + 1):
            col, last_col = columns_crossed(x, y, cos, sin, rear, front, half_width, resolution, row)
            while col <= last_col:
                if 0 <= row < rows and 0 <= col < cols and p_occupied[row, col] < max_p_occupied:
                    # No blocked cell is nearer than the field says.
                    col += max(1, int(terrain.distance[row, col] / resolution))
                    continue
                ahead = cos * ((col + 0.5) * resolution - x) + sin * ((row + 0.5) * resolution - y)
                left = cos * ((row + 0.5) * resolution - y) - sin * ((col + 0.5) * resolution - x)
                best = min(best, _gap(ahead, left, cos, sin, resolution / 2, body, best))
                col += 1
    return best


@njit(cache=True, error_model="numpy")
def _gap(ahead: float, left: float, cos: float, sin: float, half_cell: float, body: Body, best: float) -> float:
    """Distance, if below `best`, between the outline and a square cell centred at (ahead, left) of the axle; 0 on contact.

    Two convex outlines that do not meet are nearest at a corner of one of them.
    """
    out, side = max(body.rear - ahead, ahead - body.front, 0.0), max(abs(left) - body.half_width, 0.0)
    if out * out + side * side > (best + half_cell * 1.4143) ** 2:
        return best
    if _meet(ahead, left, cos, sin, half_cell, body):
        return 0.0
    nearest = best
    for along in (-half_cell, half_cell):
        for across in (-half_cell, half_cell):
            corner_ahead, corner_left = ahead + cos * along + sin * across, left + cos * across - sin * along
            out = max(body.rear - corner_ahead, corner_ahead - body.front, 0.0)
            side = max(abs(corner_left) - body.half_width, 0.0)
            nearest = min(nearest, math.sqrt(out * out + side * side))
    for end in (body.rear, body.front):
        for flank in (-body.half_width, body.half_width):
            d_x, d_y = cos * (end - ahead) - sin * (flank - left), sin * (end - ahead) + cos * (flank - left)
            out, side = max(abs(d_x) - half_cell, 0.0), max(abs(d_y) - half_cell, 0.0)
            nearest = min(nearest, math.sqrt(out * out + side * side))
    return nearest


@njit(cache=True, error_model="numpy")
def _meet(ahead: float, left: float, cos: float, sin: float, half_cell: float, body: Body) -> bool:
    """Whether outline and square overlap: no axis of either separates them."""
    reach = half_cell * (abs(cos) + abs(sin))
    out, side = max(body.rear - ahead, ahead - body.front), abs(left) - body.half_width
    from_middle, half_length = ahead - (body.rear + body.front) / 2, (body.front - body.rear) / 2
    d_x, d_y = cos * from_middle - sin * left, sin * from_middle + cos * left
    extent_x = half_length * abs(cos) + body.half_width * abs(sin) + half_cell
    extent_y = half_length * abs(sin) + body.half_width * abs(cos) + half_cell
    return out <= reach and side <= reach and abs(d_x) <= extent_x and abs(d_y) <= extent_y
