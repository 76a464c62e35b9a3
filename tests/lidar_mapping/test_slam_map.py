import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from wzsumo.errors import InputError
from wzsumo.grid import blank_grid
from wzsumo.lidar_mapping.devices import DeviceSpec, find_devices, join_devices, with_barrier
from wzsumo.lidar_mapping.posed_scan import PosedScan, ScanState
from wzsumo.lidar_mapping.slam_map import SlamMapSpec, build_maps
from wzsumo.lidar_mapping.votes import Votes, VoteSpec
from wzsumo.rigid import moved, rigid, rotation_from_rpy

CELLS = blank_grid((0.0, -10.0, 60.0, 10.0), resolution=0.2, p_occupied=0.0)  # half of a cone's base: every cone fills a cell
FAR = SlamMapSpec(votes=VoteSpec(max_range_m=80.0))
SENSOR = np.array([1.4, 0.0, 1.9])


def posed_scan(cloud, standing, *, pose=None):
    return PosedScan(
        time_s=0.0,
        pose=np.eye(4) if pose is None else pose,
        dead_reckoned=np.eye(4),
        state=ScanState.REGISTERED,
        free_directions=0,
        scale_m=0.02,
        deviation=np.zeros(6),
        has_gnss=False,
        cloud=np.asarray(cloud, dtype=float).reshape(-1, 3),
        standing=np.asarray(standing, dtype=bool),
        sensor=SENSOR,
    )


def cone_points(x, y, seed=0):
    rng = np.random.default_rng(seed)
    height = rng.uniform(0.25, 0.85, 40)
    turn = rng.uniform(0, 2 * np.pi, 40)
    return np.column_stack([x + 0.12 * np.cos(turn), y + 0.12 * np.sin(turn), height])


def ground_points():
    x, y = np.meshgrid(np.arange(2.0, 58.0, 0.1), np.arange(-9.0, 9.0, 0.1))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def zone_scans(cones, *, count=4, pose=None):
    """Scans of a wide flat road with cones at (n, 2), all taken from one place."""
    ground = ground_points()
    solid = np.vstack([cone_points(*cone, seed=k) for k, cone in enumerate(cones)])
    cloud = np.vstack([ground, solid])
    standing = np.repeat([False, True], [len(ground), len(solid)])
    if pose is not None:
        cloud = moved(cloud, np.linalg.inv(pose))
    return [posed_scan(cloud, standing, pose=pose) for _ in range(count)]


def cell(grid, x, y):
    (row,), (col,) = grid.cell_of([[x, y]])
    return grid.p_occupied[row, col]


def connected(grid, start, goal):
    label, _ = ndimage.label(grid.free)
    rows, cols = grid.cell_of([start, goal])
    return label[rows[0], cols[0]] == label[rows[1], cols[1]] != 0


def test_raw_view_is_occupied_where_hit_and_free_everywhere_else() -> None:
    maps = build_maps(zone_scans([(20.0, 3.0)]), SlamMapSpec(), cells=CELLS)
    row, col = maps.birds_eye.cell_of(cone_points(20.0, 3.0)[:, :2])
    expected = np.zeros(maps.birds_eye.shape)
    expected[row, col] = 1
    np.testing.assert_array_equal(maps.birds_eye.p_occupied, expected)


def test_cell_with_too_few_points_stays_free_in_raw_view() -> None:
    scans = [posed_scan([[20.05, 3.05, 0.5]] * 2, [True, True])]
    assert build_maps(scans, SlamMapSpec(min_points=3), cells=CELLS).birds_eye.p_occupied.max() == 0
    assert build_maps(scans, SlamMapSpec(min_points=2), cells=CELLS).birds_eye.p_occupied.max() == 1


@pytest.mark.parametrize(("scans", "log_odds"), [(1, 0.85), (3, 2.55), (9, 3.5)])
def test_hits_add_up_to_their_clamped_log_odds(scans: int, log_odds: float) -> None:
    one = posed_scan([[20.05, 3.05, 0.8]], [True])
    maps = build_maps([one] * scans, SlamMapSpec(), cells=CELLS)
    assert cell(maps.log_odds, 20.05, 3.05) == pytest.approx(1 / (1 + np.exp(-log_odds)), rel=1e-5)


def test_ground_ray_frees_its_low_end_and_nothing_before_or_behind() -> None:
    # From 1.9 m high at x = 1.4 to the ground at x = 39.5: below 0.4 m on its last 4 / 19, from x = 31.48 on.
    maps = build_maps([posed_scan([[39.5, 0.1, 0.0]], [False])], SlamMapSpec(), cells=CELLS)
    row = maps.log_odds.cell_of([[10.0, 0.1]])[0][0]
    seen = np.flatnonzero(maps.log_odds.p_occupied[row] != 0.5)
    x = maps.log_odds.centre_of(row, seen)[:, 0]
    np.testing.assert_allclose([x.min(), x.max()], [31.5, 39.5], atol=0.11)
    assert (np.diff(seen) == 1).all()
    np.testing.assert_allclose(maps.log_odds.p_occupied[row, seen], 1 / (1 + np.exp(0.4)), rtol=1e-5)
    assert (np.delete(maps.log_odds.p_occupied, row, axis=0) == 0.5).all()


