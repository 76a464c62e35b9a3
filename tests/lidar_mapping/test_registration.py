import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from wzsumo.errors import CloudError
from wzsumo.lidar_mapping.alignment import SurfaceMatcher, align, minus, plus
from wzsumo.lidar_mapping.patches import FEWEST, FLATNESS, NEIGHBOURS, SLENDERNESS, SPREAD, Shape, fit_patches
from wzsumo.lidar_mapping.registration import RegistrationStatus, register
from wzsumo.lidar_mapping.voxel_map import ROOM, VoxelMap
from wzsumo.rigid import inverse, moved, rigid, rotation_from_rpy, rotation_from_vector, rpy_from_rotation, vector_from_rotation

ANGLES = st.floats(-1.5, 1.5)


def room(seed, n=5000, noise=0.01):
    """Points on floor and four walls of a room of 20 x 12 x 6 m."""
    rng = np.random.default_rng(seed)
    face, points = rng.integers(0, 5, n), rng.uniform(-1, 1, (n, 3)) * (10, 6, 3)
    for number, (axis, side) in enumerate([(2, -3), (0, 10), (0, -10), (1, 6), (1, -6)]):
        points[face == number, axis] = side
    return points + noise * rng.standard_normal(points.shape)


def street(x, seed, *, yaw=0.0, noise=0.02, y=0.0):
    """What a LiDAR at (x, y) sees of a flat road with poles and cones: rings on the ground that travel with it."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(-np.pi, np.pi, 400, endpoint=False)
    reach = 1.9 / np.tan(np.deg2rad(np.linspace(2.5, 25, 40)))
    rings = np.column_stack([np.outer(reach, np.cos(turn)).ravel(), np.outer(reach, np.sin(turn)).ravel()])
    clouds = [np.column_stack([rings, np.full(len(rings), -1.9)])]
    for k, centre in enumerate([(-25, 6), (-7, 6), (11, 6.5), (29, 7), (-30, -9), (4, -8), (33, -10)]):
        height = np.linspace(-1.4, -1.0 if k < 4 else 0.6, 14)
        away = np.subtract(centre, (x, y))
        face = np.arctan2(-away[1], -away[0]) + np.linspace(-1.2, 1.2, 5)
        mantle = away + 0.12 * np.column_stack([np.cos(face), np.sin(face)])
        clouds.append(np.column_stack([np.tile(mantle, (14, 1)), np.repeat(height, 5)]))
    cloud = np.vstack(clouds)
    return moved(cloud + noise * rng.standard_normal(cloud.shape), rigid(rotation_from_rpy([0, 0, -yaw]), np.zeros(3)))


def slow_patch(feature, points, shape, radius):
    """(dimension, centre, projector) of the patch around one feature, by sorting all points and numpy's eigh."""
    distance = np.linalg.norm(points - feature, axis=1)
    near = points[np.argsort(distance)[:NEIGHBOURS]]
    near = near[np.linalg.norm(near - feature, axis=1) < radius]
    if len(near) < FEWEST:
        return 0, np.zeros(3), np.zeros((3, 3))
    values, vectors = np.linalg.eigh(np.cov(near.T, bias=True))
    if shape & 2 and values[0] <= FLATNESS * values[1] and values[1] >= SPREAD * values[2]:
        return 1, near.mean(axis=0), np.outer(vectors[:, 0], vectors[:, 0])
    if shape & 1 and values[2] >= SLENDERNESS * values[1]:
        return 2, near.mean(axis=0), np.eye(3) - np.outer(vectors[:, 2], vectors[:, 2])
    return (3, near.mean(axis=0), np.eye(3)) if shape == Shape.ANY else (0, np.zeros(3), np.zeros((3, 3)))


@given(ANGLES, ANGLES, st.floats(-3.1, 3.1))
def test_rotations_equal_scipy_and_come_back(roll, pitch, yaw) -> None:
    ours = rotation_from_rpy([roll, pitch, yaw])
    np.testing.assert_allclose(ours, Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rpy_from_rotation(ours), [roll, pitch, yaw], atol=1e-9)
    vector = Rotation.from_matrix(ours).as_rotvec()
    np.testing.assert_allclose(rotation_from_vector(vector), ours, atol=1e-12)
    if np.linalg.norm(vector) < 3.1:
        np.testing.assert_allclose(vector_from_rotation(ours), vector, atol=1e-7)


