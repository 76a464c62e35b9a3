"""Patches: lines and planes fitted to the map points around each feature (Zhang & Singh 2014, Section V-B)."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray, IntArray
from wzsumo.lidar_mapping.voxel_map import EMPTY, VoxelMap, find, key_of

MAX_PATCH_POINTS = 8  # nearest map points that a patch is fitted to; Zhang & Singh's program: 5, more steady the normal
MIN_PATCH_POINTS = 5  # fewer make no patch; ibid.
# Limits on the ratios of the eigenvalues of the points' covariance.
MAX_THICKNESS = 0.1  # smallest over middle one, of a plane; chosen by us
MIN_SPREAD = 0.04  # middle over largest one, of a plane: the points of one scan line span no plane. Chosen by us
MIN_SLENDERNESS = 3.0  # largest over middle one, of a line; Zhang & Singh's program
_OFFSETS = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
CUBE_OFFSETS = _OFFSETS[np.argsort(np.abs(_OFFSETS).sum(axis=1), kind="stable")]  # a cube and its neighbours, nearest first


class Shape(IntEnum):
    """What shape a patch may have. Bit 1 allows lines, bit 2 planes.

    ANY falls back on the mean of the points where they form neither. GROUND patches are planes whose normals are replaced by
    the most common normal.
    """

    LINE = 1
    PLANE = 2
    ANY = 3
    GROUND = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Patches:
    """For each of n features: the `centre` (n, 3) of its patch and the `projector` (n, 3, 3) onto the directions it constrains.

    The projector is nn' for a plane with normal n, I - dd' for a line along d and I for a point; for posts, directions are
    scaled by their certainty (`post_map`). `dimension` (n,) is the number of constrained directions, 0 where there is no patch.
    `share` (n,) is 1 over the number of features that are matched to the same cube of the map or to the same post.
    """

    centre: FloatArray
    projector: FloatArray
    dimension: IntArray
    share: FloatArray


def fit_patches(features: FloatArray, target: VoxelMap, *, shape: Shape, radius: float) -> Patches:
    """Patches for features (n, 3) in the map's frame, from points within `radius` [m], at most the edge of the map's cubes."""
    n = len(features)
    centre, axis, projector = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3, 3))
    dimension, cube = np.zeros(n, dtype=np.int64), np.full(n, EMPTY, dtype=np.int64)
    _fit(
        np.ascontiguousarray(features), target.keys, target.slots, target.counts, target.stored,
        np.array([target.cube, min(radius, target.cube), float(shape)]), centre, axis, dimension, cube,
    )  # fmt: skip
    planes, lines = dimension == 1, dimension == 2
    if shape is Shape.GROUND and planes.any():
        centre[planes], axis[planes] = _with_common_normal(features[planes], centre[planes], axis[planes])
    projector[planes] = axis[planes, :, None] * axis[planes, None, :]
    projector[dimension > 1] = np.eye(3)
    projector[lines] -= axis[lines, :, None] * axis[lines, None, :]
    found = cube[dimension > 0]
    share = np.zeros(n)
    if found.size:
        share[dimension > 0] = 1 / np.bincount(found)[found]
    return Patches(centre=centre, projector=projector, dimension=dimension, share=share)


def _with_common_normal(features: FloatArray, centre: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(centres, normals) of planes that all have the median normal. Each keeps the feature's distance along that normal.

    The normals of a road's patches differ by noise. Each difference would act as a measurement of the position along the road,
    and thousands of them would outweigh a line of cones. With one normal, ground measures height, roll and pitch only, as in
    LeGO-LOAM (Shan & Englot 2018).
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
    """Fill `centre`, `axis` (normal of a plane, direction of a line), `dimension`, `cube` (slot of the nearest point's cube).

    `size` = edge of the map's cubes [m], search radius [m], Shape.
    """
    near = np.empty((MAX_PATCH_POINTS, 3))
    for i in range(len(features)):
        found, nearest_slot = _nearest(features[i], keys, slots, counts, stored, size, near)
        if found < MIN_PATCH_POINTS:
            continue
        mean, values, vectors = _principal_axes(near[:found])
        flat = values[0] <= MAX_THICKNESS * values[1] and values[1] >= MIN_SPREAD * values[2]
        slender = values[2] >= MIN_SLENDERNESS * values[1]
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
    """(number of nearest map points written to `near`, slot of the cube that holds the nearest one).

    The feature's own cube is searched first; of its neighbours only those that reach nearer than the points found so far.
    """
    squares = np.empty(MAX_PATCH_POINTS)  # squared distances of the points in `near`, ascending
    found, nearest_slot = 0, EMPTY
    limit = size[1] ** 2
    x, y, z = feature
    own_x, own_y, own_z = int(np.floor(x / size[0])), int(np.floor(y / size[0])), int(np.floor(z / size[0]))
    for step in range(len(CUBE_OFFSETS)):
        cube_x, cube_y, cube_z = own_x + CUBE_OFFSETS[step, 0], own_y + CUBE_OFFSETS[step, 1], own_z + CUBE_OFFSETS[step, 2]
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
            rank = min(found, MAX_PATCH_POINTS - 1)
            while rank > 0 and squares[rank - 1] > distance:
                squares[rank] = squares[rank - 1]
                near[rank] = near[rank - 1]
                rank -= 1
            squares[rank] = distance
            near[rank] = stored[slot, k]
            nearest_slot = slot if rank == 0 else nearest_slot
            found = min(found + 1, MAX_PATCH_POINTS)
            if found == MAX_PATCH_POINTS:
                limit = squares[MAX_PATCH_POINTS - 1]
    return found, nearest_slot


@njit(cache=True, error_model="numpy", inline="always")
def _gap(at: float, low: float, width: float) -> float:
    """Distance of a coordinate from the interval [low, low + width]."""
    return max(low - at, at - low - width, 0.0)


@njit(cache=True, error_model="numpy", nogil=True)
def _principal_axes(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean (3,) of points (n, 3), their principal variances (3,) ascending, and the principal directions as columns (3, 3)."""
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
    """Eigenvalues (3,) ascending and eigenvectors as columns of a symmetric matrix (3, 3), by cyclic Jacobi rotations."""
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
