import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.path import ReferencePath
from wzsumo.planning.footprint import outline_body
from wzsumo.planning.plan import Plan, PlanStatus, plan_path
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.terrain import Terrain, offsets_from_guide, terrain_of
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
BODY = outline_body(CAR)
LANE = 3.66


def two_lane_road(length_m: float = 200.0) -> OccupancyGrid:
    """Two lanes, y = 4..11.32, on a map of 15.32 m; their centres at 5.83 and 9.49."""
    y = (np.arange(62) + 0.5) * 0.25
    blocked = np.tile(((y < 4) | (y > 4 + 2 * LANE))[:, None], (1, int(length_m / 0.25)))
    return OccupancyGrid(p_occupied=blocked.astype(np.float32), resolution=0.25, origin=(0.0, 0.0))


def path_of(plan: Plan) -> ReferencePath:
    assert plan.path is not None, plan.reason
    return plan.path


def lane_lines(*centres: float) -> FloatArray:
    return np.array([[(0.0, y), (200.0, y)] for y in centres])


RIGHT, LEFT = 4 + LANE / 2, 4 + 1.5 * LANE
Line = tuple[float, float, float, float]
coordinate = st.floats(-3, 13).map(lambda value: round(value, 3))


def distances(points: FloatArray, lines: FloatArray) -> FloatArray:
    """Distances (...) of points (..., 2) to the nearest of lines (n, 2, 2), by projection on each."""
    start, along = lines[:, 0], lines[:, 1] - lines[:, 0]
    offset = points[..., None, :] - start
    share = np.clip((offset * along).sum(axis=-1) / np.maximum((along**2).sum(axis=-1), 1e-12), 0, 1)
    nearest: FloatArray = np.hypot(*np.moveaxis(offset - share[..., None] * along, -1, 0)).min(axis=-1)
    return nearest


@settings(max_examples=40)
@given(ends=st.lists(st.tuples(coordinate, coordinate, coordinate, coordinate), min_size=1, max_size=4))
def test_offsets_from_guide_equal_the_distance_of_cell_centres_from_the_lines(
    ends: list[tuple[float, float, float, float]],
) -> None:
    grid = OccupancyGrid(p_occupied=np.zeros((40, 40), dtype=np.float32), resolution=0.25, origin=(0.0, 0.0))
    lines = np.array(ends).reshape(-1, 2, 2)
    off = offsets_from_guide(lines, grid=grid, slack_m=0.5, reach_m=2.0)
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
    assert (offsets_from_guide(np.array([[(100.0, 100.0), (120.0, 100.0)]]), grid=grid, slack_m=0.0, reach_m=1.83) == 1).all()


@pytest.mark.parametrize("lane", [RIGHT, LEFT])
def test_path_between_two_points_of_a_lane_stays_in_it(lane: float) -> None:
    guide = lane_lines(RIGHT, LEFT)
    plan = plan_path(
        two_lane_road(), start=(10.0, lane, 0.0), goal=(180.0, lane, 0.0), vehicle=CAR, spec=PlannerSpec(), guide=guide
    )
    assert plan.status == PlanStatus.FOUND
    assert np.abs(path_of(plan).poses[:, 1] - lane).max() < 0.4


def test_path_without_a_guide_is_drawn_to_the_middle_of_a_road_that_is_narrower_than_it_likes() -> None:
    spec = PlannerSpec(preferred_clearance_m=3.0)
    plan = plan_path(two_lane_road(), start=(10.0, RIGHT, 0.0), goal=(180.0, RIGHT, 0.0), vehicle=CAR, spec=spec)
    assert np.abs(path_of(plan).poses[:, 1] - (RIGHT + LEFT) / 2).min() < 0.4


def test_path_to_the_other_lane_changes_once_and_quickly() -> None:
    guide = lane_lines(RIGHT, LEFT)
    plan = plan_path(
        two_lane_road(), start=(10.0, RIGHT, 0.0), goal=(180.0, LEFT, 0.0), vehicle=CAR, spec=PlannerSpec(), guide=guide
    )
    y = path_of(plan).poses[:, 1]
    between = (y > RIGHT + 0.5) & (y < LEFT - 0.5)
    assert path_of(plan).arc_length[between].max() - path_of(plan).arc_length[between].min() < 60
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


def terrain_beside_a_cell(spec: PlannerSpec, *, p: float = 0.0) -> Terrain:
    """The terrain of a map of 20 x 20 m with one blocked cell, row and column 40, in ground of p."""
    cells = np.full((80, 80), p, dtype=np.float32)
    cells[40, 40] = 1
    grid = OccupancyGrid(p_occupied=cells, resolution=0.25, origin=(0.0, 0.0))
    return terrain_of(grid, body=BODY, spec=spec, reach_m=6.0)


@pytest.mark.parametrize("n_cells", [4, 6, 7, 8, 20])
def test_metre_costs_its_lack_of_clearance_squared_and_its_p(n_cells: int) -> None:
    terrain = terrain_beside_a_cell(PlannerSpec(), p=0.1)
    distance = 0.25 * (n_cells - 0.5)  # from the cell's centre to the blocked square
    lacking = np.clip(1 - (distance - 0.92) / 1.0, 0, 1)  # 0.92 m from the rear axle to the bumper, 1 m of clearance preferred
    assert terrain.distance[40, 40 + n_cells] == pytest.approx(distance)
    assert terrain.multiplier[41, 41 + n_cells] == pytest.approx(1 + 8 * lacking**2 + 10 * 0.1, rel=1e-5)


def test_axle_cannot_be_where_the_body_would_touch_the_obstacle_in_any_heading() -> None:
    multiplier = terrain_beside_a_cell(PlannerSpec()).multiplier[41, 41:]
    # A point of a cell is up to 0.177 m farther off than its centre: cell 4 is the first with its centre 0.92 - 0.177 m off.
    assert np.isinf(multiplier[:4]).all()
    assert np.isfinite(multiplier[4:36]).all()


def test_border_around_the_map_cannot_be_driven_on() -> None:
    multiplier = terrain_beside_a_cell(PlannerSpec()).multiplier
    assert np.isinf(np.concatenate([multiplier[0], multiplier[-1], multiplier[:, 0], multiplier[:, -1]])).all()


def test_inflation_takes_its_radius_off_every_distance() -> None:
    plain, inflated = (terrain_beside_a_cell(PlannerSpec(inflation_radius_m=radius)) for radius in (0.0, 0.7))
    np.testing.assert_allclose(inflated.distance[20:60, 20:60], np.maximum(plain.distance[20:60, 20:60] - 0.7, 0), atol=1e-6)


def test_metre_far_off_the_guide_costs_12_more_and_one_on_it_nothing() -> None:
    grid = OccupancyGrid(p_occupied=np.zeros((120, 400), dtype=np.float32), resolution=0.25, origin=(0.0, 0.0))
    guide = np.array([[(0.0, 15.0), (100.0, 15.0)]])
    multiplier = terrain_of(grid, body=BODY, spec=PlannerSpec(), reach_m=3.0, guide=guide).multiplier[1:-1, 201]
    y = (np.arange(120) + 0.5) * 0.25
    off = np.abs(y - 15.125) - 0.125  # from the square of cells that the line is drawn in, from 15.0 to 15.25 m
    inner = (y > 5) & (y < 25)
    expected = 1 + 12 * np.clip((off - 0.3) / (1.83 - 0.3), 0, 1) ** 2
    np.testing.assert_allclose(multiplier[inner], expected[inner], rtol=1e-4)
