import numpy as np
import pytest

from wzsumo.grid import OccupancyGrid
from wzsumo.path import ReferencePath
from wzsumo.planning.footprint import outline_body
from wzsumo.planning.lattice import poses_along
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.pushing import smooth
from wzsumo.planning.smoothing import smoothed_poses
from wzsumo.planning.terrain import terrain_of
from wzsumo.vehicle import VehicleGeometry

BODY = outline_body(VehicleGeometry())
LANE_CHANGE = np.array([(20.0, 0.0), (15.0, 0.017), (15.0, -0.017), (20.0, 0.0)])


def terrain(p_occupied=None):
    p = np.zeros((160, 400)) if p_occupied is None else p_occupied
    grid = OccupancyGrid(p_occupied=p.astype(np.float32), resolution=0.25, origin=(0.0, 0.0))
    return terrain_of(grid, body=BODY, spec=PlannerSpec(), reach_m=3.0)


def slow_smooth(points, headings, stiffness):
    """One dense least-squares problem: stay at the points, keep third differences small, ends and headings there given."""
    n, step = len(points), np.hypot(*(points[1] - points[0]))
    rows = np.zeros((n - 1, n + 2))  # columns: mirror point before, the points, mirror point after
    for i in range(n - 1):
        rows[i, i : i + 4] = (-1, 3, -3, 1)
    solved = np.empty_like(points)
    for axis, way in enumerate((np.cos, np.sin)):
        d = rows.copy()
        constant = -d[:, 0] * 2 * step * way(headings[0]) + d[:, -1] * 2 * step * way(headings[1])
        d[:, 2] += d[:, 0]  # before = second point - way; after = last but one + way
        d[:, -3] += d[:, -1]
        d = d[:, 1:-1]
        constant = constant + d[:, 0] * points[0, axis] + d[:, -1] * points[-1, axis]
        inner = d[:, 1:-1]
        weighted = np.vstack([np.eye(n - 2), np.sqrt(stiffness) * inner])
        target = np.concatenate([points[1:-1, axis], -np.sqrt(stiffness) * constant])
        solved[1:-1, axis] = np.linalg.lstsq(weighted, target, rcond=None)[0]
        solved[[0, -1], axis] = points[[0, -1], axis]
    return solved


@pytest.mark.parametrize("wavelength_m", [4.0, 15.0, 40.0])
def test_smoothing_far_from_obstacles_equals_one_dense_least_squares_problem(wavelength_m: float) -> None:
    poses = poses_along(np.array([15.0, 15.0, 0.1]), LANE_CHANGE, max_step_m=0.5)
    headings = (poses[0, 2], poses[-1, 2])
    found = smooth(
        poses[:, :2],
        headings=headings,
        wavelength_m=wavelength_m,
        clearances_m=np.full(len(poses), 0.5),
        terrain=terrain(),
        body=BODY,
    )
    step = np.hypot(*(poses[1, :2] - poses[0, :2]))
    expected = slow_smooth(poses[:, :2], headings, (wavelength_m / (2 * np.pi * step)) ** 6)
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_straight_line_stays_straight() -> None:
    poses = poses_along(np.array([10.0, 20.0, 0.0]), np.array([(70.0, 0.0)]), max_step_m=0.5)
    found = smooth(
        poses[:, :2],
        headings=(0.0, 0.0),
        wavelength_m=60.0,
        clearances_m=np.full(len(poses), 0.7),
        terrain=terrain(),
        body=BODY,
    )
    np.testing.assert_allclose(found, poses[:, :2], atol=1e-9)


def test_path_off_the_middle_of_a_corridor_moves_there() -> None:
    p = np.ones((160, 400))
    p[72:86] = 0  # 3.5 m wide, middle at y = 19.75 m
    poses = poses_along(np.array([10.0, 19.3, 0.0]), np.array([(75.0, 0.0)]), max_step_m=0.5)
    found = smooth(
        poses[:, :2],
        headings=(0.0, 0.0),
        wavelength_m=25.0,
        clearances_m=np.full(len(poses), 1.0),
        terrain=terrain(p),
        body=BODY,
    )
    np.testing.assert_allclose(found[40:-40, 1], 19.75, atol=0.05)


def test_smoothed_poses_keep_both_end_poses_and_the_limits_of_curvature() -> None:
    poses = poses_along(np.array([15.0, 15.0, 0.1]), LANE_CHANGE, max_step_m=0.48)
    found = smoothed_poses(
        poses, terrain=terrain(), body=BODY, preferred_clearance_m=1.0, max_curvature=0.02, max_curvature_jump=0.002
    )
    np.testing.assert_allclose(found[[0, -1]], poses[[0, -1]], atol=1e-12)
    curvature = ReferencePath(poses=found).curvature
    assert np.abs(curvature).max() <= 0.02
    assert np.abs(np.diff(curvature)).max() <= 0.002
    assert np.abs(np.diff(ReferencePath(poses=poses).curvature)).max() > 0.008


def test_place_where_clearance_would_take_too_sharp_a_bend_costs_none_elsewhere() -> None:
    p = np.zeros((160, 800))
    p[:74, 120:320] = 1  # up to y = 18.5 m, for 50 m: 0.57 m beside a body at y = 20 m
    p[:76, 500:504] = 1  # up to y = 19.0 m, for 1 m: 0.07 m
    poses = poses_along(np.array([10.0, 20.0, 0.0]), np.array([(180.0, 0.0)]), max_step_m=0.48)
    found = smoothed_poses(
        poses, terrain=terrain(p), body=BODY, preferred_clearance_m=1.0, max_curvature=0.001, max_curvature_jump=0.002
    )
    beside = (found[:, 0] > 40) & (found[:, 0] < 70)
    assert found[beside, 1].min() - BODY.half_width - 18.5 > 0.65
    assert np.abs(ReferencePath(poses=found).curvature).max() <= 0.001
