"""What a map is still worth: ground whose last witnesses are old becomes uncertain."""

from dataclasses import dataclass, replace

import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.lane_map import LaneMap
from wzsumo.live.ground import Ground

HALF_LIFE_S = 24 * 3600.0  # of what is known of a place: crews move zones from day to day. Chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class Witnesses:
    """When each lane was last driven (L, m) [s], and when anybody passed (m,) [s]."""

    driven_s: FloatArray
    passed_s: FloatArray


def first_witnesses(ground: Ground) -> Witnesses:
    """Nobody since the map was made."""
    m = len(ground.cells)
    made = ground.lanes.last_time_s
    return Witnesses(driven_s=np.full((ground.n_lanes, m), made), passed_s=np.full(m, made))


def with_witness(witnesses: Witnesses, in_lane: FloatArray, now_s: float) -> Witnesses:
    """After a trace that drove in lanes with chances (L, m)."""
    passed = in_lane.sum(axis=0) > 0.05
    return Witnesses(
        driven_s=np.where(in_lane > 0.5, now_s, witnesses.driven_s), passed_s=np.where(passed, now_s, witnesses.passed_s)
    )


def aged_lanes(ground: Ground, witnesses: Witnesses, *, now_s: float, half_life_s: float = HALF_LIFE_S) -> LaneMap:
    """The lanes as they are known at a time [s]: p_open goes to 0.5, half of the way in each half-life without a witness.

    The witnesses of open ground are those that drove in the lane, those of closed ground all that passed it.
    """
    lanes = ground.lanes
    aged = []
    for number, lane in enumerate(lanes.lanes):
        left = [
            2.0 ** (-np.maximum(now_s - np.interp(lanes.stations, ground.cells, seen), 0.0) / half_life_s)
            for seen in (witnesses.driven_s[number], witnesses.passed_s)
        ]
        worth = np.where(lane.p_open >= 0.5, left[0][:, None], left[1][:, None])
        aged.append(replace(lane, p_open=0.5 + (lane.p_open - 0.5) * worth))
    return replace(lanes, lanes=tuple(aged))
