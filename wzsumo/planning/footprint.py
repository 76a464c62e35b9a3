# ruff: noqa: PLR0917  (kernels take many plain arguments by position)
"""Whether the exact outline of the vehicle, or a point, keeps off blocked cells, and how far it stays from them.

Kernels work in metres from the map's lower-left corner; `x, y, heading` is the REAR AXLE. A cell is blocked where the distance
field is 0, and so is everything outside the map. A `body` is a float64 array: rear end, front end and half width of the
outline about the axle, radius of the covering discs, then the discs' offsets along the axis.
"""

import math

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.planning.distance_field import FieldArray
from wzsumo.vehicle import VehicleGeometry

N_DISCS = 4  # cover 4.64 x 1.86 m with 0.17 m to spare; a fifth saves 0.05 m and costs a quarter more look-ups
REAR, FRONT, HALF_WIDTH, RADIUS, FIRST_DISC = range(5)
POINT_BODY = np.zeros(FIRST_DISC + 1)


def outline_body(vehicle: VehicleGeometry) -> FloatArray:
    """The body of a vehicle's outline."""
    share = vehicle.length_m / N_DISCS
    offsets = -vehicle.rear_overhang_m + share * (np.arange(N_DISCS) + 0.5)
    radius = math.hypot(share / 2, vehicle.width_m / 2)
    return np.array([-vehicle.rear_overhang_m, vehicle.axle_to_bumper_m, vehicle.width_m / 2, radius, *offsets])


def inscribed_radius(body: FloatArray) -> float:
    """Radius [m] of the largest disc about the rear axle inside the body: no axle position is nearer to a blocked cell."""
    return float(min(-body[REAR], body[FRONT], body[HALF_WIDTH]))


def sweep_margin(body: FloatArray, *, curvature: float, step_m: float) -> float:
    """Distance [m] that the front corner swings beyond the outlines at both ends of a step along an arc.

    The corner at distance `front` ahead of the axle stands out sideways by front * curvature * step at one end and
    not at all at the other; half of it in between.
    """
    return float(body[FRONT] * abs(curvature) * step_m / 2)


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def pose_is_free(
    field: FieldArray, resolution: float, x: float, y: float, heading: float, body: FloatArray, margin: float
) -> bool:
    """Whether the body, wider by `margin` on each side, touches no blocked cell: discs, then the exact outline."""
    rows, cols = field.shape
    cos, sin = math.cos(heading), math.sin(heading)
    # A disc's centre lies up to half a cell diagonal nearer to an obstacle than its cell's centre.
    needed = body[RADIUS] + margin + resolution * 0.7072
    for disc in range(FIRST_DISC, len(body)):
        col = math.floor((x + cos * body[disc]) / resolution)
        row = math.floor((y + sin * body[disc]) / resolution)
        if row < 0 or col < 0 or row >= rows or col >= cols or field[row, col] <= 0.0:
            return False
        if field[row, col] < needed:
            return outline_is_free(field, resolution, x, y, cos, sin, body[REAR], body[FRONT], body[HALF_WIDTH] + margin)
    return True


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def outline_is_free(
    field: FieldArray,
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
    rows, cols = field.shape
    reach_up = max(sin * rear, sin * front) + abs(cos) * half_width
    reach_down = min(sin * rear, sin * front) - abs(cos) * half_width
    first, last = math.floor((y + reach_down) / resolution), math.floor((y + reach_up) / resolution)
    if first < 0 or last >= rows:
        return False
    for row in range(first, last + 1):
        low, high = row_span(x, y, cos, sin, rear, front, half_width, row * resolution, (row + 1) * resolution)
        left, right = math.floor(low / resolution), math.floor(high / resolution)
        if left < 0 or right >= cols:
            return False
        for col in range(left, right + 1):
            if field[row, col] <= 0.0:
                return False
    return True


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def row_span(
    x: float,
    y: float,
    cos: float,
    sin: float,
    rear: float,
    front: float,
    half_width: float,
    bottom: float,
    top: float,
) -> tuple[float, float]:
    """Least and largest x of the rectangle between two heights; (inf, -inf) where it is not there."""
    xs = (
        x + cos * rear + sin * half_width,
        x + cos * front + sin * half_width,
        x + cos * front - sin * half_width,
        x + cos * rear - sin * half_width,
    )
    ys = (
        y + sin * rear - cos * half_width,
        y + sin * front - cos * half_width,
        y + sin * front + cos * half_width,
        y + sin * rear + cos * half_width,
    )
    low, high = math.inf, -math.inf
    for corner in range(4):
        x_0, y_0, x_1, y_1 = xs[corner], ys[corner], xs[(corner + 1) % 4], ys[(corner + 1) % 4]
        if y_0 > y_1:
            x_0, y_0, x_1, y_1 = x_1, y_1, x_0, y_0
        if y_1 < bottom or y_0 > top:
            continue
        slope = (x_1 - x_0) / (y_1 - y_0) if y_1 > y_0 else 0.0
        x_low = x_0 + slope * (bottom - y_0) if y_0 < bottom else x_0
        x_high = x_0 + slope * (top - y_0) if y_1 > top else x_1
        low, high = min(low, x_low, x_high), max(high, x_low, x_high)
    return low, high
