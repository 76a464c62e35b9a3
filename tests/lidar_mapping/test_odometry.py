import numpy as np
import pytest

from wzsumo.errors import InputError, TraceError
from wzsumo.lidar_mapping.alignment import minus, plus
from wzsumo.lidar_mapping.features import FeatureSpec, classify_points, take_out_motion
from wzsumo.lidar_mapping.loam import LoamSpec, map_drive
from wzsumo.lidar_mapping.motion import MotionSpec, dead_reckon, first_prior, motion_within, predict, update, with_gnss
from wzsumo.lidar_mapping.posed_scan import ScanState, trajectory_error_m, without_clouds
from wzsumo.lidar_mapping.scan_lines import NEITHER, PLANAR, POST, SIDE, SMOOTH
from wzsumo.rigid import inverse, moved, rigid, rotation_from_rpy
from wzsumo.scan import LidarScan, MotionReadings

AZIMUTH = -np.pi + 2 * np.pi * np.arange(900) / 900
ELEVATION = np.deg2rad(np.linspace(-22, 4, 40))
MOUNT = rigid(np.eye(3), [0.0, 0.0, 1.9])
POSTS = np.array([(x, y) for x in range(-30, 90, 13) for y in (-7.0, 6.0)]) + np.linspace(0, 3, 20)[:, None] * (1, 0.3)
RADIUS, HEIGHT = 0.15, 1.6


def scan_of_posts(pose, *, start_s, seed, posts=POSTS, noise=0.01):
    """A still scan from the car's pose (4, 4): a flat ground z = 0 and upright cylinders, by closed forms."""
    rng = np.random.default_rng(seed)
    sensor = pose @ MOUNT
    column, ring = (grid.ravel() for grid in np.meshgrid(np.arange(900), np.arange(40), indexing="ij"))
    across = np.cos(ELEVATION)[ring]
    local = np.column_stack([across * np.cos(AZIMUTH)[column], across * np.sin(AZIMUTH)[column], np.sin(ELEVATION)[ring]])
    d = local @ sensor[:3, :3].T
    with np.errstate(divide="ignore"):
        t = np.where(d[:, 2] < 0, -sensor[2, 3] / d[:, 2], np.inf)
    hit = np.zeros(len(t), dtype=np.int32)
    for number, post in enumerate(posts, start=1):
        away = post - sensor[:2, 3]
        a, b = (d[:, :2] ** 2).sum(axis=1), d[:, :2] @ away
        root = b**2 - a * (away @ away - RADIUS**2)
        near = (b - np.sqrt(np.maximum(root, 0))) / a
        z = sensor[2, 3] + near * d[:, 2]
        front = (root > 0) & (near > 0) & (near < t) & (z > 0) & (z < HEIGHT)
        t, hit = np.where(front, near, t), np.where(front, number, hit)
    kept = t < 60
    points = (t + noise * rng.standard_normal(len(t)))[kept, None] * local[kept]
    return LidarScan(
        start_s=start_s,
        period_s=0.1,
        points=points,
        ring=ring[kept].astype(np.int32),
        column=column[kept].astype(np.int32),
        time_s=np.zeros(kept.sum()),
        object_id=hit[kept],
    )


def readings_of(seconds, *, speed=8.0, yaw_rate=0.05, scale=1.0, gyro_bias=0.0, fixes=False):
    """Readings of a car on an arc, exact but for a wheel scale and a gyroscope's bias; its true poses by closed form."""
    t = np.arange(0, seconds + 0.005, 0.01)

    def truth(time):
        heading = yaw_rate * np.asarray(time)
        xy = speed / yaw_rate * np.stack([np.sin(heading), 1 - np.cos(heading)], axis=-1)
        zero = np.zeros_like(heading)
        return rigid(
            rotation_from_rpy(np.stack([zero, zero, heading], axis=-1)), np.stack([xy[..., 0], xy[..., 1], zero], axis=-1)
        )

    fix_s = np.arange(0, seconds, 0.1) if fixes else np.empty(0)
    readings = MotionReadings(
        time_s=t,
        speed_mps=np.full(len(t), speed * scale),
        gyro_rps=np.tile([0, 0, yaw_rate + gyro_bias], (len(t), 1)),
        attitude=np.zeros((len(t), 2)),
        gnss_time_s=fix_s,
        gnss=truth(fix_s)[:, :3, 3].reshape(-1, 3),
    )
    return readings, truth


def drive(scans, readings, spec=None):
    return list(map_drive(scans, readings, spec or LoamSpec(), mounting=MOUNT, start=np.eye(4)))


def arc_scans(truth, count, **options):
    """Scans of still instants: what a scan of a moving car is after its motion is taken out."""
    return [scan_of_posts(truth(k * 0.1), start_s=k * 0.1, seed=k, **options) for k in range(count)]


def test_dead_reckoning_of_exact_readings_is_the_arc() -> None:
    readings, truth = readings_of(8.0)
    times = np.array([0.0, 1.234, 7.9])
    np.testing.assert_allclose(dead_reckon(readings, times, np.eye(4)), truth(times), atol=1e-4)