@given(st.lists(st.floats(-2, 2), min_size=6, max_size=6))
def test_minus_undoes_plus(step) -> None:
    pose = rigid(rotation_from_rpy([0.1, -0.2, 2.0]), [5, 6, 7])
    np.testing.assert_allclose(minus(plus(pose, np.array(step) / 2), pose), np.array(step) / 2, atol=1e-9)


def test_voxel_map_keeps_points_apart_and_grows_without_losing_any() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(-60, 60, (60_000, 3)) * (1, 1, 0.05)
    held = VoxelMap(cube=1.0, spacing=0.3)
    held.insert(points[:30_000])
    held.insert(points[30_000:])
    kept = held.points
    assert len(kept) == len(held)
    assert set(map(tuple, kept)) <= set(map(tuple, points))
    cubes = np.floor(kept).astype(int)
    pairs = cKDTree(kept).query_pairs(0.299, output_type="ndarray")
    assert (cubes[pairs[:, 0]] != cubes[pairs[:, 1]]).any(axis=1).all()
    counts = np.unique(cubes, axis=0, return_counts=True)[1]
    assert counts.max() <= ROOM
    assert {tuple(c) for c in cubes} == {tuple(c) for c in np.floor(points).astype(int)}


@pytest.mark.parametrize("shape", [Shape.LINE, Shape.PLANE, Shape.ANY])
def test_patches_equal_sorted_neighbours_and_numpy_eigenvectors(shape) -> None:
    held = VoxelMap(cube=1.0, spacing=0.05)
    held.insert(room(1, n=4000))
    features = room(2, n=300) + 0.02
    patches = fit_patches(features, held, shape=shape, radius=1.0)
    for i, feature in enumerate(features):
        dimension, centre, projector = slow_patch(feature, held.points, shape, 1.0)
        assert patches.dimension[i] == dimension
        np.testing.assert_allclose(patches.centre[i], centre, atol=1e-9)
        np.testing.assert_allclose(patches.projector[i], projector, atol=1e-6)


def test_ground_patches_measure_height_alone() -> None:
    rng = np.random.default_rng(3)
    floor = np.column_stack([rng.uniform(-10, 10, (4000, 2)), 0.02 * rng.standard_normal(4000)])
    held = VoxelMap(cube=1.5, spacing=0.2)
    held.insert(floor)
    raised = floor[:500] + np.array([0, 0, 0.3])
    patches = fit_patches(raised, held, shape=Shape.GROUND, radius=1.5)
    used = patches.dimension == 1
    normals = np.linalg.eigh(patches.projector[used])[1][:, :, 2]
    assert used.mean() > 0.5
    assert np.ptp(np.abs(normals), axis=0).max() < 1e-9
    gaps = (raised - patches.centre)[used]
    np.testing.assert_allclose(np.linalg.norm(gaps, axis=1), 0.3, atol=0.12)


def test_information_and_pull_equal_numerical_derivatives_of_the_cost():
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
        steps=1,
    )
    patches = fit_patches(moved(features, start), held, shape=Shape.PLANE, radius=1.0)
    used = patches.dimension > 0

    def offsets(step):
        away = moved(features[used], plus(start, step)) - patches.centre[used]
        return np.einsum("nij,nj->ni", patches.projector[used], away)

    size = np.linalg.norm(offsets(np.zeros(6)), axis=1)
    weight = patches.share[used] / fit.scale**2 / (1 + (size / (2.3849 * fit.scale)) ** 2)
    slopes = [(offsets(1e-6 * e) - offsets(-1e-6 * e)) / 2e-6 for e in np.eye(6)]
    expected = [[np.einsum("n,ni,ni->", weight, a, b) for b in slopes] for a in slopes]
    np.testing.assert_allclose(fit.information, expected, rtol=1e-5, atol=1e-3 * np.max(expected))


@pytest.mark.parametrize(
    ("vector", "shift"), [((0, 0, 0.1), (0.5, 0.3, 0.1)), ((0.05, -0.05, 0.3), (1.5, -1.0, 0.3)), ((0, 0, 0), (0.02, 0, 0))]
)
@pytest.mark.parametrize("far", [0.0, 500_000.0])
def test_two_scans_of_a_room_are_laid_on_each_other(vector, shift, far: float) -> None:
    truth = rigid(rotation_from_vector(vector), shift)
    offset = rigid(np.eye(3), [far, -far, 0])
    truth = offset @ truth @ inverse(offset)
    result = register(moved(moved(room(2), offset), inverse(truth)), moved(room(1), offset))
    error = inverse(offset) @ result.transform @ inverse(truth) @ offset
    assert result.status == RegistrationStatus.CONVERGED
    assert np.linalg.norm(error[:3, 3]) < 0.01
    assert np.linalg.norm(vector_from_rotation(error[:3, :3])) < 1e-3
    assert result.overlap > 0.9


