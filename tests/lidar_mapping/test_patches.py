import numpy as np
import pytest
from lidar_mapping.clouds import room

from wzsumo.frames import FloatArray
from wzsumo.lidar_mapping.patches import Shape, fit_patches
from wzsumo.lidar_mapping.voxel_map import VoxelMap


def slow_patch(feature: FloatArray, points: FloatArray, shape: Shape, radius: float) -> tuple[int, FloatArray, FloatArray]:
    """(dimension, centre, projector) of the patch around one feature, by sorting all points and numpy's eigh."""
    distance = np.linalg.norm(points - feature, axis=1)
    near = points[np.argsort(distance)[:8]]
    near = near[np.linalg.norm(near - feature, axis=1) < radius]
    if len(near) < 5:
        return 0, np.zeros(3), np.zeros((3, 3))
    values, vectors = np.linalg.eigh(np.cov(near.T, bias=True))
    if shape & 2 and values[0] <= 0.1 * values[1] and values[1] >= 0.04 * values[2]:
        return 1, near.mean(axis=0), np.outer(vectors[:, 0], vectors[:, 0])
    if shape & 1 and values[2] >= 3.0 * values[1]:
        return 2, near.mean(axis=0), np.eye(3) - np.outer(vectors[:, 2], vectors[:, 2])
    return (3, near.mean(axis=0), np.eye(3)) if shape == Shape.ANY else (0, np.zeros(3), np.zeros((3, 3)))


@pytest.mark.parametrize("shape", [Shape.LINE, Shape.PLANE, Shape.ANY])
def test_patches_equal_sorted_neighbours_and_numpy_eigenvectors(shape: Shape) -> None:
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


@pytest.mark.parametrize(("n", "dimension"), [(4, 0), (5, 2)])
def test_line_needs_five_points(n: int, dimension: int) -> None:
    held = VoxelMap(cube=1.0, spacing=0.01)
    held.insert(np.column_stack([np.full(n, 0.5), np.full(n, 0.5), 0.2 + 0.1 * np.arange(n)]))
    assert fit_patches(np.array([[0.52, 0.5, 0.4]]), held, shape=Shape.LINE, radius=1.0).dimension.tolist() == [dimension]


@pytest.mark.parametrize(("ratio", "dimension"), [(2.9, 0), (3.1, 2)])
def test_line_is_three_times_as_long_as_wide_in_variance(ratio: float, dimension: int) -> None:
    corners = np.array([(a, b) for a in (-1, 0, 1) for b in (-1, 1)]) * (0.1 * np.sqrt(1.5 * ratio), 0.1)  # variances ratio : 1
    held = VoxelMap(cube=2.0, spacing=0.01)
    held.insert(np.column_stack([1.0 + corners, np.ones(6)]))
    patches = fit_patches(np.array([[1.0, 1.0, 1.0]]), held, shape=Shape.LINE, radius=2.0)
    assert patches.dimension.tolist() == [dimension]


@pytest.mark.parametrize(
    ("across", "thick", "is_plane"), [(0.21, 0.0, True), (0.19, 0.0, False), (0.5, 0.15, True), (0.5, 0.17, False)]
)
def test_plane_is_thin_and_not_a_line(across: float, thick: float, is_plane: bool) -> None:
    # Eight corners of a box: variances 1 : across^2 : thick^2 (times 0.16). Limits: 0.04 = 0.2^2; 0.1 x 0.5^2 = 0.158^2.
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * (0.4, 0.4 * across, 0.4 * thick + 1e-3)
    held = VoxelMap(cube=2.0, spacing=1e-4)
    held.insert(1.0 + corners)
    patches = fit_patches(np.array([[1.0, 1.0, 1.0]]), held, shape=Shape.PLANE, radius=2.0)
    assert patches.dimension.tolist() == [int(is_plane)]


def test_features_at_one_cube_share_the_weight_of_one() -> None:
    held = VoxelMap(cube=1.0, spacing=0.05)
    floor = np.random.default_rng(1).uniform(0, 1, (300, 3)) * (1, 1, 0.001)
    held.insert(np.vstack([floor, floor + np.array([5, 0, 0])]))
    features = np.array([[0.5, 0.5, 0.1], [0.4, 0.6, 0.1], [0.6, 0.4, 0.1], [5.5, 0.5, 0.1], [90.0, 0.0, 0.0]])
    assert fit_patches(features, held, shape=Shape.PLANE, radius=1.0).share == pytest.approx([1 / 3, 1 / 3, 1 / 3, 1, 0])
