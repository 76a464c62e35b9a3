import numpy as np
from lidar_mapping.posed_scans import posed_scan

from wzsumo.lidar_mapping.posed_scan import trajectory_error_m, without_clouds
from wzsumo.rigid import rigid, rotation_from_rpy


def test_trajectory_error_is_the_distance_after_the_first_poses_are_aligned() -> None:
    straight = rigid(np.eye(3), [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    bent = rigid(np.eye(3), [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.5, 0.0]])
    elsewhere = rigid(rotation_from_rpy([0, 0, 1.0]), [40.0, -3.0, 2.0])
    np.testing.assert_allclose(trajectory_error_m(elsewhere @ bent, straight), [0, 0, 0.5], atol=1e-12)


def test_scan_without_its_cloud_keeps_no_points_in_memory() -> None:
    bare = without_clouds(posed_scan(np.ones((5, 3)), np.ones(5)))
    assert bare.cloud.shape == (0, 3)
    assert bare.cloud.base is None  # a view would keep the points in memory for as long as the log lives
