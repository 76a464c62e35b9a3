import numpy as np
import pytest
from lidar_mapping.posed_scans import CELLS, cell, cone_points, ground_points, posed_scan, zone_scans
from scipy import ndimage

from wzsumo.errors import InputError
from wzsumo.grid import OccupancyGrid
from wzsumo.lidar_mapping.devices import DeviceSpec, with_barrier
from wzsumo.lidar_mapping.slam_map import SlamMapSpec, build_maps
from wzsumo.lidar_mapping.votes import VoteSpec
from wzsumo.rigid import rigid, rotation_from_rpy

FAR = SlamMapSpec(votes=VoteSpec(max_range_m=80.0))


def connected(grid: OccupancyGrid, start: tuple[float, float], goal: tuple[float, float]) -> bool:
    label, _ = ndimage.label(grid.free)
    rows, cols = grid.cell_of([start, goal])
    return bool(label[rows[0], cols[0]] == label[rows[1], cols[1]] != 0)


def test_birds_eye_view_is_occupied_where_hit_and_free_everywhere_else() -> None:
    maps = build_maps(zone_scans([(20.0, 3.0)]), SlamMapSpec(), cells=CELLS)
    row, col = maps.birds_eye.cell_of(cone_points(20.0, 3.0)[:, :2])
    expected = np.zeros(maps.birds_eye.shape)
    expected[row, col] = 1
    np.testing.assert_array_equal(maps.birds_eye.p_occupied, expected)


def test_cell_with_too_few_points_stays_free_in_birds_eye_view() -> None:
    scans = [posed_scan([[20.05, 3.05, 0.5]] * 2, [True, True])]
    assert build_maps(scans, SlamMapSpec(min_points=3), cells=CELLS).birds_eye.p_occupied.max() == 0
    assert build_maps(scans, SlamMapSpec(min_points=2), cells=CELLS).birds_eye.p_occupied.max() == 1


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


def test_vehicle_that_one_scan_hit_is_in_all_maps_but_the_barrier() -> None:
    ground = posed_scan(ground_points(), np.zeros(len(ground_points())))
    passing = posed_scan([[30.05, -4.95, 0.5], [30.05, -4.95, 1.2]], [True, True])
    maps = build_maps([ground] * 6 + [passing], SlamMapSpec(), cells=CELLS)
    # Six misses are clamped to -2, the hit adds 0.85.
    assert cell(maps.birds_eye, 30.05, -4.95) == 1
    assert cell(maps.log_odds, 30.05, -4.95) == pytest.approx(1 / (1 + np.exp(2.0 - 0.85)), rel=1e-5)
    assert cell(maps.barrier, 30.05, -4.95) == pytest.approx(1 / (1 + np.exp(2.0)), rel=1e-5)


@pytest.mark.parametrize(("hits", "stands"), [(4, False), (12, True)])
def test_vehicle_that_hid_its_way_from_later_rays_leaves_no_trail_in_the_barrier_map(hits: int, stands: bool) -> None:
    # 20 scans saw the cell free, then a vehicle was in it, and nothing saw it again. Clamped odds: -2 + 4 x 0.85 > 0.
    # Over the whole drive 20 x 0.4 = 8 speak for free, 4 x 0.85 = 3.4 or 12 x 0.85 = 10.2 for occupied.
    ground = posed_scan(ground_points(), np.zeros(len(ground_points())))
    in_cell = posed_scan([[30.05, -4.95, 0.5], [30.05, -4.95, 1.2]], [True, True])
    maps = build_maps([ground] * 20 + [in_cell] * hits, SlamMapSpec(), cells=CELLS)
    assert cell(maps.log_odds, 30.05, -4.95) > 0.7
    assert (cell(maps.barrier, 30.05, -4.95) > 0.5) == stands
    assert len(maps.devices) == stands


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
