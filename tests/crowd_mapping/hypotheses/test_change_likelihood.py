from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from scipy.stats import norm

from wzsumo.crowd_mapping.hypotheses.change_likelihood import LaneEvidence, change_likelihood
from wzsumo.crowd_mapping.hypotheses.closures import ClosurePrior, known_closure
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern
from wzsumo.frames import IntArray

ANYWHERE = ClosurePrior(stations=np.arange(0.0, 300.0, 10.0), announced=None, merging_length_m=200.0)
PATTERNS = [LanePattern(1, ()), LanePattern(3, ()), LanePattern(3, (2,)), LanePattern(4, (2, 3)), LanePattern(4, (1, 2))]


def evidence_of(lanes: npt.ArrayLike, *, spread: float) -> LaneEvidence:
    lanes = np.asarray(lanes)
    return LaneEvidence(
        levels=np.zeros(len(lanes)), lanes=lanes, weights=np.ones(len(lanes)), spacing=10.0, width=(3.6, 0.1),
        usual_spread=spread,
    )  # fmt: skip


def wandering(seed: int, *, n: int = 6, n_stations: int = 30) -> IntArray:
    random = np.random.default_rng(seed)
    steps = random.choice([-1, 0, 1], p=[0.08, 0.84, 0.08], size=(n, n_stations))
    steps[:, 0] = 0
    return np.asarray(steps.cumsum(axis=1))


def cost_written_out(lanes: IntArray, pattern: LanePattern, closes: int, opens: int, *, spread: float) -> float:
    """The cost of one trace's lanes (stations,) for one pattern and one closure, rule by rule."""
    closed = set(pattern.closed)
    outside = [not 0 <= lane < pattern.n_lanes for lane in lanes]
    beyond = [lane in closed or (lane >= pattern.n_lanes and not pattern.is_interior) for lane in lanes]
    # Beside the lanes a station costs 1; a trace is mistaken as a whole with a chance of 0.002 to 0.02.
    most = -np.log(np.clip(norm.cdf(-1.8 / spread), 0.002, 0.02))
    cost = min(sum(outside) + sum(beyond[closes:opens]), most)
    for j, (here, then) in enumerate(pairwise(lanes)):
        one_way = not 0 < here < pattern.n_lanes - 1
        towards_open = closed and not pattern.is_interior and here >= min(closed) and then < here
        along_closure = closed and here in (min(closed) - 1, max(closed) + 1) and closes <= j < opens
        if here != then and not (one_way or towards_open or along_closure):
            cost += np.log(2)
    if closed and any(beyond[:closes]):
        # At discretion a driver changes lanes every 2000 m; out of a closing lane 150 m ahead of its end on average.
        ahead = 10.0 * (closes - max(np.flatnonzero(beyond[:closes])))
        cost -= max(np.log(2000 / 150) - ahead / 150, 0)
    return float(cost)


# At a spread of 0.9 m half a lane has a chance of 0.023, at 0.75 m of 0.008, at 0.3 m of 1e-9.
@pytest.mark.parametrize("spread", [0.9, 0.75, 0.3])
@pytest.mark.parametrize("pattern", PATTERNS, ids=str)
def test_likelihoods_of_lanes_equal_the_rules_written_out(pattern: LanePattern, spread: float) -> None:
    lanes = wandering(4)
    closures = ANYWHERE.candidates(pattern)
    changes = change_likelihood(evidence_of(lanes, spread=spread), pattern, closures=closures)
    for p in range(0, len(closures.ends), 7):
        expected = [
            [cost_written_out(row + first, pattern, *closures.ends[p], spread=spread) for first in range(pattern.n_lanes)]
            for row in lanes
        ]
        np.testing.assert_allclose(-np.log(changes.likelihood[:, p]), expected, atol=1e-9)


def test_lanes_that_a_trace_was_ever_in_follow_from_its_first() -> None:
    changes = change_likelihood(evidence_of([[0, 0, 1, 1]], spread=0.9), LanePattern(3, ()), closures=known_closure(0, 0))
    np.testing.assert_array_equal(changes.visited[0], [[1, 1, 0], [0, 1, 1], [0, 0, 1]])
