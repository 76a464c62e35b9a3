import numpy as np
import pytest
import shapely
from scipy.optimize import lsq_linear

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.path import ReferencePath
from wzsumo.planning.bending import stiffness_of
from wzsumo.planning.easing import ease, eased_points, room_beside
from wzsumo.planning.footprint import outline_body
from wzsumo.planning.lattice import poses_along
from wzsumo.planning.path_check import poses_through, touching_poses
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.terrain import Terrain, terrain_of
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
BODY = outline_body(CAR)
RESOLUTION = 0.25


def terrain(p_occupied: FloatArray) -> Terrain:
    grid = OccupancyGrid(p_occupied=p_occupied.astype(np.float32), resolution=RESOLUTION, origin=(0.0, 0.0))
    return terrain_of(grid, body=BODY, spec=PlannerSpec(), reach_m=3.0)


def cones(seed: int, *, beside: FloatArray, n: int = 40) -> FloatArray:
    """A map with single blocked cells, none of them under the outlines along `beside`."""
    random, p = np.random.default_rng(seed), np.zeros((160, 400))
    p[random.integers(40, 120, n), random.integers(0, 400, n)] = 1
    for pose in beside:
        x_min, y_min, x_max, y_max = shapely.Polygon(CAR.outline(pose)).bounds
        p[int(y_min / RESOLUTION) : int(y_max / RESOLUTION) + 1, int(x_min / RESOLUTION) : int(x_max / RESOLUTION) + 1] = 0
    return p


def bent_poses() -> FloatArray:
    """A change of lanes by four arcs whose curvature jumps by 0.017 1/m."""
    arcs = np.array([(20.0, 0.0), (12.0, 0.017), (12.0, -0.017), (30.0, 0.0)])
    return poses_along(np.array([8.0, 18.0, 0.0]), arcs, max_step_m=0.48)


def slow_room(poses: FloatArray, p_occupied: FloatArray, side: int) -> FloatArray:
    """Room to one side by shapely: the first shift by whole steps of 0.02 m at which the outline meets a blocked cell."""
    row, col = np.nonzero(p_occupied)
    cells = shapely.union_all(shapely.box(*(RESOLUTION * np.array([col, row, col + 1, row + 1]))))
    room = []
    for x, y, heading in poses:
        for step in range(31):
            shift = side * 0.02 * step
            outline = shapely.Polygon(
                CAR.outline(np.array([x - shift * np.sin(heading), y + shift * np.cos(heading), heading]))
            )
            if cells.intersects(outline):
                break
        room.append(side * 0.02 * (step - (step < 30 or cells.intersects(outline))))
    return np.array(room)


def test_room_beside_poses_is_where_shapely_finds_the_first_blocked_cell() -> None:
    poses = bent_poses()[::4]
    p = cones(3, beside=bent_poses(), n=400)
    room = room_beside(poses, terrain(p), BODY)
    np.testing.assert_allclose(room[:, 0], slow_room(poses, p, -1), atol=0.021)
    np.testing.assert_allclose(room[:, 1], slow_room(poses, p, 1), atol=0.021)
    assert (np.abs(room) < 0.5).any(axis=0).all()


def test_eased_line_is_the_bounded_least_squares_problems() -> None:
    # Along x a line of points with a bend to the left and one to the right, in a tube that is off the middle: only y can move.
    n, step, wavelength_m = 60, 0.5, 12.0
    place = np.arange(n)
    poses = np.column_stack([step * place, 0.3 * np.tanh((place - 30) / 6) * (1 - ((place - 29.5) / 29.5) ** 2), np.zeros(n)])
    room = np.column_stack([-0.02 - 0.1 * (np.sin(place / 9) > 0), 0.02 + 0.1 * (np.sin(place / 7) > 0)])
    found = ease(poses, room=room, wavelength_m=wavelength_m)
    third = np.zeros((n - 1, n + 2))  # columns: mirror point before, the points, mirror point after
    for i in range(n - 1):
        third[i, i : i + 4] = (-1, 3, -3, 1)
    third[:, 2] += third[:, 0]  # both ends are at y = 0 with heading 0: the mirror points are level with those inside
    third[:, -3] += third[:, -1]
    third = third[:, 2:-2]
    weighted = np.vstack([np.eye(n - 2), np.sqrt(stiffness_of(wavelength_m, step)) * third])
    target = np.concatenate([poses[1:-1, 1], np.zeros(n - 1)])
    expected = lsq_linear(weighted, target, bounds=tuple((poses[1:-1, 1, None] + room[1:-1]).T), tol=1e-12)
    np.testing.assert_allclose(found[1:-1, 1], expected.x, atol=1e-3)
    np.testing.assert_allclose(found[:, 0], poses[:, 0], atol=1e-3)
    assert expected.active_mask.any()


@pytest.mark.parametrize("seed", range(5))
def test_eased_path_between_cones_touches_none_and_has_no_jump_of_curvature(seed: int) -> None:
    poses, field = bent_poses(), terrain(cones(seed, beside=bent_poses(), n=200))
    points = eased_points(poses, wavelength_m=25.0, terrain=field, body=BODY)
    eased = poses_through(points, ends=poses[[0, -1], 2])
    assert not touching_poses(eased, 0.0, field, BODY).any()
    np.testing.assert_allclose(eased[[0, -1]], poses[[0, -1]], atol=1e-9)
    assert np.abs(np.diff(ReferencePath(poses=poses).curvature)).max() > 0.008
    assert np.abs(np.diff(ReferencePath(poses=eased).curvature)).max() <= 0.002


def test_room_is_looked_for_up_to_0_6_m_to_either_side() -> None:
    room = room_beside(bent_poses(), terrain(np.zeros((160, 400))), BODY)
    np.testing.assert_allclose(room, np.tile([-0.6, 0.6], (len(room), 1)), atol=0.02)


def test_line_without_room_stays_where_it_is() -> None:
    poses = bent_poses()
    np.testing.assert_allclose(ease(poses, room=np.zeros((len(poses), 2)), wavelength_m=18.0), poses[:, :2], atol=0.005)
