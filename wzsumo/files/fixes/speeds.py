"""How fast vehicles move from fix to fix: what units of coordinates and times can be told by."""

from dataclasses import dataclass

import numpy as np

from wzsumo.frames import FloatArray, IntArray

THINNED_TO_S = 3.0  # between the fixes that are compared: positioning errors of 1 m are then 0.5 m/s. Chosen by us
MAX_STEP = 20.0  # times the median step, in the same unit: longer ones are pauses between drives. Chosen by us
MIN_MOVING_MPS = 3.0  # reported speeds below are not compared: standing traffic jumps about. Chosen by us
MAX_USUAL_MPS = 45.0  # 100 mph, above the fastest posted speed of 85 mph: no traffic's upper quartile
SPEED_UNITS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704, "kn": 0.514444, "ft/s": 0.3048}  # [m/s]
UNIT_TOLERANCE = 0.12  # relative, of the ratio of two speeds; mph and knots are 0.15 apart. Chosen by us


@dataclass(frozen=True, kw_only=True, eq=False)
class Steps:
    """Pairs of fixes of one vehicle, some seconds apart: rows `first` and `last` (k,), `elapsed` (k,) in the times' unit.

    `vehicle` (k,) is its number.
    """

    vehicle: IntArray
    first: IntArray
    last: IntArray
    elapsed: FloatArray

    def speeds(self, points: FloatArray) -> FloatArray:
        """Distance over time (k,) between the points (n, 2) of the two fixes."""
        return np.asarray(np.hypot(*(points[self.last] - points[self.first]).T) / self.elapsed)

    def usual_speed(self, points: FloatArray) -> float:
        """Upper quartile of the speeds: that of traffic in motion; nan without steps."""
        speeds = self.speeds(points)
        speeds = speeds[np.isfinite(speeds)]
        return float(np.quantile(speeds, 0.75)) if speeds.size else float("nan")

    def advance_share(self, points: FloatArray) -> float:
        """Median over vehicles of the way that they got on over the way that they went: 1 straight on, near 0 to and fro."""
        way = np.nan_to_num(points[self.last] - points[self.first])
        of_vehicle = np.unique(self.vehicle, return_inverse=True)[1]
        got_on = np.hypot(*(np.bincount(of_vehicle, weights=part) for part in way.T))
        went = np.bincount(of_vehicle, weights=np.hypot(*way.T))
        return float(np.median(got_on / np.maximum(went, 1e-9))) if len(way) else 0.0

    def ratio_to(self, reported: FloatArray, points: FloatArray) -> float:
        """Median of speed over distance to reported speed (n,) of vehicles that move; nan where too few report."""
        mean = (reported[self.first] + reported[self.last]) / 2
        ratio = (self.speeds(points) / np.where(mean >= MIN_MOVING_MPS, mean, np.nan))[np.isfinite(mean)]
        ratio = ratio[np.isfinite(ratio)]
        return float(np.median(ratio)) if len(ratio) >= 5 else float("nan")


def steps_between(codes: IntArray, times: FloatArray, *, apart: float = THINNED_TO_S) -> Steps:
    """The steps of vehicles (n,) by number at times (n,), between fixes at least about `apart` from each other."""
    rows = np.flatnonzero(np.isfinite(times) & (codes >= 0))
    rows = rows[np.lexsort((times[rows], codes[rows]))]
    if not rows.size:
        return Steps(vehicle=rows, first=rows, last=rows, elapsed=np.zeros(0))
    begins = np.r_[True, np.diff(codes[rows]) != 0]
    start = times[rows][begins][np.cumsum(begins) - 1]
    bucket = np.floor((times[rows] - start) / apart)
    kept = rows[begins | np.r_[True, np.diff(bucket) > 0]]
    same = np.diff(codes[kept]) == 0
    elapsed = np.diff(times[kept])[same]
    first, last = kept[:-1][same], kept[1:][same]
    if not elapsed.size:
        return Steps(vehicle=kept[:0], first=kept[:0], last=kept[:0], elapsed=elapsed)
    moving = (elapsed > 0) & (elapsed < MAX_STEP * np.median(elapsed))
    return Steps(vehicle=codes[first[moving]], first=first[moving], last=last[moving], elapsed=elapsed[moving])


def unit_of_ratio(ratio: float) -> str | None:
    """The unit of reported speeds, of which distance over time [m/s] is `ratio` times as many; None where none fits."""
    if not ratio > 0:
        return None
    unit = min(SPEED_UNITS, key=lambda unit: abs(np.log(ratio / SPEED_UNITS[unit])))
    return unit if abs(np.log(ratio / SPEED_UNITS[unit])) < UNIT_TOLERANCE else None
