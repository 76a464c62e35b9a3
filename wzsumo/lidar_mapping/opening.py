"""Greyscale opening of a surface by a disk, by row-wise minima and maxima that grow with the disk's chords."""

import numpy as np
import numpy.typing as npt
from numba import njit

from wzsumo.frames import FloatArray


def open_by_disk(surface: FloatArray, *, radius: int) -> FloatArray:
    """The opening (rows, cols) of a surface by the disk dx^2 + dy^2 <= radius^2 [cells]: dilation of the erosion.

    Cells beyond the border count for nothing, as in Matlab's imopen and scipy's grey_opening on a surface padded with
    +inf before the erosion and -inf before the dilation.
    """
    chords = np.floor(np.sqrt(radius**2 - np.arange(radius + 1.0) ** 2) + 1e-9).astype(np.int64)
    eroded = _erode(np.ascontiguousarray(surface, dtype=np.float64), chords)
    return np.asarray(-_erode(-eroded, chords))  # dilation is the erosion of the negative


@njit(cache=True, error_model="numpy", nogil=True)
def _erode(surface: FloatArray, chords: npt.NDArray[np.int64]) -> FloatArray:
    """Minimum over the disk whose row at distance dy reaches chords[dy] cells to either side.

    `running` holds the minimum over [-w, w] of each row, for w growing from 0: the union of [-w, w - 2] and [-w + 2, w] is
    [-w, w] from w = 2 on, so each step costs one minimum a cell; every dy takes it when w has grown to its chord.
    """
    rows, cols = surface.shape
    radius = chords.size - 1
    running, grown = surface.copy(), surface.copy()
    eroded = np.full((rows, cols), np.inf)
    for w in range(radius + 1):
        if w > 0:
            for row in range(rows):
                _grow_row(running[row], grown[row], w)
            running, grown = grown, running
        for dy in range(radius + 1):
            if chords[dy] != w:
                continue
            for row in range(rows):
                if row + dy < rows:
                    _take_minimum(eroded[row], running[row + dy])
                if dy > 0 and row >= dy:
                    _take_minimum(eroded[row], running[row - dy])
    return eroded


@njit(cache=True, error_model="numpy", inline="always")
def _take_minimum(target: FloatArray, other: FloatArray) -> None:
    for col in range(target.size):
        target[col] = other[col] if other[col] < target[col] else target[col]


@njit(cache=True, error_model="numpy", inline="always")
def _grow_row(running: FloatArray, grown: FloatArray, w: int) -> None:
    cols = running.size
    for col in range(1, cols - 1):
        left, right = running[col - 1], running[col + 1]
        grown[col] = left if left < right else right
    # At the borders one of the two halves is cut off; what is left of the other holds what is left of the window.
    grown[0], grown[cols - 1] = running[0], running[cols - 1]
    if cols > 1:
        grown[0], grown[cols - 1] = min(running[0], running[1]), min(running[cols - 1], running[cols - 2])
    if w == 1:
        _take_minimum(grown, running)
