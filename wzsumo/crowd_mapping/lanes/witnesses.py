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
MAX_SIGMA_M = 1.2  # of a receiver whose word counts: it is wrong by half a lane in one of eight drives
P_OPEN_WITNESSED = 0.85  # of ground that so many drove against the model: free, but not certain


def witnesses(fit: LaneFit, *, slow: BoolArray) -> BoolArray:
    """Which (traces, stations) count as witnesses: vehicles that follow lanes, do not creep, and whose receivers are good."""
    good = (fit.sigma < MAX_SIGMA_M) & (fit.stray < 0.5)
    return good[:, None] & ~slow


def misplaced_share(fit: LaneFit) -> float:
    """Share of the traces that seem to be beside the lanes, on one side, because their receivers err by half a lane."""
    shares = fit.class_share[:, :-1].mean(axis=0)
    return float((shares * ndtr(-fit.course.width / 2 / fit.receivers.sigma[:-1])).sum())


def open_where_driven(
    lanes: tuple[MappedLane, ...], fit: LaneFit, observations: Observations, *, slow: BoolArray
) -> tuple[tuple[MappedLane, ...], list[str]]:
    """The lanes, open where enough witnesses drove in one that the model has closed; and what was overruled, in words."""
    needed = MIN_WITNESSES + round(2 * misplaced_share(fit) * len(observations.ids))
    counted = witnesses(fit, slow=slow)
    opened, words = [], []
    for number, lane in enumerate(lanes):
        count = (fit.in_lane[:, :, number] * counted > 0.5).sum(axis=0)
        against = (count >= needed) & (lane.p_open_middle < 1 - FREE_THRESHOLD)
        if against.any():
            at = observations.stations[against]
            words.append(
                f"{int(count[against].max())} traces drove in lane {number} (0 = rightmost) between {at[0]:.0f} m and "
                f"{at[-1]:.0f} m, where the model has it closed: it is kept open there"
            )
        opened.append(replace(lane, p_open=np.where(against[:, None], np.maximum(lane.p_open, P_OPEN_WITNESSED), lane.p_open)))
    return tuple(opened), words


def share_of_fixes(lanes: tuple[MappedLane, ...], fit: LaneFit, observations: Observations) -> tuple[float, float]:
    """Shares of the places of usable traces in lanes that the map has free, and that it has closed (p > 0.5).

    A place is that of a trace at a station, in its likeliest lane, so that the error of its receiver does not count. Places
    beside the lanes and of vehicles that follow none are left out; they are named in the warnings.
    """
    p_occupied = 1 - np.stack([lane.p_open_middle for lane in lanes], axis=1)
    used = (observations.eta > 0) & (fit.burst < 0.5) & (fit.stray < 0.5)[:, None]
    if not used.any():
        return 0.0, 0.0
    lane = fit.in_lane.argmax(axis=2)
    p: FloatArray = p_occupied[np.arange(p_occupied.shape[0])[None, :], lane][used]
    return float((p < FREE_THRESHOLD).mean()), float((p > 0.5).mean())
