"""Lines and planes fitted to the map points around each feature: what a scan point is drawn to (Zhang & Singh 2014, V-B)."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray, IntArray
from wzsumo.lidar_mapping.voxel_map import EMPTY, VoxelMap, find, key_of

NEIGHBOURS = 8  # map points a patch is fitted to; five in LOAM, more steady the normal
FEWEST = 5
FLATNESS = 0.1  # smallest over middle eigenvalue of a plane, at most
SPREAD = 0.04  # middle over largest eigenvalue of a plane, at least: points of one scan line span no plane
SLENDERNESS = 3.0  # largest over middle eigenvalue of a line, at least: LOAM's own test
_STEPS = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
AROUND = _STEPS[np.argsort(np.abs(_STEPS).sum(axis=1), kind="stable")]  # a cube and those around it, the nearest first


class Shape(IntEnum):
    """What neighbours may form; ANY takes a plane, a line or, where they form neither, their mean.

    GROUND takes planes, and of each the distance along their common normal alone.
    """

    LINE = 1
    PLANE = 2
    ANY = 3
    GROUND = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Patches:
    """For each of n features: `centre` (n, 3) of its patch, `projector` (n, 3, 3) onto the directions away from it.

    The projector is nn' for a plane with normal n, I - dd' for a line along d and I for a point; of directions that are known
    less well than others (`post_map`) it takes a share. `dimension` counts the directions: 0 where no patch was found. `share`
    (n,) is 1 over the count of features drawn to the same cube of the map, or to the same post.
    """

    centre: FloatArray
    projector: FloatArray
    dimension: IntArray
    share: FloatArray


def fit_patches(features: FloatArray, target: VoxelMap, *, shape: Shape, radius: float) -> Patches:
    """Patches around features (n, 3) given in the map's frame, from map points within `radius` <= the map's cube [m]."""
    n = len(features)
    centre, axis, projector = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3, 3))
    dimension, cube = np.zeros(n, dtype=np.int64), np.full(n, EMPTY, dtype=np.int64)
    _fit(
        np.ascontiguousarray(features), target.keys, target.slots, target.counts, target.stored,
        np.array([target.cube, min(radius, target.cube), float(shape)]), centre, axis, dimension, cube,
    )  # fmt: skip
    planes, lines = dimension == 1, dimension == 2
    if shape is Shape.GROUND and planes.any():
        centre[planes], axis[planes] = _levelled(features[planes], centre[planes], axis[planes])
    projector[planes] = axis[planes, :, None] * axis[planes, None, :]
    projector[dimension > 1] = np.eye(3)
    projector[lines] -= axis[lines, :, None] * axis[lines, None, :]
    found = cube[dimension > 0]
    share = np.zeros(n)
    if found.size:
        share[dimension > 0] = 1 / np.bincount(found)[found]
    return Patches(centre=centre, projector=projector, dimension=dimension, share=share)


def _levelled(features: FloatArray, centre: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(centre, normal) of planes across the commonest normal, each through the foot of its feature on the plane fitted.

    The normals of a road differ by noise. Each difference would count as knowledge of where the scan is ALONG the road,
    and thousands of them, all drawn to the rings of the scan before, outvote a line of cones. So ground speaks of height,
    roll and pitch alone, as in Shan & Englot 2018 (LeGO-LOAM).
    """
    aligned = normals * np.where(normals[:, 2] < 0, -1.0, 1.0)[:, None]
    common = np.median(aligned, axis=0)
    common /= max(float(np.linalg.norm(common)), 1e-9)
    gap = np.einsum("ni,ni->n", features - centre, aligned) / np.maximum(aligned @ common, 0.1)
    return features - gap[:, None] * common, np.broadcast_to(common, normals.shape)


@njit(cache=True, error_model="numpy", nogil=True)
def _fit(
    features: FloatArray, keys: IntArray, slots: IntArray, counts: IntArray, stored: FloatArray, size: FloatArray,
    centre: FloatArray, axis: FloatArray, dimension: IntArray, cube: IntArray,
) -> None:  # fmt: skip
    """Fill the outputs: `axis` is a plane's normal or a line's direction.

    `size` = the map's cube [m], radius of the search [m], Shape.
    """
    near = np.empty((NEIGHBOURS, 3))
    for i in range(len(features)):
        found, nearest_slot = _nearest(features[i], keys, slots, counts, stored, size, near)
        if found < FEWEST:
            continue
        mean, values, vectors = _principal_axes(near[:found])
        flat = values[0] <= FLATNESS * values[1] and values[1] >= SPREAD * values[2]
        slender = values[2] >= SLENDERNESS * values[1]
        kind = int(size[2])
        if kind & 2 and flat:
            dimension[i], column = 1, 0
        elif kind & 1 and slender:
            dimension[i], column = 2, 2
        elif kind == 3:
            dimension[i], column = 3, 2
        else:
            continue
        for a in range(3):
            centre[i, a] = mean[a]
            axis[i, a] = vectors[a, column]
        cube[i] = nearest_slot