def test_hit_wins_over_rays_that_pass_its_cell_in_the_same_scan() -> None:
    scan = posed_scan([[20.05, 3.05, 0.5], [20.08, 3.02, 0.0], [22.0, 3.3, 0.0]], [True, False, False])
    assert cell(build_maps([scan], SlamMapSpec(), cells=CELLS).log_odds, 20.05, 3.05) > 0.65


def test_maps_lie_in_the_world_whatever_the_pose() -> None:
    pose = rigid(rotation_from_rpy([0, 0, 0.8]), [5.0, -4.0, 0.0])
    still, turned = (
        build_maps(zone_scans([(20.0, 3.0), (30.0, 1.0)], pose=p), SlamMapSpec(), cells=CELLS) for p in (None, pose)
    )
    np.testing.assert_array_equal(still.birds_eye.p_occupied, turned.birds_eye.p_occupied)
    np.testing.assert_allclose(still.devices, turned.devices)


def test_line_of_cones_separates_the_lanes_in_the_barrier_map_alone() -> None:
    cones = [(x, 1.0 + 0.05 * x) for x in np.linspace(0.1, 59.9, 8)]
    maps = build_maps(zone_scans(cones), FAR, cells=CELLS)
    below, above = (50.0, -3.0), (50.0, 8.0)
    assert connected(maps.birds_eye, below, above)
    assert connected(maps.log_odds, below, above)
    assert not connected(maps.barrier, below, above)
    assert len(maps.devices) == len(cones)
    assert len(maps.links) == len(cones) - 1


def test_gap_longer_than_the_widest_spacing_stays_open() -> None:
    cones = [(0.5, 2.0), (9.0, 2.0), (45.0, 2.0), (60.0, 2.0)]
    maps = build_maps(
        zone_scans(cones), SlamMapSpec(votes=VoteSpec(max_range_m=80.0), devices=DeviceSpec(max_gap_m=30.0)), cells=CELLS
    )
    assert connected(maps.barrier, (50.0, -3.0), (50.0, 8.0))


def test_only_what_has_a_device_size_and_was_seen_often_is_a_device() -> None:
    votes = Votes(CELLS, VoteSpec())
    for (row, col, rows, cols), top, often in (
        ((20, 40, 2, 2), 0.9, 9),  # a cone
        ((20, 80, 2, 2), 2.1, 9),  # a pole
        ((20, 120, 2, 2), 0.1, 9),  # grass
        ((20, 160, 9, 23), 1.2, 9),  # a car
        ((20, 220, 2, 2), 0.9, 1),  # something that was there once
    ):
        part = np.s_[row : row + rows, col : col + cols]
        votes.count[part], votes.scans[part], votes.height[part] = 5, often, top
    devices = find_devices(votes, DeviceSpec())
    np.testing.assert_allclose(devices, [[8.2, -5.8]])


def test_vehicle_that_was_there_in_one_scan_leaves_its_mark_in_all_maps_but_the_barrier() -> None:
    ground = posed_scan(ground_points(), np.zeros(len(ground_points())))
    passing = posed_scan([[30.05, -4.95, 0.5], [30.05, -4.95, 1.2]], [True, True])
    maps = build_maps([ground] * 6 + [passing], SlamMapSpec(), cells=CELLS)
    # Six misses are clamped to -2, the hit adds 0.85.
    assert cell(maps.birds_eye, 30.05, -4.95) == 1
    assert cell(maps.log_odds, 30.05, -4.95) == pytest.approx(1 / (1 + np.exp(2.0 - 0.85)), rel=1e-5)
    assert cell(maps.barrier, 30.05, -4.95) == pytest.approx(1 / (1 + np.exp(2.0)), rel=1e-5)


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 40))
def test_devices_along_a_line_are_joined_in_their_order(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    along = np.cumsum(rng.uniform(6, 37, n))
    points = np.column_stack([along, 3 + 2 * np.sin(along / 60)])
    order = rng.permutation(n)
    links = join_devices(points[order], max_gap_m=45.0)
    assert {frozenset(order[pair]) for pair in links} == {frozenset((k, k + 1)) for k in range(n - 1)}


def test_no_device_leaves_the_map_as_it_was() -> None:
    grid = CELLS.with_p_occupied(np.full(CELLS.shape, 0.3))
    assert with_barrier(grid, np.empty((0, 2)), np.empty((0, 2), dtype=np.int64), half_width_m=0.2) is grid
    maps = build_maps([posed_scan(ground_points(), np.zeros(len(ground_points())))], SlamMapSpec(), cells=CELLS)
    assert maps.devices.shape == (0, 2)


def test_no_scan_is_refused_and_an_empty_one_leaves_all_unknown() -> None:
    with pytest.raises(InputError, match="no scans"):
        build_maps([], SlamMapSpec(), cells=CELLS)
    maps = build_maps([posed_scan(np.empty((0, 3)), [])], SlamMapSpec(), cells=CELLS)
    assert (maps.log_odds.p_occupied == 0.5).all()
    assert (maps.birds_eye.p_occupied == 0).all()
