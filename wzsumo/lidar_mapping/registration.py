"""Registration: the rigid motion that takes one cloud to another, coarse to fine, and how well the clouds determine it."""

from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from wzsumo.errors import CloudError, NoGroundError
from wzsumo.frames import FloatArray
from wzsumo.lidar_mapping.alignment import MIN_FEATURES, Fit, SurfaceMatcher, align, minus
from wzsumo.lidar_mapping.determined import Determination, determination
from wzsumo.lidar_mapping.patches import Shape
from wzsumo.lidar_mapping.smrf import SmrfSpec, ground_mask
from wzsumo.lidar_mapping.voxel_map import VoxelMap
from wzsumo.rigid import moved, rigid, rotation_from_vector
from wzsumo.scan import check_cloud

# The cube edge of the finest level is the larger of two lengths. Points this near to each other count as overlap. Chosen by us.
MIN_CUBE_SPACINGS = 4.0  # in spacings of the target's points
MIN_CUBE_SHARE = 0.02  # of the cloud's radius: 1 m in a street scene of 50 m, 0.2 m in a room of 10 m
LEVELS = (8, 4, 2, 1)  # cube edges of the levels, in edges of the finest one
GROUND_FINENESS, STANDING_FINENESS = 4.0, 16.0  # cube edge over point spacing of the map's two parts
SEARCHES = 8  # in each level, at most
PRIOR_INFORMATION = 1e-6  # of a level's start [1/m^2]: weak, it only keeps free directions where they are
MAX_DEVIATION_SHARE = 0.003  # of the cloud's radius; a direction with a larger predicted deviation counts as free. Chosen by us
MIN_OVERLAP = 0.3  # share of the source that must lie near the target; chosen by us
MIN_SCENE_RADIUS_M = 10.0  # from here on SMRF's cells of 1 m can tell objects from ground; chosen by us
MAX_CELLS_PER_RADIUS = 100  # of SMRF; in large clouds its cells are coarser than 1 m. Chosen by us
ELEVATION_THRESHOLD_M = 0.2  # Chen et al. 2022
MAX_STRAY_RADII = 4  # points farther off are left out of the ground filter; chosen by us
MAX_CONVINCING_ERROR = 0.2  # of a fit without free directions; beyond it turns about the vertical are tried. Chosen by us
TURNS = 12  # that are tried; a fit converges from half the step between them, 15 degrees
MAX_FEATURES = 4000  # of the source's ground, and of its standing points, that are matched in a level; chosen by us
FOLLOWED_TURNS = 3  # that are followed to the end, the most promising ones; chosen by us


class RegistrationStatus(StrEnum):
    """How well a registration is determined."""

    CONVERGED = "converged"
    DEGENERATE = "degenerate"  # the clouds do not determine some directions
    IDENTICAL_CLOUDS = "identical_clouds"  # the same points: the identity is exact, but no sensor moved like this
    TOO_FEW_FEATURES = "too_few_features"  # fewer matched features than twice the unknowns
    NOT_CONVERGED = "not_converged"  # the last step was still long
    POOR_OVERLAP = "poor_overlap"  # most points of the source are not near the target


@dataclass(frozen=True, kw_only=True, eq=False)
class RegistrationResult:
    """The `transform` (4, 4) that takes the source to the target, and how well it is determined.

    `scale_m` is the residual scale, `overlap` the share of source points near the target. `deviation_m` (6,) holds predicted
    standard deviations along the principal directions, rotations as lengths at the cloud's radius. `free_motions` (k, 6) are
    the directions that the clouds do not determine, as unit vectors: translation in the target's axes, then the rotation
    vector about the middle of the source, as lengths at its radius.
    """

    transform: FloatArray
    status: RegistrationStatus
    scale_m: float
    overlap: float
    deviation_m: FloatArray
    free_motions: FloatArray

    @property
    def free_directions(self) -> int:
        """How many directions the clouds do not determine."""
        return len(self.free_motions)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Trial:
    """Where one guess led: the fit, the share of the source near the target, and the mean distance of the telling points.

    Telling points are the standing ones, or all where none stands. Distances are in units of what counts as near, at most 1.
    """

    fit: Fit
    known: Determination
    overlap: float
    error: float


