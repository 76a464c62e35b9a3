"""How well the lanes that traces drove in suit a pattern of lanes, for each first lane and each place of the closure."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from wzsumo.crowd_mapping.lane_patterns import LanePattern
from wzsumo.frames import FloatArray, IntArray

# Changes of lane: at discretion about one in 2 km; out of a closing lane one for certain, some 150 m ahead of its end.
DISCRETION_M, MERGE_AHEAD_M = 2000.0, 150.0
STATION_COST = 1.0  # -log chance of a station beside the lanes
MISTAKEN = (0.002, 0.02)  # least and most chance that a trace is nowhere near the lanes that it seems to drive in
CORE_M, CORE_SPREAD = 500.0, 0.6  # median length of the closed stretch and the standard deviation of its logarithm
PLACES = 18  # tried for either end of the closure


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What the traces say: levels (n,) [m] of their first lanes, lanes (n, stations) from the first, weights (n,)."""

    levels: FloatArray
    lanes: IntArray
    weights: FloatArray
    spacing: float  # of the stations [m]
    width: tuple[float, float]  # of the lanes, prior mean and sd [m]
    usual_spread: float  # between traces [m], as far as their drift tells it


class ChangeCosts:
    """How well each trace's lanes suit each first lane and each pair of places where the closure begins and ends."""

    def __init__(self, evidence: Evidence, pattern: LanePattern, *, pair: tuple[int, int] | None = None) -> None:
        n_stations = evidence.lanes.shape[1]
        self.pattern = pattern
        lanes = evidence.lanes[:, None, :] + np.arange(pattern.n_lanes)[:, None]  # (n, first lane, stations)
        beside = ((lanes < 0) | (lanes >= pattern.n_lanes)).sum(axis=2)
        # Beyond the outermost closed lane is as far from the open ones as in it.
        beyond = np.isin(lanes, pattern.closed) | ((lanes >= pattern.n_lanes) & (not pattern.is_interior))
        self.pairs = np.array([pair or (0, 0)])
        self.log_prior = np.zeros(1)
        if pattern.closed and pair is None:
            places = np.unique(np.linspace(1, n_stations, PLACES).astype(int))
            closes, opens = (side.ravel() for side in np.meshgrid(places[:-1], places, indexing="ij"))
            longer = opens > closes
            self.pairs = np.column_stack([closes, opens])[longer]
            length = (self.pairs[:, 1] - self.pairs[:, 0]) * evidence.spacing
            prior = np.exp(-0.5 * (np.log(length / CORE_M) / CORE_SPREAD) ** 2)
            self.log_prior = np.log(prior / prior.sum())
        driven = np.concatenate([np.zeros((*beyond.shape[:2], 1)), np.cumsum(beyond, axis=2)], axis=2)
        inside = driven[:, :, self.pairs[:, 1]] - driven[:, :, self.pairs[:, 0]]
        most_cost = -np.log(np.clip(ndtr(-evidence.width[0] / 2 / evidence.usual_spread), *MISTAKEN))
        cost = np.minimum(STATION_COST * (inside + beside[:, :, None]), most_cost)
        cost += np.log(2.0) * self._changes_between_two(lanes)
        if pattern.closed:
            # The last change out of a closed lane ahead of its end was no change at discretion.
            index = np.arange(n_stations)
            last = np.maximum.accumulate(np.where(beyond, index, -10_000), axis=2)[:, :, self.pairs[:, 0] - 1]
            ahead = (self.pairs[:, 0] - last) * evidence.spacing
            gain = np.log(DISCRETION_M / MERGE_AHEAD_M) - ahead / MERGE_AHEAD_M
            cost -= np.maximum(gain, 0.0)
        self.fit = np.ascontiguousarray(np.exp(-cost).transpose(0, 2, 1))  # (n, pairs, first lane)
        self.ever = np.stack([(lanes == k).any(axis=2) for k in range(pattern.n_lanes)], axis=2).astype(float)

    def _changes_between_two(self, lanes: IntArray) -> FloatArray:
        """Changes of lane (n, first lane, pairs) out of lanes that have another on either side: drivers chose between two."""
        here, closed = lanes[:, :, :-1], self.pattern.closed
        moves = np.diff(lanes, axis=2)
        between = (moves != 0) & (here > 0) & (here < self.pattern.n_lanes - 1)
        if closed and not self.pattern.is_interior:
            # Out of closing lanes the way is towards the open ones.
            between &= ~((here >= closed[0]) & (moves < 0))
        count = between.sum(axis=2)[:, :, None]
        if not closed:
            return np.asarray(count)
        # Beside the closure there is one way only.
        spared = between & ((here == closed[0] - 1) | (here == closed[-1] + 1))
        until = np.concatenate([np.zeros((*here.shape[:2], 1)), np.cumsum(spared, axis=2)], axis=2)
        ends = np.minimum(self.pairs, here.shape[2])
        return np.asarray(count - (until[:, :, ends[:, 1]] - until[:, :, ends[:, 0]]))
