import numpy as np
import pandas as pd
import pytest
from builders import paper_layout
from pydantic import ValidationError

from wzsumo.errors import InputError, TraceError
from wzsumo.road import RoadSpec
from wzsumo.sensing.ground import GroundSpec, flat_ground, ground_of
from wzsumo.sensing.imu import ImuSpec, MappingGnssSpec, read_motion
from wzsumo.sensing.lidar import Drive, LidarSpec, cast_ahead, cast_scan, drive_of, drive_scans, without_motion
from wzsumo.sensing.scene import DeviceFaults, SceneSpec, road_scene, scene_of, with_vehicles

SMOOTH = GroundSpec(grade_pct=2.0, cross_slope_pct=2.0, road_roughness_m=0.0, verge_roughness_m=0.0)
SMALL = LidarSpec(layers=32, azimuth_count=360)


def straight_road(length_ft=700):
    return RoadSpec(lane_count=2, left_shoulder_ft=6, right_shoulder_ft=10, length_ft=length_ft).build()


def cone_line(n=12, kind="cone_36in"):
    return pd.DataFrame({"kind": kind, "x_m": 20.0 + 10 * np.arange(n), "y_m": 7.5, "height_m": 0.914, "radius_m": 0.178})


def steady_drive(speed=10.0, seconds=6.0, yaw_rate=0.0):
    t = np.linspace(0, seconds, 301)
    heading = yaw_rate * t
    step = np.column_stack([np.cos(heading), np.sin(heading)]) * speed * (t[1] - t[0])
    xy = np.array([20.0, 1.8]) + np.vstack([[0.0, 0.0], np.cumsum(step[:-1], axis=0)])
    return Drive(time_s=t, poses=np.column_stack([xy, heading]))


def rims(frustum, n=200):
    """Points on both rims of a frustum."""
    axis = frustum[3:6]
    u = np.cross(axis, [1, 0, 0] if abs(axis[0]) < 0.9 else [0, 1, 0])
    u /= np.linalg.norm(u)
    turn = np.linspace(0, 2 * np.pi, n)[:, None]
    ring = np.cos(turn) * u + np.sin(turn) * np.cross(axis, u)
    return np.vstack([frustum[:3] + frustum[7] * ring, frustum[:3] + frustum[6] * axis + frustum[8] * ring])


def test_car_on_tilted_ground_stands_square_to_it() -> None:
    slope = (0.04, -0.03)
    poses = Drive(time_s=np.array([0.0, 1.0]), poses=np.array([[0, 0, 0.7], [1, 1, 0.7]])).car_poses(
        [0.0, 0.5], flat_ground(slope=slope)
    )
    normal = np.array([-slope[0], -slope[1], 1.0]) / np.linalg.norm([*slope, 1.0])
    np.testing.assert_allclose(poses[:, :3, 2], [normal, normal], atol=1e-12)
    np.testing.assert_allclose(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]), 0.7)
    np.testing.assert_allclose(poses[1, :3, 3], [0.5, 0.5, 0.5 * sum(slope)])


def test_ground_of_straight_road_rises_along_it_and_falls_to_the_right() -> None:
    ground = ground_of(straight_road(), SMOOTH, seed=1)
    np.testing.assert_allclose(ground.height([[0, 0], [100, 0], [100, 5]]), [0, 2.0, 2.1], atol=1e-3)


def test_car_stands_on_the_surface_of_a_straight_road() -> None:
    road = straight_road()
    ground = ground_of(road, SMOOTH, seed=1)
    xy = road.to_xy([10.0, 150.0], [1.8, 5.4])
    drive = Drive(time_s=np.array([0.0, 1.0]), poses=np.column_stack([xy, np.zeros(2)]))
    np.testing.assert_allclose(drive.car_poses(drive.time_s, ground)[:, 2, 3], ground.height(xy), atol=1e-3)


def test_superelevation_of_a_curve_turns_with_the_road() -> None:
    spec = RoadSpec(lane_count=2, left_shoulder_ft=6, right_shoulder_ft=10, alignment=({"length_ft": 1500, "radius_ft": 1500},))
    road = spec.build()
    ground = ground_of(road, SMOOTH, seed=1)
    s = np.linspace(20, 430, 9)
    for d in (0.0, 6.0):
        np.testing.assert_allclose(ground.height(road.to_xy(s, np.full_like(s, d))), 0.02 * (s + d), atol=0.02)


def test_verge_is_rough_and_road_nearly_even_by_their_rms() -> None:
    ground = ground_of(straight_road(), GroundSpec(grade_pct=0, cross_slope_pct=0), seed=3)
    x = np.random.default_rng(0).uniform(10, 200, 4000)
    road, verge = (ground.height(np.column_stack([x, np.full_like(x, y)])) for y in (3.0, 20.0))
    # Bilinear interpolation between independent neighbours keeps at least 2/3 x 2/3 of the variance.
    assert 0.003 * 0.6 < road.std() < 0.003 * 1.1
    assert 0.05 * 0.6 < verge.std() < 0.05 * 1.1


