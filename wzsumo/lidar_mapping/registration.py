"""Scan registration: the rigid motion that lays features on the lines and planes of a map, and how much it is worth.

Gauss-Newton on point-to-line and point-to-plane distances (Zhang & Singh 2014, Section V) with Cauchy weights and, where
there is one, a prior. The residual scale is estimated from the residuals themselves, and features drawn to one and the
same patch share the weight of one: else thousands of correlated points would outvote every other source.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy.spatial import cKDTree

from wzsumo.cloud import check_cloud
from wzsumo.errors import CloudError
from wzsumo.frames import FloatArray
from wzsumo.lidar_mapping.patches import Patches, Shape, fit_patches
from wzsumo.lidar_mapping.smrf import SmrfSpec, ground_mask
from wzsumo.lidar_mapping.voxel_map import VoxelMap
from wzsumo.rigid import inverse, moved, rigid, rotation_from_vector, vector_from_rotation

SCALE_FLOOR_M = 0.01  # no residual scale below it: half of what a LiDAR's range noise is
CAUCHY = 2.3849  # 95 % efficiency on Gaussian residuals; Holland & Welsch 1977
MEDIAN_OF_NORM = np.array([1.0, 0.6745, 1.1774, 1.5382])  # |residual| over sigma in 1, 2, 3 Gaussian directions (chi)
FEWEST_FEATURES = 12  # twice the unknowns
SPACINGS = 4.0  # of the target's points that a cube spans at least, so that it holds enough for a plane
FINEST = 0.02  # cube of the finest level over the cloud's radius: 1 m of a street scene, 0.2 m of a room
LOOSEST = 0.01  # deviation over radius beyond which a direction counts as free
LEAST_OVERLAP = 0.3  # share of the source that must lie near the target
SMALLEST_SCENE_M = 10.0  # radius of a cloud in which SMRF's cells of 1 m can tell objects from ground


class RegistrationStatus(StrEnum):
    """What a registration is worth."""

    CONVERGED = "converged"
    DEGENERATE = "degenerate"  # some directions are not determined by the clouds
    IDENTICAL_CLOUDS = "identical_clouds"  # the same points twice: the identity is exact, and says nothing about a motion
    TOO_FEW_FEATURES = "too_few_features"
    NOT_CONVERGED = "not_converged"
    POOR_OVERLAP = "poor_overlap"  # converged, but most points of the source lie nowhere near the target


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


@dataclass(frozen=True, kw_only=True, eq=False)
class RegistrationResult:
    """`transform` (4, 4) takes the source to the target. `overlap` is the share of source points near the target.

    `deviation_m` (6,): predicted standard deviations along the principal directions, rotations at the cloud's radius [m].
    """

    transform: FloatArray
    status: RegistrationStatus
    scale_m: float
    overlap: float
    deviation_m: FloatArray
    free_directions: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Matcher:
    """Features of one kind against the map they are laid on."""

    features: FloatArray  # (n, 3), in the moved frame
    target: VoxelMap
    shape: Shape


def align(
    matchers: tuple[Matcher, ...],
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
        fitted = [
            (matcher, fit_patches(moved(matcher.features, pose), matcher.target, shape=matcher.shape, radius=radius))
            for matcher in matchers
        ]
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


def register(source: npt.ArrayLike, target: npt.ArrayLike, *, start: FloatArray | None = None) -> RegistrationResult:
    """The rigid motion that takes one cloud (n, 3) to another (m, 3) [m], coarse to fine, from `start` or several guesses.

    Points are drawn to lines and planes of the target alike. Clouds that tell nothing come back with a status that says
    so. Raises CloudError for clouds that are none.
    """
    moving, fixed = check_cloud(source, source="source", at_least=3), check_cloud(target, source="target", at_least=3)
    if moving.shape == fixed.shape and (moving == fixed).all():
        return _nothing(RegistrationStatus.IDENTICAL_CLOUDS)
    # About their own middles, for rotations about a far origin are ill-conditioned; and small clouds in larger units, so
    # that one floor of the residual scale serves a street and a part on a table.
    centres = np.median(moving, axis=0), np.median(fixed, axis=0)
    extent = float(np.percentile(np.linalg.norm(fixed - centres[1], axis=1), 90))
    if extent == 0:
        raise CloudError("target: most points are the same; a cloud has an extent")
    unit = min(extent / SMALLEST_SCENE_M, 1.0)
    moving, fixed, extent = (moving - centres[0]) / unit, (fixed - centres[1]) / unit, extent / unit
    tree = cKDTree(fixed)
    apart = np.asarray(tree.query(fixed[:: 1 + len(fixed) // 2000], k=2)[0])[:, 1]
    near = max(extent * FINEST, SPACINGS * float(np.median(apart)))
    levels, sample = _levels(moving, fixed, near=near, extent=extent), _thinned(moving, near)
    best: tuple[float, float, Fit] | None = None
    for guess in _guesses(start, centres, unit):
        fit = _coarse_to_fine(levels, guess, extent=extent)
        apart = np.asarray(tree.query(moved(sample, fit.pose), distance_upper_bound=near)[0])
        overlap, error = float(np.isfinite(apart).mean()), float(np.minimum(apart, near).mean())
        if best is None or error < best[0]:
            best = error, overlap, fit
    assert best is not None  # noqa: S101 - there is always a guess
    _, overlap, fit = best
    pose = rigid(fit.pose[:3, :3], fit.pose[:3, 3] * unit + centres[1] - fit.pose[:3, :3] @ centres[0])
    return _judged(fit, pose, overlap=overlap, extent=extent, unit=unit)


def compile_kernels() -> None:
    """Compile, or load from the cache, every kernel of the registration."""
    rng = np.random.default_rng(1)
    floor = np.column_stack([rng.uniform(-5, 5, (400, 2)), np.zeros(400)])
    register(floor + np.array([0.1, 0.0, 0.1]), floor)


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


@njit(cache=True, error_model="numpy")
def _accumulate(
    features: FloatArray, rotation: FloatArray, projector: FloatArray, offset: FloatArray, weight: FloatArray,
    information: FloatArray, gradient: FloatArray,
) -> None:  # fmt: skip
    """Add sum w J'J and sum w J'r; J = P R [I, -[p]x], r = P (R p + t - c) = `offset`, P a projector."""
    for i in range(len(features)):
        x, y, z = features[i]
        turned = np.zeros((3, 6))  # P R [I, -[p]x]; J'J = its own square, since P is a projector
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


def _guesses(start: FloatArray | None, centres: tuple[FloatArray, FloatArray], unit: float) -> list[FloatArray]:
    """Poses between the centred, scaled clouds to begin from: the given one; or no motion, then the middles on each other."""
    if start is not None:
        return [rigid(start[:3, :3], (start[:3, :3] @ centres[0] + start[:3, 3] - centres[1]) / unit)]
    return [rigid(np.eye(3), (centres[0] - centres[1]) / unit), np.eye(4)]


def _levels(moving: FloatArray, fixed: FloatArray, *, near: float, extent: float) -> list[tuple[Matcher, ...]]:
    """Matchers of each level, coarse to fine. Ground is matched to planes alone, standing points to whatever they form.

    Kept apart, a cone among ten thousand ground points still has its own neighbours at a radius of metres; together, the
    rings of a LiDAR on the ground, which look the same from everywhere, would hold the scan in place.
    """
    source, target = _parts(moving, extent), _parts(fixed, extent)
    levels = []
    for factor in (8, 4, 2, 1):
        matchers = []
        for shape, fineness, points, others in zip((Shape.GROUND, Shape.ANY), (4.0, 16.0), source, target, strict=True):
            cube = factor * near
            held = VoxelMap(cube=cube, spacing=cube / fineness)
            held.insert(others)
            matchers.append(Matcher(features=_thinned(points, cube / fineness), target=held, shape=shape))
        levels.append(tuple(matchers))
    return levels


def _parts(points: FloatArray, extent: float) -> tuple[FloatArray, FloatArray]:
    """(ground, standing) points of a cloud; of one too small to hold ground and objects all are standing."""
    if extent < SMALLEST_SCENE_M:
        return points[:0], points
    ground = ground_mask(points, SmrfSpec(elevation_threshold_m=0.2))
    return points[ground], points[~ground]


def _coarse_to_fine(levels: list[tuple[Matcher, ...]], pose: FloatArray, *, extent: float) -> Fit:
    weak = np.diag([1e-6] * 3 + [1e-6 * extent**2] * 3)
    fit = Fit(pose=pose, information=np.zeros((6, 6)), scale=np.inf, used=0, converged=False)
    for matchers in levels:
        radius = max(matcher.target.cube for matcher in matchers)
        fit = align(matchers, fit.pose, prior_information=weak, radii=(radius,) * 8)
    return fit


def _thinned(points: FloatArray, spacing: float) -> FloatArray:
    """Points of a cloud that keep some distance."""
    kept = VoxelMap(cube=4 * spacing, spacing=spacing)
    kept.insert(points)
    return kept.points


def _judged(fit: Fit, transform: FloatArray, *, overlap: float, extent: float, unit: float) -> RegistrationResult:
    """The result in metres, with rotations counted by what they move at the cloud's radius."""
    lever = np.diag([1.0] * 3 + [1 / extent] * 3)
    values = np.linalg.eigvalsh(lever @ fit.information @ lever)
    deviation = 1 / np.sqrt(np.maximum(values[::-1], 1e-12))
    free = int((deviation > LOOSEST * extent).sum())
    status = RegistrationStatus.CONVERGED
    if fit.used < FEWEST_FEATURES:
        status = RegistrationStatus.TOO_FEW_FEATURES
    elif overlap < LEAST_OVERLAP:
        status = RegistrationStatus.POOR_OVERLAP
    elif free:
        status = RegistrationStatus.DEGENERATE
    elif not fit.converged:
        status = RegistrationStatus.NOT_CONVERGED
    return RegistrationResult(
        transform=transform,
        status=status,
        scale_m=fit.scale * unit,
        overlap=overlap,
        deviation_m=deviation * unit,
        free_directions=free,
    )


def _nothing(status: RegistrationStatus) -> RegistrationResult:
    return RegistrationResult(
        transform=np.eye(4), status=status, scale_m=0.0, overlap=1.0, deviation_m=np.full(6, np.inf), free_directions=6
    )
