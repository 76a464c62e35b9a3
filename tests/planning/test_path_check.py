import numpy as np
import numpy.typing as npt
import pytest
import shapely
from shapely.geometry.base import BaseGeometry

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.planning.footprint import outline_body
from wzsumo.planning.path_check import Exposure, exposure_along, touching_poses
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.terrain import Terrain, terrain_of
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
BODY = outline_body(CAR)


def exposure_of(p_occupied: FloatArray, poses: npt.ArrayLike, limit_m: float = 1.5) -> tuple[Exposure, Terrain]:
    grid = OccupancyGrid(p_occupied=p_occupied.astype(np.float32), resolution=0.25, origin=(0.0, 0.0))
    terrain = terrain_of(grid, body=BODY, spec=PlannerSpec(), reach_m=3.0)
    return exposure_along(
        np.asarray(poses, dtype=float),
        max_p_occupied=0.196,
        terrain=terrain,
        body=BODY,
        limit_m=limit_m,
    ), terrain


def squares(mask: FloatArray) -> BaseGeometry:
    row, col = np.nonzero(mask)
    return shapely.union_all(shapely.box(*(0.25 * np.array([col, row, col + 1, row + 1]))))


@pytest.mark.parametrize("seed", range(25))
def test_clearance_of_one_pose_equals_shapelys_distance_to_blocked_squares_and_the_border(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p = (rng.random((80, 80)) < 0.002).astype(float)
    pose = rng.uniform([4, 4, -4], [16, 16, 4])
    outline = shapely.Polygon(CAR.outline(pose))
    border = shapely.box(0, 0, 20, 20).exterior
    expected = min(outline.distance(squares(p)) if p.any() else np.inf, outline.distance(border), 1.5)
    exposure, _ = exposure_of(p, [pose, pose])
    assert exposure.min_clearance_m == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_largest_p_under_one_pose_equals_that_of_the_squares_that_shapely_intersects(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p = rng.random((80, 80)) * 0.19
    pose = rng.uniform([5, 5, -4], [15, 15, 4])
    row, col = np.mgrid[:80, :80]
    cells = shapely.box(*(0.25 * np.stack([col, row, col + 1, row + 1]).reshape(4, -1)))
    under = shapely.intersects(shapely.Polygon(CAR.outline(pose)), cells).reshape(80, 80)
    exposure, _ = exposure_of(p, [pose, pose])
    assert exposure.max_p_occupied == pytest.approx(p[under].max(), abs=1e-6)


def test_risk_is_the_length_of_the_path_times_p_where_p_is_the_same_everywhere() -> None:
    poses = np.column_stack([np.linspace(3, 13, 21), np.full(21, 10.0), np.zeros(21)])
    exposure, _ = exposure_of(np.full((80, 80), 0.05), poses)
    assert exposure.risk_m == pytest.approx(0.05 * 10)


def test_poses_from_the_first_on_whose_front_reaches_the_wall_touch() -> None:
    p = np.zeros((80, 80))
    p[:, 60] = 1  # a wall from x = 15.00 m on: the front, 3.72 m ahead, is there from x = 11.28 m on
    poses = np.column_stack([np.linspace(5, 14, 91), np.full(91, 10.0), np.zeros(91)])
    _, terrain = exposure_of(p, poses)
    assert touching_poses(poses, 0.0, terrain, BODY).tolist() == [False] * 63 + [True] * 28
