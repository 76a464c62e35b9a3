"""Breakdown of a bottleneck and its queue discharge, from counts and speeds per minute.

Terms of the Highway Capacity Manual: capacity is the highest 15-minute flow up to the breakdown, queue discharge is the mean
flow while a queue waits upstream, the drop is the share of the capacity that is lost.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wzsumo.errors import InputError
from wzsumo.frames import BoolArray, FloatArray

# A breakdown: 5 minutes with a mean speed below 60 % of the free speed, then 10 minutes with one below half of it. The shares
# and times are set on our simulated traffic (analysis/traffic/discharge_runs.py): with 70 % instead of half, ten slow minutes
# without a standing queue count as a breakdown, and the demand that passes after them as discharge.
BREAKDOWN_SPEED_SHARE = 0.6  # of the free speed
QUEUED_SPEED_SHARE = 0.5  # of the free speed; slower vehicles queue. HCM: free flow is above 75 %
BREAKDOWN_MIN, QUEUED_MIN = 5, 10
SETTLING_MIN = 8  # from the breakdown to the steady discharge of a queue; set on our simulated traffic
CAPACITY_MIN = 15  # HCM 7: capacity is a 15-minute flow
MIN_DISCHARGE_MIN = 10  # a mean over fewer minutes is not given as a discharge; chosen by us


@dataclass(frozen=True, kw_only=True)
class Discharge:
    """Flows of a bottleneck per hour; NaN where the series is too short or there was no breakdown."""

    breakdown_min: float  # minutes from the start of the series
    peak_flow_per_h: float  # highest 15-minute flow; where there was a breakdown, that before it, the capacity
    queue_discharge_per_h: float
    n_discharge_min: int  # number of minutes over which the discharge is averaged

    @property
    def drop(self) -> float:
        """Share of the capacity that is lost while a queue stands; NaN where none stands."""
        return 1 - self.queue_discharge_per_h / self.peak_flow_per_h


def bottleneck_discharge(counts: npt.ArrayLike, upstream_speed: npt.ArrayLike, *, free_speed: float) -> Discharge:
    """Breakdown and discharge from counts (n,) [1/min] in the bottleneck and mean speeds (n,) [m/s] a few hundred metres ahead.

    The speed of a minute without a vehicle is NaN and counts as free.
    """
    count, speed = np.asarray(counts, dtype=float), np.asarray(upstream_speed, dtype=float)
    if count.shape != speed.shape or count.ndim != 1:
        raise InputError(f"counts {count.shape} and speeds {speed.shape} must be two series of the same minutes")
    speed_share = np.where(np.isnan(speed), free_speed, speed) / free_speed
    breakdown = _breakdown_minute(speed_share)
    if breakdown is None:
        return Discharge(
            breakdown_min=np.nan, peak_flow_per_h=_highest_flow(count), queue_discharge_per_h=np.nan, n_discharge_min=0
        )
    discharge = count[_queue_has_stood(speed_share) & (np.arange(len(count)) >= breakdown + SETTLING_MIN)]
    long_enough = len(discharge) >= MIN_DISCHARGE_MIN
    return Discharge(
        breakdown_min=float(breakdown),
        peak_flow_per_h=_highest_flow(count[:breakdown]),
        queue_discharge_per_h=float(60 * discharge.mean()) if long_enough else np.nan,
        n_discharge_min=len(discharge) if long_enough else 0,
    )


def _breakdown_minute(speed_share: FloatArray) -> int | None:
    """First slow minute of the first 5 minutes that are slow on average and are followed by 10 minutes of queue."""
    window = BREAKDOWN_MIN + QUEUED_MIN
    for first in range(len(speed_share) - window + 1):
        slow, after = speed_share[first : first + BREAKDOWN_MIN], speed_share[first + BREAKDOWN_MIN : first + window]
        if slow.mean() < BREAKDOWN_SPEED_SHARE and after.mean() < QUEUED_SPEED_SHARE:
            return first + int(np.argmax(slow < BREAKDOWN_SPEED_SHARE))
    return None


def _queue_has_stood(speed_share: FloatArray) -> BoolArray:
    """Whether the mean of the 8 minutes before each minute is below half the free speed."""
    stood = np.zeros(len(speed_share), dtype=bool)
    if len(speed_share) > SETTLING_MIN:
        means = np.convolve(speed_share, np.full(SETTLING_MIN, 1 / SETTLING_MIN), mode="valid")
        stood[SETTLING_MIN:] = means[:-1] < QUEUED_SPEED_SHARE
    return stood


def _highest_flow(count: FloatArray) -> float:
    """Highest flow [1/h] of any 15 minutes; NaN where there are fewer."""
    if len(count) < CAPACITY_MIN:
        return float("nan")
    totals = np.convolve(count, np.ones(CAPACITY_MIN), mode="valid")
    return float(totals.max() * 60 / CAPACITY_MIN)