def test_faulty_devices_are_missing_lying_and_tilted_in_their_shares() -> None:
    faults = DeviceFaults(missing_share=0.2, lying_share=0.3, tilted_share=0.1, tilt_deg=20, seed=4)
    spec = SceneSpec(ground=SMOOTH, faults=faults, pole_spacing_m=0)
    scene = road_scene(straight_road(9000), cone_line(2000), spec, seed=1)
    lean = np.degrees(np.arccos(scene.frusta[:, 5]))
    shares = [(scene.device_id == 0).mean(), (lean > 80).sum() / 2000, ((lean > 1) & (lean < 80)).sum() / 2000]
    np.testing.assert_allclose(shares, [0.2, 0.3, 0.1], atol=0.04)
    assert len(scene.kinds) == len(scene.frusta) == (scene.device_id > 0).sum()


def test_of_a_sparse_set_up_every_nth_device_stands() -> None:
    spec = SceneSpec(ground=SMOOTH, faults=DeviceFaults(set_up_every=3), pole_spacing_m=0)
    there = road_scene(straight_road(), cone_line(10), spec, seed=1).device_id > 0
    assert there.tolist() == [True, False, False] * 3 + [True]


@pytest.mark.parametrize("fault", [{}, {"lying_share": 1.0}, {"tilted_share": 1.0, "tilt_deg": 30}])
def test_every_device_touches_level_ground_without_sinking_in(fault) -> None:
    level = GroundSpec(grade_pct=0, cross_slope_pct=0, road_roughness_m=0, verge_roughness_m=0)
    spec = SceneSpec(ground=level, faults=DeviceFaults(**fault), pole_spacing_m=0)
    for frustum in road_scene(straight_road(), cone_line(), spec, seed=1).frusta:
        assert rims(frustum)[:, 2].min() == pytest.approx(0.0, abs=1e-3)


def test_faults_that_exceed_all_devices_are_refused() -> None:
    with pytest.raises(ValidationError, match="must not exceed 1"):
        DeviceFaults(missing_share=0.7, lying_share=0.4)


def test_guardrail_follows_the_pavement_edge_at_its_offset() -> None:
    road = straight_road()
    scene = road_scene(road, cone_line(), SceneSpec(ground=SMOOTH, guardrail="both", pole_spacing_m=0), seed=1)
    beams, posts = scene.boxes[scene.boxes[:, 3] > 0.5], scene.boxes[scene.boxes[:, 3] < 0.5]
    edges = np.array([road.left_edge + 0.6, -road.right_shoulder - 0.6])
    beyond = [np.abs(road.to_sd(boxes[:, :2])[1] - edges.mean()) - np.ptp(edges) / 2 for boxes in (beams, posts)]
    np.testing.assert_allclose(beyond[0], 0.0, atol=1e-6)
    assert (beyond[1] > 0.3).all()  # posts stand behind the beam
    top = beams[:, 2] + beams[:, 5] - scene.ground.height(beams[:, :2])
    np.testing.assert_allclose(top, 0.7874, atol=1e-3)  # 31 in


def test_vehicle_box_has_its_outline_and_default_height() -> None:
    scene = road_scene(straight_road(), cone_line(), SceneSpec(ground=SMOOTH), seed=1)
    columns = {"x_m": [50.0, 80.0], "y_m": 1.8, "heading_rad": 0.3, "length_m": [4.6, 12.0], "width_m": [1.8, 2.5]}
    boxes = with_vehicles(scene, pd.DataFrame(columns)).boxes[-2:]
    np.testing.assert_allclose(boxes[:, 3:5] * 2, [[4.6, 1.8], [12.0, 2.5]])
    np.testing.assert_allclose(boxes[:, 2] + boxes[:, 5] - scene.ground.height(boxes[:, :2]), [1.5, 3.5], atol=1e-6)
    with pytest.raises(InputError, match="width_m missing"):
        with_vehicles(scene, pd.DataFrame({"x_m": [0.0], "y_m": 0.0, "heading_rad": 0.0, "length_m": 4.0}))


def test_raw_scan_of_a_moving_car_smears_a_pole_and_true_motion_mends_it() -> None:
    scene = road_scene(straight_road(), cone_line(), SceneSpec(ground=SMOOTH), seed=1)
    spec = LidarSpec(layers=32, azimuth_count=1800, range_noise_m=0.0, dropout_at_max_range=0.0)
    drive = steady_drive(speed=25.0, seconds=3.0, yaw_rate=0.1)
    scan = cast_scan(scene, drive, spec, start_s=1.0, seed=1)
    poses = drive.car_poses(1.0 + np.arange(1800) / 18000, scene.ground) @ spec.mounting
    mended = without_motion(scan, poses)
    world = mended.points @ poses[0, :3, :3].T + poses[0, :3, 3]
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


