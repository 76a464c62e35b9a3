"""How well the lanes that traces drove in suit a pattern of lanes, for each first lane and each place of the closure."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import ndtr

from wzsumo.crowd_mapping.hypotheses.closures import Closures
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern
from wzsumo.frames import FloatArray, IntArray

# Changes of lane: at discretion about one in 2 km; out of a closing lane one for certain, some 150 m ahead of its end.
DISCRETION_M, MERGE_AHEAD_M = 2000.0, 150.0
STATION_COST = 1.0  # -log chance of a station beside the lanes
MISTAKEN = (0.002, 0.02)  # least and most chance that a trace is nowhere near the lanes that it seems to drive in


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What the traces say: levels (n,) [m] of their first lanes, lanes (n, stations) from the first, weights (n,)."""

    levels: FloatArray
    lanes: IntArray
    weights: FloatArray
    spacing: float  # of the stations [m]
    width: tuple[float, float]  # of the lanes, prior mean and sd [m]
    usual_spread: float  # between traces [m], as far as their drift tells it


@dataclass(frozen=True, kw_only=True, eq=False)
class ChangeCosts:
    """How well each trace's lanes suit each first lane and each pair of places where the closure begins and ends.

    `fit` (n, pairs, first lane) is the chance of a trace's lanes, `ever` (n, first lane, lane) whether it drove in a lane.
    """

    pattern: LanePattern
    closures: Closures
    fit: FloatArray
    ever: FloatArray


def change_costs(evidence: Evidence, pattern: LanePattern, *, closures: Closures) -> ChangeCosts:
    """The costs for a pattern of lanes and the closures that its closed ones may have."""
    most_cost = -np.log(np.clip(ndtr(-evidence.width[0] / 2 / evidence.usual_spread), *MISTAKEN))
    closed = (pattern.closed[0], pattern.closed[-1]) if pattern.closed else (_NOWHERE, _NOWHERE)
    cost, ever = _costs(
        evidence.lanes, pattern.n_lanes, closed, pattern.is_interior, closures.pairs, evidence.spacing, float(most_cost)
    )  # fmt: skip
    return ChangeCosts(pattern=pattern, closures=closures, fit=np.exp(-cost), ever=ever)


_NOWHERE = 1_000  # a lane that no trace is in


@njit(cache=True)
def _costs(
    lanes: IntArray, n_lanes: int, closed: tuple[int, int], interior: bool, pairs: IntArray, spacing: float, most_cost: float
) -> tuple[FloatArray, FloatArray]:
    n, n_stations = lanes.shape
    cost, ever = np.empty((n, len(pairs), n_lanes)), np.zeros((n, n_lanes, n_lanes))
    beyond_until, spared_until = np.zeros(n_stations + 1), np.zeros(n_stations + 1)
    last_beyond = np.empty(n_stations)
    for i in range(n):
        for first in range(n_lanes):
            beside, chosen, last = 0, 0, -10_000
            for j in range(n_stations):
                lane = lanes[i, j] + first
                if 0 <= lane < n_lanes:
                    ever[i, first, lane] = 1.0
                else:
                    beside += 1
                # Beyond the outermost closed lane is as far from the open ones as in it.
                beyond = closed[0] <= lane <= closed[1] or (lane >= n_lanes and not interior)
                last = j if beyond else last
                last_beyond[j] = last
                beyond_until[j + 1] = beyond_until[j] + beyond
                way = lanes[i, min(j + 1, n_stations - 1)] - lanes[i, j]
                between = way != 0 and _chose(lane, way, n_lanes, closed, interior)
                chosen += between
                # Beside the closure there is one way only.
                spared_until[j + 1] = spared_until[j] + (between and (lane == closed[0] - 1 or lane == closed[1] + 1))
            for p in range(len(pairs)):
                closes, opens = pairs[p]
                inside = beyond_until[opens] - beyond_until[closes]
                choices = chosen - (spared_until[opens] - spared_until[closes])
                cost[i, p, first] = min(STATION_COST * (inside + beside), most_cost) + np.log(2.0) * choices
                if closes > 0:
                    # The last change out of a closed lane ahead of its end was no change at discretion.
                    ahead = (closes - last_beyond[closes - 1]) * spacing
                    cost[i, p, first] -= max(np.log(DISCRETION_M / MERGE_AHEAD_M) - ahead / MERGE_AHEAD_M, 0.0)
    return cost, ever


@njit(cache=True)
def _chose(lane: int, way: int, n_lanes: int, closed: tuple[int, int], interior: bool) -> bool:
    """Whether a driver who left a lane chose between two: out of closing lanes the way is towards the open ones."""
    return 0 < lane < n_lanes - 1 and not (lane >= closed[0] and way < 0 and not interior)
