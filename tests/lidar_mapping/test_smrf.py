import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.sparse.linalg import spsolve

from wzsumo.errors import CloudError
from wzsumo.lidar_mapping.membrane import fill_holes
from wzsumo.lidar_mapping.smrf import SmrfSpec, ground_mask, object_cells, open_by_disk


def slow_opening(surface, radius):
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    disk = x**2 + y**2 <= radius**2
    padded = np.pad(surface, radius, constant_values=np.inf)
    eroded = ndimage.grey_erosion(padded, footprint=disk)[radius:-radius, radius:-radius]
    padded = np.pad(eroded, radius, constant_values=-np.inf)
    return ndimage.grey_dilation(padded, footprint=disk)[radius:-radius, radius:-radius]


def slow_membrane(surface, hole):
    index = np.arange(surface.size).reshape(surface.shape)
    pairs = np.vstack([np.c_[index[:, 1:].ravel(), index[:, :-1].ravel()], np.c_[index[1:].ravel(), index[:-1].ravel()]])
    rows, cols = np.vstack([pairs, pairs[:, ::-1]]).T
    springs = sp.csr_matrix((np.ones(len(rows)), (rows, cols)), shape=(surface.size,) * 2)
    laplacian = sp.csr_matrix(sp.diags(np.asarray(springs.sum(axis=1)).ravel()) - springs)
    flat, empty = np.where(hole, 0.0, surface).ravel(), hole.ravel()
    flat[empty] = spsolve(sp.csc_matrix(laplacian[empty][:, empty]), -laplacian[empty][:, ~empty] @ flat[~empty])
    return flat.reshape(surface.shape)


def slow_smrf(points, spec):
    nodes = np.floor(points[:, :2] / spec.cell_m + 0.5).astype(int)
    first = nodes.min(axis=0)
    shape = tuple((nodes.max(axis=0) - first + 1)[::-1])
    lowest = np.full(shape, np.inf)
    np.minimum.at(lowest, tuple((nodes - first).T[::-1]), points[:, 2])
    empty = np.isinf(lowest)
    surface = slow_membrane(lowest, empty)
    hole = empty | (-surface - slow_opening(-surface, 1) > 5.0 * spec.cell_m)
    opened = surface
    for radius in range(1, int(np.ceil(spec.window_m / spec.cell_m)) + 1):
        before, opened = opened, slow_opening(opened, radius)
        hole |= before - opened > spec.slope * radius * spec.cell_m
    terrain = slow_membrane(surface, hole)
    slope = np.hypot(*np.gradient(terrain, spec.cell_m))
    at = (points[:, :2] / spec.cell_m - first).T[::-1]
    z, steepness = (ndimage.map_coordinates(field, at, order=3, mode="mirror") for field in (terrain, slope))
    return np.abs(points[:, 2] - z) <= spec.elevation_threshold_m + spec.elevation_scalar * steepness


