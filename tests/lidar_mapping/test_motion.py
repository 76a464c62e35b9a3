import numpy as np
import pytest
from lidar_mapping.drive_past_posts import readings_of

from wzsumo.errors import TraceError
from wzsumo.lidar_mapping.alignment import minus, plus
from wzsumo.lidar_mapping.motion import (
    MotionSpec,
    Prior,
    dead_reckoned_poses,
    initial_prior,
    kalman_update,
    motion_within,
    poses_between,
    predict,
    with_attitude,
    with_gnss,
)
from wzsumo.rigid import inverse, rigid, rotation_from_rpy
from wzsumo.scan import MotionReadings


def test_dead_reckoning_of_exact_readings_is_the_arc() -> None:
    readings, truth = readings_of(8.0)
    poses = dead_reckoned_poses(readings, np.eye(4))
    np.testing.assert_allclose(poses[::50], truth(readings.time_s[::50]), atol=1e-4)


def test_dead_reckoning_starts_at_the_given_pose() -> None:
    readings, truth = readings_of(4.0)
    start = rigid(rotation_from_rpy([0, 0, 2.0]), [10, -5, 3])
    np.testing.assert_allclose(dead_reckoned_poses(readings, start)[300], start @ truth(3.0), atol=1e-4)


def test_dead_reckoning_of_a_banked_car_turns_by_its_yaw_rate_about_the_vertical() -> None:
    roll, yaw_rate = 0.1, 0.2
    time_s = np.arange(0, 2.001, 0.01)
    # Body rates of a car that turns about the vertical at a constant roll: (0, sin(roll), cos(roll)) times the yaw rate.
    rates = np.tile([0.0, yaw_rate * np.sin(roll), yaw_rate * np.cos(roll)], (len(time_s), 1))
    readings = MotionReadings(
        time_s=time_s, speed_mps=np.zeros(len(time_s)), gyro_rps=rates, attitude=np.tile([roll, 0.0], (len(time_s), 1)),
        gnss_time_s=np.empty(0), gnss=np.empty((0, 3)),
    )  # fmt: skip
    expected = rotation_from_rpy([roll, 0.0, yaw_rate * 2.0])
    np.testing.assert_allclose(dead_reckoned_poses(readings, np.eye(4))[-1, :3, :3], expected, atol=1e-9)


def test_pose_between_two_known_ones_is_linear_in_position_and_angles() -> None:
    poses = rigid(rotation_from_rpy([[0, 0, 3.1], [0, 0, -3.1], [0.2, 0, -3.1]]), [[0, 0, 0], [2, 0, 0], [2, 4, 0]])
    between = poses_between(np.array([0.0, 1.0, 2.0]), poses, [0.5, 1.75])
    expected = rigid(rotation_from_rpy([[0, 0, np.pi], [0.15, 0, -3.1]]), [[1, 0, 0], [2, 3, 0]])
    np.testing.assert_allclose(between, expected, atol=1e-12)


def test_motion_within_a_scan_is_relative_to_its_start() -> None:
    readings, truth = readings_of(4.0)
    times = np.array([2.0, 2.03, 2.1])
    expected = inverse(truth(2.0)) @ truth(times)
    np.testing.assert_allclose(motion_within(readings, initial_prior(np.eye(4), MotionSpec()), times), expected, atol=1e-5)


def test_motion_beyond_the_readings_is_refused() -> None:
    readings, _ = readings_of(2.0)
    with pytest.raises(TraceError, match="no motion readings"):
        motion_within(readings, initial_prior(np.eye(4), MotionSpec()), np.array([30.0, 30.1]))


def test_motion_is_corrected_by_the_estimated_scale_and_bias() -> None:
    readings, truth = readings_of(4.0, scale=1.02, gyro_bias=0.01)
    prior = Prior(pose=np.eye(4), covariance=np.eye(8), scale=1 / 1.02 - 1, bias_rps=-0.01)
    expected = inverse(truth(2.0)) @ truth(2.1)
    np.testing.assert_allclose(motion_within(readings, prior, np.array([2.0, 2.1]))[1], expected, atol=1e-5)


def test_predicted_covariance_equals_monte_carlo() -> None:
    spec = MotionSpec()
    rng = np.random.default_rng(1)
    prior = initial_prior(np.eye(4), spec)
    motion = rigid(rotation_from_rpy([0.0, 0.02, 0.1]), [2.0, 0.1, 0.05])
    ends = []
    for _ in range(4000):
        error = rng.multivariate_normal(np.zeros(8), prior.covariance)
        true_motion = rigid(motion[:3, :3] @ rotation_from_rpy([0, 0, 0.1 * error[7]]), motion[:3, 3] * (1 + error[6]))
        ends.append(minus(plus(prior.pose, error[:6]) @ true_motion, prior.pose @ motion))
    quiet = MotionSpec(along_m_per_sqrt_m=1e-9, aside_m_per_sqrt_m=1e-9, turn_deg_per_sqrt_s=1e-9)
    predicted = predict(prior, motion, elapsed_s=0.1, spec=quiet).covariance[:6, :6]
    np.testing.assert_allclose(np.cov(np.array(ends).T), predicted, atol=0.08 * predicted.max(), rtol=0.12)


