"""How probable the lanes that a trace drove in are, for a pattern of lanes, the trace's first lane and the ends of a closure.

Lane changes are seen in a trace, but its first lane is not. For a first lane and a closure from station a to b the negative log
likelihood ("cost") of a trace's lanes is

    min(n_out, c_max) + n_choice log 2 - max(log(D / M) - x / M, 0)

n_out     stations at which the trace is in no lane of the pattern, or in a closed lane between a and b; a station costs 1
c_max     -log of the chance that the trace's lanes are mistaken as a whole: its level is half a lane width off
n_choice  changes out of a lane with lanes on both sides, from which the driver could have gone either way
x         distance [m] from the last station in a closed lane to the closure. The last term is the log ratio of two densities of
          a lane change: exp(-x / M) / M for drivers who must leave the lane, 1 / D for discretionary changes
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import ndtr

from wzsumo.crowd_mapping.hypotheses.closures import CandidateClosures
from wzsumo.crowd_mapping.hypotheses.lane_patterns import LanePattern
from wzsumo.frames import FloatArray, IntArray

DISCRETIONARY_SPACING_M = 2000.0  # D, mean distance between a driver's discretionary lane changes; chosen by us
MEAN_MERGE_DISTANCE_M = 150.0  # M, mean distance ahead of a lane's end at which drivers leave it; chosen by us
OUTSIDE_STATION_COST = 1.0  # -log probability of a station outside the open lanes; chosen by us
MIN_MISTAKEN, MAX_MISTAKEN = 0.002, 0.02  # bounds of the probability that a trace's lanes are mistaken as a whole; chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneEvidence:
    """What the traces say of the lanes.

    `levels` (n,) [m] are the lateral levels of the traces' first lanes about the common course, `lanes` (n, stations) the
    traces' lanes counted from their first, `weights` (n,) what each trace counts. `spacing` [m] is that of the stations,
    `width` the prior mean and standard deviation [m] of the lanes' width, `usual_spread` [m] the standard deviation of levels
    about their lanes that the traces' drift lets expect.
    """

    levels: FloatArray
    lanes: IntArray
    weights: FloatArray
    spacing: float
    width: tuple[float, float]
    usual_spread: float


@dataclass(frozen=True, kw_only=True, eq=False)
class ChangeLikelihood:
    """How probable each trace's lanes are under one pattern.

    `likelihood` (n, pairs, n_lanes) is given for each pair of the closure's ends and each first lane; `visited`
    (n, n_lanes, n_lanes) is 1 where a trace with a first lane (second axis) was ever in a lane (third axis), else 0.
    """

    pattern: LanePattern
    closures: CandidateClosures
    likelihood: FloatArray
    visited: FloatArray


def change_likelihood(evidence: LaneEvidence, pattern: LanePattern, *, closures: CandidateClosures) -> ChangeLikelihood:
    """How probable the traces' lanes are under a pattern, for the closures that its closed lanes may have."""
    half_lane_off = ndtr(-evidence.width[0] / 2 / evidence.usual_spread)
    max_cost = -np.log(np.clip(half_lane_off, MIN_MISTAKEN, MAX_MISTAKEN))
    closed = (pattern.closed[0], pattern.closed[-1]) if pattern.closed else (_NO_LANE, _NO_LANE)
    cost, visited = _costs(
        evidence.lanes, pattern.n_lanes, closed, pattern.is_interior, closures.ends, evidence.spacing, float(max_cost)
    )  # fmt: skip
    return ChangeLikelihood(pattern=pattern, closures=closures, likelihood=np.exp(-cost), visited=visited)


_NO_LANE = 1_000  # a lane that no trace is in


@njit(cache=True)
def _costs(
    lanes: IntArray, n_lanes: int, closed: tuple[int, int], interior: bool, ends: IntArray, spacing: float, max_cost: float
) -> tuple[FloatArray, FloatArray]:
    """Costs (n, pairs, first lane), and the lanes visited (n, first lane, lane); sums along the stations serve all pairs."""
    n, n_stations = lanes.shape
    cost, visited = np.empty((n, len(ends), n_lanes)), np.zeros((n, n_lanes, n_lanes))
    beyond_until, spared_until = np.zeros(n_stations + 1), np.zeros(n_stations + 1)
    last_beyond = np.empty(n_stations)
    for i in range(n):
        for first in range(n_lanes):
            outside, choices, last = 0, 0, -10_000
            for j in range(n_stations):
                lane = lanes[i, j] + first
                if 0 <= lane < n_lanes:
                    visited[i, first, lane] = 1.0
                else:
                    outside += 1
                # A place beyond the outermost closed lane is as far from the open lanes as the closed lane.
                beyond = closed[0] <= lane <= closed[1] or (lane >= n_lanes and not interior)
                last = j if beyond else last
                last_beyond[j] = last
                beyond_until[j + 1] = beyond_until[j] + beyond
                step = lanes[i, min(j + 1, n_stations - 1)] - lanes[i, j]
                choice = step != 0 and _had_a_choice(lane, step, n_lanes, closed, interior)
                choices += choice
                # A driver in the lane beside the closure could only change away from it.
                spared_until[j + 1] = spared_until[j] + (choice and (lane == closed[0] - 1 or lane == closed[1] + 1))
            for p in range(len(ends)):
                closes, opens = ends[p]
                inside = beyond_until[opens] - beyond_until[closes]
                free_choices = choices - (spared_until[opens] - spared_until[closes])
                cost[i, p, first] = min(OUTSIDE_STATION_COST * (inside + outside), max_cost) + np.log(2.0) * free_choices
                if closes > 0:
                    ahead = (closes - last_beyond[closes - 1]) * spacing
                    merge_gain = np.log(DISCRETIONARY_SPACING_M / MEAN_MERGE_DISTANCE_M) - ahead / MEAN_MERGE_DISTANCE_M
                    cost[i, p, first] -= max(merge_gain, 0.0)
    return cost, visited


@njit(cache=True)
def _had_a_choice(lane: int, step: int, n_lanes: int, closed: tuple[int, int], interior: bool) -> bool:
    """Whether a driver who left a lane by a step could have gone either way.

    A driver in an outermost lane could not, nor one who left closing lanes towards the open ones.
    """
    return 0 < lane < n_lanes - 1 and not (lane >= closed[0] and step < 0 and not interior)