def test_dead_reckoning_starts_where_it_is_told() -> None:
    readings, truth = readings_of(4.0)
    start = rigid(rotation_from_rpy([0, 0, 2.0]), [10, -5, 3])
    np.testing.assert_allclose(dead_reckon(readings, [3.0], start)[0], start @ truth(3.0), atol=1e-4)


def test_motion_within_a_scan_is_relative_to_its_start() -> None:
    readings, truth = readings_of(4.0)
    times = np.array([2.0, 2.03, 2.1])
    expected = inverse(truth(2.0)) @ truth(times)
    np.testing.assert_allclose(motion_within(readings, first_prior(np.eye(4), MotionSpec()), times), expected, atol=1e-5)


def test_motion_beyond_the_readings_is_refused() -> None:
    readings, _ = readings_of(2.0)
    with pytest.raises(TraceError, match="no motion readings"):
        motion_within(readings, first_prior(np.eye(4), MotionSpec()), np.array([30.0, 30.1]))


def test_predicted_covariance_equals_monte_carlo() -> None:
    spec = MotionSpec()
    rng = np.random.default_rng(1)
    prior = first_prior(np.eye(4), spec)
    motion = rigid(rotation_from_rpy([0.0, 0.02, 0.1]), [2.0, 0.1, 0.05])
    ends = []
    for _ in range(4000):
        error = rng.multivariate_normal(np.zeros(8), prior.covariance)
        true_motion = rigid(motion[:3, :3] @ rotation_from_rpy([0, 0, 0.1 * error[7]]), motion[:3, 3] * (1 + error[6]))
        ends.append(minus(plus(prior.pose, error[:6]) @ true_motion, prior.pose @ motion))
    quiet = MotionSpec(along_m_per_sqrt_m=1e-9, aside_m_per_sqrt_m=1e-9, turn_deg_per_sqrt_s=1e-9)
    predicted = predict(prior, motion, elapsed_s=0.1, spec=quiet).covariance[:6, :6]
    np.testing.assert_allclose(np.cov(np.array(ends).T), predicted, atol=0.08 * predicted.max(), rtol=0.12)


def test_exact_measurement_leaves_no_doubt_in_what_it_measures() -> None:
    prior = first_prior(np.eye(4), MotionSpec())
    jacobian = np.eye(8)[:1]
    after = update(prior, jacobian=jacobian, residual=np.array([0.002]), noise=np.array([[1e-12]]))
    assert after.pose[0, 3] == pytest.approx(0.002)
    assert after.covariance[0, 0] < 1e-11


def test_gnss_calibrates_the_wheel_and_the_gyroscope() -> None:
    readings, truth = readings_of(30.0, scale=1.02, gyro_bias=0.0005, fixes=True)
    spec = MotionSpec(gnss_m=0.02)
    prior = first_prior(np.eye(4), spec)
    for k in range(1, 290):
        motion = motion_within(readings, prior, np.array([(k - 1) / 10, k / 10]))[1]
        prior = with_gnss(predict(prior, motion, elapsed_s=0.1, spec=spec), truth(k / 10)[:3, 3], spec)
    assert 1 + prior.scale == pytest.approx(1 / 1.02, abs=0.002)
    assert prior.bias_rps == pytest.approx(-0.0005, abs=0.0002)


def test_posts_are_found_on_their_axes_and_ground_gives_planars() -> None:
    pose = rigid(rotation_from_rpy([0, 0, 0.3]), [12.0, 0.5, 0])
    scan = scan_of_posts(pose, start_s=0.0, seed=1, noise=0.0)
    kind, place = classify_points(scan, scan.object_id > 0, FeatureSpec(edges_per_sector=0))
    post = kind == POST
    assert post.sum() > 40
    assert (scan.object_id[post] > 0).all()
    assert (scan.object_id[kind == PLANAR] == 0).mean() > 0.99
    axes = moved(place[post], pose @ MOUNT)[:, :2] - POSTS[scan.object_id[post] - 1]
    away = np.linalg.norm(scan.points[post], axis=1)
    assert np.linalg.norm(axes[away < 15], axis=1).max() < 0.08  # half an azimuth step is 5 cm at 15 m
    np.testing.assert_allclose(axes.mean(axis=0), 0.0, atol=0.02)


def test_planars_of_a_line_keep_their_distance_and_stay_within_their_number() -> None:
    scan = scan_of_posts(np.eye(4), start_s=0.0, seed=1)
    spec = FeatureSpec(sectors=4, planars_per_sector=3)
    kind, _ = classify_points(scan, np.zeros(len(scan.points), dtype=bool), spec)
    assert set(kind) <= {NEITHER, PLANAR, SMOOTH}
    for ring in range(10):
        columns = np.sort(scan.column[(kind == PLANAR) & (scan.ring == ring)])
        assert 0 < len(columns) <= 12
        assert (np.diff(columns) > SIDE / 2).all()