def test_first_pose_is_known_to_a_millimetre_and_scale_and_bias_to_twice_their_usual_size() -> None:
    deviation = np.sqrt(np.diag(initial_prior(np.eye(4), MotionSpec()).covariance))
    np.testing.assert_allclose(deviation, [1e-3] * 3 + [1e-4] * 3 + [0.02, np.deg2rad(0.02)])


def test_noise_of_a_motion_grows_with_the_root_of_its_length_and_of_its_time() -> None:
    sure = Prior(pose=np.eye(4), covariance=np.zeros((8, 8)))
    covariance = predict(sure, rigid(np.eye(3), [4.0, 0, 0]), elapsed_s=0.25, spec=MotionSpec()).covariance
    # 0.01 and 0.005 m per root metre over 4 m (and a millimetre), 0.05 degrees per root second over a quarter of a second.
    expected = [0.02, 0.01, 0.01, *[np.deg2rad(0.025)] * 3, 1e-6, 1e-7]
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), expected, rtol=2e-4)
    np.testing.assert_allclose(covariance, np.diag(np.diag(covariance)), atol=1e-20)


def test_exact_measurement_leaves_no_doubt_in_what_it_measures() -> None:
    prior = initial_prior(np.eye(4), MotionSpec())
    jacobian = np.eye(8)[:1]
    after = kalman_update(prior, jacobian=jacobian, residual=np.array([0.002]), noise=np.array([[1e-12]]))
    assert after.pose[0, 3] == pytest.approx(0.002)
    assert after.covariance[0, 0] < 1e-11


def test_fix_is_trusted_to_3_cm_horizontally_and_6_cm_vertically() -> None:
    prior = Prior(pose=np.eye(4), covariance=np.diag([0.03**2, 0.03**2, 0.06**2, *[1e-12] * 5]))
    after = with_gnss(prior, np.array([0.1, -0.2, 0.4]), MotionSpec())
    np.testing.assert_allclose(after.pose[:3, 3], [0.05, -0.1, 0.2], atol=1e-6)  # as sure as the prior: half way
    np.testing.assert_allclose(np.diag(after.covariance)[:3], np.square([0.03, 0.03, 0.06]) / 2, rtol=1e-6)


@pytest.mark.parametrize(("elapsed_s", "readings_per_correlation_time"), [(0.1, 100), (2.5, 4), (20.0, 1)])
def test_attitude_readings_of_ten_seconds_count_as_one_of_half_a_degree(
    elapsed_s: float, readings_per_correlation_time: int
) -> None:
    deviation = np.deg2rad(0.5) * np.sqrt(readings_per_correlation_time)
    prior = Prior(pose=np.eye(4), covariance=np.diag([1e-12] * 3 + [deviation**2] * 2 + [1e-12] * 3))
    after = with_attitude(prior, np.array([0.002, -0.001]), elapsed_s=elapsed_s, spec=MotionSpec())
    np.testing.assert_allclose(minus(after.pose, prior.pose)[3:5], [0.001, -0.0005], rtol=1e-4)  # half way


def test_gnss_calibrates_the_wheel_and_the_gyroscope() -> None:
    readings, truth = readings_of(30.0, scale=1.02, gyro_bias=0.0005, fixes=True)
    spec = MotionSpec(gnss_m=0.02)
    prior = initial_prior(np.eye(4), spec)
    for k in range(1, 290):
        motion = motion_within(readings, prior, np.array([(k - 1) / 10, k / 10]))[1]
        prior = with_gnss(predict(prior, motion, elapsed_s=0.1, spec=spec), truth(k / 10)[:3, 3], spec)
    assert 1 + prior.scale == pytest.approx(1 / 1.02, abs=0.002)
    assert prior.bias_rps == pytest.approx(-0.0005, abs=0.0002)


def test_default_noise_is_that_of_an_automotive_unit_and_rtk() -> None:
    assert MotionSpec().model_dump() == {
        "speed_scale": 0.02, "gyro_bias_deg_per_s": 0.02, "along_m_per_sqrt_m": 0.01, "aside_m_per_sqrt_m": 0.005,
        "turn_deg_per_sqrt_s": 0.05, "attitude_deg": 0.5, "attitude_time_s": 10.0, "gnss_m": 0.03, "gnss_vertical_factor": 2.0,
    }  # fmt: skip
