import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError
from sensing.roadside import SMOOTH, cone_line, steady_drive, straight_road

from wzsumo.errors import InputError, TraceError
from wzsumo.sensing.ground import flat_ground, ground_of
from wzsumo.sensing.lidar import Drive, LidarSpec, cast_ahead, cast_scan, drive_scans
from wzsumo.sensing.scene import SceneSpec, road_scene

SMALL = LidarSpec(layers=32, azimuth_count=360)


def test_car_on_tilted_ground_stands_square_to_it() -> None:
    slope = (0.04, -0.03)
    poses = Drive(time_s=np.array([0.0, 1.0]), poses=np.array([[0, 0, 0.7], [1, 1, 0.7]])).car_poses(
        [0.0, 0.5], flat_ground(slope=slope)
    )
    normal = np.array([-slope[0], -slope[1], 1.0]) / np.linalg.norm([*slope, 1.0])
    np.testing.assert_allclose(poses[:, :3, 2], [normal, normal], atol=1e-12)
    np.testing.assert_allclose(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]), 0.7)
    np.testing.assert_allclose(poses[1, :3, 3], [0.5, 0.5, 0.5 * sum(slope)])


def test_car_stands_on_the_surface_of_a_straight_road() -> None:
    road = straight_road()
    ground = ground_of(road, SMOOTH, seed=1)
    xy = road.to_xy([10.0, 150.0], [1.8, 5.4])
    drive = Drive(time_s=np.array([0.0, 1.0]), poses=np.column_stack([xy, np.zeros(2)]))
    np.testing.assert_allclose(drive.car_poses(drive.time_s, ground)[:, 2, 3], ground.height(xy), atol=1e-3)


def test_raw_scan_of_a_moving_car_is_skewed_and_deskewing_by_the_true_motion_corrects_it() -> None:
    scene = road_scene(straight_road(), cone_line(), SceneSpec(ground=SMOOTH), seed=1)
    spec = LidarSpec(layers=32, azimuth_count=1800, range_noise_m=0.0, dropout_at_max_range=0.0)
    drive = steady_drive(speed=25.0, seconds=3.0, yaw_rate=0.1)
    scan = cast_scan(scene, drive, spec, start_s=1.0, seed=1)
    poses = drive.car_poses(1.0 + np.arange(1800) / 18000, scene.ground) @ spec.mounting
    to_world = poses[scan.column]
    world = np.einsum("nij,nj->ni", to_world[:, :3, :3], scan.points) + to_world[:, :3, 3]
    raw = scan.points @ poses[0, :3, :3].T + poses[0, :3, 3]
    ground = scan.object_id == 0
    assert np.abs(world[ground, 2] - scene.ground.height(world[ground, :2])).max() < 2e-3
    for number in range(1, 5):
        seen = scan.object_id == number
        axis = scene.frusta[number - 1, :2]
        assert (np.linalg.norm(world[seen, :2] - axis, axis=1) < 0.18).all()
        late = scan.time_s[seen].mean()
        assert np.linalg.norm(raw[seen, :2].mean(axis=0) - axis) == pytest.approx(25.0 * late, abs=0.5)


def test_range_noise_and_dropout_have_their_given_size() -> None:
    scene = road_scene(straight_road(), cone_line(), SceneSpec(ground=SMOOTH), seed=1)
    drive = Drive(time_s=np.array([0.0, 9.0]), poses=np.array([[100.0, 1.8, 0], [100.0, 1.8, 0]]))
    clean = cast_scan(scene, drive, LidarSpec(range_noise_m=0, dropout_at_max_range=0), start_s=0.0, seed=1)
    noisy = cast_scan(scene, drive, LidarSpec(range_noise_m=0.05, dropout_at_max_range=0), start_s=0.0, seed=1)
    assert (noisy.range_m - clean.range_m).std() == pytest.approx(0.05, rel=0.02)
    fog = cast_scan(scene, drive, LidarSpec(range_noise_m=0, dropout_at_max_range=0, visibility_m=100), start_s=0.0, seed=1)
    near, far = (((s.range_m > 20) & (s.range_m < 22)).sum() for s in (clean, fog))
    assert far / near == pytest.approx(np.exp(-2 * 3.912 / 100 * 21), abs=0.03)
    lossy = cast_scan(scene, drive, LidarSpec(range_noise_m=0, dropout_at_max_range=0.5), start_s=0.0, seed=1)
    before, after = (((s.range_m > 55) & (s.range_m < 65)).sum() for s in (clean, lossy))
    assert after / before == pytest.approx(1 - 0.5 * 0.25, abs=0.03)


