import numpy as np

from wzsumo.planning.lattice import poses_along


def test_poses_along_arcs_equal_a_fine_integration_of_the_heading() -> None:
    start, segments = np.array([3.0, -2.0, 0.7]), np.array([(5.0, 0.1), (3.0, 0.0), (8.0, -0.2), (0.0, 0.3)])
    poses = poses_along(start, segments, max_step_m=0.5)
    s = np.linspace(0, 16, 160_001)
    ends, curvatures = np.array([5.0, 8.0, 16.0]), np.array([0.1, 0.0, -0.2])
    middle = (s[1:] + s[:-1]) / 2
    curvature = curvatures[np.searchsorted(ends, middle)]
    heading = start[2] + np.concatenate([[0], np.cumsum(curvature * np.diff(s))])
    x = start[0] + np.concatenate([[0], np.cumsum(np.cos((heading[1:] + heading[:-1]) / 2) * np.diff(s))])
    y = start[1] + np.concatenate([[0], np.cumsum(np.sin((heading[1:] + heading[:-1]) / 2) * np.diff(s))])
    at = np.linspace(0, 16, len(poses))
    for column, values in enumerate((x, y, heading)):
        np.testing.assert_allclose(poses[:, column], np.interp(at, s, values), atol=1e-6)


def test_poses_are_spaced_evenly_within_the_largest_step() -> None:
    poses = poses_along(np.zeros(3), np.array([(10.3, 0.0)]), max_step_m=0.48)
    np.testing.assert_allclose(np.diff(poses[:, 0]), 10.3 / 22, atol=1e-12)


def test_full_circle_ends_where_it_began() -> None:
    poses = poses_along(np.array([1.0, 2.0, 0.3]), np.array([(2 * np.pi * 7, 1 / 7)]), max_step_m=0.5)
    np.testing.assert_allclose(poses[-1], poses[0], atol=1e-9)