def test_clouds_of_a_part_in_millimetre_size_are_registered_alike() -> None:
    truth = rigid(rotation_from_vector([0.05, 0, 0.1]), [0.002, -0.001, 0.0])
    result = register(moved(room(2) / 100, inverse(truth)), room(1) / 100)
    np.testing.assert_allclose(result.transform, truth, atol=2e-4)


@pytest.mark.parametrize("stray", [[2e6, 0.0, 0.0], [300.0, -900.0, 40.0]])
def test_stray_point_far_off_changes_nothing(stray) -> None:
    result = register(np.vstack([street(0.4, 2), [stray]]), street(0.0, 1))
    assert result.status == RegistrationStatus.CONVERGED
    np.testing.assert_allclose(result.transform[:2, 3], [0.4, 0.0], atol=0.06)


def test_clouds_in_centimetres_are_registered_in_centimetres() -> None:
    truth = rigid(rotation_from_vector([0.0, 0, 0.1]), [40.0, -20.0, 5.0])
    result = register(moved(100 * room(2), inverse(truth)), 100 * room(1))
    assert result.status == RegistrationStatus.CONVERGED
    np.testing.assert_allclose(result.transform[:3, 3], truth[:3, 3], atol=1.5)


@pytest.mark.parametrize("step", [0.4, 1.0])
def test_street_scans_do_not_lock_on_their_own_ground_rings(step: float) -> None:
    result = register(street(step, 2, yaw=0.01, y=0.1), street(0.0, 1))
    assert result.status == RegistrationStatus.CONVERGED
    np.testing.assert_allclose(result.transform[:2, 3], [step, 0.1], atol=0.06)
    assert rpy_from_rotation(result.transform[:3, :3])[2] == pytest.approx(0.01, abs=0.005)


@pytest.mark.parametrize("yaw", [1.2, -1.7, 2.6])
def test_scan_turned_far_about_the_vertical_is_found(yaw: float) -> None:
    result = register(street(0.4, 2, yaw=yaw, y=0.1), street(0.0, 1))
    np.testing.assert_allclose(result.transform[:2, 3], [0.4, 0.1], atol=0.06)
    assert rpy_from_rotation(result.transform[:3, :3])[2] == pytest.approx(yaw, abs=0.005)


@pytest.mark.parametrize("order", [1, -1])
def test_identical_clouds_are_named_and_not_silently_an_identity(order: int) -> None:
    result = register(room(1)[::order], room(1))
    assert result.status == RegistrationStatus.IDENTICAL_CLOUDS
    np.testing.assert_array_equal(result.transform, np.eye(4))
    assert result.free_directions == 6


def test_bare_plane_leaves_three_directions_free() -> None:
    rng = np.random.default_rng(1)
    floors = [np.column_stack([rng.uniform(-8, 8, (4000, 2)), 0.005 * rng.standard_normal(4000)]) for _ in range(2)]
    result = register(floors[0] + (0, 0, 0.2), floors[1])
    assert result.status == RegistrationStatus.DEGENERATE
    assert result.free_directions == 3
    assert result.transform[2, 3] == pytest.approx(-0.2, abs=0.01)


def test_handful_of_points_is_too_few() -> None:
    result = register(room(1, n=8), room(2))
    assert result.status == RegistrationStatus.TOO_FEW_FEATURES


def test_clouds_of_different_places_overlap_poorly() -> None:
    elsewhere = np.random.default_rng(4).uniform(-1, 1, (4000, 3)) * (90, 90, 3) + (200, 0, 0)
    result = register(np.vstack([room(1, n=800), elsewhere]), room(2, n=3000), start=np.eye(4))
    assert result.status == RegistrationStatus.POOR_OVERLAP
    assert result.overlap < 0.3


@pytest.mark.parametrize(
    ("source", "target", "part"),
    [
        (np.zeros((1, 3)), room(1, n=50), "source: 1 point"),
        (room(1, n=50), np.full((10, 3), np.nan), "target: point 0"),
        (room(1, n=50), np.zeros((10, 3)), "extent"),
    ],
)
def test_clouds_that_cannot_be_registered_are_refused_with_reason(source, target, part: str) -> None:
    with pytest.raises(CloudError, match=part):
        register(source, target)
