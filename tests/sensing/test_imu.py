import numpy as np
import pytest
from pydantic import ValidationError
from sensing.roadside import steady_drive

from wzsumo.sensing.ground import flat_ground
from wzsumo.sensing.imu import ImuSpec, MappingGnssSpec, read_motion
from wzsumo.sensing.lidar import Drive


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


def test_white_noise_of_the_readings_has_its_given_size() -> None:
    spec = ImuSpec(gyro_noise_deg_per_sqrt_s=0.02, attitude_noise_deg=0.3, speed_noise_mps=0.1, rate_hz=25.0)
    drive = steady_drive(seconds=100.0, speed=3.0)
    readings = read_motion(drive, flat_ground(), spec, MappingGnssSpec(), seed=3)
    # A rate's noise over one step of 1/25 s is the angle random walk times sqrt(25 Hz).
    np.testing.assert_allclose(np.rad2deg(readings.gyro_rps.std(axis=0)), 0.02 * 5, rtol=0.08)
    np.testing.assert_allclose(np.rad2deg(readings.attitude.std(axis=0)), 0.3, rtol=0.08)
    assert readings.speed_mps.std() == pytest.approx(0.1, rel=0.08)


def test_biases_and_the_wheels_scale_are_drawn_once_a_drive_with_their_given_size() -> None:
    spec = ImuSpec(gyro_bias_deg_per_s=0.5, attitude_bias_deg=0.4, speed_scale=0.02, rate_hz=2)
    quiet = spec.model_copy(update={"gyro_noise_deg_per_sqrt_s": 0.0, "attitude_noise_deg": 0.0, "speed_noise_mps": 0.0})
    drives = [read_motion(steady_drive(), flat_ground(), quiet, MappingGnssSpec(), seed=seed) for seed in range(300)]
    assert all(np.ptp(readings.gyro_rps, axis=0).max() < 1e-9 for readings in drives)
    # A standard deviation from 300 drives has a standard error of 4 %.
    np.testing.assert_allclose(np.rad2deg(np.std([r.gyro_rps[0] for r in drives], axis=0)), 0.5, rtol=0.16)
    np.testing.assert_allclose(np.rad2deg(np.std([r.attitude[0] for r in drives], axis=0)), 0.4, rtol=0.16)
    assert np.std([r.speed_mps[5] / 10 for r in drives]) == pytest.approx(0.02, rel=0.16)


def test_slow_gnss_error_loses_its_memory_with_its_correlation_time() -> None:
    spec = MappingGnssSpec(bias_m=1.0, noise_m=0.0, bias_time_s=20.0, rate_hz=0.1)
    drive = Drive(time_s=np.array([0.0, 21.0]), poses=np.array([[0, 0, 0], [0.001, 0, 0]], float))
    errors = np.array([read_motion(drive, flat_ground(), ImuSpec(rate_hz=1), spec, seed=s).gnss[:, :2] for s in range(400)])
    for lag in (1, 2):
        measured = (errors[:, 0] * errors[:, lag]).mean()
        assert measured == pytest.approx(np.exp(-10 * lag / 20), abs=4 * np.sqrt(2 / 800))


def test_default_sensors_are_an_automotive_unit_and_rtk() -> None:
    assert ImuSpec().model_dump() == {
        "rate_hz": 100.0, "gyro_noise_deg_per_sqrt_s": 0.01, "gyro_bias_deg_per_s": 0.01, "attitude_noise_deg": 0.1,
        "attitude_bias_deg": 0.2, "speed_scale": 0.01, "speed_noise_mps": 0.05,
    }  # fmt: skip
    assert MappingGnssSpec().model_dump() == {
        "rate_hz": 10.0, "bias_m": 0.01, "bias_time_s": 60.0, "noise_m": 0.01, "vertical_factor": 2.0, "gaps_s": (),
    }  # fmt: skip


def test_gap_that_ends_before_it_starts_is_refused() -> None:
    with pytest.raises(ValidationError, match="must end after it starts"):
        MappingGnssSpec(gaps_s=((3.0, 3.0),))