def test_share_of_devices_is_seen_in_a_scan_as_given() -> None:
    scene = road_scene(straight_road(), cone_line(15), SceneSpec(ground=SMOOTH), seed=1)
    drive = steady_drive()
    seen = dict.fromkeys((1.0, 0.6), 0)
    for share in seen:
        for scan in drive_scans(scene, drive, SMALL.model_copy(update={"detected_share": share}), seed=2):
            seen[share] += len(set(scan.object_id) & set(scene.device_id))
    assert seen[0.6] / seen[1.0] == pytest.approx(0.6, abs=0.08)


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


def test_vehicles_of_the_moment_stand_in_the_scan():
    scene, drive = road_scene(straight_road(), cone_line(), SceneSpec(), seed=1), steady_drive(seconds=1.0)

    def ahead(time_s):
        return pd.DataFrame({"x_m": [35 + 10 * time_s], "y_m": 1.8, "heading_rad": 0.0, "length_m": 4.6, "width_m": 1.8})

    vehicle = len(scene.kinds) + 1
    for scan in drive_scans(scene, drive, SMALL, seed=1, vehicles_at=ahead):
        front = scan.points[(scan.object_id == vehicle) & (np.abs(scan.points[:, 1]) < 0.5)]
        # Rear bumper 15 m - 2.3 m ahead of the axle, the sensor 1.4 m before it.
        assert front[:, 0].min() == pytest.approx(35 - 20 - 2.3 - 1.4 - 10 * 0.05, abs=0.2)


@pytest.mark.parametrize("column", ["time_s", "heading_rad"])
def test_trace_without_a_column_is_no_drive(column: str) -> None:
    table = pd.DataFrame({"time_s": [0.0, 1], "x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0}).drop(columns=column)
    with pytest.raises(TraceError, match=column):
        drive_of(table)


def test_times_that_stand_still_are_no_drive() -> None:
    with pytest.raises(TraceError, match="ascend"):
        Drive(time_s=np.array([0.0, 0.0]), poses=np.zeros((2, 3)))


def test_noise_free_readings_are_the_true_motion() -> None:
    imu = ImuSpec(gyro_noise_deg_per_sqrt_s=0, gyro_bias_deg_per_s=0, attitude_noise_deg=0, attitude_bias_deg=0)
    imu = imu.model_copy(update={"speed_scale": 0.0, "speed_noise_mps": 0.0})
    gnss = MappingGnssSpec(bias_m=0, noise_m=0, gaps_s=((2.0, 3.0),))
    readings = read_motion(steady_drive(yaw_rate=0.2), flat_ground(), imu, gnss, seed=1)
    np.testing.assert_allclose(readings.speed_mps[1:-1], 10.0, rtol=1e-3)
    np.testing.assert_allclose(readings.gyro_rps[1:-1], np.tile([0, 0, 0.2], (len(readings.time_s) - 2, 1)), atol=1e-6)
    assert not ((readings.gnss_time_s > 2.0) & (readings.gnss_time_s < 3.0)).any()
    assert np.hypot(*(readings.gnss[0, :2] - (20.0, 1.8))) < 1e-9


def test_gnss_error_is_white_about_a_bias_that_stays_for_minutes() -> None:
    spec = MappingGnssSpec(bias_m=0.5, noise_m=0.1, bias_time_s=1e6, vertical_factor=2.0)
    drive = Drive(time_s=np.array([0.0, 100.0]), poses=np.array([[0, 0, 0], [0.001, 0, 0]], float))
    errors = np.array([read_motion(drive, flat_ground(), ImuSpec(rate_hz=1), spec, seed=s).gnss for s in range(60)])
    np.testing.assert_allclose(errors.std(axis=1).mean(axis=0), [0.1, 0.1, 0.2], rtol=0.1)
    np.testing.assert_allclose(errors.mean(axis=1).std(axis=0), [0.5, 0.5, 1.0], rtol=0.35)


def test_barrier_beside_the_work_is_a_wall_without_gaps_in_the_scene() -> None:
    layout = paper_layout(work_space_device="barrier")
    scene = scene_of(layout, SceneSpec(), seed=1)
    pieces = layout.devices["kind"].to_numpy() == "barrier"
    kinds = np.array(scene.kinds)[scene.device_id - 1]
    assert (kinds == layout.devices["kind"].to_numpy()).all()
    walls = scene.boxes[scene.device_id[pieces] - 1 - len(scene.frusta)]
    x, length = walls[:, 0], 2 * walls[:, 3]
    assert x[1:] - length[1:] / 2 == pytest.approx(x[:-1] + length[:-1] / 2)
    assert 2 * walls[:, 4] == pytest.approx(24 * 0.0254)  # 24 in wide
    top = walls[:, 2] + walls[:, 5]
    assert top - scene.ground.height(walls[:, :2]) == pytest.approx(32 * 0.0254)  # 32 in high
