import numpy as np
import pytest

from wzsumo.crowd_mapping.lanes.lane_chain import lane_chain
from wzsumo.frames import FloatArray, IntArray


def matrix_of(first: IntArray, source: IntArray, probability: FloatArray) -> FloatArray:
    """Transition matrix (from, to) of edges sorted by their target."""
    n = len(first) - 1
    matrix = np.zeros((n, n))
    for target in range(n):
        for edge in range(first[target], first[target + 1]):
            matrix[source[edge], target] += probability[edge]
    return matrix


@pytest.mark.parametrize("n_lanes", [1, 2, 6])
@pytest.mark.parametrize("spacing", [2.0, 20.0, 60.0])
def test_chain_backwards_is_the_time_reversal_of_the_chain(n_lanes: int, spacing: float) -> None:
    chain = lane_chain(n_lanes, spacing=spacing)
    forward = matrix_of(chain.first, chain.source, chain.probability)
    backward = matrix_of(chain.back_first, chain.back_source, chain.back_probability)
    shares = chain.stationary
    assert (forward >= 0).all()
    assert forward.sum(axis=1) == pytest.approx(1.0, abs=1e-9)
    assert backward.sum(axis=1) == pytest.approx(1.0, abs=1e-9)
    assert shares.sum() == pytest.approx(1.0)
    assert shares @ forward == pytest.approx(shares, abs=1e-12)
    assert shares[:, None] * forward == pytest.approx((shares[:, None] * backward).T, abs=1e-12)


@pytest.mark.parametrize("spacing", [5.0, 10.0, 20.0])
def test_lane_change_takes_40_to_150_m_however_near_the_stations_are(spacing: float) -> None:
    """The mean distance between two lanes, from the fundamental matrix of the states between them."""
    chain = lane_chain(2, spacing=spacing)
    forward = matrix_of(chain.first, chain.source, chain.probability)
    between = np.flatnonzero(chain.position % 1 > 0)
    steps = np.linalg.solve(np.eye(len(between)) - forward[np.ix_(between, between)], np.ones(len(between)))
    from_right = int(np.argmin(np.abs(chain.position[between] - 1 / 3)))
    assert 40 < steps[from_right] * spacing < 150


def test_longer_stretches_without_a_fix_leave_no_vehicle_between_lanes() -> None:
    """Between stations 100 m apart most lane changes are over: those under way are no more than at 20 m."""
    near, far = lane_chain(2, spacing=20.0), lane_chain(2, spacing=100.0)
    shares = [chain.stationary[chain.position % 1 > 0].sum() for chain in (near, far)]
    assert shares[1] < 2.5 * shares[0]
    assert shares[1] < 0.1


@pytest.mark.parametrize("spacing", [5.0, 20.0, 60.0])
def test_vehicles_change_lanes_once_in_3_km_to_each_side(spacing: float) -> None:
    chain = lane_chain(3, spacing=spacing)
    forward = matrix_of(chain.first, chain.source, chain.probability)
    middle = 1
    to_the_left = sum(forward[middle, j] for j in range(len(forward)) if 1 < chain.position[j] <= 2 and not chain.burst[j])
    assert to_the_left / spacing == pytest.approx(1 / 3000, rel=1e-6)


def test_rates_of_lane_changes_are_those_given_for_each_lane_and_side() -> None:
    rates = np.array([[1e-3, 2e-3], [3e-3, 4e-3]])
    chain = lane_chain(3, spacing=10.0, changes_per_m=rates)
    matrix = matrix_of(chain.first, chain.source, chain.probability)
    for lane in range(2):
        for side, start in enumerate((lane, lane + 1)):
            state = chain.begun[lane, side]
            assert matrix[start, state] == pytest.approx(10.0 * rates[lane, side])
            assert chain.position[state] == pytest.approx(start + (1 - 2 * side) / 3)


@pytest.mark.parametrize("spacing", [10.0, 20.0, 40.0])
def test_visits_of_a_change_are_those_of_the_chain(spacing: float) -> None:
    """Expected stations in a change's first third, for each change that begins: quick ones pass between two stations."""
    chain = lane_chain(2, spacing=spacing)
    matrix = matrix_of(chain.first, chain.source, chain.probability)
    slow, quick = matrix[0, chain.begun[0, 0]], matrix[0, 1]
    stay = matrix[chain.begun[0, 0], chain.begun[0, 0]]
    assert chain.visits == pytest.approx(slow / (slow + quick) / (1 - stay))
