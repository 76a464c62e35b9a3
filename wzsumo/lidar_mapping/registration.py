"""Registration: the rigid motion that takes one cloud of anybody's to another, coarse to fine, and how much it is worth."""

from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from wzsumo.errors import CloudError, NoGroundError
from wzsumo.frames import FloatArray
from wzsumo.lidar_mapping.alignment import FEWEST_FEATURES, Fit, SurfaceMatcher, align
from wzsumo.lidar_mapping.patches import Shape
from wzsumo.lidar_mapping.smrf import SmrfSpec, ground_mask
from wzsumo.lidar_mapping.voxel_map import VoxelMap
from wzsumo.rigid import moved, rigid, rotation_from_vector
from wzsumo.scan import check_cloud

SPACINGS = 4.0  # of the target's points that a cube spans at least, so that it holds enough for a plane
FINEST = 0.02  # cube of the finest level over the cloud's radius: 1 m of a street scene, 0.2 m of a room
LOOSEST = 0.01  # deviation over radius beyond which a direction counts as free
LEAST_OVERLAP = 0.3  # share of the source that must lie near the target
SMALLEST_SCENE_M = 10.0  # radius of a cloud in which SMRF's cells of 1 m can tell objects from ground
CONVINCING = 0.2  # error of a fit that leaves nothing free, up to which no other turn is tried
TURNS = 12  # about the vertical that are tried else: a fit finds its way from half the step between them, 15 degrees
MOST_PROMISING = 3  # of them that are followed to the end


class RegistrationStatus(StrEnum):
    """What a registration is worth."""

    CONVERGED = "converged"
    DEGENERATE = "degenerate"  # some directions are not determined by the clouds
    IDENTICAL_CLOUDS = "identical_clouds"  # the same points twice: the identity is exact, and says nothing about a motion
    TOO_FEW_FEATURES = "too_few_features"
    NOT_CONVERGED = "not_converged"
    POOR_OVERLAP = "poor_overlap"  # converged, but most points of the source lie nowhere near the target


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
class _Trial:
    """Where one guess led: the share of the source near the target, and the mean distance of what tells.

    Distances count in units of what is near, at most 1.
    """

    fit: Fit
    overlap: float
    error: float


def register(source: npt.ArrayLike, target: npt.ArrayLike, *, start: FloatArray | None = None) -> RegistrationResult:
    """The rigid motion that takes one cloud (n, 3) to another (m, 3) [m], coarse to fine, from `start` or several guesses.

    Without a start, no motion and the middles on each other are tried, and where neither convinces, turns about the
    vertical. Clouds that tell nothing come back with a status that says so. Raises CloudError for clouds that are none.
    """
    moving, fixed = check_cloud(source, source="source", at_least=3), check_cloud(target, source="target", at_least=3)
    if _same_points(moving, fixed):
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
    standing = levels[-1][-1]
    # What stands decides between guesses: a LiDAR's rings on the ground lie on each other whatever the turn.
    telling, target = (standing.features, standing.target.points) if len(standing.features) else (sample, fixed)
    telling_tree = cKDTree(target) if len(target) else tree

    def followed(guess: FloatArray) -> _Trial:
        fit = _coarse_to_fine(levels, guess, extent=extent)
        away = np.asarray(telling_tree.query(moved(telling, fit.pose), distance_upper_bound=near)[0])
        overlap = np.isfinite(tree.query(moved(sample, fit.pose), distance_upper_bound=near)[0]).mean()
        return _Trial(fit=fit, overlap=float(overlap), error=float(np.minimum(away / near, 1.0).mean()))

    trials = [followed(guess) for guess in _guesses(start, centres, unit)]
    best = min(trials, key=lambda trial: trial.error)
    if start is None and (best.error > CONVINCING or _free_directions(best.fit, extent=extent)):
        trials += [followed(guess) for guess in _promising_turns(levels[0], centres, unit)]
        best = min(trials, key=lambda trial: trial.error)
    fit = best.fit
    pose = rigid(fit.pose[:3, :3], fit.pose[:3, 3] * unit + centres[1] - fit.pose[:3, :3] @ centres[0])
    return _judged(fit, pose, overlap=best.overlap, extent=extent, unit=unit)


