"""LiDAR odometry and mapping of one drive (LOAM): the car's pose at each scan, and how certain it is.

Features by curvature are matched to the lines and planes of a growing map (Zhang & Singh 2014), starting from the prior pose of
`motion`. The scan is then fused with the prior as a measurement of the pose. Its information is first reduced by the
uncertainty of the map, which was built from the same poses. Directions in which the scan is less certain than the prior are
left to the prior (solution remapping, Zhang, Kaess & Singh 2016): a bare line of cones does not fix height and pitch, a
guardrail does not fix the position along it. Dead reckoning runs beside it and is part of every result.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from wzsumo.errors import InputError, NoGroundError
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.lidar_mapping.alignment import MIN_FEATURES, Fit, Matcher, SurfaceMatcher, align, minus
from wzsumo.lidar_mapping.features import Features, FeatureSpec, deskew, extract_features
from wzsumo.lidar_mapping.motion import (
    MotionSpec,
    Prior,
    corrected,
    dead_reckoned_poses,
    initial_prior,
    motion_within,
    poses_between,
    predict,
    with_attitude,
    with_gnss,
)
from wzsumo.lidar_mapping.patches import Shape
from wzsumo.lidar_mapping.posed_scan import PosedScan, ScanState
from wzsumo.lidar_mapping.post_map import PostMap, PostMatcher
from wzsumo.lidar_mapping.smrf import SmrfSpec, ground_mask
from wzsumo.lidar_mapping.voxel_map import VoxelMap
from wzsumo.rigid import moved
from wzsumo.scan import LidarScan, MotionReadings
from wzsumo.spec import Spec

SEARCHES, STEPS_PER_SEARCH = 3, 3  # of one registration at most: the prior is good, so few are needed. Chosen by us
SETTLED_STEP = 2e-3  # [m, rad]; no further search follows a shorter first step. Chosen by us
GROUND_STRIDE = 3  # every third smooth ground point goes into the map; the others would hardly change it. Chosen by us


class LoamSpec(Spec):
    """Odometry and mapping of one drive."""

    # Threshold: Chen et al. 2022. No allowance for slope: roads have little of it, and noise in the slope would hide low cones.
    ground: SmrfSpec = SmrfSpec(elevation_threshold_m=0.2, elevation_scalar=0.0)
    features: FeatureSpec = FeatureSpec()
    motion: MotionSpec = MotionSpec()
    # Search radii for the points of a line or a post, and for those of a plane. Set on our simulated drives.
    edge_radius_m: float = Field(default=0.6, gt=0)
    plane_radius_m: float = Field(default=1.2, gt=0)  # likewise, for planes
    edge_spacing_m: float = Field(default=0.08, gt=0)  # between the map's edge points; chosen by us
    plane_spacing_m: float = Field(default=0.35, gt=0)  # between the map's planar points; chosen by us
    map_deviation_m: float = Field(default=0.01, gt=0)  # sd of the map's position as a whole, per scan; chosen by us
    map_deviation_deg: float = Field(default=0.02, gt=0)  # sd of the map's rotation as a whole, per scan; chosen by us
    gate: float = Field(default=5.0, gt=0)  # standard deviations between scan and prior, at most; chosen by us
    max_range_m: float = Field(default=60.0, gt=0)  # of points that may be standing; a cone gets six rays there


def map_drive(
    scans: Iterable[LidarScan], readings: MotionReadings, spec: LoamSpec, *, mounting: FloatArray, start: FloatArray
) -> Iterator[PosedScan]:
    """The scans of a drive with their poses, one by one. `mounting` (4, 4): sensor to car; `start` (4, 4): first car pose.

    Raises InputError where there is no scan, TraceError where there is no motion reading around a scan.
    """
    maps = _empty_maps(spec)
    prior, reckoned = initial_prior(start, spec.motion), dead_reckoned_poses(readings, start)
    last: LidarScan | None = None
    for scan in scans:
        fix: FloatArray | None = None
        if last is not None:
            prior, fix = _predicted(prior, readings, last.start_s, scan.start_s, spec.motion)
        step = 2 * np.pi / (int(scan.column.max()) + 1) if len(scan.points) else 0.0
        motion = _motion_of_columns(scan, readings, prior) @ mounting
        cloud = deskew(scan, motion)
        standing = _standing(scan, cloud, prior, spec)
        features = extract_features(scan, cloud, standing, spec.features, motion=motion)
        fit: Fit | None = None
        free = 0
        state = ScanState.FIRST_SCAN if last is None else _state_before_registration(scan, last, features)
        if state is ScanState.REGISTERED:
            fit = _registered(maps.matchers(features, sensor=mounting[:3, 3], step=step), prior, spec)
            prior, state, free = _fused(prior, fit, spec)
        if fix is not None:
            prior = with_gnss(prior, fix, spec.motion)
        if state is not ScanState.IDENTICAL_SCAN:
            maps.insert(features, prior.pose, sensor=(prior.pose @ mounting)[:3, 3], step=step)
        last = scan
        yield PosedScan(
            time_s=scan.start_s,
            pose=prior.pose,
            dead_reckoned=poses_between(readings.time_s, reckoned, [scan.start_s])[0],
            state=state,
            free_directions=free,
            scale_m=0.0 if fit is None else fit.scale,
            deviation=np.sqrt(np.diag(prior.covariance)[:6]),
            has_gnss=fix is not None,
            cloud=cloud,
            standing=standing,
            sensor=mounting[:3, 3],
        )
    if last is None:
        raise InputError("no scans: a drive of the mapping car must last for at least one turn of its LiDAR")


@dataclass(frozen=True, kw_only=True, eq=False)
class _FeatureMaps:
    """The map that grows with the drive: one part for each kind of feature, in the world frame."""

    posts: PostMap
    edges: VoxelMap
    walls: VoxelMap
    ground: VoxelMap

    def matchers(self, features: Features, *, sensor: FloatArray, step: float) -> tuple[Matcher, ...]:
        """Each kind of features with its part of the map. `sensor` (3,) is in the car's frame, `step` is in azimuth [rad]."""
        return (
            PostMatcher(features=features.posts, target=self.posts, sensor=sensor, step=step),
            SurfaceMatcher(features=features.edge, target=self.edges, shape=Shape.LINE),
            SurfaceMatcher(features=features.walls, target=self.walls, shape=Shape.PLANE),
            SurfaceMatcher(features=features.ground, target=self.ground, shape=Shape.GROUND),
        )

    def insert(self, features: Features, pose: FloatArray, *, sensor: FloatArray, step: float) -> None:
        """Add the features of a scan taken at a car pose (4, 4); `sensor` (3,) is in the world frame."""
        self.posts.insert(moved(features.posts, pose), sensor=sensor, step=step)
        self.edges.insert(moved(features.edge, pose))
        self.walls.insert(moved(features.smooth_walls, pose))
        self.ground.insert(moved(features.smooth_ground[::GROUND_STRIDE], pose))


