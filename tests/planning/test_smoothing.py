import numpy as np
import pytest

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.path import ReferencePath
from wzsumo.planning.footprint import outline_body
from wzsumo.planning.lattice import poses_along
from wzsumo.planning.path_check import cost_along
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.smoothing import smoothed_poses
from wzsumo.planning.terrain import Terrain, terrain_of
from wzsumo.vehicle import VehicleGeometry

BODY = outline_body(VehicleGeometry())
LANE_CHANGE = np.array([(20.0, 0.0), (15.0, 0.017), (15.0, -0.017), (20.0, 0.0)])


def terrain(p_occupied: FloatArray | None = None) -> Terrain:
    p = np.zeros((160, 400)) if p_occupied is None else p_occupied
    grid = OccupancyGrid(p_occupied=p.astype(np.float32), resolution=0.25, origin=(0.0, 0.0))
    return terrain_of(grid, body=BODY, spec=PlannerSpec(), reach_m=3.0)


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


@pytest.mark.parametrize(("n", "smoothed"), [(8, False), (9, True)])
def test_path_of_fewer_than_9_poses_is_not_smoothed(n: int, smoothed: bool) -> None:
    poses = poses_along(np.array([15.0, 15.0, 0.1]), np.array([(0.24 * (n - 1), 0.1), (0.24 * (n - 1), -0.1)]), max_step_m=0.48)
    assert len(poses) == n
    found = smoothed_poses(
        poses, terrain=terrain(), body=BODY, preferred_clearance_m=1.0, max_curvature=0.2, max_curvature_jump=0.002
    )
    assert np.array_equal(found, poses) != smoothed


def test_poses_that_no_smoothing_can_better_come_back_as_they_are() -> None:
    p = np.ones((160, 400))
    p[76:84] = 0  # a slot of 2 m: 7 cm on either side
    poses = poses_along(np.array([10.0, 20.0, 0.0]), np.array([(75.0, 0.0)]), max_step_m=0.48)
    found = smoothed_poses(
        poses, terrain=terrain(p), body=BODY, preferred_clearance_m=1.0, max_curvature=0.02, max_curvature_jump=0.002
    )
    np.testing.assert_allclose(found, poses, atol=0.03)


def test_smoothing_takes_no_short_cut_through_what_costs_more_than_a_fifth() -> None:
    # A bulge of 2 m round doubtful ground on the straight line: every strong smoothing would lead over that ground.
    p = np.zeros((160, 800))
    p[76:84, 380:420] = 0.19  # 10 m long, costs 1 + 10 x 0.19 = 2.9 a metre
    arcs = np.array([(20.0, 0.0), (17.0, 0.012), (34.0, -0.012), (17.0, 0.012), (20.0, 0.0)])
    poses = poses_along(np.array([46.0, 17.0, 0.0]), arcs, max_step_m=0.48)
    searched = cost_along(poses, terrain(p))
    found = smoothed_poses(
        poses, terrain=terrain(p), body=BODY, preferred_clearance_m=1.0, max_curvature=0.02, max_curvature_jump=0.002
    )
    assert cost_along(found, terrain(p)) <= 1.05 * searched