def test_scan_sees_the_given_share_of_devices() -> None:
    scene = road_scene(straight_road(), cone_line(15), SceneSpec(ground=SMOOTH), seed=1)
    drive = steady_drive()
    sightings = dict.fromkeys((1.0, 0.6), 0)
    for share in sightings:
        for scan in drive_scans(scene, drive, SMALL.model_copy(update={"detected_share": share}), seed=2):
            sightings[share] += len(set(scan.object_id) & set(scene.device_id))
    assert sightings[0.6] / sightings[1.0] == pytest.approx(0.6, abs=0.08)


def test_same_seed_gives_same_scans_and_another_seed_others() -> None:
    scene, drive = road_scene(straight_road(), cone_line(), SceneSpec(), seed=1), steady_drive(seconds=1.0)
    first, again, other = (list(drive_scans(scene, drive, SMALL, seed=seed)) for seed in (5, 5, 6))
    assert len(first) == 10
    assert all((a.points == b.points).all() for a, b in zip(first, again, strict=True))
    assert first[0].points.shape != other[0].points.shape or (first[0].points != other[0].points).any()


def test_scans_cast_ahead_are_the_same_in_the_same_order() -> None:
    scene, drive = road_scene(straight_road(), cone_line(), SceneSpec(), seed=1), steady_drive(seconds=1.0)
    plain, ahead = drive_scans(scene, drive, SMALL, seed=5), cast_ahead(drive_scans(scene, drive, SMALL, seed=5))
    for one, other in zip(plain, ahead, strict=True):
        assert one.start_s == other.start_s
        np.testing.assert_array_equal(one.points, other.points)


def test_fault_while_casting_ahead_reaches_the_caller() -> None:
    scene, drive = road_scene(straight_road(), cone_line(), SceneSpec(), seed=1), steady_drive(seconds=1.0)
    scans = drive_scans(scene, drive, SMALL, seed=1, vehicles_at=lambda _: pd.DataFrame({"x_m": [1.0]}))
    with pytest.raises(InputError, match="missing"):
        list(cast_ahead(scans))


def test_vehicles_of_the_moment_stand_in_the_scan() -> None:
    scene, drive = road_scene(straight_road(), cone_line(), SceneSpec(), seed=1), steady_drive(seconds=1.0)

    def ahead(time_s: float) -> pd.DataFrame:
        return pd.DataFrame({"x_m": [35 + 10 * time_s], "y_m": 1.8, "heading_rad": 0.0, "length_m": 4.6, "width_m": 1.8})

    vehicle = len(scene.kinds) + 1
    for scan in drive_scans(scene, drive, SMALL, seed=1, vehicles_at=ahead):
        front = scan.points[(scan.object_id == vehicle) & (np.abs(scan.points[:, 1]) < 0.5)]
        # Rear bumper 15 m - 2.3 m ahead of the axle, the sensor 1.4 m before it.
        assert front[:, 0].min() == pytest.approx(35 - 20 - 2.3 - 1.4 - 10 * 0.05, abs=0.2)


def test_times_that_do_not_ascend_are_no_drive() -> None:
    with pytest.raises(TraceError, match="ascend"):
        Drive(time_s=np.array([0.0, 0.0]), poses=np.zeros((2, 3)))


def test_default_lidar_is_that_of_the_paper_on_the_roof_of_a_sedan() -> None:
    assert LidarSpec().model_dump() == {
        "layers": 128, "lowest_deg": -25.0, "highest_deg": 15.0, "azimuth_count": 1800, "rate_hz": 10.0, "max_range_m": 120.0,
        "range_noise_m": 0.02, "dropout_at_max_range": 0.5, "visibility_m": None, "detected_share": 1.0, "forward_m": 1.4,
        "left_m": 0.0, "height_m": 1.9, "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0,
    }  # fmt: skip


def test_turn_begins_at_the_rear_and_layers_begin_at_the_lowest() -> None:
    spec = LidarSpec(layers=5, azimuth_count=8, lowest_deg=-20, highest_deg=20)
    np.testing.assert_allclose(np.rad2deg(spec.elevation), [-20, -10, 0, 10, 20])
    np.testing.assert_allclose(np.rad2deg(spec.azimuth), [-180, -135, -90, -45, 0, 45, 90, 135])


def test_lidar_whose_lowest_layer_is_above_its_highest_is_refused() -> None:
    with pytest.raises(ValidationError, match="must not lie above"):
        LidarSpec(lowest_deg=5, highest_deg=-5)
