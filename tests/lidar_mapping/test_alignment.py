from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lidar_mapping.clouds import room

from wzsumo.frames import FloatArray
from wzsumo.lidar_mapping.alignment import SurfaceMatcher, align, minus, plus
from wzsumo.lidar_mapping.patches import Patches, Shape, fit_patches
from wzsumo.lidar_mapping.voxel_map import VoxelMap
from wzsumo.rigid import moved, rigid, rotation_from_rpy

FREE, HELD = np.diag([1e-9] * 6), np.diag([1e12] * 6)  # information of a prior that lets the pose go, or keeps it


@dataclass(frozen=True, kw_only=True, eq=False)
class FixedMatcher:
    """Features (n, 3) that are matched to given centres (n, 3) in all of the first `dimension` directions."""

    features: FloatArray
    centre: FloatArray
    dimension: int

    def patches(self, _pose: FloatArray, _radius: float) -> Patches:
        n = len(self.features)
        projector = np.tile(np.diag(np.arange(3) < self.dimension).astype(float), (n, 1, 1))
        dimension = np.full(n, self.dimension, dtype=np.int64)
        return Patches(centre=self.centre, projector=projector, dimension=dimension, share=np.ones(n))


def cube_of_points(n: int = 3000) -> FloatArray:
    return np.random.default_rng(1).uniform(-10, 10, (n, 3))


@given(st.lists(st.floats(-2, 2), min_size=6, max_size=6))
def test_minus_undoes_plus(step: list[float]) -> None:
    pose = rigid(rotation_from_rpy([0.1, -0.2, 2.0]), [5, 6, 7])
    np.testing.assert_allclose(minus(plus(pose, np.array(step) / 2), pose), np.array(step) / 2, atol=1e-9)


def test_information_equals_numerical_derivatives_of_the_cost() -> None:
    held = VoxelMap(cube=1.0, spacing=0.1)
    held.insert(room(1))
    features = room(2, n=400)
    strong = np.diag([1e12] * 6)  # the prior holds the pose, so that the information is taken at the start
    start = rigid(rotation_from_rpy([0.01, -0.02, 0.03]), [0.1, 0.05, -0.05])
    fit = align(
        (SurfaceMatcher(features=features, target=held, shape=Shape.PLANE),),
        start,
        prior_information=strong,
        radii=(1.0,),
        max_steps=1,
    )
    patches = fit_patches(moved(features, start), held, shape=Shape.PLANE, radius=1.0)
    used = patches.dimension > 0

    def offsets(step: FloatArray) -> FloatArray:
        away = moved(features[used], plus(start, step)) - patches.centre[used]
        return np.asarray(np.einsum("nij,nj->ni", patches.projector[used], away))

    size = np.linalg.norm(offsets(np.zeros(6)), axis=1)
    weight = patches.share[used] / fit.scale**2 / (1 + (size / (2.3849 * fit.scale)) ** 2)
    slopes = [(offsets(1e-6 * e) - offsets(-1e-6 * e)) / 2e-6 for e in np.eye(6)]
    expected = [[np.einsum("n,ni,ni->", weight, a, b) for b in slopes] for a in slopes]
    np.testing.assert_allclose(fit.information, expected, rtol=1e-5, atol=1e-3 * np.max(expected))


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_scale_of_gaussian_residuals_is_their_standard_deviation(dimension: int) -> None:
    points = cube_of_points()
    noisy = points + 0.07 * np.random.default_rng(2).standard_normal(points.shape)
    fit = align(
        [FixedMatcher(features=points, centre=noisy, dimension=dimension)], np.eye(4), prior_information=HELD, radii=(1.0,)
    )
    assert fit.scale == pytest.approx(0.07, rel=0.05)


def test_scale_of_exact_residuals_is_a_centimetre() -> None:
    points = cube_of_points(100)
    fit = align([FixedMatcher(features=points, centre=points, dimension=3)], np.eye(4), prior_information=HELD, radii=(1.0,))
    assert fit.scale == 0.01


@pytest.mark.parametrize(("n", "moves"), [(11, False), (12, True)])
def test_fewer_features_than_twice_the_unknowns_leave_the_start_and_have_no_information(n: int, moves: bool) -> None:
    points = cube_of_points(n)
    fit = align(
        [FixedMatcher(features=points, centre=points + 0.1, dimension=3)], np.eye(4), prior_information=FREE, radii=(1.0,)
    )
    assert fit.information.any() == moves
    np.testing.assert_allclose(fit.pose[:3, 3], 0.1 if moves else 0.0, atol=1e-6)
    assert fit.used == n


@pytest.mark.parametrize(("offset", "converged"), [(0.009, True), (0.011, False)])
def test_fit_whose_last_step_is_longer_than_a_centimetre_has_not_converged(offset: float, converged: bool) -> None:
    points = cube_of_points(50)
    matcher = FixedMatcher(features=points, centre=points + np.array([offset, 0, 0]), dimension=3)
    fit = align([matcher], np.eye(4), prior_information=FREE, radii=(1.0,), max_steps=1)
    assert fit.converged == converged


def test_steps_go_on_until_they_are_shorter_than_a_hundredth_of_a_millimetre() -> None:
    points = cube_of_points(300)
    truth = rigid(rotation_from_rpy([0.1, -0.2, 0.3]), [0.3, 0.2, 0.1])
    matcher = FixedMatcher(features=points, centre=moved(points, truth), dimension=3)
    fit = align([matcher], np.eye(4), prior_information=FREE, radii=(1.0,), max_steps=20)
    np.testing.assert_allclose(fit.pose, truth, atol=1e-9)


def test_outliers_hardly_move_the_pose() -> None:
    points = cube_of_points(300)
    target = points + 0.01 * np.random.default_rng(3).standard_normal(points.shape)
    target[:60] += (5.0, 0.0, 0.0)  # with equal weights the pose would move by a metre
    fit = align(
        [FixedMatcher(features=points, centre=target, dimension=3)], np.eye(4), prior_information=FREE, radii=(1.0,) * 5
    )
    assert np.linalg.norm(fit.pose[:3, 3]) < 0.01


def test_pose_lies_between_prior_and_features_by_their_information() -> None:
    points = cube_of_points(100)
    matcher = FixedMatcher(features=points, centre=points + np.array([0.02, 0, 0]), dimension=1)
    held = align([matcher], np.eye(4), prior_information=HELD, radii=(1.0,), max_steps=1)
    half = np.diag([held.information[0, 0], *[1e12] * 5])  # the prior knows x as well as the features do
    fit = align([matcher], np.eye(4), prior_information=half, radii=(1.0,), max_steps=1)
    np.testing.assert_allclose(fit.pose[:3, 3], [0.01, 0, 0], atol=1e-9)