def _empty_maps(spec: LoamSpec) -> _FeatureMaps:
    return _FeatureMaps(
        posts=PostMap(apart=spec.edge_radius_m),
        edges=VoxelMap(cube=spec.edge_radius_m, spacing=spec.edge_spacing_m),
        walls=VoxelMap(cube=spec.plane_radius_m, spacing=spec.plane_spacing_m),
        ground=VoxelMap(cube=spec.plane_radius_m, spacing=spec.plane_spacing_m),
    )


def _predicted(
    prior: Prior, readings: MotionReadings, from_s: float, to_s: float, spec: MotionSpec
) -> tuple[Prior, FloatArray | None]:
    """(prior at the next scan, GNSS position at the next scan or None).

    The position is that of the last fix since the last scan, moved on to the next scan's time.
    """
    motion = motion_within(readings, prior, np.array([from_s, to_s]))[1]
    prior = predict(prior, motion, elapsed_s=to_s - from_s, spec=spec)
    attitude = np.array([np.interp(to_s, readings.time_s, angle) for angle in readings.attitude.T])
    prior = with_attitude(prior, attitude, elapsed_s=to_s - from_s, spec=spec)
    since = np.flatnonzero((readings.gnss_time_s > from_s + 1e-6) & (readings.gnss_time_s <= to_s + 1e-6))
    if not since.size:
        return prior, None
    fixed_s = float(readings.gnss_time_s[since[-1]])
    rest = motion_within(readings, prior, np.array([fixed_s, to_s + 1e-9]))[1]
    return prior, readings.gnss[since[-1]] + prior.pose[:3, :3] @ rest[:3, :3].T @ rest[:3, 3]


