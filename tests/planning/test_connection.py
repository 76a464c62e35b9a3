import math
from itertools import pairwise

import numpy as np
import pytest

from wzsumo.grid import OccupancyGrid
from wzsumo.planning.connection import connect, dubins_word, segment_sign, shortest_length
from wzsumo.planning.footprint import outline_body
from wzsumo.planning.lattice import lattice_for, poses_along
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.terrain import terrain_of
from wzsumo.vehicle import VehicleGeometry

BODY = outline_body(VehicleGeometry())


@pytest.mark.parametrize("word", range(6))
def test_dubins_word_ends_at_the_goal_pose(word: int) -> None:
    rng, solved = np.random.default_rng(word), 0
    for _ in range(300):
        goal, start_heading, radius = rng.uniform([-8, -8, -4], [8, 8, 4]), rng.uniform(-4, 4), rng.uniform(0.5, 3)
        lengths = dubins_word(word, goal[0], goal[1], start_heading, goal[2], radius)
        if not np.isfinite(lengths[0]):
            continue
        segments = np.array([(length, segment_sign(word, k) / radius) for k, length in enumerate(lengths)])
        assert segments[:, 0].min() >= 0
        end = poses_along(np.array([0.0, 0.0, start_heading]), segments, max_step_m=100.0)[-1]
        np.testing.assert_allclose(end[:2], goal[:2], atol=1e-9)
        assert abs(math.remainder(end[2] - goal[2], 2 * math.pi)) < 1e-9
        solved += 1
    assert solved > 100


@pytest.mark.parametrize(
    ("goal", "length"),
    [
        ((10.0, 0.0, 0.0), 10.0),  # straight on
        ((3, 3, math.pi / 2), 1.5 * math.pi),  # a quarter turn
        ((0, 6, math.pi), 3 * math.pi),  # a half turn
        ((-6, 0, 0), 2 * math.pi * 3 + 6),  # once round, then 6 m on the far side
        ((0, 0, 0), 0),
    ],
)
def test_shortest_curve_of_radius_3_has_the_length_of_the_closed_form(goal: tuple[float, float, float], length: float) -> None:
    found = shortest_length(0.0, 0.0, 0.0, np.array(goal, dtype=float), 3.0)
    if goal[0] == -6:  # the closed form is one feasible way; a shorter one may exist
        assert found <= length + 1e-9
    else:
        assert found == pytest.approx(length, abs=1e-6)


def connected(
    goal: tuple[float, float, float], *, p_occupied: float = 0.0, last_curvature: float = 0.0, limit: float = math.inf
) -> tuple[float, list[list[float]]]:
    """Cost and segments of the connection from (20, 40, 0) on a map of 100 x 80 m that is alike everywhere."""
    grid = OccupancyGrid(p_occupied=np.full((320, 400), p_occupied, dtype=np.float32), resolution=0.25, origin=(0.0, 0.0))
    terrain = terrain_of(grid, body=BODY, spec=PlannerSpec(), reach_m=3.0)
    lattice = lattice_for(BODY, max_curvature=0.1, resolution=0.25, fineness=1)
    cost, segments = connect(terrain, BODY, lattice, 20.0, 40.0, 0.0, last_curvature, np.array(goal), limit)
    return float(cost), segments.tolist()


def slow_cost(goal: tuple[float, float, float], *, last_curvature: float) -> float:
    """Least cost over all words and the three curvatures: a metre costs 1 + 0.3 k / k_max, a change of curvature 0.3 m x it."""
    sharpest, least = 0.085, math.inf
    for curvature in (sharpest, sharpest / 4, sharpest / 16):
        for word in range(6):
            lengths = dubins_word(word, goal[0] - 20, goal[1] - 40, 0.0, goal[2], 1 / curvature)
            driven = [(length, segment_sign(word, k) * curvature) for k, length in enumerate(lengths) if length > 0]
            bends = [last_curvature, *(k for _, k in driven)]
            changes = sum(abs(b - a) for a, b in pairwise(bends)) / sharpest
            cost = sum(length * (1 + 0.3 * abs(k) / sharpest) for length, k in driven) + 0.3 * changes
            least = min(least, cost)
    return least


@pytest.mark.parametrize("last_curvature", [0.0, 0.085, -0.02])
@pytest.mark.parametrize("goal", [(70.0, 40.0, 0.0), (70.0, 44.0, 0.0), (60.0, 35.0, 0.3), (40.0, 55.0, 1.5)])
def test_connection_costs_its_length_its_bends_and_its_changes_of_curvature(
    goal: tuple[float, float, float], last_curvature: float
) -> None:
    cost, _ = connected(goal, last_curvature=last_curvature)
    assert cost == pytest.approx(slow_cost(goal, last_curvature=last_curvature), rel=1e-9)


def test_connection_over_doubtful_ground_costs_as_in_the_search() -> None:
    cost, segments = connected((70.0, 40.0, 0.0), p_occupied=0.1)
    assert cost == pytest.approx(50 * (1 + 10 * 0.1), rel=1e-6)
    assert sum(length for length, _ in segments) == pytest.approx(50)


@pytest.mark.parametrize(("limit", "cost"), [(50.1, 50.0), (49.9, math.inf)])
def test_connection_that_costs_as_much_as_the_limit_is_none(limit: float, cost: float) -> None:
    assert connected((70.0, 40.0, 0.0), limit=limit)[0] == pytest.approx(cost)


def test_connection_through_an_obstacle_is_none() -> None:
    assert connected((70.0, 40.0, 0.0), p_occupied=0.5)[0] == math.inf