def register(source: npt.ArrayLike, target: npt.ArrayLike, *, start: FloatArray | None = None) -> RegistrationResult:
    """The rigid motion that takes one cloud (n, 3) to another (m, 3) [m], from `start` (4, 4) or from several guesses.

    Without a start, two guesses are tried: no motion, and the clouds' middles on each other. Where neither fits well, turns
    about the vertical are tried too. The status tells where the clouds do not determine the motion. Raises CloudError for
    arrays that are no clouds or have no extent.
    """
    moving, fixed = check_cloud(source, source="source", at_least=3), check_cloud(target, source="target", at_least=3)
    if _same_points(moving, fixed):
        return _identity()
    # The clouds are centred, because rotations about a far origin are ill-conditioned. Small clouds are scaled up, so that one
    # least residual scale serves a street and a part on a table.
    centres = np.median(moving, axis=0), np.median(fixed, axis=0)
    extent = float(np.percentile(np.linalg.norm(fixed - centres[1], axis=1), 90))
    if extent == 0:
        raise CloudError("target: most points are the same; a cloud has an extent")
    unit = min(extent / MIN_SCENE_RADIUS_M, 1.0)
    moving, fixed, extent = (moving - centres[0]) / unit, (fixed - centres[1]) / unit, extent / unit
    tree = cKDTree(fixed)
    spacings = np.asarray(tree.query(fixed[:: 1 + len(fixed) // 2000], k=2)[0])[:, 1]
    near = max(extent * MIN_CUBE_SHARE, MIN_CUBE_SPACINGS * float(np.median(spacings)))
    levels, sample = _levels(moving, fixed, near=near, extent=extent), _thinned(moving, near)
    standing = levels[-1][-1]
    # Standing points decide between guesses: a LiDAR's rings on the ground lie on each other whatever the turn.
    telling, target = (standing.features, standing.target.points) if len(standing.features) else (sample, fixed)
    telling_tree = cKDTree(target) if len(target) else tree

    def followed(guess: FloatArray) -> _Trial:
        fit = _coarse_to_fine(levels[1:], guess, extent=extent)
        known = determination(levels[-1], fit, extent=extent, radius=near)
        away = np.asarray(telling_tree.query(moved(telling, fit.pose), distance_upper_bound=near)[0])
        overlap = np.isfinite(tree.query(moved(sample, fit.pose), distance_upper_bound=near)[0]).mean()
        return _Trial(fit=fit, known=known, overlap=float(overlap), error=float(np.minimum(away / near, 1.0).mean()))

    def coarsely(guesses: list[FloatArray]) -> list[FloatArray]:
        return _distinct([_coarse_to_fine(levels[:1], guess, extent=extent).pose for guess in guesses], near, extent=extent)

    trials = [followed(guess) for guess in coarsely(_guesses(start, centres, unit))]
    best = min(trials, key=lambda trial: trial.error)
    if start is None and best.error > MAX_CONVINCING_ERROR:
        trials += [followed(guess) for guess in coarsely(_promising_turns(levels[0], centres, unit))]
        best = min(trials, key=lambda trial: trial.error)
    fit = best.fit
    pose = rigid(fit.pose[:3, :3], fit.pose[:3, 3] * unit + centres[1] - fit.pose[:3, :3] @ centres[0])
    return _judged(best, pose, extent=extent, unit=unit)


def compile_kernels() -> None:
    """Compile, or load from the cache, every kernel of the registration."""
    rng = np.random.default_rng(1)
    floor = np.column_stack([rng.uniform(-5, 5, (400, 2)), np.zeros(400)])
    register(floor + np.array([0.1, 0.0, 0.1]), floor)


def _same_points(moving: FloatArray, fixed: FloatArray) -> bool:
    """Whether two clouds hold the same points in any order."""
    if moving.shape != fixed.shape:
        return False
    moving, fixed = (cloud[np.lexsort(cloud.T)] for cloud in (moving, fixed))
    return bool((moving == fixed).all())


def _guesses(start: FloatArray | None, centres: tuple[FloatArray, FloatArray], unit: float) -> list[FloatArray]:
    """First guesses between the centred, scaled clouds: the given start, or no motion and the middles on each other."""
    if start is not None:
        return [rigid(start[:3, :3], (start[:3, :3] @ centres[0] + start[:3, 3] - centres[1]) / unit)]
    return [rigid(np.eye(3), (centres[0] - centres[1]) / unit), np.eye(4)]


def _promising_turns(
    coarse: tuple[SurfaceMatcher, ...], centres: tuple[FloatArray, FloatArray], unit: float
) -> list[FloatArray]:
    """Further guesses: the turns about the vertical, through the middles or the origins, that bring standing points nearest."""
    standing = coarse[-1]
    if not (len(standing.features) and len(standing.target)):
        return []
    tree = cKDTree(standing.target.points)
    guesses = []
    for turn in np.arange(TURNS) * (2 * np.pi / TURNS):
        rotation = rotation_from_vector([0.0, 0.0, turn])
        origins = (rotation @ centres[0] - centres[1]) / unit
        guesses += [rigid(rotation, np.zeros(3)), rigid(rotation, origins)]

    def mean_distance(guess: FloatArray) -> float:
        away = np.asarray(tree.query(moved(standing.features, guess), distance_upper_bound=standing.target.cube)[0])
        return float(np.minimum(away, standing.target.cube).mean())

    return sorted(guesses, key=mean_distance)[:FOLLOWED_TURNS]


def _levels(moving: FloatArray, fixed: FloatArray, *, near: float, extent: float) -> list[tuple[SurfaceMatcher, ...]]:
    """Matchers (ground, standing) of each level, coarse to fine. Ground is matched to planes, standing points to any shape.

    The two parts are kept apart, so that a cone among ten thousand ground points finds its own neighbours even at a radius of
    metres. Together, the rings of a LiDAR on the ground, which look the same from every place, would hold the scan in place.
    """
    columns = []
    kinds = ((Shape.GROUND, GROUND_FINENESS), (Shape.ANY, STANDING_FINENESS))
    for (shape, fineness), points, others in zip(kinds, _parts(moving, extent), _parts(fixed, extent), strict=True):
        column = []
        for factor in sorted(LEVELS):  # a coarser level is thinned from the finer one
            cube = factor * near
            held = VoxelMap(cube=cube, spacing=cube / fineness)
            held.insert(others)
            points, others = _thinned(points, cube / fineness), held.points  # noqa: PLW2901
            features = points[:: 1 + len(points) // MAX_FEATURES]
            column.append(SurfaceMatcher(features=features, target=held, shape=shape))
        columns.append(column[::-1])
    return list(zip(*columns, strict=True))


def _parts(points: FloatArray, extent: float) -> tuple[FloatArray, FloatArray]:
    """(ground, standing) points of a centred cloud. In a cloud smaller than MIN_SCENE_RADIUS_M all points are standing."""
    ground = np.zeros(len(points), dtype=bool)
    if extent >= MIN_SCENE_RADIUS_M:
        # Stray points, or a cloud in centimetres, would spread the surface over millions of cells.
        within = np.abs(points[:, :2]).max(axis=1) < MAX_STRAY_RADII * extent
        cell = max(1.0, extent / MAX_CELLS_PER_RADIUS)
        with suppress(NoGroundError):
            ground[within] = ground_mask(points[within], SmrfSpec(cell_m=cell, elevation_threshold_m=ELEVATION_THRESHOLD_M))
    return points[ground], points[~ground]


def _coarse_to_fine(levels: list[tuple[SurfaceMatcher, ...]], pose: FloatArray, *, extent: float) -> Fit:
    """The fit of the finest level, each level starting at the pose of the one before."""
    weak = np.diag([PRIOR_INFORMATION] * 3 + [PRIOR_INFORMATION * extent**2] * 3)
    fit = Fit(pose=pose, information=np.zeros((6, 6)), scale=np.inf, used=0, converged=False)
    for matchers in levels:
        radius = max(matcher.target.cube for matcher in matchers)
        fit = align(matchers, fit.pose, prior_information=weak, radii=(radius,) * SEARCHES)
    return fit


def _thinned(points: FloatArray, spacing: float) -> FloatArray:
    """Points of a cloud that keep a spacing [m], by cubes of a point map."""
    kept = VoxelMap(cube=4 * spacing, spacing=spacing)
    kept.insert(points)
    return kept.points


def _distinct(poses: list[FloatArray], near: float, *, extent: float) -> list[FloatArray]:
    """The poses (4, 4) without those that put the cloud where one before them puts it."""
    kept: list[FloatArray] = []
    for pose in poses:
        apart = [minus(pose, other) * ([1.0] * 3 + [extent] * 3) for other in kept]
        if all(np.linalg.norm(each) > near for each in apart):
            kept.append(pose)
    return kept


def _judged(trial: _Trial, transform: FloatArray, *, extent: float, unit: float) -> RegistrationResult:
    """The result in metres, with the status that the trial deserves."""
    fit, free = trial.fit, trial.known.free(above=MAX_DEVIATION_SHARE * extent)
    status = RegistrationStatus.CONVERGED
    if fit.used < MIN_FEATURES:
        status = RegistrationStatus.TOO_FEW_FEATURES
    elif trial.overlap < MIN_OVERLAP:
        status = RegistrationStatus.POOR_OVERLAP
    elif len(free):
        status = RegistrationStatus.DEGENERATE
    elif not fit.converged:
        status = RegistrationStatus.NOT_CONVERGED
    return RegistrationResult(
        transform=transform, status=status, scale_m=fit.scale * unit, overlap=trial.overlap,
        deviation_m=trial.known.deviation * unit, free_motions=free,
    )  # fmt: skip


def _identity() -> RegistrationResult:
    """The result for identical clouds."""
    return RegistrationResult(
        transform=np.eye(4),
        status=RegistrationStatus.IDENTICAL_CLOUDS,
        scale_m=0.0,
        overlap=1.0,
        deviation_m=np.full(6, np.inf),
        free_motions=np.eye(6),
    )
