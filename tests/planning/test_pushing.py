import numpy as np
import pytest
from planning.terrains import BODY, LANE_CHANGE, terrain

from wzsumo.frames import FloatArray
from wzsumo.planning.lattice import poses_along
from wzsumo.planning.pushing import smooth
from wzsumo.planning.terrain import Terrain


def smoothed(
    points: FloatArray,
    ground: Terrain,
    *,
    wavelength_m: float,
    clearance_m: float,
    headings: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    """The points, smoothed on a terrain with one clearance everywhere."""
    clearances = np.full(len(points), clearance_m)
    return smooth(points, headings=headings, wavelength_m=wavelength_m, clearances_m=clearances, terrain=ground, body=BODY)


def slow_smooth(points: FloatArray, headings: tuple[float, float], stiffness: float) -> FloatArray:
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
    found = smoothed(poses[:, :2], terrain(), wavelength_m=wavelength_m, clearance_m=0.5, headings=headings)
    step = np.hypot(*(poses[1, :2] - poses[0, :2]))
    expected = slow_smooth(poses[:, :2], headings, (wavelength_m / (2 * np.pi * step)) ** 6)
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_straight_line_stays_straight() -> None:
    poses = poses_along(np.array([10.0, 20.0, 0.0]), np.array([(70.0, 0.0)]), max_step_m=0.5)
    found = smoothed(poses[:, :2], terrain(), wavelength_m=60.0, clearance_m=0.7)
    np.testing.assert_allclose(found, poses[:, :2], atol=1e-9)


def test_path_off_the_middle_of_a_corridor_moves_there() -> None:
    p = np.ones((160, 400))
    p[72:86] = 0  # 3.5 m wide, middle at y = 19.75 m
    poses = poses_along(np.array([10.0, 19.3, 0.0]), np.array([(75.0, 0.0)]), max_step_m=0.5)
    found = smoothed(poses[:, :2], terrain(p), wavelength_m=25.0, clearance_m=1.0)
    np.testing.assert_allclose(found[40:-40, 1], 19.75, atol=0.05)


def test_wave_of_the_wavelength_is_damped_to_half_and_longer_ones_stay() -> None:
    x = np.arange(0.0, 300.0, 0.5)
    halved, kept = (
        smoothed(
            np.column_stack([x, 20 + 0.1 * np.sin(2 * np.pi * x / wave_m)]),
            terrain(np.zeros((160, 1300))),
            wavelength_m=20.0,
            clearance_m=0.5,
        )[200:400, 1]
        - 20
        for wave_m in (20.0, 60.0)
    )
    assert np.abs(halved).max() == pytest.approx(0.05, rel=0.02)
    assert np.abs(kept).max() == pytest.approx(0.1, rel=0.02)


@pytest.mark.parametrize(("gap_m", "pushed"), [(0.9, False), (0.5, True)])
def test_obstacle_beyond_the_clearance_asked_for_does_not_push(gap_m: float, pushed: bool) -> None:
    p = np.zeros((160, 400))
    p[: int((20 - 0.93 - gap_m) * 4)] = 1  # a wall to the right, at most the gap and a cell of 0.25 m from the body
    poses = poses_along(np.array([10.0, 20.0, 0.0]), np.array([(75.0, 0.0)]), max_step_m=0.5)
    found = smoothed(poses[:, :2], terrain(p), wavelength_m=25.0, clearance_m=0.8)
    assert (found[60:-60, 1].min() > 20.1) == pushed


def test_wall_on_one_side_is_pushed_off_to_nearly_the_clearance_asked_for() -> None:
    p = np.zeros((160, 400))
    p[:74] = 1  # up to y = 18.5 m, 0.57 m from a body at y = 20 m
    poses = poses_along(np.array([5.0, 20.0, 0.0]), np.array([(90.0, 0.0)]), max_step_m=0.5)
    found = smoothed(poses[:, :2], terrain(p), wavelength_m=15.0, clearance_m=1.2)
    clearance = found[80:-80, 1].min() - 0.93 - 18.5
    assert 0.85 * 1.2 < clearance < 1.2
