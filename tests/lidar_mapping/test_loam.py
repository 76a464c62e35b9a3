from dataclasses import replace

import numpy as np
import pytest
from lidar_mapping.drive_past_posts import POSTS, arc_scans, drive, readings_of, scan_of_posts

from wzsumo.errors import InputError
from wzsumo.lidar_mapping.loam import LoamSpec
from wzsumo.lidar_mapping.posed_scan import ScanState, trajectory_error_m
from wzsumo.rigid import rigid
from wzsumo.scan import LidarScan


def test_posts_correct_a_wheel_that_is_off_by_two_percent() -> None:
    readings, truth = readings_of(4.0, scale=1.02)
    posed = drive(arc_scans(truth, 24), readings)
    true_poses = truth(np.arange(24) * 0.1)
    error = trajectory_error_m(np.array([p.pose for p in posed]), true_poses)
    reckoned = trajectory_error_m(np.array([p.dead_reckoned for p in posed]), true_poses)
    assert reckoned[-1] == pytest.approx(0.02 * 8 * 2.3, rel=0.05)
    assert error.max() < 0.25 * reckoned.max()
    assert posed[0].state == ScanState.FIRST_SCAN
    assert all(p.state in {ScanState.REGISTERED, ScanState.DEGENERATE} for p in posed[1:])


def test_bare_ground_leaves_position_along_the_road_to_the_prior() -> None:
    readings, truth = readings_of(2.0, scale=1.02)
    posed = drive(arc_scans(truth, 15, posts=POSTS[:0]), readings)
    assert {p.state for p in posed[1:]} == {ScanState.DEGENERATE}
    assert all(p.free_directions >= 3 for p in posed[1:])
    # x, y and yaw come from the prior: the error is the wheel's, no more and no less.
    along = posed[-1].pose[:3, 3] - posed[-1].dead_reckoned[:3, 3]
    assert np.linalg.norm(along) < 0.01


def test_empty_and_repeated_scans_leave_the_pose_to_the_prior_and_say_so() -> None:
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
    frozen = replace(scans[4], start_s=0.5)
    posed = drive([*scans[:3], empty, scans[4], frozen, *scans[6:]], readings)
    states = [p.state for p in posed]
    assert states[3] == ScanState.TOO_FEW_FEATURES
    assert states[5] == ScanState.IDENTICAL_SCAN
    error = trajectory_error_m(np.array([p.pose for p in posed]), truth(np.arange(8) * 0.1))
    assert error.max() < 0.05
    assert len(posed[3].cloud) == 0


def test_scan_that_contradicts_the_prior_hardly_moves_the_pose() -> None:
    readings, truth = readings_of(2.0)
    scans = arc_scans(truth, 6)
    moved_away = scan_of_posts(truth(0.6) @ rigid(np.eye(3), [0.35, 0, 0]), start_s=0.6, seed=9)
    posed = drive([*scans, moved_away], readings)
    assert trajectory_error_m(np.array([p.pose for p in posed]), truth(np.arange(7) * 0.1)).max() < 0.05


def test_scans_beyond_the_gate_leave_the_pose_to_the_prior() -> None:
    readings, truth = readings_of(2.0, scale=1.02)
    posed = drive(arc_scans(truth, 6), readings, LoamSpec(gate=1e-3))
    assert {p.state for p in posed[1:]} == {ScanState.CONTRADICTS_PRIOR}
    np.testing.assert_allclose(posed[-1].pose[:3, 3], posed[-1].dead_reckoned[:3, 3], atol=1e-3)


def test_rtk_fixes_bound_the_error_and_scans_without_one_say_so() -> None:
    readings, truth = readings_of(2.5, scale=1.02, fixes=True)
    kept = (readings.gnss_time_s < 1.0) | (readings.gnss_time_s > 1.5)
    gap = replace(readings, gnss_time_s=readings.gnss_time_s[kept], gnss=readings.gnss[kept])
    posed = drive(arc_scans(truth, 19), gap)
    assert [p.has_gnss for p in posed[1:]] == [not 1.0 <= p.time_s <= 1.5 for p in posed[1:]]
    assert trajectory_error_m(np.array([p.pose for p in posed]), truth(np.arange(19) * 0.1)).max() < 0.06


def test_drive_without_a_scan_is_refused() -> None:
    readings, _ = readings_of(1.0)
    with pytest.raises(InputError, match="no scans"):
        drive([], readings)


def test_scan_is_never_surer_than_the_map_it_is_matched_to() -> None:
    readings, truth = readings_of(1.0)
    sure, doubtful = (drive(arc_scans(truth, 8), readings, LoamSpec(map_deviation_m=d))[-1].deviation[0] for d in (0.001, 0.1))
    assert doubtful > 4 * sure


def test_default_odometry_takes_grounds_threshold_from_the_paper_and_no_slope() -> None:
    spec = LoamSpec()
    assert spec.ground.model_dump() == {
        "cell_m": 1.0, "slope": 0.15, "window_m": 18.0, "elevation_threshold_m": 0.2, "elevation_scalar": 0.0,
    }  # fmt: skip
    assert spec.model_dump(exclude={"ground", "features", "motion"}) == {
        "edge_radius_m": 0.6, "plane_radius_m": 1.2, "edge_spacing_m": 0.08, "plane_spacing_m": 0.35, "map_deviation_m": 0.01,
        "map_deviation_deg": 0.02, "gate": 5.0, "max_range_m": 60.0,
    }  # fmt: skip
