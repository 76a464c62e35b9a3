"""VoxelMap: a point map that finds the points near a place in constant time, by cubes in a hash table."""

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray, IntArray

MAX_CUBE_POINTS = 20  # a surface at a spacing of 0.3 cube edges puts 11 points into a cube. Chosen by us
INITIAL_CUBES = 4096
EMPTY = -1
MAX_CUBE_INDEX = 1 << 20  # cubes on either side of the origin along each axis: 21 bits of a key


class VoxelMap:
    """Points in cubes of edge `cube` [m], no two of one cube nearer than `spacing` [m]; the table grows as points are added."""

    def __init__(self, *, cube: float, spacing: float) -> None:
        self.cube = cube
        self.spacing = spacing
        self.cubes = 0
        self.keys: IntArray = np.full(4 * INITIAL_CUBES, EMPTY, dtype=np.int64)
        self.slots: IntArray = np.zeros(4 * INITIAL_CUBES, dtype=np.int64)
        self.counts: IntArray = np.zeros(INITIAL_CUBES, dtype=np.int64)
        self.stored: FloatArray = np.zeros((INITIAL_CUBES, MAX_CUBE_POINTS, 3))

    def insert(self, points: FloatArray) -> None:
        """Add points (n, 3); points too near to a kept one and points of full cubes are left out."""
        done = 0
        while done < len(points):
            self.cubes, done = _insert(
                np.ascontiguousarray(points), done, self.keys, self.slots, self.counts, self.stored, self.cubes,
                np.array([self.cube, self.spacing]),
            )  # fmt: skip
            if done < len(points):
                self._grow()

    @property
    def points(self) -> FloatArray:
        """All kept points (n, 3)."""
        kept = np.arange(MAX_CUBE_POINTS) < self.counts[: self.cubes, None]
        return np.asarray(self.stored[: self.cubes][kept])

    def __len__(self) -> int:
        return int(self.counts[: self.cubes].sum())

    def _grow(self) -> None:
        """Double the number of cubes."""
        self.counts = np.concatenate([self.counts, np.zeros_like(self.counts)])
        self.stored = np.concatenate([self.stored, np.zeros_like(self.stored)])
        used = self.keys != EMPTY
        keys, slots = self.keys[used], self.slots[used]
        self.keys = np.full(2 * len(self.keys), EMPTY, dtype=np.int64)
        self.slots = np.zeros(len(self.keys), dtype=np.int64)
        _rehash(keys, slots, self.keys, self.slots)


@njit(cache=True, error_model="numpy", nogil=True)
def key_of(x: int, y: int, z: int) -> int:
    """The key of the cube at integer coordinates below MAX_CUBE_INDEX."""
    return ((x + MAX_CUBE_INDEX) << 42) | ((y + MAX_CUBE_INDEX) << 21) | (z + MAX_CUBE_INDEX)


@njit(cache=True, error_model="numpy", nogil=True)
def find(key: int, keys: IntArray) -> int:
    """Place of a key in the table, or of the empty entry where it belongs (linear probing)."""
    mask = len(keys) - 1
    mixed = key * 0x9E3779B97F4A7C15  # Fibonacci hashing, Knuth vol. 3, 6.4
    place = (mixed ^ (mixed >> 32)) & mask
    while keys[place] not in (EMPTY, key):
        place = (place + 1) & mask
    return place


@njit(cache=True, error_model="numpy", nogil=True)
def _insert(
    points: FloatArray, first: int, keys: IntArray, slots: IntArray, counts: IntArray, stored: FloatArray, cubes: int,
    size: FloatArray,
) -> tuple[int, int]:  # fmt: skip
    """(number of cubes in use, index of the first point that needs a new cube where there is none left)."""
    too_near = size[1] ** 2
    for i in range(first, len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        key = key_of(int(np.floor(x / size[0])), int(np.floor(y / size[0])), int(np.floor(z / size[0])))
        place = find(key, keys)
        if keys[place] == EMPTY:
            if cubes == len(counts):
                return cubes, i
            keys[place], slots[place] = key, cubes
            cubes += 1
        slot = slots[place]
        free = counts[slot] < MAX_CUBE_POINTS
        for k in range(counts[slot]):
            apart = (stored[slot, k, 0] - x) ** 2 + (stored[slot, k, 1] - y) ** 2 + (stored[slot, k, 2] - z) ** 2
            free = free and apart >= too_near
        if free:
            stored[slot, counts[slot], 0], stored[slot, counts[slot], 1], stored[slot, counts[slot], 2] = x, y, z
            counts[slot] += 1
    return cubes, len(points)


@njit(cache=True, error_model="numpy", nogil=True)
def _rehash(old_keys: IntArray, old_slots: IntArray, keys: IntArray, slots: IntArray) -> None:
    for i in range(len(old_keys)):
        place = find(old_keys[i], keys)
        keys[place], slots[place] = old_keys[i], old_slots[i]
