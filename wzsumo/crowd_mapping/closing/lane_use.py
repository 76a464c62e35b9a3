"""LaneUse: where the lanes that go through were driven, and whether a lane is open where nobody drove it.

A lane between the edges of the road may be closed for a while, with traffic on both sides of it or on one. Traces tell so by
leaving it all at once and by keeping out of it: each is weighed against what would happen were it open.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.special import betaln, ndtr

from wzsumo.crowd_mapping.course.station_table import STATION_SPACING_M, StationTable
from wzsumo.crowd_mapping.hypotheses.lane_levels import LaneLevels
from wzsumo.frames import BoolArray, FloatArray

PRIOR_ODDS = 0.1  # that a lane which others drove is closed somewhere, before anybody is seen to keep out of it
CLOSED_M, CLOSED_SPREAD = 300.0, 0.8  # median length of a closed stretch, from a taper and a tangent to a whole work space
SHORTEST_CLOSED_M = 60.0  # shorter than any taper and tangent: a gap between two vehicles' changes of lane
SHARE_COUNT = 3.0  # as `lane_hypotheses.SHARE_COUNTS`: prior count of vehicles in each open lane
# One who leaves a lane at discretion does so once in 2 km, one who has to some 150 m ahead; where a closure begins, the first
# to leave tells: anywhere within 1 km.
DISCRETION_M, MERGE_AHEAD_M, ZONE_M = 2000.0, 150.0, 1000.0
IN_LANE = 0.02  # of a lane's width from its middle: farther off a vehicle is on its way to another lane
MOST_MISTAKEN = 0.05  # share of traces that seem to drive in a lane by mistake, at 2 m of error
SCATTER_M = 0.6  # to either side of a driven line: 2.45 standard deviations of 0.25 m, drivers' scatter in a lane
BLUR_M = 0.2
BIN_LANES = 0.05  # lateral step of the places that crossing vehicles swept


@dataclass(frozen=True, kw_only=True, eq=False)
class LaneUse:
    """`open_chance` (lanes, stations) of the lanes that go through; `swept` (stations, bins) where vehicles crossed lanes.

    Bins are BIN_LANES wide and begin at the right edge of lane 0.
    """

    stations: FloatArray
    open_chance: FloatArray
    swept: FloatArray

    def open_at(self, s: FloatArray, across: FloatArray) -> FloatArray:
        """Chance (n,) that places at stations s (n,) [m], `across` (n,) lane widths from the lanes' right edge, are open."""
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
    # A vehicle that reports every 3 s drove between its fixes, too.
    fixes = np.isfinite(table.offsets)
    known = np.logical_or.accumulate(fixes, axis=1) & np.logical_or.accumulate(fixes[:, ::-1], axis=1)[:, ::-1]
    trusted = weights * ~_mistaken(levels, known)
    chance = np.ones((levels.n_lanes, len(table.stations)))
    mistaken = min(float(ndtr(-levels.width / 2 / levels.spread)), MOST_MISTAKEN)
    for lane in range(levels.n_lanes):
        there = known & (np.abs(levels.lanes - lane) < IN_LANE)
        users = trusted @ there
        idle = np.flatnonzero(users <= mistaken * (trusted @ known))
        for stretch in np.split(idle, np.flatnonzero(np.diff(idle) > 1) + 1):
            if len(stretch) * STATION_SPACING_M < SHORTEST_CLOSED_M:
                continue
            odds = _closed_odds(stretch, there, known, trusted, n_lanes=levels.n_lanes)
            if lane in levels.interior and stretch[0] < levels.opens and stretch[-1] >= levels.closes:
                odds = np.inf
            chance[lane, stretch] = 1 / (1 + odds)
    # Where every lane is open anyhow, nobody's way between them adds to it.
    swept = _swept(levels, trusted, known, reach=half_vehicle_m + SCATTER_M) if (chance < 1.0).any() else np.zeros((1, 1))
    return LaneUse(stations=table.stations, open_chance=chance, swept=swept)


def _mistaken(levels: LaneLevels, known: BoolArray) -> BoolArray:
    """Traces (n,) that seem to drive all through an interior closed lane: their level is another one."""
    inside = np.isin(np.rint(levels.lanes), levels.interior) & known
    core = slice(levels.closes, levels.opens)
    return np.asarray(inside[:, core].sum(axis=1) > 0.5 * np.maximum(known[:, core].sum(axis=1), 1))


def _closed_odds(stretch: np.ndarray, there: BoolArray, known: BoolArray, weights: FloatArray, *, n_lanes: int) -> float:
    """Odds that a lane is closed somewhere along an idle stretch (indices of stations), others having passed it."""
    n = float((weights[:, None] * known[:, stretch]).sum(axis=0).mean())
    length = len(stretch) * STATION_SPACING_M
    prior = PRIOR_ODDS * float(ndtr(np.log(length / CLOSED_M) / CLOSED_SPREAD))
    others = SHARE_COUNT * max(n_lanes - 1, 1)
    log_nobody_if_open = betaln(SHARE_COUNT, others + n) - betaln(SHARE_COUNT, others)
    return float(prior * np.exp(_leavers(stretch, there, weights) - log_nobody_if_open))


def _leavers(stretch: np.ndarray, there: BoolArray, weights: FloatArray) -> float:
    """Log likelihood ratio, closed against open, of the vehicles that were in the lane ahead of the stretch."""
    ahead = there[:, : stretch[0]]
    was_there = ahead.any(axis=1)
    if not was_there.any():
        return 0.0
    last = ahead.shape[1] - 1 - np.argmax(ahead[was_there][:, ::-1], axis=1)
    distance = (stretch[0] - 1 - last) * STATION_SPACING_M
    gain = np.maximum(np.log(DISCRETION_M / MERGE_AHEAD_M) - distance / MERGE_AHEAD_M, 0.0)
    first = int(np.argmin(distance))  # the closure is put where this one left: that place is no coincidence
    gain[first] = np.log(DISCRETION_M / ZONE_M)
    return float(weights[was_there] @ gain)


def _swept(levels: LaneLevels, weights: FloatArray, known: BoolArray, *, reach: float) -> FloatArray:
    """Chance (stations, bins) that vehicles on their way between two lanes swept a place."""
    place = np.arange(0.5 * BIN_LANES, levels.n_lanes, BIN_LANES) - 0.5  # in lanes, 0 the middle of the rightmost one
    swept = np.zeros((levels.lanes.shape[1], len(place)))
    near = np.abs(levels.lanes - np.rint(levels.lanes)) > 1e-9
    for trace in np.flatnonzero(near.any(axis=1) & (weights > 0)):
        beside = np.convolve(near[trace], [1, 1, 1], mode="same") > 0
        for at in np.flatnonzero(beside & known[trace]):
            room = (reach - levels.width * np.abs(place - levels.lanes[trace, at])) / BLUR_M
            swept[at] = np.maximum(swept[at], min(weights[trace], 1.0) * ndtr(room))
    return swept
