"""Breakdown of a bottleneck and what it discharges afterwards, from counts and speeds a minute.

As the Highway Capacity Manual uses the words: capacity is the highest 15-minute flow up to the breakdown, queue discharge is
the mean flow while a queue waits upstream, the drop is what lies between them.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wzsumo.errors import InputError
from wzsumo.frames import BoolArray, FloatArray

# A queue stands upstream where the speed stays down: below 60 % of the free one for 5 minutes, below half for 10 more. Where it
# falls by less, what passes is what arrives: with 70 % instead of half, 10 minutes of slow traffic counted as a breakdown and
# the 1,800 pc/h after it as discharge.
BREAKDOWN_SHARE, QUEUED_SHARE = 0.6, 0.5
BREAKDOWN_MIN, QUEUED_MIN = 5, 10
SETTLING_MIN = 8  # from breakdown to the steady discharge of a queue
CAPACITY_MIN = 15  # HCM 7: capacity is a 15-minute flow
LEAST_DISCHARGE_MIN = 10


@dataclass(frozen=True, kw_only=True)
class Discharge:
    """Flows of a bottleneck in the unit of its counts an hour; NaN where the series is too short or nothing broke down."""

    breakdown_min: float  # minutes from the start of the series
    peak_flow_per_h: float  # highest 15-minute flow, up to the breakdown if there was one: then it is the capacity
    queue_discharge_per_h: float
    n_discharge_min: int  # minutes behind the mean

    @property
    def drop(self) -> float:
        """Share of the capacity that is lost once the queue stands, NaN where none does."""
        return 1 - self.queue_discharge_per_h / self.peak_flow_per_h


def bottleneck_discharge(
    counts: npt.ArrayLike, upstream_speed: npt.ArrayLike, *, free_speed: float, last_min: float = np.inf
) -> Discharge:
    """Breakdown and discharge from counts (n,) [1/min] in the bottleneck and mean speeds (n,) [m/s] a few hundred metres ahead.

    A minute without a vehicle has the speed NaN and counts as free. Minutes from `last_min` on are left out.
    """
    count, speed = np.asarray(counts, dtype=float), np.asarray(upstream_speed, dtype=float)
    if count.shape != speed.shape or count.ndim != 1:
        raise InputError(f"counts {count.shape} and speeds {speed.shape} must be two series of the same minutes")
    end = int(min(len(count), last_min))
    count, slow = count[:end], np.where(np.isnan(speed), free_speed, speed)[:end] / free_speed
    breakdown = _breakdown(slow)
    if breakdown is None:
        return Discharge(
            breakdown_min=np.nan, peak_flow_per_h=_highest_flow(count), queue_discharge_per_h=np.nan, n_discharge_min=0
        )
    discharge = count[_queue_has_stood(slow) & (np.arange(len(count)) >= breakdown + SETTLING_MIN)]
    long_enough = len(discharge) >= LEAST_DISCHARGE_MIN
    return Discharge(
        breakdown_min=float(breakdown),
        peak_flow_per_h=_highest_flow(count[:breakdown]),
        queue_discharge_per_h=float(60 * discharge.mean()) if long_enough else np.nan,
        n_discharge_min=len(discharge) if long_enough else 0,
    )


def _breakdown(speed_share: FloatArray) -> int | None:
    """First slow minute of the first 5 that are slow on average and that a queue of 10 more follows."""
    window = BREAKDOWN_MIN + QUEUED_MIN
    for first in range(len(speed_share) - window + 1):
        slow, after = speed_share[first : first + BREAKDOWN_MIN], speed_share[first + BREAKDOWN_MIN : first + window]
        if slow.mean() < BREAKDOWN_SHARE and after.mean() < QUEUED_SHARE:
            return first + int(np.argmax(slow < BREAKDOWN_SHARE))
    return None


def _queue_has_stood(speed_share: FloatArray) -> BoolArray:
    """Whether the mean of the 8 minutes before each minute is below half the free speed."""
    stood = np.zeros(len(speed_share), dtype=bool)
    if len(speed_share) > SETTLING_MIN:
        means = np.convolve(speed_share, np.full(SETTLING_MIN, 1 / SETTLING_MIN), mode="valid")
        stood[SETTLING_MIN:] = means[:-1] < QUEUED_SHARE
    return stood


def _highest_flow(count: FloatArray) -> float:
    if len(count) < CAPACITY_MIN:
        return float("nan")
    totals = np.convolve(count, np.ones(CAPACITY_MIN), mode="valid")
    return float(totals.max() * 60 / CAPACITY_MIN)