def hilly_town(seed, n=6000):
    """Points on rolling ground with three houses, trees, a low outlier, and which of them are ground."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, 80, (n, 2))
    ground = 4 * np.sin(xy[:, 0] / 25) + 0.05 * xy[:, 1]
    z, is_ground = ground + rng.normal(0, 0.03, n), np.ones(n, dtype=bool)
    for x, y, side, height in ((20, 20, 10, 6), (55, 25, 14, 9), (40, 60, 8, 5)):
        inside = (np.abs(xy - (x, y)) < side / 2).all(axis=1)
        z[inside], is_ground[inside] = height + ground[inside].max(), False
    trees = rng.random(n) < 0.05
    z[trees & is_ground] += rng.uniform(2, 10, (trees & is_ground).sum())
    is_ground &= ~trees
    z[0], is_ground[0] = -30.0, False
    return np.column_stack([xy, z]), is_ground


@pytest.mark.parametrize("radius", [1, 2, 3, 7, 18, 40])
@pytest.mark.parametrize("shape", [(31, 27), (1, 30), (30, 1), (1, 1)])
def test_opening_by_disk_equals_scipy_with_padded_borders(radius: int, shape) -> None:
    surface = np.random.default_rng(radius).normal(size=shape)
    np.testing.assert_array_equal(open_by_disk(surface, radius=radius), slow_opening(surface, radius))


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), share=st.floats(0.05, 0.97), rows=st.integers(1, 25), cols=st.integers(2, 25))
def test_filled_holes_equal_direct_solution_of_membrane(seed: int, share: float, rows: int, cols: int) -> None:
    rng = np.random.default_rng(seed)
    hole = rng.random((rows, cols)) < share
    hole[rng.integers(rows), rng.integers(cols)] = False
    surface = np.where(hole, np.nan, rng.normal(100, 3, hole.shape))
    np.testing.assert_allclose(fill_holes(surface, hole), slow_membrane(surface, hole), atol=2e-4)


def test_long_hole_to_a_stray_point_is_filled_with_the_slope_between() -> None:
    """A solver that starts from nothing needs as many steps as the hole is long, and would stop before it is there."""
    surface = np.full((5, 6000), np.nan)
    surface[:, :40], surface[2, -1] = 0.0, 100.0
    filled = fill_holes(surface, np.isnan(surface))
    np.testing.assert_allclose(filled, slow_membrane(surface, np.isnan(surface)), atol=0.02)


def test_wide_hole_in_a_plane_is_filled_with_the_plane() -> None:
    y, x = np.mgrid[:90, :120]
    plane = 500 + 0.1 * x - 0.05 * y
    hole = (x > 10) & (x < 100) & (y > 5) & (y < 80)
    np.testing.assert_allclose(fill_holes(np.where(hole, np.nan, plane), hole), plane, atol=5e-4)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("spec", [SmrfSpec(), SmrfSpec(cell_m=0.7, window_m=9.0, elevation_threshold_m=0.2, slope=0.25)])
def test_ground_mask_equals_slow_smrf(seed: int, spec) -> None:
    points, _ = hilly_town(seed)
    agreement = ground_mask(points, spec) == slow_smrf(points, spec)
    assert agreement.mean() > 0.9995  # a point whose distance equals the threshold to within the fill's tolerance may differ


def test_houses_trees_and_low_outlier_on_rolling_ground_are_not_ground() -> None:
    points, is_ground = hilly_town(7)
    mask = ground_mask(points, SmrfSpec())
    assert (mask & ~is_ground).sum() == 0
    assert (mask & is_ground).sum() >= 0.99 * is_ground.sum()


def test_every_point_of_a_steep_smooth_slope_is_ground() -> None:
    y, x = np.mgrid[:60, :60] * 0.9
    points = np.column_stack([x.ravel(), y.ravel(), 0.14 * x.ravel()])
    assert ground_mask(points, SmrfSpec()).all()


def test_ground_mask_of_shifted_cloud_is_the_same() -> None:
    points, _ = hilly_town(3)
    shifted = points + np.array([500_000.0, 4_600_000.0, 200.0])
    assert (ground_mask(points, SmrfSpec()) == ground_mask(shifted, SmrfSpec())).mean() > 0.9995


def test_object_cells_of_a_tower_are_its_footprint() -> None:
    surface = np.zeros((40, 40))
    surface[15:20, 12:30] = 8.0
    np.testing.assert_array_equal(object_cells(surface, 0.15, 10, cell=1.0), surface > 0)


@pytest.mark.parametrize("points", [[[1.0, 2.0, 3.0]], [[0.0, 0.0, 0.0], [0.0, 50.0, 0.0]]])
def test_one_point_and_one_column_of_cells_are_ground(points) -> None:
    assert ground_mask(points, SmrfSpec()).all()


@pytest.mark.parametrize(
    ("points", "part"),
    [
        (np.empty((0, 3)), "0 point"),
        (np.zeros((5, 2)), "shape (5, 2)"),
        ([[0, 0, 0], [1, np.nan, 2]], "point 1"),
        ([[0, 0, 0], [1e9, 1e9, 0]], "stray"),
        (np.random.default_rng(1).uniform(0, 3000, (2000, 3)), "less than one in 400 cells"),  # centimetres for metres
        ([["a", "b", "c"]], "not a table of real numbers"),
        (np.full((4, 3), 1j), "not a table of real numbers"),
    ],
)
def test_cloud_that_cannot_be_filtered_is_refused_with_reason(points, part: str) -> None:
    with pytest.raises(CloudError, match=part.replace("(", r"\(").replace(")", r"\)")):
        ground_mask(points, SmrfSpec())
