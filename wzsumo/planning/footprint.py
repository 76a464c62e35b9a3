"""Whether the exact outline of the vehicle, or a point, keeps off blocked cells.

Kernels work in metres from the map's lower-left corner; `x, y, heading` is the pose of the REAR AXLE. A cell is blocked where
the distance field is 0; everything outside the map is blocked.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.planning.distance_field import FieldArray
from wzsumo.vehicle import VehicleGeometry

N_DISCS = 4  # they cover 4.64 x 1.86 m with 0.17 m to spare; a fifth saves 0.05 m and costs a quarter more look-ups


class Body(NamedTuple):
    """A rectangle about the rear axle and the discs that cover it. Lengths in metres."""

    rear: float  # from the axle to the rear end, so 0 or below
    front: float  # from the axle to the front end
    half_width: float
    disc_radius: float
    disc_offsets: FloatArray  # (n,) from the axle to the discs' centres


POINT_BODY = Body(rear=0.0, front=0.0, half_width=0.0, disc_radius=0.0, disc_offsets=np.zeros(1))


def outline_body(vehicle: VehicleGeometry) -> Body:
    """The body that is a vehicle's outline."""
    share = vehicle.length_m / N_DISCS
    return Body(
        rear=-vehicle.rear_overhang_m,
        front=vehicle.axle_to_bumper_m,
        half_width=vehicle.width_m / 2,
        disc_radius=math.hypot(share / 2, vehicle.width_m / 2),
        disc_offsets=-vehicle.rear_overhang_m + share * np.arange(0.5, N_DISCS, dtype=np.float64),
    )


def inscribed_radius(body: Body) -> float:
    """Radius [m] of the largest disc about the rear axle inside the body: a free axle keeps at least that off blocked cells."""
    return min(-body.rear, body.front, body.half_width)


def sweep_margin(body: Body, *, step_m: float) -> float:
    """How far the front corner swings out between two outlines on an arc, one step apart: metres for each 1/m of curvature.

    The second outline is turned by curvature * step, so that the corner of the first stands out from it by
    front * curvature * step.
    """
    return body.front * step_m


@njit(cache=True, error_model="numpy")
def pose_is_free(
    distance: FieldArray, resolution: float, body: Body, x: float, y: float, heading: float, margin: float
) -> bool:
    """Whether the body, wider by `margin` on each side, touches no blocked cell: discs, then the exact outline."""
    rows, cols = distance.shape
    cos, sin = math.cos(heading), math.sin(heading)
    # A disc's centre lies up to half a cell diagonal, sqrt(1/2) of a cell, nearer to an obstacle than its cell's centre.
    needed = body.disc_radius + margin + resolution * 0.7072
    for offset in body.disc_offsets:
        col, row = math.floor((x + cos * offset) / resolution), math.floor((y + sin * offset) / resolution)
        if row < 0 or col < 0 or row >= rows or col >= cols or distance[row, col] <= 0.0:
            return False
        if distance[row, col] < needed:
            return _outline_is_free(distance, resolution, x, y, cos, sin, body.rear, body.front, body.half_width + margin)
    return True


@njit(cache=True, error_model="numpy")
def _outline_is_free(
    distance: FieldArray,
    resolution: float,
    x: float,
    y: float,
    cos: float,
    sin: float,
    rear: float,
    front: float,
    half_width: float,
) -> bool:
    """Whether the rectangle touches no blocked cell: every cell of every row that it crosses is looked at."""
    rows, cols = distance.shape
    first, last = rows_crossed(y, cos, sin, rear, front, half_width, resolution)
    if first < 0 or last >= rows:
        return False
    for row in range(first, last + 1):
        left, right = columns_crossed(x, y, cos, sin, rear, front, half_width, resolution, row)
        if left < 0 or right >= cols:
            return False
        for col in range(left, right + 1):
            if distance[row, col] <= 0.0:
                return False
    return True


@njit(cache=True, error_model="numpy")
def rows_crossed(
    y: float, cos: float, sin: float, rear: float, front: float, half_width: float, resolution: float
) -> tuple[int, int]:
    """First and last row of cells that the rectangle touches."""
    sideways = abs(cos) * half_width
    low, high = min(sin * rear, sin * front) - sideways, max(sin * rear, sin * front) + sideways
    return math.floor((y + low) / resolution), math.floor((y + high) / resolution)


@njit(cache=True, error_model="numpy")
def columns_crossed(
    x: float,
    y: float,
    cos: float,
    sin: float,
    rear: float,
    front: float,
    half_width: float,
    resolution: float,
    row: int,
) -> tuple[int, int]:
    """First and last cell of a row that the rectangle touches: its four sides, cut off at the row's two edges."""
    bottom, top = row * resolution, (row + 1) * resolution
    low, high = math.inf, -math.inf
    for side in range(4):
        ahead_0, left_0 = rear if side in (0, 3) else front, -half_width if side < 2 else half_width
        ahead_1, left_1 = rear if side >= 2 else front, -half_width if side in (0, 3) else half_width
        x_0, y_0 = x + cos * ahead_0 - sin * left_0, y + sin * ahead_0 + cos * left_0
        x_1, y_1 = x + cos * ahead_1 - sin * left_1, y + sin * ahead_1 + cos * left_1
        if y_0 > y_1:
            x_0, y_0, x_1, y_1 = x_1, y_1, x_0, y_0
        if y_1 < bottom or y_0 > top:
            continue
        slope = (x_1 - x_0) / (y_1 - y_0) if y_1 > y_0 else 0.0
        x_low = x_0 + slope * (bottom - y_0) if y_0 < bottom else x_0
        x_high = x_0 + slope * (top - y_0) if y_1 > top else x_1
        low, high = min(low, x_low, x_high), max(high, x_low, x_high)
    if low > high:  # rounding: the rectangle only just reaches the row
        return 1, 0
    return math.floor(low / resolution), math.floor(high / resolution)
