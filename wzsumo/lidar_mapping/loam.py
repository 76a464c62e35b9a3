"""LiDAR odometry and mapping of one drive (LOAM): where the car was at each scan, and how far that can be trusted.

Features by curvature, laid on the lines and planes of a growing map (Zhang & Singh 2014), from the prior of `motion`. What
the scan says is then weighed against the prior: its information is first lowered by the map's own uncertainty, for the
map was made with the same poses; and in directions where it says less than the prior (a bare line of cones leaves
height and pitch free, a guardrail the way along it) it says nothing (solution remapping, Zhang, Kaess & Singh 2016).
Dead reckoning runs beside it and is part of every result.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from pydantic import Field

from wzsumo.errors import InputError, NoGroundError
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.lidar_mapping.alignment import FEWEST_FEATURES, Fit, Matcher, SurfaceMatcher, align, minus
from wzsumo.lidar_mapping.features import Features, FeatureSpec, extract_features, take_out_motion
from wzsumo.lidar_mapping.motion import (
    MotionSpec,
    Prior,
    corrected,
    first_prior,
    motion_within,
    poses_between,
    predict,
    reckoned_poses,
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


class LoamSpec(Spec):
    """Odometry and mapping of one drive."""

    # Chen et al. 2022 for the threshold. No allowance for slope: a road has hardly any, and what noise adds hides low cones.
    ground: SmrfSpec = SmrfSpec(elevation_threshold_m=0.2, elevation_scalar=0.0)
    features: FeatureSpec = FeatureSpec()
    motion: MotionSpec = MotionSpec()
    edge_radius_m: float = Field(default=0.6, gt=0)  # of the search for a line's points: a cone's width and a scan's spacing
    plane_radius_m: float = Field(default=1.2, gt=0)  # of a plane's points
    edge_spacing_m: float = Field(default=0.08, gt=0)  # of the map's points; denser than the LiDAR sees at 30 m
    plane_spacing_m: float = Field(default=0.35, gt=0)
    map_deviation_m: float = Field(default=0.01, gt=0)  # how far the map as a whole may be off from one scan to the next
    map_deviation_deg: float = Field(default=0.02, gt=0)
    gate: float = Field(default=5.0, gt=0)  # standard deviations that a scan may contradict the prior by
    max_range_m: float = Field(default=60.0, gt=0)  # of points that can stand above the ground; a cone has six rays there


def map_drive(
    scans: Iterable[LidarScan], readings: MotionReadings, spec: LoamSpec, *, mounting: FloatArray, start: FloatArray
) -> Iterator[PosedScan]:
    """Posed scans of a drive, one as each comes. `mounting` (4, 4): sensor to car; `start` (4, 4): the car's first pose.

    Raises InputError where there is no scan, or no motion reading around one.
    """
    edges = VoxelMap(cube=spec.edge_radius_m, spacing=spec.edge_spacing_m)
    posts = PostMap(apart=spec.edge_radius_m)
    ground, walls = (VoxelMap(cube=spec.plane_radius_m, spacing=spec.plane_spacing_m) for _ in range(2))
    prior, reckoned = first_prior(start, spec.motion), reckoned_poses(readings, start)
    last: LidarScan | None = None
    for scan in scans:
        fix: FloatArray | None = None
        if last is not None:
            prior, fix = _carried_on(prior, readings, last.start_s, scan.start_s, spec.motion)
        step = 2 * np.pi / (int(scan.column.max()) + 1) if len(scan.points) else 0.0
        motion = _motion_of_columns(scan, readings, prior) @ mounting
        cloud = take_out_motion(scan, motion)
        standing = _standing(scan, cloud, prior, spec)
        features = extract_features(scan, cloud, standing, spec.features, motion=motion)
        fit: Fit | None = None
        state, free = ScanState.FIRST_SCAN, 0
        if last is not None:
            state = _readiness(scan, last, features)
        if state is ScanState.REGISTERED:
            matchers = (
                PostMatcher(features=features.posts, target=posts, sensor=mounting[:3, 3], step=step),
                SurfaceMatcher(features=features.edge, target=edges, shape=Shape.LINE),
                SurfaceMatcher(features=features.walls, target=walls, shape=Shape.PLANE),
                SurfaceMatcher(features=features.ground, target=ground, shape=Shape.GROUND),
            )
            fit = _laid_on(matchers, prior, spec)
            prior, state, free = _weighed(prior, fit, spec)
        if fix is not None:
            prior = with_gnss(prior, fix, spec.motion)
        if state is not ScanState.IDENTICAL_SCAN:
            posts.insert(moved(features.posts, prior.pose), sensor=(prior.pose @ mounting)[:3, 3], step=step)
            edges.insert(moved(features.edge, prior.pose))
            walls.insert(moved(features.smooth_walls, prior.pose))
            ground.insert(moved(features.smooth_ground[::3], prior.pose))  # a third of them fill the map as well
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


def _carried_on(
    prior: Prior, readings: MotionReadings, from_s: float, to_s: float, spec: MotionSpec
) -> tuple[Prior, FloatArray | None]:
    """(prior at the next scan, the last GNSS fix since, moved on to the scan's time)."""
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
    """Motions (columns, 4, 4) of the car from the scan's start to when each azimuth column was fired."""
    if len(scan.points) == 0:
        return np.eye(4)[None]
    offsets = np.zeros(int(scan.column.max()) + 1)
    offsets[scan.column] = scan.time_s
    return motion_within(readings, prior, scan.start_s + np.maximum.accumulate(offsets))


def _standing(scan: LidarScan, cloud: FloatArray, prior: Prior, spec: LoamSpec) -> BoolArray:
    """Which points (n,) stand above the ground; far ones count as ground."""
    near = np.einsum("ni,ni->n", scan.points, scan.points) < spec.max_range_m**2
    standing = np.zeros(len(cloud), dtype=bool)
    if near.any():
        # Level axes, as SMRF needs them: the car's own roll and pitch would add to every slope.
        try:
            standing[near] = ~ground_mask(cloud[near] @ prior.pose[:3, :3].T, spec.ground)
        except NoGroundError:
            standing[near] = True
    return standing


def _readiness(scan: LidarScan, last: LidarScan, features: Features) -> ScanState:
    """REGISTERED where registration may be tried."""
    if len(scan.points) and scan.points.shape == last.points.shape and (scan.points == last.points).all():
        return ScanState.IDENTICAL_SCAN
    return ScanState.REGISTERED if len(features) >= FEWEST_FEATURES else ScanState.TOO_FEW_FEATURES


def _laid_on(matchers: Sequence[Matcher], prior: Prior, spec: LoamSpec) -> Fit:
    radius = max(spec.edge_radius_m, spec.plane_radius_m)
    trust = np.asarray(np.linalg.solve(prior.covariance[:6, :6], np.eye(6)), dtype=np.float64)
    return align(matchers, prior.pose, prior_information=trust, radii=(radius,) * 3, steps=3, settle=2e-3)


def _weighed(prior: Prior, fit: Fit, spec: LoamSpec) -> tuple[Prior, ScanState, int]:
    """(the prior with what the scan adds, state, count of directions left to the prior).

    Gauss-Newton ended where information (x_scan - x) = prior information (x - x_prior), so that information
    (x_scan - x_prior) is known even where the information is singular. With H the information and S the map's own
    covariance, the scan as a measurement of the pose has the information (I + H S)^-1 H.
    """
    if fit.used < FEWEST_FEATURES or not fit.converged:
        return prior, ScanState.TOO_FEW_FEATURES, 6
    P = prior.covariance[:6, :6]
    offset = minus(fit.pose, prior.pose)
    if float(offset @ np.linalg.solve(P, offset)) > spec.gate**2 * 6:
        return prior, ScanState.CONTRADICTS_PRIOR, 6
    map_covariance = np.diag(np.square([spec.map_deviation_m] * 3 + [np.deg2rad(spec.map_deviation_deg)] * 3))
    lowered = np.linalg.inv(np.eye(6) + fit.information @ map_covariance)
    information = lowered @ fit.information
    information = (information + information.T) / 2
    pull = lowered @ (fit.information + np.linalg.inv(P)) @ offset
    # In coordinates where the prior's covariance is the identity, an eigenvalue below 1 says less than the prior.
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
