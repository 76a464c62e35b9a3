import numpy as np
import numpy.typing as npt
import pytest
from lidar_mapping.slow_membrane import slow_membrane
from scipy import ndimage

from wzsumo.errors import CloudError, NoGroundError
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.lidar_mapping.smrf import SmrfSpec, ground_mask, object_cells, open_by_disk


def slow_opening(surface: FloatArray, radius: int) -> FloatArray:
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    disk = x**2 + y**2 <= radius**2
    padded = np.pad(surface, radius, constant_values=np.inf)
    eroded = ndimage.grey_erosion(padded, footprint=disk)[radius:-radius, radius:-radius]
    padded = np.pad(eroded, radius, constant_values=-np.inf)
    return np.asarray(ndimage.grey_dilation(padded, footprint=disk)[radius:-radius, radius:-radius])


def slow_smrf(points: FloatArray, spec: SmrfSpec) -> BoolArray:
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
    return np.asarray(np.abs(points[:, 2] - z) <= spec.elevation_threshold_m + spec.elevation_scalar * steepness)


def hilly_town(seed: int, n: int = 6000) -> tuple[FloatArray, BoolArray]:
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
def test_opening_by_disk_equals_scipy_with_padded_borders(radius: int, shape: tuple[int, int]) -> None:
    surface = np.random.default_rng(radius).normal(size=shape)
    np.testing.assert_array_equal(open_by_disk(surface, radius=radius), slow_opening(surface, radius))


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("spec", [SmrfSpec(), SmrfSpec(cell_m=0.7, window_m=9.0, elevation_threshold_m=0.2, slope=0.25)])
def test_ground_mask_equals_slow_smrf(seed: int, spec: SmrfSpec) -> None:
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
    np.testing.assert_array_equal(object_cells(surface, 0.15, max_radius=10, cell=1.0), surface > 0)


@pytest.mark.parametrize("points", [[[1.0, 2.0, 3.0]], [[0.0, 0.0, 0.0], [0.0, 50.0, 0.0]]])
def test_one_point_and_one_column_of_cells_are_ground(points: list[list[float]]) -> None:
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
def test_cloud_that_cannot_be_filtered_is_refused_with_reason(points: npt.ArrayLike, part: str) -> None:
    with pytest.raises(CloudError, match=part.replace("(", r"\(").replace(")", r"\)")):
        ground_mask(points, SmrfSpec())


def plane_with_pole(height: float, *, slope: float = 0.0) -> FloatArray:
    """A tilted plane of points at the nodes of 1 m cells, and one more point above its middle."""
    y, x = np.mgrid[:21, :21].astype(float)
    return np.vstack([np.column_stack([x.ravel(), y.ravel(), slope * x.ravel()]), [[10.0, 10.0, 10 * slope + height]]])


@pytest.mark.parametrize(("height", "is_ground"), [(0.49, True), (0.51, False), (-0.49, True)])
def test_ground_is_up_to_half_a_metre_from_level_terrain(height: float, is_ground: bool) -> None:
    assert ground_mask(plane_with_pole(height), SmrfSpec())[-1] == is_ground


@pytest.mark.parametrize(("height", "is_ground"), [(0.61, True), (0.64, False)])
def test_threshold_grows_by_125_cm_a_unit_of_slope(height: float, is_ground: bool) -> None:
    # 0.5 m + 1.25 m x 0.1.
    assert ground_mask(plane_with_pole(height, slope=0.1), SmrfSpec())[-1] == is_ground


@pytest.mark.parametrize(("depth", "is_ground"), [(4.9, True), (5.1, False)])
def test_single_cell_more_than_5_m_below_its_neighbours_is_an_outlier(depth: float, is_ground: bool) -> None:
    y, x = np.mgrid[:21, :21].astype(float)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(441)])
    points[220, 2] = -depth
    assert ground_mask(points, SmrfSpec(slope=10.0, elevation_scalar=0.0))[220] == is_ground


def test_cloud_of_nothing_but_spikes_has_no_ground() -> None:
    y, x = np.mgrid[:2, :2].astype(float)
    points = np.column_stack([x.ravel(), y.ravel(), [0.0, 50.0, 50.0, 0.0]])
    with pytest.raises(NoGroundError, match="no ground"):
        ground_mask(points, SmrfSpec())


def test_sparse_cloud_on_more_than_a_million_cells_is_refused() -> None:
    with pytest.raises(CloudError, match="2 points on 1002 x 1002 cells"):
        ground_mask([[0, 0, 0], [1001, 1001, 0]], SmrfSpec())


def test_cloud_on_more_than_30_million_cells_is_refused_however_dense() -> None:
    points = np.random.default_rng(1).uniform(0, 5500, (80_000, 3)) * (1, 1, 0)  # one point in 378 cells
    with pytest.raises(CloudError, match=r"cells of 1\.0 m are more than 30000000"):
        ground_mask(points, SmrfSpec())


def test_default_parameters_are_those_of_the_paper_for_all_samples() -> None:
    assert SmrfSpec().model_dump() == {
        "cell_m": 1.0, "slope": 0.15, "window_m": 18.0, "elevation_threshold_m": 0.5, "elevation_scalar": 1.25,
    }  # fmt: skip
