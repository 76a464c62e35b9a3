import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wzsumo.grid import OccupancyGrid
from wzsumo.planning.plan import PlanStatus, plan_path
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.terrain import off_guide
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
LANE = 3.66


def two_lane_road(length_m=200.0):
    """Two lanes, y = 4..11.32, on a map of 15.32 m; their centres at 5.83 and 9.49."""
    y = (np.arange(62) + 0.5) * 0.25
    blocked = np.tile(((y < 4) | (y > 4 + 2 * LANE))[:, None], (1, int(length_m / 0.25)))
    return OccupancyGrid(p_occupied=blocked.astype(np.float32), resolution=0.25, origin=(0.0, 0.0))


def lane_lines(*centres):
    return np.array([[(0.0, y), (200.0, y)] for y in centres])


RIGHT, LEFT = 4 + LANE / 2, 4 + 1.5 * LANE
coordinate = st.floats(-3, 13).map(lambda value: round(value, 3))


def distances(points, lines):
    """Distances (...) of points (..., 2) to the nearest of lines (n, 2, 2), by projection on each."""
    start, along = lines[:, 0], lines[:, 1] - lines[:, 0]
    offset = points[..., None, :] - start
    share = np.clip((offset * along).sum(axis=-1) / np.maximum((along**2).sum(axis=-1), 1e-12), 0, 1)
    return np.hypot(*np.moveaxis(offset - share[..., None] * along, -1, 0)).min(axis=-1)


@settings(max_examples=40)
@given(ends=st.lists(st.tuples(coordinate, coordinate, coordinate, coordinate), min_size=1, max_size=4))
def test_off_guide_equals_the_distance_of_cell_centres_from_the_lines(ends) -> None:
    grid = OccupancyGrid(p_occupied=np.zeros((40, 40), dtype=np.float32), resolution=0.25, origin=(0.0, 0.0))
    lines = np.array(ends).reshape(-1, 2, 2)
    off = off_guide(lines, grid=grid, slack_m=0.5, reach_m=2.0)
    row, col = np.mgrid[:40, :40]
    exact = distances(grid.centre_of(row, col), lines)
    found = 0.5 + np.sqrt(off) * 1.5
    inside = (exact > 0.9) & (exact < 1.6)
    # A line is drawn in cells: the nearest square is nearer than the line by up to a diagonal, never farther by more than one.
    assert (np.abs(found - exact)[inside] <= 0.25 * np.sqrt(2) + 1e-5).all()
    assert (off[exact < 0.5 - 0.25 * np.sqrt(2)] == 0).all()
    assert (off[exact > 2.0 + 0.25 * np.sqrt(2)] == 1).all()


def test_map_without_a_line_near_it_is_off_the_guide_everywhere() -> None:
    grid = OccupancyGrid(p_occupied=np.zeros((20, 20), dtype=np.float32), resolution=0.25, origin=(0.0, 0.0))
    assert (off_guide(np.array([[(100.0, 100.0), (120.0, 100.0)]]), grid=grid, slack_m=0.0, reach_m=1.83) == 1).all()


@pytest.mark.parametrize("lane", [RIGHT, LEFT])
def test_path_between_two_points_of_a_lane_stays_in_it(lane) -> None:
    guide = lane_lines(RIGHT, LEFT)
    plan = plan_path(
        two_lane_road(), start=(10.0, lane, 0.0), goal=(180.0, lane, 0.0), vehicle=CAR, spec=PlannerSpec(), guide=guide
    )
    assert plan.status == PlanStatus.FOUND
    assert np.abs(plan.path.poses[:, 1] - lane).max() < 0.4


def test_path_without_a_guide_is_drawn_to_the_middle_of_a_road_that_is_narrower_than_it_likes() -> None:
    spec = PlannerSpec(preferred_clearance_m=3.0)
    plan = plan_path(two_lane_road(), start=(10.0, RIGHT, 0.0), goal=(180.0, RIGHT, 0.0), vehicle=CAR, spec=spec)
    assert np.abs(plan.path.poses[:, 1] - (RIGHT + LEFT) / 2).min() < 0.4


def test_path_to_the_other_lane_changes_once_and_quickly() -> None:
    guide = lane_lines(RIGHT, LEFT)
    plan = plan_path(
        two_lane_road(), start=(10.0, RIGHT, 0.0), goal=(180.0, LEFT, 0.0), vehicle=CAR, spec=PlannerSpec(), guide=guide
    )
    y = plan.path.poses[:, 1]
    between = (y > RIGHT + 0.5) & (y < LEFT - 0.5)
    assert plan.path.arc_length[between].max() - plan.path.arc_length[between].min() < 60
    assert np.diff(np.sign(y - (RIGHT + LEFT) / 2)).astype(bool).sum() == 1


def test_guide_that_leads_through_an_obstacle_is_left() -> None:
    grid = two_lane_road()
    blocked = grid.p_occupied.copy()
    blocked[: int((4 + LANE) / 0.25), 380:420] = 1  # 10 m of the right lane
    plan = plan_path(
        grid.with_p_occupied(blocked), start=(10.0, RIGHT, 0.0), goal=(180.0, RIGHT, 0.0), vehicle=CAR, spec=PlannerSpec(),
        guide=lane_lines(RIGHT),
    )  # fmt: skip
    assert plan.status == PlanStatus.FOUND
    assert plan.min_clearance_m > 0.3