def compile_kernels() -> None:
    """Compile, or load from the cache, every kernel of the registration."""
    rng = np.random.default_rng(1)
    floor = np.column_stack([rng.uniform(-5, 5, (400, 2)), np.zeros(400)])
    register(floor + np.array([0.1, 0.0, 0.1]), floor)


def _same_points(moving: FloatArray, fixed: FloatArray) -> bool:
    """Whether two clouds hold the same points, in whatever order."""
    if moving.shape != fixed.shape:
        return False
    moving, fixed = (cloud[np.lexsort(cloud.T)] for cloud in (moving, fixed))
    return bool((moving == fixed).all())


def _guesses(start: FloatArray | None, centres: tuple[FloatArray, FloatArray], unit: float) -> list[FloatArray]:
    """Poses between the centred, scaled clouds to begin from: the given one; or no motion, then the middles on each other."""
    if start is not None:
        return [rigid(start[:3, :3], (start[:3, :3] @ centres[0] + start[:3, 3] - centres[1]) / unit)]
    return [rigid(np.eye(3), (centres[0] - centres[1]) / unit), np.eye(4)]


def _promising_turns(
    coarse: tuple[SurfaceMatcher, ...], centres: tuple[FloatArray, FloatArray], unit: float
) -> list[FloatArray]:
    """Of turns about the vertical through the middles, and through the origins, those that bring standing points nearest."""
    standing = coarse[-1]
    if not (len(standing.features) and len(standing.target)):
        return []
    tree = cKDTree(standing.target.points)
    guesses = []
    for turn in np.arange(TURNS) * (2 * np.pi / TURNS):
        rotation = rotation_from_vector([0.0, 0.0, turn])
        origins = (rotation @ centres[0] - centres[1]) / unit
        guesses += [rigid(rotation, np.zeros(3)), rigid(rotation, origins)]

    def apart(guess: FloatArray) -> float:
        away = np.asarray(tree.query(moved(standing.features, guess), distance_upper_bound=standing.target.cube)[0])
        return float(np.minimum(away, standing.target.cube).mean())

    return sorted(guesses, key=apart)[:MOST_PROMISING]


def _levels(moving: FloatArray, fixed: FloatArray, *, near: float, extent: float) -> list[tuple[SurfaceMatcher, ...]]:
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
            matchers.append(SurfaceMatcher(features=_thinned(points, cube / fineness), target=held, shape=shape))
        levels.append(tuple(matchers))
    return levels


def _parts(points: FloatArray, extent: float) -> tuple[FloatArray, FloatArray]:
    """(ground, standing) points of a centred cloud; of one too small to hold ground and objects all are standing."""
    ground = np.zeros(len(points), dtype=bool)
    if extent >= SMALLEST_SCENE_M:
        # Strays would spread the surface over millions of cells, and so would a cloud in centimetres.
        within = np.abs(points[:, :2]).max(axis=1) < 4 * extent
        cell = max(1.0, extent / 100)
        with suppress(NoGroundError):
            ground[within] = ground_mask(points[within], SmrfSpec(cell_m=cell, elevation_threshold_m=0.2))
    return points[ground], points[~ground]


def _coarse_to_fine(levels: list[tuple[SurfaceMatcher, ...]], pose: FloatArray, *, extent: float) -> Fit:
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
    """The result in metres."""
    deviation, free = _deviation(fit, extent=extent), _free_directions(fit, extent=extent)
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


def _deviation(fit: Fit, *, extent: float) -> FloatArray:
    """Predicted standard deviations (6,) along the principal directions, rotations by what they move at the radius."""
    lever = np.diag([1.0] * 3 + [1 / extent] * 3)
    values = np.linalg.eigvalsh(lever @ fit.information @ lever)
    return np.asarray(1 / np.sqrt(np.maximum(values[::-1], 1e-12)))


def _free_directions(fit: Fit, *, extent: float) -> int:
    return int((_deviation(fit, extent=extent) > LOOSEST * extent).sum())


def _nothing(status: RegistrationStatus) -> RegistrationResult:
    return RegistrationResult(
        transform=np.eye(4), status=status, scale_m=0.0, overlap=1.0, deviation_m=np.full(6, np.inf), free_directions=6
    )
