import numpy as np
import pytest
from scipy.spatial import cKDTree

from wzsumo.lidar_mapping.voxel_map import VoxelMap


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
    assert counts.max() <= 20
    assert {tuple(c) for c in cubes} == {tuple(c) for c in np.floor(points).astype(int)}


def test_cube_keeps_20_points_at_most() -> None:
    held = VoxelMap(cube=1.0, spacing=0.01)
    held.insert(np.random.default_rng(1).uniform(0, 1, (200, 3)))
    assert len(held) == 20


@pytest.mark.parametrize(("gap", "kept"), [(0.299, 1), (0.301, 2)])
def test_second_point_of_a_cube_is_kept_beyond_the_spacing(gap: float, kept: int) -> None:
    held = VoxelMap(cube=1.0, spacing=0.3)
    held.insert(np.array([[0.1, 0.1, 0.1], [0.1 + gap, 0.1, 0.1]]))
    assert len(held) == kept


def test_cubes_far_off_on_all_sides_are_told_apart() -> None:
    far = 1_000_000.0
    corners = np.array([(x, y, z) for x in (-far, 0, far) for y in (-far, 0, far) for z in (-far, 0, far)]) + 0.5
    held = VoxelMap(cube=1.0, spacing=0.1)
    held.insert(corners)
    assert {tuple(point) for point in held.points} == {tuple(point) for point in corners}
