"""A map never speaks against its own witnesses: ground that several independent traces drove is not called occupied."""

from dataclasses import replace

import numpy as np
from scipy.special import ndtr

from wzsumo.crowd_mapping.lanes.fit import LaneFit
from wzsumo.crowd_mapping.lanes.observations import Observations
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.grid import FREE_THRESHOLD
from wzsumo.lane_map import MappedLane

MIN_WITNESSES = 2  # one is not enough
MAX_SLOPE = 0.12  # of a way against the lanes: a lane change of 60 m peaks at 0.09; what is steeper is a jump of positions
HALF_OF_LANE = 0.4  # of a width to either side of its middle: a car does not straddle the line
MAX_SIGMA_M = 1.2  # of a receiver whose word counts: it is wrong by half a lane in one of eight drives
P_OPEN_WITNESSED = 0.85  # of ground that so many drove against the model: free, but not certain


def witnesses(fit: LaneFit, *, slow: BoolArray) -> BoolArray:
    """Which (traces,) count as witnesses: vehicles that follow lanes, creep nowhere, and whose receivers are good."""
    return np.asarray((fit.sigma < MAX_SIGMA_M) & (fit.stray < 0.5) & ~slow.max(axis=1))


def lanes_driven(fit: LaneFit, observations: Observations) -> FloatArray:
    """Chance (traces, stations, lanes) that a vehicle is on the ground of a lane: in the lane, or off the lanes' course there.

    A vehicle in a burst may be anywhere. Where its positions lie in a lane, its receiver is good and it came there without a
    jump, it drives there.
    """
    middle = fit.course.offset + fit.setting.base
    place = (observations.offset - middle[None, :]) / fit.course.width
    lanes = np.arange(fit.setting.n_lanes)
    there = np.abs(place[:, :, None] - lanes[None, None, :]) < HALF_OF_LANE
    believed = np.where(_begun_by_jump(fit, observations), 0.0, fit.burst * (fit.sigma < MAX_SIGMA_M)[:, None])[:, :, None]
    return np.asarray(np.where(observations.eta[:, :, None] > 0, np.minimum(fit.in_lane + believed * there, 1.0), fit.in_lane))


def _begun_by_jump(fit: LaneFit, observations: Observations) -> BoolArray:
    """Where (traces, stations) a vehicle is in a burst into which, or out of which, its positions jump aside."""
    place = observations.offset - fit.course.offset
    seen = observations.eta > 0
    step = np.abs(np.diff(place, axis=1)) > MAX_SLOPE * observations.spacing
    jumps = np.pad(step & seen[:, 1:] & seen[:, :-1], ((0, 0), (1, 1)))
    found = np.zeros(seen.shape, dtype=bool)
    for trace, burst in enumerate(fit.burst > 0.5):
        for first, last in _runs(burst):
            found[trace, first : last + 1] = jumps[trace, first : last + 2].any()
    return found


def misplaced_share(fit: LaneFit) -> float:
    """Share of the traces that seem to be beside the lanes, on one side, because their receivers err by half a lane."""
    shares = fit.class_share[:, :-1].mean(axis=0)
    return float((shares * ndtr(-fit.course.width / 2 / fit.receivers.sigma[:-1])).sum())


def open_where_driven(
    lanes: tuple[MappedLane, ...], fit: LaneFit, observations: Observations, *, slow: BoolArray
) -> tuple[tuple[MappedLane, ...], list[str]]:
    """The lanes, open where enough witnesses drove in one that the model has closed; and what was overruled, in words."""
    needed = MIN_WITNESSES + round(2 * misplaced_share(fit) * len(observations.ids))
    counted, driven = witnesses(fit, slow=slow), lanes_driven(fit, observations)
    opened, words = [], []
    for number, lane in enumerate(lanes):
        count = (driven[counted, :, number] > 0.5).sum(axis=0)
        against = (count >= needed) & (lane.p_open_middle < 1 - FREE_THRESHOLD)
        for first, last in _runs(against):
            words.append(
                f"{int(count[first : last + 1].max())} traces drove in lane {number} (0 = rightmost) between "
                f"{observations.stations[first]:.0f} m and {observations.stations[last]:.0f} m, where the model has it closed "
                "or unsure: it is kept open there"
            )
        opened.append(replace(lane, p_open=np.where(against[:, None], np.maximum(lane.p_open, P_OPEN_WITNESSED), lane.p_open)))
    return tuple(opened), words


def _runs(chosen: BoolArray) -> list[tuple[int, int]]:
    """(first, last) of each run of chosen stations."""
    ends = np.flatnonzero(np.diff(np.r_[0, chosen.astype(int), 0]))
    return [(int(first), int(end) - 1) for first, end in zip(ends[::2], ends[1::2], strict=True)]


def share_of_fixes(lanes: tuple[MappedLane, ...], fit: LaneFit, observations: Observations) -> tuple[float, float]:
    """Shares of the places of usable traces in lanes that the map has free, and that it has closed (p > 0.5).

    A place is that of a trace at a station, in its likeliest lane, so that the error of its receiver does not count. Places
    beside the lanes and of vehicles that follow none are left out; they are named in the warnings.
    """
    p_occupied = 1 - np.stack([lane.p_open_middle for lane in lanes], axis=1)
    driven = lanes_driven(fit, observations)
    used = (observations.eta > 0) & (driven.max(axis=2) > 0.5) & (fit.stray < 0.5)[:, None]
    if not used.any():
        return 0.0, 0.0
    lane = driven.argmax(axis=2)
    p: FloatArray = p_occupied[np.arange(p_occupied.shape[0])[None, :], lane][used]
    return float((p < FREE_THRESHOLD).mean()), float((p > 0.5).mean())
