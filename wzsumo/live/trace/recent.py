"""The last traces, as far as a stretch needs them to be mapped again."""

from dataclasses import dataclass, replace

import numba
import numpy as np

from wzsumo.frames import FloatArray
from wzsumo.live.trace.decoding import Places

KEPT = 64  # traces


@dataclass(frozen=True, kw_only=True, eq=False)
class RecentTrace:
    """Trace `number`: offsets (m,) [m] from the lanes it drove in, nan where unknown; chances (L, m) of its lanes.

    `noise` and `walk` [m^2] are the variances of its offsets that are new in each cell, and that add up from cell to cell.
    """

    number: int
    start_s: float
    end_s: float
    residual: FloatArray
    in_lane: FloatArray
    noise: float
    walk: float


Recent = tuple[RecentTrace, ...]


def with_recent(recent: Recent, trace: RecentTrace) -> Recent:
    """The last traces after one more."""
    return (*recent[-(KEPT - 1) :], trace)


def since(recent: Recent, number: int) -> Recent:
    """The traces behind trace `number`."""
    return tuple(trace for trace in recent if trace.number > number)


def moved(recent: Recent, profile: FloatArray, *, lane: int | None) -> Recent:
    """The traces as seen from lanes that were moved by a profile (m,) [m]; of one lane only, its users."""
    if lane is None:
        return tuple(replace(trace, residual=trace.residual - profile) for trace in recent)
    return tuple(
        replace(trace, residual=np.where(trace.in_lane[lane] > 0.5, trace.residual - profile, trace.residual))
        for trace in recent
    )


@numba.njit(cache=True, nogil=True)
def lane_shares(places: Places, weights: FloatArray, n_lanes: int) -> FloatArray:
    """Chances (L, m) of having been in each lane."""
    shares = np.zeros((n_lanes, places.shape[1]))
    for i in range(places.shape[0]):
        for t in range(places.shape[1]):
            place = places[i, t]
            if place >= 0:
                lane = (place + 1) // 3
                if abs(place - 3 * lane) <= 1:
                    shares[lane, t] += weights[i]
    return shares
