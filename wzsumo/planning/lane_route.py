"""The route of the ego in lanes: the line along which a path is to lead, from the lines along which vehicles drive.

Lines tell where lanes are. A metre in the middle of a lane costs nothing, a metre between two lanes costs 1, and moving
sideways against the road's course costs the square of the slope. The cheapest line from the start to the goal keeps its lane,
and changes lanes where that must be, over the length of one comfortable lane change: with a mean cost c and a change by w
over the length l, the sum c l + stiffness w^2 / l is least at l = w sqrt(stiffness / c), and is 2 c l.
Source: Viterbi 1967 (the search).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wzsumo.frames import BoolArray, FloatArray

STATION_STEP_M = 5.0
OFFSET_STEP_M = 0.1
LANE_SD_M = 0.5  # of the places of drivers in a lane, as a line's bump; half a lane is three of it
LANE_REACH_M = 1.6  # lines nearer to each other than this are of one lane: less than half of the narrowest (10 ft) and a bump
LANE_WIDTH_M = 3.66  # 12 ft, AASHTO Green Book
# Of a metre on the way from one lane's middle to the next one's: two halves of a bump are cheaper than 1.
MEAN_COST_BETWEEN = 1 - math.sqrt(2 * math.pi) * LANE_SD_M / LANE_WIDTH_M
LANE_CHANGE_S = 4.6  # Toledo & Zohar 2007: mean duration of lane changes
MAX_SLOPE = 0.3  # sideways against along; a lane change at 10 m/s has a mean slope of 0.08
MIN_SHARE_OF_LARGEST = 0.05  # of the bumps at a station; where there is less, no lane is
# So many metres that the map has not free cost as much as two changes of lanes: a path may be pushed past a few of them.
# Chosen by us.
WORTH_TWO_CHANGES_M = 25.0
BARRED_COST = 1e4  # of a metre that the map has not free: dearer than any way around


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneLine:
    """A line along which vehicles drive: offsets (k,) [m] at ascending stations (k,) [m] of a road, linear in between."""

    stations: FloatArray
    offsets: FloatArray
    weight: float = 1.0  # how much it counts beside others at the same place: vehicles a metre

    def at(self, stations: FloatArray) -> FloatArray:
        """Offsets (n,) [m] at stations (n,), nan before and beyond the line."""
        return np.interp(stations, self.stations, self.offsets, left=np.nan, right=np.nan)

    def between(self, first: float, last: float) -> "LaneLine | None":
        """The part between two stations; None where there is none."""
        first, last = max(first, float(self.stations[0])), min(last, float(self.stations[-1]))
        if first >= last:
            return None
        inner = self.stations[(self.stations > first) & (self.stations < last)]
        stations = np.concatenate([[first], inner, [last]])
        return LaneLine(stations=stations, offsets=np.interp(stations, self.stations, self.offsets), weight=self.weight)


def route_offsets(
    stations: FloatArray,
    lines: Sequence[LaneLine],
    *,
    ends: tuple[float, float],
    offsets: FloatArray,
    speed_mps: float,
    blocked: BoolArray,
    blocked_cost: float | None = None,
) -> FloatArray:
    """Offsets (n,) [m] of the route at evenly spaced stations (n,) [m], between the offsets `ends` of start and goal.

    It keeps to `offsets` (m,), OFFSET_STEP_M apart; `blocked` (n, m) says where the map is not free. Where no line reaches, the
    route leads on along the road. Without `blocked_cost`, of a metre that is not free, it follows from WORTH_TWO_CHANGES_M.
    """
    step = float(stations[1] - stations[0])
    at_stations = np.array([line.at(stations) for line in lines])
    weights = np.array([line.weight for line in lines])
    change_m = LANE_CHANGE_S * max(speed_mps, 1.0)  # the length over which a change of lanes is cheapest
    if blocked_cost is None:
        blocked_cost = 4 * MEAN_COST_BETWEEN * change_m / WORTH_TWO_CHANGES_M
    cost = step * (lane_cost(offsets, at_stations, weights=weights) + blocked_cost * blocked)
    course = _course(at_stations, weights=weights)
    moves = np.arange(-int(MAX_SLOPE * step / OFFSET_STEP_M), int(MAX_SLOPE * step / OFFSET_STEP_M) + 1)
    before = np.arange(len(offsets))[:, None] - moves
    inside = (before >= 0) & (before < len(offsets))
    before = np.clip(before, 0, len(offsets) - 1)
    stiffness = MEAN_COST_BETWEEN * (change_m / LANE_WIDTH_M) ** 2
    start, goal = (int(np.argmin(np.abs(offsets - end))) for end in ends)
    total = np.full(len(offsets), np.inf)
    total[start] = 0.0
    came = np.zeros((len(stations), len(offsets)), dtype=np.intp)
    for row in range(1, len(stations)):
        aside = moves * OFFSET_STEP_M - course[row]
        through = np.where(inside, total[before], np.inf) + stiffness * aside**2 / step
        best = np.argmin(through, axis=1)
        came[row] = np.take_along_axis(before, best[:, None], axis=1)[:, 0]
        total = np.take_along_axis(through, best[:, None], axis=1)[:, 0] + cost[row]
    found = np.full(len(stations), goal, dtype=np.intp)
    for row in range(len(stations) - 1, 0, -1):
        found[row - 1] = came[row, found[row]]
    return np.asarray(offsets[found])


def lane_cost(offsets: FloatArray, lines: FloatArray, *, weights: FloatArray) -> FloatArray:
    """Cost of a metre (n, m) at n stations and offsets (m,): 0 in the middle of a lane, 1 far off every lane.

    `lines` (k, n) are offsets, nan where a line does not reach. Each line is a bump as high as its weight; their sum is set
    against its largest value within LANE_REACH_M, which makes every lane's middle 0, however many drove in it.
    """
    apart = (offsets[None, None, :] - lines[:, :, None]) / LANE_SD_M
    bumps = np.nansum(weights[:, None, None] * np.exp(-(apart**2) / 2), axis=0)
    reach = round(LANE_REACH_M / OFFSET_STEP_M)
    padded = np.pad(bumps, ((0, 0), (reach, reach)))
    of_lane = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=1).max(axis=2)
    least = MIN_SHARE_OF_LARGEST * bumps.max(axis=1, keepdims=True)
    return np.asarray(1 - bumps / np.maximum(np.maximum(of_lane, least), 1e-9))


def _course(lines: FloatArray, *, weights: FloatArray) -> FloatArray:
    """Steps (n,) [m] sideways of the road's lanes from the station before: the weighted median of those of the lines (k, n)."""
    steps = np.diff(lines, axis=1)
    course = np.zeros(lines.shape[1])
    for column in range(1, lines.shape[1]):
        there = np.flatnonzero(np.isfinite(steps[:, column - 1]))
        if len(there):
            order = there[np.argsort(steps[there, column - 1])]
            share = np.cumsum(weights[order])
            course[column] = steps[order[np.searchsorted(share, share[-1] / 2)], column - 1]
    return course
