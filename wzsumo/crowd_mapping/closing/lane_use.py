"""LaneUse: where the lanes that go through were driven, and how probable it is that a lane is open where nobody drove in it.

A lane between the road's edges may be closed for a while, with traffic on one side of it or on both. Where no trace drove in a
lane for a stretch of length l [m], the odds that it is closed somewhere along it are

    0.1 Phi(log(l / 300 m) / 0.8)  x  p(how traces left the lane | closed) / p(same | open)  /  p(nobody in the lane | open)

The share of traffic in an open lane has a beta distribution, Beta(a, b) with a = 3 and b = 3 (lanes - 1), so that with n traces
beside the stretch p(nobody in the lane | open) = B(a, b + n) / B(a, b). A trace that left the lane x [m] ahead of the stretch
counts as in `change_likelihood`: exp(-x / M) / M where the lane closes, 1 / D where it does not.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.special import betaln, ndtr

from wzsumo.crowd_mapping.course.station_table import STATION_SPACING_M, StationTable
from wzsumo.crowd_mapping.hypotheses.change_likelihood import DISCRETIONARY_SPACING_M, MEAN_MERGE_DISTANCE_M
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels
from wzsumo.crowd_mapping.hypotheses.lane_patterns import OPEN_LANE_PSEUDOCOUNT
from wzsumo.frames import BoolArray, FloatArray, IntArray

CLOSED_PRIOR_ODDS = 0.1  # that a lane is closed somewhere along a long stretch; chosen by us
# Of the closed stretch, from a taper with its tangent to a whole work space; chosen by us.
IDLE_LENGTH_MEDIAN_M, IDLE_LENGTH_LOG_SD = 300.0, 0.8
MIN_CLOSED_LENGTH_M = 60.0  # shorter than any taper and tangent: a gap between two vehicles' lane changes
CLOSURE_RANGE_M = 1000.0  # along which a closure may begin: the first trace that leaves the lane says where. Chosen by us
IN_LANE_TOLERANCE = 0.02  # lane widths from the lane's middle; a vehicle farther off is on its way to another lane
MAX_MISLABELLED_SHARE = 0.05  # of the traces, which seem to drive in a lane by mistake, at 2 m of GNSS error
# Beside a vehicle on its way between lanes: 2.45 standard deviations of 0.25 m, drivers' scatter in a lane.
SWEPT_MARGIN_M = 0.6
SWEPT_EDGE_SD_M = 0.2  # of the edge of what such a vehicle swept; chosen by us
BIN_LANES = 0.05  # [lane widths], lateral step of the places that such vehicles swept


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneUse:
    """Use of the lanes that go through, at equally spaced `stations` [m].

    `open_chance` (lanes, stations) is the probability that a lane is open, `swept` (stations, bins) that a vehicle on its way
    between two lanes drove over a place; bins are BIN_LANES wide and begin at the right edge of lane 0.
    """

    stations: FloatArray
    open_chance: FloatArray
    swept: FloatArray

    def open_at(self, s: FloatArray, across: FloatArray) -> FloatArray:
        """Probability (n,) that places are open, at stations s (n,) [m], `across` (n,) lane widths from lane 0's right edge."""
        if (self.open_chance == 1.0).all():
            return np.ones(len(s))
        at = (s - self.stations[0]) / (self.stations[1] - self.stations[0])
        n_lanes = len(self.open_chance)
        lane = np.clip(np.floor(across), 0, n_lanes - 1)
        chance = map_coordinates(self.open_chance, [lane, at], order=1, mode="nearest")
        swept = map_coordinates(self.swept, [at, across / BIN_LANES - 0.5], order=1, mode="nearest")
        return np.asarray(np.maximum(chance, swept))


