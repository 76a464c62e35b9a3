"""In which azimuth columns of a turn the rays can hit each solid, while the sensor moves."""

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray, IntArray

ANGLE_MARGIN_RAD = 1e-6  # against rounding


def columns_touched(spheres: FloatArray, poses: FloatArray, azimuth: FloatArray) -> tuple[IntArray, IntArray]:
    """First and last column (n,) whose rays can touch each of the bounding spheres (n, 4): x, y, z, radius [m].

    The last column may exceed the number of columns; it then wraps around. `poses` (columns, 4, 4) are the sensor's, one for
    each azimuth (columns,) [rad]. A sphere's bearing is computed at the start, the middle and the end of the turn. The sensor
    moves almost straight, so the bearing sweeps between these three; the half width is that at the nearest approach.
    """
    count = len(azimuth)
    bearing, range_ = [], []
    for pose in (poses[0], poses[count // 2], poses[-1]):
        local = (spheres[:, :3] - pose[:3, 3]) @ pose[:3, :3]
        bearing.append(np.arctan2(local[:, 1], local[:, 0]))
        range_.append(np.hypot(local[:, 0], local[:, 1]))
    travelled = float(np.linalg.norm(poses[-1, :3, 3] - poses[0, :3, 3]))
    nearest = np.min(range_, axis=0) - travelled / 4  # between two of the three poses the sensor is at most this much nearer
    inside = nearest <= spheres[:, 3] * 1.01  # the sensor may be inside the sphere: every column touches it
    half = np.arcsin(np.clip(spheres[:, 3] / np.where(inside, 1.0, nearest), 0, 1)) + ANGLE_MARGIN_RAD
    offset = [np.mod(b - bearing[0] + np.pi, 2 * np.pi) - np.pi for b in bearing]
    # Between the three samples a bearing may exceed them by a quarter of what it turns from one to the next.
    swing = np.max(np.abs(np.diff(offset, axis=0)), axis=0) / 4
    low, high = np.min(offset, axis=0) - swing - half, np.max(offset, axis=0) + swing + half
    step = 2 * np.pi / count
    start = np.mod(bearing[0] + low - azimuth[0], 2 * np.pi) / step
    first = np.floor(start).astype(np.int64)
    last = np.ceil(start + (high - low) / step).astype(np.int64)
    whole = inside | (last - first >= count)
    return np.where(whole, 0, first), np.where(whole, count - 1, last)


def sorted_into_columns(first: IntArray, last: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """(start (count + 1,), members): the solids that column j can touch are members[start[j] : start[j + 1]]."""
    count_of = np.zeros(count + 1, dtype=np.int64)
    _count_columns(first, last, count_of)
    start = np.cumsum(count_of)
    members = np.empty(start[-1], dtype=np.int64)
    _fill_columns(first, last, start.copy(), members)
    return start, members


@njit(cache=True, error_model="numpy")
def _count_columns(first: IntArray, last: IntArray, count_of: IntArray) -> None:
    """Add the number of solids of column j to count_of[j + 1]."""
    for solid in range(len(first)):
        for column in range(first[solid], last[solid] + 1):
            count_of[column % (len(count_of) - 1) + 1] += 1


@njit(cache=True, error_model="numpy")
def _fill_columns(first: IntArray, last: IntArray, place: IntArray, members: IntArray) -> None:
    """Write the index of each solid to the next free place of each of its columns."""
    for solid in range(len(first)):
        for column in range(first[solid], last[solid] + 1):
            j = column % (len(place) - 1)
            members[place[j]] = solid
            place[j] += 1
