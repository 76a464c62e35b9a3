"""Alignment: the pose that lays features on the lines and planes of a map, by Gauss-Newton, and what that pose is worth.

Point-to-line and point-to-plane distances (Zhang & Singh 2014, Section V) with Cauchy weights and, where there is one, a
prior. The residual scale is estimated from the residuals themselves, and features drawn to one and the same patch share the
weight of one: else thousands of correlated points would outvote every other source.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit

from wzsumo.frames import FloatArray
from wzsumo.lidar_mapping.patches import Patches, Shape, fit_patches
from wzsumo.lidar_mapping.voxel_map import VoxelMap
from wzsumo.rigid import inverse, moved, rigid, rotation_from_vector, vector_from_rotation

SCALE_FLOOR_M = 0.01  # no residual scale below it: half of what a LiDAR's range noise is
CAUCHY = 2.3849  # 95 % efficiency on Gaussian residuals; Holland & Welsch 1977
MEDIAN_OF_NORM = np.array([1.0, 0.6745, 1.1774, 1.5382])  # |residual| over sigma in 1, 2, 3 Gaussian directions (chi)
FEWEST_FEATURES = 12  # twice the unknowns


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Where Gauss-Newton ended: `pose` (4, 4), and of its last step the normal equations in the moved frame.

    Order of the six unknowns: translation, rotation vector, both in the axes of the registered cloud. `information`
    (6, 6) is of the features alone, in 1/m^2 and 1/rad^2; `scale` the residual scale [m], `used` the features with a patch.
    """

    pose: FloatArray
    information: FloatArray
    scale: float
    used: int
    converged: bool


class Matcher(Protocol):
    """Features of one kind, and the map they are laid on."""

    @property
    def features(self) -> FloatArray:
        """(n, 3), in the moved frame."""

    def patches(self, pose: FloatArray, radius: float) -> Patches:
        """What each feature, moved by the pose (4, 4), is drawn to within a radius [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceMatcher:
    """Features on lines or planes of a point map."""

    features: FloatArray
    target: VoxelMap
    shape: Shape

    def patches(self, pose: FloatArray, radius: float) -> Patches:
        """See Matcher."""
        return fit_patches(moved(self.features, pose), self.target, shape=self.shape, radius=radius)


def align(
    matchers: Sequence[Matcher],
    start: FloatArray,
    *,
    prior_information: FloatArray,
    radii: tuple[float, ...],
    steps: int = 4,
    settle: float = 1e-4,
) -> Fit:
    """The pose (4, 4) nearest to all patches and to `start`, the mean of a prior of given information (6, 6).

    For each search radius [m] in turn patches are fitted anew and up to `steps` Gauss-Newton steps follow; where the first
    of them is shorter than `settle` [m, rad], new patches would change nothing and the rest is left out.
    """
    pose, information, scale, used, change = np.asarray(start, dtype=np.float64), np.zeros((6, 6)), SCALE_FLOOR_M, 0, np.inf
    for radius in radii:
        fitted = [(matcher, matcher.patches(pose, radius)) for matcher in matchers]
        used = sum(int((patches.dimension > 0).sum()) for _, patches in fitted)
        if used < FEWEST_FEATURES:
            information = np.zeros((6, 6))
            continue
        settled = True
        for number in range(steps):
            information, gradient, scale = _normal_equations(fitted, pose)
            offset = minus(pose, start)
            step = np.linalg.solve(information + prior_information, -gradient - prior_information @ offset)
            pose = plus(pose, np.asarray(step, dtype=np.float64))
            change = float(np.linalg.norm(step))
            settled = settled and (number > 0 or change < settle)
            if change < 1e-5:
                break
        if settled:
            break
    return Fit(pose=pose, information=information, scale=scale, used=used, converged=change < 1e-2)


def plus(pose: FloatArray, step: FloatArray) -> FloatArray:
    """Pose (4, 4) after a small step (6,) in its own frame: translation, then rotation vector."""
    return pose @ rigid(rotation_from_vector(step[3:]), step[:3])


def minus(pose: FloatArray, other: FloatArray) -> FloatArray:
    """The step (6,) from `other` to `pose`, which `plus` undoes."""
    between = inverse(other) @ pose
    return np.concatenate([between[:3, 3], vector_from_rotation(between[:3, :3])])


def _normal_equations(fitted: list[tuple[Matcher, Patches]], pose: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """(information (6, 6), gradient (6,), largest residual scale [m]) of all matchers at a pose."""
    information, gradient, largest = np.zeros((6, 6)), np.zeros(6), SCALE_FLOOR_M
    for matcher, patches in fitted:
        used = patches.dimension > 0
        if not used.any():
            continue
        offset = np.einsum("nij,nj->ni", patches.projector[used], moved(matcher.features[used], pose) - patches.centre[used])
        size = np.linalg.norm(offset, axis=1)
        scale = max(float(np.median(size / MEDIAN_OF_NORM[patches.dimension[used]])), SCALE_FLOOR_M)
        weight = patches.share[used] / scale**2 / (1 + (size / (CAUCHY * scale)) ** 2)
        part, pull = np.zeros((6, 6)), np.zeros(6)
        _accumulate(matcher.features[used], pose[:3, :3].copy(), patches.projector[used], offset, weight, part, pull)
        information, gradient, largest = information + part, gradient + pull, max(largest, scale)
    return information, gradient, largest


@njit(cache=True, error_model="numpy", nogil=True)
def _accumulate(
    features: FloatArray, rotation: FloatArray, projector: FloatArray, offset: FloatArray, weight: FloatArray,
    information: FloatArray, gradient: FloatArray,
) -> None:  # fmt: skip
    """Add sum w J'J and sum w J'r; J = P R [I, -[p]x], r = P (R p + t - c) = `offset`, P symmetric."""
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
