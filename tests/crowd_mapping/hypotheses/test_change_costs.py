from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import norm

from wzsumo.crowd_mapping.hypotheses.change_costs import (
    DISCRETION_M,
    MERGE_AHEAD_M,
    MISTAKEN,
    STATION_COST,
    Evidence,
    change_costs,
)
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior, one_closure
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern

ANYWHERE = ClosurePrior(stations=10.0 * np.arange(30), announced=None, merging_m=200.0)
PATTERNS = [LanePattern(1, ()), LanePattern(3, ()), LanePattern(3, (2,)), LanePattern(4, (2, 3)), LanePattern(4, (1, 2))]


def evidence_of(lanes):
    return Evidence(
        levels=np.zeros(len(lanes)), lanes=lanes, weights=np.ones(len(lanes)), spacing=10.0, width=(3.6, 0.1), usual_spread=0.9
    )


def wandering(seed, *, n=6, n_stations=30):
    random = np.random.default_rng(seed)
    steps = random.choice([-1, 0, 1], p=[0.08, 0.84, 0.08], size=(n, n_stations))
    steps[:, 0] = 0
    return steps.cumsum(axis=1)


def cost_written_out(lanes, pattern, closes, opens):
    """The cost of one trace's lanes (stations,) for one pattern and one closure, rule by rule."""
    closed = set(pattern.closed)
    beside = [not 0 <= lane < pattern.n_lanes for lane in lanes]
    beyond = [lane in closed or (lane >= pattern.n_lanes and not pattern.is_interior) for lane in lanes]
    most = -np.log(np.clip(norm.cdf(-1.8 / 0.9), *MISTAKEN))
    cost = min(STATION_COST * (sum(beside) + sum(beyond[closes:opens])), most)
    for j, (here, then) in enumerate(pairwise(lanes)):
        one_way = not 0 < here < pattern.n_lanes - 1
        towards_open = closed and not pattern.is_interior and here >= min(closed) and then < here
        along_closure = closed and here in (min(closed) - 1, max(closed) + 1) and closes <= j < opens
        if here != then and not (one_way or towards_open or along_closure):
            cost += np.log(2)
    if closed and any(beyond[:closes]):
        ahead = 10.0 * (closes - max(np.flatnonzero(beyond[:closes])))
        cost -= max(np.log(DISCRETION_M / MERGE_AHEAD_M) - ahead / MERGE_AHEAD_M, 0)
    return cost


@pytest.mark.parametrize("pattern", PATTERNS, ids=str)
def test_chances_of_lanes_equal_the_rules_written_out(pattern) -> None:
    lanes = wandering(4)
    closures = ANYWHERE.closures(pattern)
    costs = change_costs(evidence_of(lanes), pattern, closures=closures)
    for p in range(0, len(closures.pairs), 7):
        expected = [
            [cost_written_out(row + first, pattern, *closures.pairs[p]) for first in range(pattern.n_lanes)] for row in lanes
        ]
        np.testing.assert_allclose(-np.log(costs.fit[:, p]), expected, atol=1e-9)


def test_lanes_that_a_trace_was_ever_in_follow_from_its_first() -> None:
    costs = change_costs(evidence_of(np.array([[0, 0, 1, 1]])), LanePattern(3, ()), closures=one_closure(0, 0))
    np.testing.assert_array_equal(costs.ever[0], [[1, 1, 0], [0, 1, 1], [0, 0, 1]])