def fit_lane_use(table: StationTable, weights: FloatArray, levels: LaneLevels, *, half_vehicle_m: float) -> LaneUse:
    """The use of the lanes that go through, by traces in the lanes that `levels` has them in."""
    # A vehicle drove between its first and last fix also at stations where it reported none.
    fixes = np.isfinite(table.offsets)
    known = np.logical_or.accumulate(fixes, axis=1) & np.logical_or.accumulate(fixes[:, ::-1], axis=1)[:, ::-1]
    believed = weights * ~_seem_to_drive_through_closure(levels, known)
    chance = np.ones((levels.n_lanes, len(table.stations)))
    mislabelled = min(float(ndtr(-levels.width / 2 / levels.spread)), MAX_MISLABELLED_SHARE)
    for lane in range(levels.n_lanes):
        in_lane = known & (np.abs(levels.lanes - lane) < IN_LANE_TOLERANCE)
        users = believed @ in_lane
        idle = np.flatnonzero(users <= mislabelled * (believed @ known))
        for stretch in np.split(idle, np.flatnonzero(np.diff(idle) > 1) + 1):
            if len(stretch) * STATION_SPACING_M < MIN_CLOSED_LENGTH_M:
                continue
            odds = _closed_odds(stretch, in_lane, known, believed, n_lanes=levels.n_lanes)
            if lane in levels.interior and stretch[0] < levels.open_from and stretch[-1] >= levels.closed_from:
                odds = np.inf
            chance[lane, stretch] = 1 / (1 + odds)
    # Where every lane is open anyhow, vehicles on their way between lanes add nothing.
    any_doubt = (chance < 1.0).any()
    swept = _swept(levels, believed, known, reach=half_vehicle_m + SWEPT_MARGIN_M) if any_doubt else np.zeros((1, 1))
    return LaneUse(stations=table.stations, open_chance=chance, swept=swept)


def _seem_to_drive_through_closure(levels: LaneLevels, known: BoolArray) -> BoolArray:
    """Traces (n,) that seem to drive in an interior closed lane for most of its closure: their lanes are mistaken."""
    inside = np.isin(np.rint(levels.lanes), levels.interior) & known
    closure = slice(levels.closed_from, levels.open_from)
    return np.asarray(inside[:, closure].sum(axis=1) > 0.5 * np.maximum(known[:, closure].sum(axis=1), 1))


def _closed_odds(stretch: IntArray, in_lane: BoolArray, known: BoolArray, weights: FloatArray, *, n_lanes: int) -> float:
    """Odds that a lane is closed somewhere along an idle stretch (indices of stations) that traces passed in other lanes."""
    n = float((weights[:, None] * known[:, stretch]).sum(axis=0).mean())
    length = len(stretch) * STATION_SPACING_M
    prior = CLOSED_PRIOR_ODDS * float(ndtr(np.log(length / IDLE_LENGTH_MEDIAN_M) / IDLE_LENGTH_LOG_SD))
    others = OPEN_LANE_PSEUDOCOUNT * max(n_lanes - 1, 1)
    log_nobody_if_open = betaln(OPEN_LANE_PSEUDOCOUNT, others + n) - betaln(OPEN_LANE_PSEUDOCOUNT, others)
    return float(prior * np.exp(_log_ratio_of_leavers(stretch, in_lane, weights) - log_nobody_if_open))


def _log_ratio_of_leavers(stretch: IntArray, in_lane: BoolArray, weights: FloatArray) -> float:
    """Log likelihood ratio, closed against open, of where the traces left the lane ahead of the stretch."""
    ahead = in_lane[:, : stretch[0]]
    was_in_lane = ahead.any(axis=1)
    if not was_in_lane.any():
        return 0.0
    last = ahead.shape[1] - 1 - np.argmax(ahead[was_in_lane][:, ::-1], axis=1)
    distance = (stretch[0] - 1 - last) * STATION_SPACING_M
    gain = np.maximum(np.log(DISCRETIONARY_SPACING_M / MEAN_MERGE_DISTANCE_M) - distance / MEAN_MERGE_DISTANCE_M, 0.0)
    # The closure is put where the last trace left. That place is no coincidence: the closure could begin anywhere.
    nearest = int(np.argmin(distance))
    gain[nearest] = np.log(DISCRETIONARY_SPACING_M / CLOSURE_RANGE_M)
    return float(weights[was_in_lane] @ gain)


def _swept(levels: LaneLevels, weights: FloatArray, known: BoolArray, *, reach: float) -> FloatArray:
    """Probability (stations, bins) that vehicles on their way between two lanes drove over a place, within a reach [m]."""
    place = np.arange(0.5 * BIN_LANES, levels.n_lanes, BIN_LANES) - 0.5  # lane widths from the middle of lane 0
    swept = np.zeros((levels.lanes.shape[1], len(place)))
    between = np.abs(levels.lanes - np.rint(levels.lanes)) > 1e-9
    for trace in np.flatnonzero(between.any(axis=1) & (weights > 0)):
        changing = np.convolve(between[trace], [1, 1, 1], mode="same") > 0
        for at in np.flatnonzero(changing & known[trace]):
            inside = (reach - levels.width * np.abs(place - levels.lanes[trace, at])) / SWEPT_EDGE_SD_M
            swept[at] = np.maximum(swept[at], min(weights[trace], 1.0) * ndtr(inside))
    return swept