@njit(cache=True, error_model="numpy", nogil=True)
def _nearest(
    feature: FloatArray, keys: IntArray, slots: IntArray, counts: IntArray, stored: FloatArray, size: FloatArray,
    near: FloatArray,
) -> tuple[int, int]:  # fmt: skip
    """(count of the nearest map points written to `near`, slot of the cube that holds the very nearest).

    The feature's own cube comes first; of those around it only the ones that reach nearer than what is found already.
    """
    apart = np.empty(NEIGHBOURS)
    found, home = 0, EMPTY
    limit = size[1] ** 2
    x, y, z = feature
    own_x, own_y, own_z = int(np.floor(x / size[0])), int(np.floor(y / size[0])), int(np.floor(z / size[0]))
    for step in range(len(AROUND)):
        cube_x, cube_y, cube_z = own_x + AROUND[step, 0], own_y + AROUND[step, 1], own_z + AROUND[step, 2]
        gap_x = _gap(x, cube_x * size[0], size[0])
        gap_y, gap_z = _gap(y, cube_y * size[0], size[0]), _gap(z, cube_z * size[0], size[0])
        if gap_x * gap_x + gap_y * gap_y + gap_z * gap_z >= limit:
            continue
        place = find(key_of(cube_x, cube_y, cube_z), keys)
        if keys[place] == EMPTY:
            continue
        slot = slots[place]
        for k in range(counts[slot]):
            d0, d1, d2 = stored[slot, k, 0] - x, stored[slot, k, 1] - y, stored[slot, k, 2] - z
            distance = d0 * d0 + d1 * d1 + d2 * d2
            if distance >= limit:
                continue
            rank = min(found, NEIGHBOURS - 1)
            while rank > 0 and apart[rank - 1] > distance:
                apart[rank] = apart[rank - 1]
                near[rank] = near[rank - 1]
                rank -= 1
            apart[rank] = distance
            near[rank] = stored[slot, k]
            home = slot if rank == 0 else home
            found = min(found + 1, NEIGHBOURS)
            if found == NEIGHBOURS:
                limit = apart[NEIGHBOURS - 1]
    return found, home


@njit(cache=True, error_model="numpy", inline="always")
def _gap(at: float, low: float, width: float) -> float:
    """How far a coordinate lies outside [low, low + width]."""
    return max(low - at, at - low - width, 0.0)


@njit(cache=True, error_model="numpy", nogil=True)
def _principal_axes(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean (3,), variances (3,) ascending and their unit directions as columns (3, 3) of points (n, 3)."""
    n = len(points)
    mean = np.zeros(3)
    for i in range(n):
        for a in range(3):
            mean[a] += points[i, a] / n
    covariance = np.zeros((3, 3))
    for i in range(n):
        for a in range(3):
            for b in range(3):
                covariance[a, b] += (points[i, a] - mean[a]) * (points[i, b] - mean[b]) / n
    values, vectors = _eigen(covariance)
    return mean, values, vectors


@njit(cache=True, error_model="numpy", nogil=True)
def _eigen(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues (3,) ascending and eigenvectors as columns of a symmetric (3, 3) by cyclic Jacobi rotations."""
    m, v = matrix.copy(), np.eye(3)
    for _ in range(12):
        if m[0, 1] ** 2 + m[0, 2] ** 2 + m[1, 2] ** 2 < 1e-24 * (m[0, 0] + m[1, 1] + m[2, 2]) ** 2 + 1e-300:
            break
        for p, q in ((0, 1), (0, 2), (1, 2)):
            if m[p, q] == 0.0:
                continue
            ratio = (m[q, q] - m[p, p]) / (2.0 * m[p, q])
            t = (1.0 if ratio >= 0 else -1.0) / (abs(ratio) + np.sqrt(ratio * ratio + 1.0))
            c = 1.0 / np.sqrt(t * t + 1.0)
            s = t * c
            for k in range(3):
                m[k, p], m[k, q] = c * m[k, p] - s * m[k, q], s * m[k, p] + c * m[k, q]
            for k in range(3):
                m[p, k], m[q, k] = c * m[p, k] - s * m[q, k], s * m[p, k] + c * m[q, k]
                v[k, p], v[k, q] = c * v[k, p] - s * v[k, q], s * v[k, p] + c * v[k, q]
    for p, q in ((0, 1), (1, 2), (0, 1)):
        if m[p, p] > m[q, q]:
            m[p, p], m[q, q] = m[q, q], m[p, p]
            for k in range(3):
                v[k, p], v[k, q] = v[k, q], v[k, p]
    return np.array([m[0, 0], m[1, 1], m[2, 2]]), v
