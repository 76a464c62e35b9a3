import heapq

import numpy as np
import pytest

from wzsumo.grid import OccupancyGrid
from wzsumo.planning import hybrid_astar
from wzsumo.planning.footprint import outline_body
from wzsumo.planning.heuristic import cost_to_go
from wzsumo.planning.lattice import lattice_for, poses_along
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.terrain import terrain_of
from wzsumo.vehicle import VehicleGeometry

BODY = outline_body(VehicleGeometry())


def searched(start, goal, *, p_occupied=None, max_expansions=2000, weight=2.0):
    p = np.zeros((160, 480), dtype=np.float32) if p_occupied is None else p_occupied.astype(np.float32)
    terrain = terrain_of(
        OccupancyGrid(p_occupied=p, resolution=0.25, origin=(0.0, 0.0)), body=BODY, spec=PlannerSpec(), reach_m=3.0
    )
    remaining = cost_to_go(terrain.multiplier, dearest=12.0, goal_cell=(int(goal[1] * 4), int(goal[0] * 4)), resolution=0.25)
    lattice = lattice_for(BODY, max_curvature=0.02, resolution=0.25, fineness=1)
    return hybrid_astar.search(
        terrain, remaining, BODY, lattice, np.array(start, dtype=float), np.array(goal, dtype=float), weight, max_expansions
    )


def test_search_on_open_ground_goes_straight_to_a_goal_straight_ahead() -> None:
    outcome, _, segments = searched((10, 20, 0), (110, 20, 0))
    assert outcome == hybrid_astar.FOUND
    assert segments[:, 0].sum() == pytest.approx(100)
    assert np.abs(segments[:, 0] * segments[:, 1]).max() < 1e-9


@pytest.mark.parametrize("goal", [(110, 25, 0), (105, 12, -0.1), (100, 30, 0.3)])
def test_segments_of_a_search_lead_to_the_goal_pose(goal) -> None:
    outcome, _, segments = searched((10, 20, 0), goal)
    assert outcome == hybrid_astar.FOUND
    end = poses_along(np.array([10.0, 20.0, 0.0]), segments, max_step_m=1.0)[-1]
    np.testing.assert_allclose(end, goal, atol=1e-6)


def test_search_reports_the_limit_after_as_many_expansions() -> None:
    outcome, n_expansions, segments = searched((10, 20, 0), (110, 20, np.pi), max_expansions=300)
    assert (outcome, n_expansions, len(segments)) == (hybrid_astar.LIMIT_REACHED, 300, 0)


def test_search_is_exhausted_where_nothing_can_be_reached() -> None:
    p = np.ones((160, 480))
    p[76:84, 20:200] = 0  # a slot of 2 m, closed ahead
    p[40:120, 240:] = 0
    outcome, _, _ = searched((8, 20, 0), (100, 20, 0), p_occupied=p)
    assert outcome == hybrid_astar.EXHAUSTED


def test_queue_gives_its_entries_in_the_order_of_heapq() -> None:
    rng = np.random.default_rng(3)
    costs, nodes, size, twin = np.empty(512), np.empty(512, dtype=np.int64), 0, []
    for node in range(500):
        cost = rng.random()
        size = hybrid_astar._push(costs, nodes, size, cost, node)
        heapq.heappush(twin, (cost, node))
        if rng.random() < 0.4:
            assert (costs[0], nodes[0]) == heapq.heappop(twin)
            size = hybrid_astar._pop(costs, nodes, size)
    while twin:
        assert (costs[0], nodes[0]) == heapq.heappop(twin)
        size = hybrid_astar._pop(costs, nodes, size)
    assert size == 0


def test_table_finds_what_a_dict_finds_also_after_it_has_grown() -> None:
    rng = np.random.default_rng(4)
    keys, holders = hybrid_astar._empty_table(64)
    twin = {}
    for node in range(2000):
        key = int(rng.integers(0, 500)) << 40 | int(rng.integers(0, 4)) << 16 | int(rng.integers(0, 3))
        slot = hybrid_astar._slot(keys, key)
        assert (keys[slot] == key) == (key in twin)
        keys[slot], holders[slot], twin[key] = key, node, node
        if 2 * len(twin) > len(keys):
            keys, holders = hybrid_astar._rehashed(keys, holders)
    for key, node in twin.items():
        assert holders[hybrid_astar._slot(keys, key)] == node


@pytest.mark.parametrize(("speed_curvature", "step_m"), [(0.02, 4.0), (0.2, 0.35 / 0.17)])
def test_lattice_turns_at_most_20_degrees_a_step_and_checks_to_7_cm(speed_curvature: float, step_m: float) -> None:
    lattice = lattice_for(BODY, max_curvature=speed_curvature, resolution=0.25, fineness=1)
    assert lattice.step_m == pytest.approx(step_m)
    assert lattice.sweep_margin * lattice.sharpest <= 0.07 + 1e-9
    assert np.abs(lattice.curvatures).max() < speed_curvature
