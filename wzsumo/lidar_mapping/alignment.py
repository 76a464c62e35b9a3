"""Alignment: the pose at which features lie on the lines and planes of a map, by Gauss-Newton, and the information it has.

Minimises point-to-line and point-to-plane distances (Zhang & Singh 2014, Section V) with Cauchy weights, plus a Gaussian prior.
The scale of the residuals is estimated from the residuals themselves. Features that are matched to the same patch share the
weight of one feature; otherwise thousands of correlated points would outweigh every other source.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.lidar_mapping.patches import Patches, Shape, fit_patches
from wzsumo.lidar_mapping.voxel_map import VoxelMap
from wzsumo.rigid import inverse, moved, rigid, rotation_from_vector, vector_from_rotation

MIN_RESIDUAL_SCALE_M = 0.01  # half of a LiDAR's range noise
CAUCHY_TUNING = 2.3849  # in residual scales; 95 % efficiency on Gaussian residuals, Holland & Welsch 1977
CHI_MEDIAN = np.array([1.0, 0.6745, 1.1774, 1.5382])  # median of |residual| / sigma in 1, 2, 3 dimensions; index 0 is not used
MIN_FEATURES = 12  # twice the number of unknowns; chosen by us
LAST_STEP = 1e-5  # [m, rad]; no further Gauss-Newton step follows a shorter one
MAX_CONVERGED_STEP = 1e-2  # [m, rad]; a fit whose last step is longer has not converged. Chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """The result of an alignment: `pose` (4, 4), and what the last Gauss-Newton step knew about it.

    `information` (6, 6) [1/m^2, 1/rad^2] is that of the features alone, without the prior. Its unknowns are translation and
    rotation vector in the axes of the aligned cloud. `scale` is the residual scale [m], `used` the number of matched features.
    """

    pose: FloatArray
    information: FloatArray
    scale: float
    used: int
    converged: bool


class Matcher(Protocol):
    """Features of one kind, and the map that they are matched to."""

    @property
    def features(self) -> FloatArray:
        """Points (n, 3) [m] in the frame of the cloud that is aligned."""

    def patches(self, pose: FloatArray, radius: float) -> Patches:
        """The patch of the map that each feature, moved by the pose (4, 4), is matched to within a radius [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceMatcher:
    """Features that are matched to lines or planes of a point map."""

    features: FloatArray
    target: VoxelMap
    shape: Shape

    def patches(self, pose: FloatArray, radius: float) -> Patches:
        """See Matcher."""
        return self.patches_at(moved(self.features, pose), radius)

    def patches_at(self, places: FloatArray, radius: float) -> Patches:
        """The patch that each place (n, 3) [m] in the map's frame is matched to within a radius [m]."""
        return fit_patches(places, self.target, shape=self.shape, radius=radius)


def align(
    matchers: Sequence[Matcher],
    start: FloatArray,
    *,
    prior_information: FloatArray,
    radii: tuple[float, ...],
    max_steps: int = 4,
    settled_step: float = 1e-4,
) -> Fit:
    """The pose (4, 4) that fits all patches and a Gaussian prior of mean `start` (4, 4) and given information (6, 6) best.

    For each search radius [m] in turn, patches are fitted anew and up to `max_steps` Gauss-Newton steps follow. Where the first
    of these steps is shorter than `settled_step` [m, rad], new patches would not change the pose, so the remaining radii are
    skipped.
    """
    pose, information, scale, used, length = (
        np.asarray(start, dtype=np.float64),
        np.zeros((6, 6)),
        MIN_RESIDUAL_SCALE_M,
        0,
        np.inf,
    )
    for radius in radii:
        fitted = [(matcher, matcher.patches(pose, radius)) for matcher in matchers]
        used = sum(int((patches.dimension > 0).sum()) for _, patches in fitted)
        if used < MIN_FEATURES:
            information = np.zeros((6, 6))
            continue
        settled = True
        for number in range(max_steps):
            information, gradient, scale = _normal_equations(fitted, pose)
            offset = minus(pose, start)
            step = np.linalg.solve(information + prior_information, -gradient - prior_information @ offset)
            pose = plus(pose, np.asarray(step, dtype=np.float64))
            length = float(np.linalg.norm(step))
            settled = settled and (number > 0 or length < settled_step)
            if length < LAST_STEP:
                break
        if settled:
            break
    return Fit(pose=pose, information=information, scale=scale, used=used, converged=length < MAX_CONVERGED_STEP)


def plus(pose: FloatArray, step: FloatArray) -> FloatArray:
    """The pose (4, 4) moved by a step (6,) in its own frame: translation, then rotation vector."""
    return pose @ rigid(rotation_from_vector(step[3:]), step[:3])


def minus(pose: FloatArray, other: FloatArray) -> FloatArray:
    """The step (6,) with plus(other, step) = pose."""
    between = inverse(other) @ pose
    return np.concatenate([between[:3, 3], vector_from_rotation(between[:3, :3])])


def weighted_residuals(matcher: Matcher, patches: Patches, pose: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray, float]:
    """(which features (n,) are matched, offsets (m, 3) [m] of these from their patches, weights (m,), residual scale [m])."""
    used = patches.dimension > 0
    if not used.any():
        return used, np.zeros((0, 3)), np.zeros(0), MIN_RESIDUAL_SCALE_M
    offset = np.einsum("nij,nj->ni", patches.projector[used], moved(matcher.features[used], pose) - patches.centre[used])
    size = np.linalg.norm(offset, axis=1)
    scale = max(float(np.median(size / CHI_MEDIAN[patches.dimension[used]])), MIN_RESIDUAL_SCALE_M)
    return used, offset, patches.share[used] / scale**2 / (1 + (size / (CAUCHY_TUNING * scale)) ** 2), scale


def _normal_equations(fitted: list[tuple[Matcher, Patches]], pose: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """(information (6, 6), gradient (6,), largest residual scale [m]) of the features of all matchers at a pose."""
    information, gradient, largest = np.zeros((6, 6)), np.zeros(6), MIN_RESIDUAL_SCALE_M
    for matcher, patches in fitted:
        used, offset, weight, scale = weighted_residuals(matcher, patches, pose)
        if not used.any():
            continue
        part, part_gradient = np.zeros((6, 6)), np.zeros(6)
        _accumulate(matcher.features[used], pose[:3, :3].copy(), patches.projector[used], offset, weight, part, part_gradient)
        information, gradient, largest = information + part, gradient + part_gradient, max(largest, scale)
    return information, gradient, largest


@njit(cache=True, error_model="numpy", nogil=True)
def _accumulate(
    features: FloatArray, rotation: FloatArray, projector: FloatArray, offset: FloatArray, weight: FloatArray,
    information: FloatArray, gradient: FloatArray,
) -> None:  # fmt: skip
    """Add sum w J'J to `information` and sum w J'r to `gradient`.

    J = P R [I, -[p]x] with the symmetric projector P, the rotation R and the feature p; r = P (R p + t - c) = `offset`.
    """
    for i in range(len(features)):
        x, y, z = features[i]
        turned = np.zeros((3, 6))  # P R [I, -[p]x]
        for a in range(3):
            for c in range(3):
                for k in range(3):
                    turned[a, c] += projector[i, a, k] * rotation[k, c]
            turned[a, 3] = turned[a, 2] * y - turned[a, 1] * z
            turned[a, 4] = turned[a, 0] * z - turned[a, 2] * x
            turned[a, 5] = turned[a, 1] * x - turned[a, 0] * y
        for a in range(6):
            for k in range(3):
                gradient[a] += weight[i] * turned[k, a] * offset[i, k]
                for b in range(6):
                    information[a, b] += weight[i] * turned[k, a] * turned[k, b]
