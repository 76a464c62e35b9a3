import numpy as np
import numpy.typing as npt
import pytest

from wzsumo.frames import FloatArray
from wzsumo.planning.distance_field import FieldArray
from wzsumo.planning.planning_field import cost_to_go


def bordered(multiplier: npt.ArrayLike) -> FieldArray:
    return np.pad(np.asarray(multiplier, dtype=np.float32), 1, constant_values=np.inf)


def slow_cost_to_go(multiplier: FloatArray, goal: tuple[int, int], resolution: float) -> FloatArray:
    """Upwind differences swept over all cells until nothing changes."""
    cost = np.full(multiplier.shape, np.inf)
    cost[goal[0] + 1, goal[1] + 1] = 0
    while True:
        before = cost.copy()
        for row in range(1, multiplier.shape[0] - 1):
            for col in range(1, multiplier.shape[1] - 1):
                edge = multiplier[row, col] * resolution
                low, high = sorted((min(cost[row, col - 1], cost[row, col + 1]), min(cost[row - 1, col], cost[row + 1, col])))
                if not np.isfinite(edge + low):
                    continue
                reached = low + edge if high - low >= edge else (low + high + np.sqrt(2 * edge**2 - (high - low) ** 2)) / 2
                cost[row, col] = min(cost[row, col], reached)
        if np.array_equal(cost, before):
            return cost


@pytest.mark.parametrize("seed", range(4))
def test_cost_to_go_equals_sweeps_until_nothing_changes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    multiplier = 1 + 8 * rng.random((17, 23)) ** 3
    multiplier[rng.random((17, 23)) < 0.2] = np.inf
    multiplier[8, 11] = 1
    field = bordered(multiplier)
    expected = slow_cost_to_go(field.astype(float), (8, 11), 0.25)
    np.testing.assert_allclose(cost_to_go(field, max_metre_cost=9.0, goal_cell=(8, 11), resolution=0.25), expected, rtol=1e-4)


def test_cost_to_go_on_open_ground_is_the_straight_distance_in_every_direction() -> None:
    cost = cost_to_go(bordered(np.ones((201, 201))), max_metre_cost=1.0, goal_cell=(100, 100), resolution=0.25)[1:-1, 1:-1]
    row, col = np.mgrid[:201, :201] - 100
    straight = 0.25 * np.hypot(row, col)
    far = straight > 10
    assert (cost[far] / straight[far]).min() >= 1 - 1e-5
    assert (cost[far] / straight[far]).max() < 1.03  # Dijkstra over 8 neighbours: 1.082


def test_cost_to_go_is_infinite_behind_a_wall_and_proportional_to_the_multiplier() -> None:
    open_ground = np.ones((20, 40))
    open_ground[:, 30] = np.inf
    once = cost_to_go(bordered(open_ground), max_metre_cost=1.0, goal_cell=(10, 5), resolution=0.5)
    thrice = cost_to_go(bordered(3 * open_ground), max_metre_cost=3.0, goal_cell=(10, 5), resolution=0.5)
    assert np.isinf(once[1:-1, 31:]).all()
    np.testing.assert_allclose(thrice[1:-1, 1:31], 3 * once[1:-1, 1:31], rtol=1e-5)