def test_motion_taken_out_equals_matrix_product_point_by_point() -> None:
    scan = scan_of_posts(np.eye(4), start_s=0.0, seed=1)
    share = np.linspace(0, 1, 900)[:, None]
    motion = rigid(rotation_from_rpy(share * (0.1, 0.2, 0.3)), share * (1.0, 2.0, 3.0))
    expected = [motion[c, :3, :3] @ p + motion[c, :3, 3] for c, p in zip(scan.column[::50], scan.points[::50], strict=True)]
    np.testing.assert_allclose(take_out_motion(scan, motion)[::50], expected, atol=1e-12)


def test_posts_mend_a_wheel_that_is_off_by_two_percent() -> None:
    readings, truth = readings_of(4.0, scale=1.02)
    posed = drive(arc_scans(truth, 24), readings)
    true_poses = truth(np.arange(24) * 0.1)
    error = trajectory_error_m(np.array([p.pose for p in posed]), true_poses)
    reckoned = trajectory_error_m(np.array([p.dead_reckoned for p in posed]), true_poses)
    assert reckoned[-1] == pytest.approx(0.02 * 8 * 2.3, rel=0.05)
    assert error.max() < 0.25 * reckoned.max()
    assert posed[0].state == ScanState.FIRST_SCAN
    assert all(p.state in {ScanState.REGISTERED, ScanState.DEGENERATE} for p in posed[1:])


def test_ground_alone_leaves_the_way_along_the_road_to_the_prior() -> None:
    readings, truth = readings_of(2.0, scale=1.02)
    posed = drive(arc_scans(truth, 15, posts=POSTS[:0]), readings)
    assert {p.state for p in posed[1:]} == {ScanState.DEGENERATE}
    assert all(p.free_directions >= 3 for p in posed[1:])
    # x, y and yaw come from the prior: the error is the wheel's, no more and no less.
    along = posed[-1].pose[:3, 3] - posed[-1].dead_reckoned[:3, 3]
    assert np.linalg.norm(along) < 0.01


def test_empty_and_repeated_scans_fall_back_on_the_prior_and_say_so() -> None:
    readings, truth = readings_of(2.0)
    scans = arc_scans(truth, 8)
    empty = LidarScan(
        start_s=0.3,
        period_s=0.1,
        points=np.empty((0, 3)),
        ring=np.empty(0, np.int32),
        column=np.empty(0, np.int32),
        time_s=np.empty(0),
        object_id=np.empty(0, np.int32),
    )
    frozen = LidarScan(**{**vars(scans[4]), "start_s": 0.5})
    posed = drive([*scans[:3], empty, scans[4], frozen, *scans[6:]], readings)
    states = [p.state for p in posed]
    assert states[3] == ScanState.TOO_FEW_FEATURES
    assert states[5] == ScanState.IDENTICAL_SCAN
    error = trajectory_error_m(np.array([p.pose for p in posed]), truth(np.arange(8) * 0.1))
    assert error.max() < 0.05
    assert len(posed[3].cloud) == 0
    assert without_clouds(posed[0]).cloud.shape == (0, 3)
    assert without_clouds(posed[0]).cloud.base is None  # a view would keep the points in memory for as long as the log lives


def test_scan_that_fits_elsewhere_is_not_believed() -> None:
    readings, truth = readings_of(2.0)
    scans = arc_scans(truth, 6)
    moved_away = scan_of_posts(truth(0.6) @ rigid(np.eye(3), [0.35, 0, 0]), start_s=0.6, seed=9)
    posed = drive([*scans, moved_away], readings)
    assert trajectory_error_m(np.array([p.pose for p in posed]), truth(np.arange(7) * 0.1)).max() < 0.05


def test_scans_beyond_the_gate_leave_the_prior_alone() -> None:
    readings, truth = readings_of(2.0, scale=1.02)
    posed = drive(arc_scans(truth, 6), readings, LoamSpec(gate=1e-3))
    assert {p.state for p in posed[1:]} == {ScanState.CONTRADICTS_PRIOR}
    np.testing.assert_allclose(posed[-1].pose[:3, 3], posed[-1].dead_reckoned[:3, 3], atol=1e-3)


def test_rtk_fixes_bound_the_error_and_gaps_are_told() -> None:
    readings, truth = readings_of(2.5, scale=1.02, fixes=True)
    kept = (readings.gnss_time_s < 1.0) | (readings.gnss_time_s > 1.5)
    gap = MotionReadings(**{**vars(readings), "gnss_time_s": readings.gnss_time_s[kept], "gnss": readings.gnss[kept]})
    posed = drive(arc_scans(truth, 19), gap)
    assert [p.has_gnss for p in posed[1:]] == [not 1.0 <= p.time_s <= 1.5 for p in posed[1:]]
    assert trajectory_error_m(np.array([p.pose for p in posed]), truth(np.arange(19) * 0.1)).max() < 0.06


def test_drive_without_a_scan_is_refused() -> None:
    readings, _ = readings_of(1.0)
    with pytest.raises(InputError, match="no scans"):
        drive([], readings)