def _motion_of_columns(scan: LidarScan, readings: MotionReadings, prior: Prior) -> FloatArray:
    """Motions (columns, 4, 4) of the car from the scan's start to the firing of each azimuth column."""
    if len(scan.points) == 0:
        return np.eye(4)[None]
    offsets = np.zeros(int(scan.column.max()) + 1)
    offsets[scan.column] = scan.time_s
    return motion_within(readings, prior, scan.start_s + np.maximum.accumulate(offsets))


def _standing(scan: LidarScan, cloud: FloatArray, prior: Prior, spec: LoamSpec) -> BoolArray:
    """Which points (n,) stand above the ground; points beyond `max_range_m` count as ground."""
    near = np.einsum("ni,ni->n", scan.points, scan.points) < spec.max_range_m**2
    standing = np.zeros(len(cloud), dtype=bool)
    if near.any():
        # SMRF needs level axes: the car's roll and pitch would otherwise add to every slope.
        try:
            standing[near] = ~ground_mask(cloud[near] @ prior.pose[:3, :3].T, spec.ground)
        except NoGroundError:
            standing[near] = True
    return standing


def _state_before_registration(scan: LidarScan, last: LidarScan, features: Features) -> ScanState:
    """REGISTERED where a registration can be tried, otherwise why not."""
    if len(scan.points) and scan.points.shape == last.points.shape and (scan.points == last.points).all():
        return ScanState.IDENTICAL_SCAN
    return ScanState.REGISTERED if len(features) >= MIN_FEATURES else ScanState.TOO_FEW_FEATURES


def _registered(matchers: Sequence[Matcher], prior: Prior, spec: LoamSpec) -> Fit:
    """The fit of a scan's features to the map, from the prior."""
    radius = max(spec.edge_radius_m, spec.plane_radius_m)
    information = np.asarray(np.linalg.solve(prior.covariance[:6, :6], np.eye(6)), dtype=np.float64)
    return align(
        matchers,
        prior.pose,
        prior_information=information,
        radii=(radius,) * SEARCHES,
        max_steps=STEPS_PER_SEARCH,
        settled_step=SETTLED_STEP,
    )


def _fused(prior: Prior, fit: Fit, spec: LoamSpec) -> tuple[Prior, ScanState, int]:
    """(the prior updated by the scan, the scan's state, number of directions left to the prior).

    Let H be the scan's information and P the prior's covariance. Gauss-Newton ended at the pose x where
    H (x_scan - x) = P^-1 (x - x_prior), so H (x_scan - x_prior) = (H + P^-1) (x - x_prior) is known even where H is singular.
    With the map's own covariance S, the scan measures the pose with the information (I + H S)^-1 H.
    """
    if fit.used < MIN_FEATURES or not fit.converged:
        return prior, ScanState.TOO_FEW_FEATURES, 6
    P = prior.covariance[:6, :6]
    offset = minus(fit.pose, prior.pose)
    if float(offset @ np.linalg.solve(P, offset)) > spec.gate**2 * 6:  # 6 is the mean of chi-squared with six unknowns
        return prior, ScanState.CONTRADICTS_PRIOR, 6
    map_covariance = np.diag(np.square([spec.map_deviation_m] * 3 + [np.deg2rad(spec.map_deviation_deg)] * 3))
    lowered = np.linalg.inv(np.eye(6) + fit.information @ map_covariance)
    information = lowered @ fit.information
    information = (information + information.T) / 2
    pull = lowered @ (fit.information + np.linalg.inv(P)) @ offset
    # In coordinates where P is the identity, a direction with an eigenvalue below 1 is known less well than from the prior.
    root = np.linalg.cholesky(P)
    values, vectors = np.linalg.eigh(root.T @ information @ root)
    kept = values >= 1.0
    onto = vectors[:, kept] @ vectors[:, kept].T
    white_information = onto @ (root.T @ information @ root) @ onto
    back = np.linalg.inv(root)
    information, pull = back.T @ white_information @ back, back.T @ onto @ root.T @ pull
    full = np.zeros((8, 8))
    full[:6, :6] = information
    covariance = np.asarray(np.linalg.inv(np.linalg.inv(prior.covariance) + full), dtype=np.float64)
    error = covariance[:, :6] @ pull
    free = int(6 - kept.sum())
    state = ScanState.REGISTERED if free == 0 else ScanState.DEGENERATE
    return corrected(prior, error, covariance), state, free
