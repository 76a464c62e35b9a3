"""Which rigid motions two aligned clouds determine, and how well.

The normal of a patch errs by some degrees, and the middle of points on a long thing is nowhere. Beside a rail or in a tunnel
thousands of such errors add up to what looks like information about the way along it (Tuna et al. 2024, X-ICP, IEEE
Transactions on Robotics 40). So each feature is moved a little way forth and back and matched again. Where its patch comes
along, as on a rail, it says nothing about that way; where the patch stays behind both times, as that of a post, it counts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wzsumo.frames import BoolArray, FloatArray
from wzsumo.lidar_mapping.alignment import Fit, SurfaceMatcher, weighted_residuals
from wzsumo.lidar_mapping.patches import Patches
from wzsumo.rigid import moved

TESTED_DIRECTIONS = 3  # the worst determined ones: a plane leaves three free, a sphere too
MOVED_SHARE = 0.5  # of the search radius, by which features are moved; farther than the points of a patch reach
MAX_FOLLOWING = 0.5  # of that way, by which the patch of a feature that holds may come along; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class Determination:
    """Principal directions of motion, the best determined first, and the predicted standard deviations along them.

    `directions` (6, 6) has a unit vector a row: translation in the target's axes, then the rotation vector about the middle of
    the cloud as lengths at its radius. `deviation` (6,) is in the unit of the clouds.
    """

    directions: FloatArray
    deviation: FloatArray

    def free(self, *, above: float) -> FloatArray:
        """The directions (k, 6) whose deviation is larger."""
        return self.directions[self.deviation > above]


def determination(matchers: Sequence[SurfaceMatcher], fit: Fit, *, extent: float, radius: float) -> Determination:
    """What the features of a fit determine, of a cloud of the radius `extent` about its own middle."""
    lever = np.diag([1.0] * 3 + [1 / extent] * 3)
    _, vectors = np.linalg.eigh(lever @ fit.information @ lever)
    principal = vectors.T[::-1]
    rotation = fit.pose[:3, :3]
    held = np.zeros(6)
    for matcher in matchers:
        patches = matcher.patches(fit.pose, radius)
        used, _, weight, _ = weighted_residuals(matcher, patches, fit.pose)
        for number, (along, about) in enumerate(zip(principal[:, :3], principal[:, 3:] / extent, strict=True)):
            motion = (along + np.cross(about, matcher.features)) @ rotation.T
            told = weight * (np.einsum("nij,nj->ni", patches.projector[used], motion[used]) ** 2).sum(axis=1)
            holds = np.ones(len(told), dtype=bool)
            if number >= 6 - TESTED_DIRECTIONS:
                holds = _stays_behind(matcher, patches, fit.pose, motion, radius=radius)[used]
            held[number] += told[holds].sum()
    in_target = np.hstack([principal[:, :3] @ rotation.T, principal[:, 3:] @ rotation.T])
    deviation = 1 / np.sqrt(np.maximum(held, 1e-12))
    order = np.argsort(deviation, kind="stable")
    return Determination(directions=in_target[order], deviation=deviation[order])


def _stays_behind(
    matcher: SurfaceMatcher, patches: Patches, pose: FloatArray, motion: FloatArray, *, radius: float
) -> BoolArray:
    """Whether the patches (n,) of features that are moved along motions (n, 3), forth and back, stay behind."""
    ahead = motion / np.maximum(np.linalg.norm(motion, axis=1, keepdims=True), 1e-12)
    places, way = moved(matcher.features, pose), MOVED_SHARE * radius
    stays = np.ones(len(places), dtype=bool)
    for step in (way * ahead, -way * ahead):
        found = matcher.patches_at(places + step, radius)
        followed = ((found.centre - patches.centre) * step).sum(axis=1) / way
        stays &= (found.dimension == 0) | (followed < MAX_FOLLOWING * way)
    return stays
