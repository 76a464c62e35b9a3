import heapq

import numpy as np
import pytest

from wzsumo.frames import FloatArray
from wzsumo.grid import OccupancyGrid
from wzsumo.planning import hybrid_astar
from wzsumo.planning.footprint import outline_body
from wzsumo.planning.lattice import lattice_for, poses_along
from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.planning.planning_field import cost_to_go
from wzsumo.planning.terrain import terrain_of
from wzsumo.vehicle import VehicleGeometry

Pose = tuple[float, float, float]
BODY = outline_body(VehicleGeometry())


def searched(
    start: Pose,
    goal: Pose,
    *,
    p_occupied: FloatArray | None = None,
    max_expansions: int = 2000,
    weight: float = 2.0,
    change_cost_m: float | None = None,
) -> tuple[int, int, FloatArray]:
    p = np.zeros((160, 480), dtype=np.float32) if p_occupied is None else p_occupied.astype(np.float32)
    terrain = terrain_of(
        OccupancyGrid(p_occupied=p, resolution=0.25, origin=(0.0, 0.0)), body=BODY, spec=PlannerSpec(), reach_m=3.0
    )
    remaining = cost_to_go(
        terrain.multiplier, max_metre_cost=12.0, goal_cell=(int(goal[1] * 4), int(goal[0] * 4)), resolution=0.25
    )
    lattice = lattice_for(BODY, max_curvature=0.02, resolution=0.25, fineness=1)
    if change_cost_m is not None:
        lattice = lattice._replace(change_cost_m=change_cost_m)
    return hybrid_astar.search(
        terrain, remaining, BODY, lattice, np.array(start, dtype=float), np.array(goal, dtype=float), weight, max_expansions
    )


def test_search_on_open_ground_goes_straight_to_a_goal_straight_ahead() -> None:
    outcome, _, segments = searched((10, 20, 0), (110, 20, 0))
    assert outcome == hybrid_astar.FOUND
    assert segments[:, 0].sum() == pytest.approx(100)
    assert np.abs(segments[:, 0] * segments[:, 1]).max() < 1e-9


@pytest.mark.parametrize("goal", [(110, 25, 0), (105, 12, -0.1), (100, 30, 0.3)])
def test_segments_of_a_search_lead_to_the_goal_pose(goal: Pose) -> None:
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
    costs, nodes, size = np.empty(512), np.empty(512, dtype=np.int64), 0
    twin: list[tuple[float, int]] = []
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
    twin: dict[int, int] = {}
    for node in range(2000):
        key = int(rng.integers(0, 500)) << 40 | int(rng.integers(0, 4)) << 16 | int(rng.integers(0, 3))
        slot = hybrid_astar._slot(keys, key)
        assert (keys[slot] == key) == (key in twin)
        keys[slot], holders[slot], twin[key] = key, node, node
        if 2 * len(twin) > len(keys):
            keys, holders = hybrid_astar._rehashed(keys, holders)
    for key, node in twin.items():
        assert holders[hybrid_astar._slot(keys, key)] == node


def test_changes_of_curvature_cost_in_the_search() -> None:
    p = np.zeros((160, 480))
    p[:82, 200:240] = 1  # up to y = 20.5 m, to be passed on the left
    total_changes = []
    for change_cost_m in (None, 0.0):
        outcome, _, segments = searched((10, 20, 0), (110, 20, 0), p_occupied=p, weight=1.0, change_cost_m=change_cost_m)
        assert outcome == hybrid_astar.FOUND
        total_changes.append(np.abs(np.diff(segments[segments[:, 0] > 0, 1])).sum())
    assert total_changes[0] < 0.5 * total_changes[1]


@pytest.mark.parametrize("goal", [(60, 24, 0), (105, 12, -0.1), (100, 30, 0.3)])
def test_search_ends_20_expansions_after_a_connection_that_costs_about_the_cost_to_go(goal: Pose) -> None:
    outcome, n_expansions, _ = searched((10, 20, 0), goal)  # the start itself is connected with the goal
    assert (outcome, n_expansions) == (hybrid_astar.FOUND, 1 + 20)


def test_search_goes_on_for_500_expansions_after_a_dear_connection_and_finds_the_way_round() -> None:
    # Doubtful ground on the straight line, 20 m long and 7 m wide: straight on costs 70 + 20 (1 + 10 x 0.19) = 128, round it
    # little more than 90. The start is connected at once; by 21 expansions nothing better is known.
    p = np.zeros((160, 480))
    p[66:94, 200:280] = 0.19
    found = [searched((10, 20, 0), (100, 20, 0), p_occupied=p, max_expansions=limit) for limit in (21, 2000)]
    assert [(outcome, n) for outcome, n, _ in found] == [(hybrid_astar.FOUND, 21), (hybrid_astar.FOUND, 501)]
    straight, around = (poses_along(np.array([10.0, 20.0, 0.0]), segments, max_step_m=0.5)[:, 1] for _, _, segments in found)
    assert np.abs(straight - 20).max() < 0.1
    assert np.abs(around - 20).max() > 3.5
