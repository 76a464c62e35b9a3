"""LaneChain: the Markov chain of a vehicle's lane from one station to the next.

States: in lane k; between neighbouring lanes, a third or two thirds of the way, on the way to the left or to the right; and in
a burst, in which the fixes say nothing while the lane is remembered (jumps, multipath, ground beside the lanes).
"""

from dataclasses import dataclass

import numpy as np

from wzsumo.frames import BoolArray, FloatArray, IntArray

LANE_CHANGES_PER_M = 1 / 3000  # to each side: 0.3 to 0.6 changes a km on freeways (NGSIM; Knoop et al. 2012)
BURSTS_PER_M = 3e-5  # one in 30 km. Chosen by us
BURST_LENGTH_M = 200.0  # mean
QUICK_PER_M = 0.015  # share of the lane changes that pass between two stations, by their distance. Chosen by us
CHANGE_STAY = 0.35  # of a third of a lane change at 20 m between stations: changes of 60 to 150 m


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneChain:
    """Transitions between states, as lists of edges sorted by their target.

    `position` (states,) is the lane, with fractions between lanes; `burst` (states,) marks bursts. Forward edges: from
    `source[first[j]:first[j + 1]]` to state j with `probability`; `back_*` are those of the chain read backwards. `stationary`
    (states,) are the long-run shares. `begun` (lanes - 1, 2) numbers the states in which changes to the left, and back to the
    right, begin; a change is there for `visits` stations in the mean.
    """

    n_lanes: int
    position: FloatArray
    burst: BoolArray
    first: IntArray
    source: IntArray
    probability: FloatArray
    back_first: IntArray
    back_source: IntArray
    back_probability: FloatArray
    stationary: FloatArray
    begun: IntArray
    visits: float


def lane_chain(n_lanes: int, *, spacing: float, changes_per_m: FloatArray | None = None) -> LaneChain:
    """The chain over `n_lanes` lanes between stations `spacing` [m] apart.

    `changes_per_m` (lanes - 1, 2) [1/m] are the rates of changes from lane k to k + 1 and back, by default LANE_CHANGES_PER_M.
    """
    rates = np.full((n_lanes - 1, 2), LANE_CHANGES_PER_M) if changes_per_m is None else changes_per_m
    position = [float(lane) for lane in range(n_lanes)]
    edges: list[tuple[int, int, float]] = []
    burst = BURSTS_PER_M * spacing
    leave_burst = min(spacing / BURST_LENGTH_M, 0.5)
    stay = CHANGE_STAY ** (spacing / 20.0)
    quick = min(QUICK_PER_M * spacing, 0.9) if spacing >= 20 else 0.0
    begun = np.zeros((n_lanes - 1, 2), dtype=int)
    for lane in range(n_lanes - 1):
        for side, (start, end) in enumerate(((lane, lane + 1), (lane + 1, lane))):
            change = min(float(rates[lane, side]) * spacing, 0.4)
            begun[lane, side] = one = len(position)
            two = one + 1
            position += [start + (end - start) / 3, start + 2 * (end - start) / 3]
            edges += [(start, one, change * (1 - quick)), (start, end, change * quick)]
            edges += [(one, one, stay), (one, two, 0.95 * (1 - stay)), (one, start, 0.05 * (1 - stay))]
            edges += [(two, two, stay), (two, end, 1 - stay)]
    first_burst = len(position)
    position += [float(lane) for lane in range(n_lanes)]
    for lane in range(n_lanes):
        state = first_burst + lane
        edges += [(lane, state, burst), (state, state, 1 - leave_burst), (state, lane, 0.9 * leave_burst)]
        beside = [other for other in (lane - 1, lane + 1) if 0 <= other < n_lanes] or [lane]
        edges += [(state, other, 0.1 * leave_burst / len(beside)) for other in beside]
    n = len(position)
    matrix = np.zeros((n, n))
    for source, target, probability in edges:
        matrix[source, target] += probability
    matrix[np.arange(n), np.arange(n)] += 1 - matrix.sum(axis=1)
    stationary = _stationary(matrix)
    backwards = (stationary[:, None] * matrix / stationary[None, :]).T  # from target to source
    first, source_, probability_ = _sorted_edges(matrix)
    back_first, back_source, back_probability = _sorted_edges(backwards)
    return LaneChain(
        n_lanes=n_lanes,
        position=np.array(position),
        burst=np.arange(n) >= first_burst,
        first=first,
        source=source_,
        probability=probability_,
        back_first=back_first,
        back_source=back_source,
        back_probability=back_probability,
        stationary=stationary,
        begun=begun,
        visits=(1 - quick) / (1 - stay),
    )


def _stationary(matrix: FloatArray) -> FloatArray:
    n = len(matrix)
    system = np.vstack([matrix.T - np.eye(n), np.ones(n)])
    shares = np.linalg.lstsq(system, np.r_[np.zeros(n), 1.0], rcond=None)[0]
    return np.maximum(shares, 1e-12)


def _sorted_edges(matrix: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """(first, source, probability) of the edges into each state."""
    target, source = np.nonzero(matrix.T)
    first = np.searchsorted(target, np.arange(len(matrix) + 1))
    return first, source, matrix[source, target]
