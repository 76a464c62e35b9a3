"""How far each cell of a map is from the nearest blocked cell; everything outside the map counts as blocked.

The distance runs from the CENTRE of a cell to the nearest point of a blocked cell's SQUARE. Any point of a cell is therefore at
most half a cell diagonal nearer to an obstacle than the field says.
"""

import math

import numpy as np
import numpy.typing as npt
from numba import njit

FieldArray = npt.NDArray[np.float32]


def distance_field(p_occupied: FieldArray, *, max_p_occupied: float, resolution: float, limit_m: float) -> FieldArray:
    """Distances (rows, cols) [m] to the nearest cell with p_occupied >= max_p_occupied, 0 in such a cell, at most `limit_m`.

    Squared distances are separable: along y first, then along x the least sum inside a window as wide as the limit.
    Source: Felzenszwalb and Huttenlocher, Distance Transforms of Sampled Functions, 2012 (the separation, not their scan).
    """
    reach = max(1, math.ceil(limit_m / resolution + 0.5))
    field = np.empty(p_occupied.shape, dtype=np.float32)  # by NumPy, not by the kernel: NumPy asks the system for large pages
    _fill_distances(field, p_occupied, np.float32(max_p_occupied), np.float32(resolution), reach, np.float32(limit_m))
    return field


# fastmath lets the compiler turn the loops over a row into vector code; no value in them is infinite or nan.
@njit(cache=True, error_model="numpy", fastmath=True)
def _fill_distances(  # noqa: C901 - one pass over the cells: a call in it costs more than reading it
    field: FieldArray,
    p_occupied: FieldArray,
    max_p_occupied: np.float32,
    resolution: np.float32,
    reach: int,
    limit_m: np.float32,
) -> None:
    """Distances along y, then their squares, then the result, all in the same memory: touching more of it costs time."""
    rows, cols = p_occupied.shape
    far, half, one, none = np.float32(reach + 0.5), np.float32(0.5), np.float32(1.0), np.float32(0.0)
    # Up and down the columns: 0 in a blocked cell, 1/2 beside it, then one more a row. Beyond both ends lies a blocked row.
    nearest = np.empty(cols, dtype=np.float32)
    for col in range(cols):
        nearest[col] = none
    for row in range(rows):
        for col in range(cols):
            beside = nearest[col] + (half if nearest[col] == none else one)
            nearest[col] = none if p_occupied[row, col] >= max_p_occupied else min(beside, far)
            field[row, col] = nearest[col]
    for col in range(cols):
        nearest[col] = none
    for row in range(rows - 1, -1, -1):
        for col in range(cols):
            beside = nearest[col] + (half if nearest[col] == none else one)
            nearest[col] = min(field[row, col], beside)
            field[row, col] = nearest[col] * nearest[col]
    line, best = np.empty(cols + 2 * reach, dtype=np.float32), np.empty(cols, dtype=np.float32)
    for col in range(cols + 2 * reach):
        line[col] = far * far
    line[reach - 1] = line[reach + cols] = none
    for row in range(rows):
        for col in range(cols):
            best[col] = line[reach + col] = field[row, col]
        for shift in range(1, reach + 1):
            away = (np.float32(shift) - half) * (np.float32(shift) - half)
            left, right = line[reach - shift : reach - shift + cols], line[reach + shift : reach + shift + cols]
            for col in range(cols):
                best[col] = min(best[col], min(left[col], right[col]) + away)
        for col in range(cols):
            field[row, col] = min(np.sqrt(best[col]) * resolution, limit_m)
