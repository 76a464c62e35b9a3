"""StationTable: lateral offsets of traces at common stations of an axis; and the speed of the traffic that left them."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from wzsumo.errors import TraceError
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.road import Road

STATION_SPACING_M = 10.0  # chosen by us: a lane change takes 50 m and more, a kink is found to about half of this
# The first and last of every thousand fixes may be wild: stations begin and end beside the others.
END_QUANTILES = (0.001, 0.999)
MIN_STATIONS = 3  # with fewer a trace has a level but no course
MIN_PROGRESS_M = 30.0  # a vehicle that advances by less is parked, or crosses the road; chosen by us
MAX_OFFSET_M = 15.0  # of a trace's median offset from that of the others: four lanes
MAX_FIX_OFFSET_M = 150.0  # of a fix from the median of all; what lies farther off counts in no station
SPEED_INTERVAL_S = 3.0  # over some seconds the noise of positions adds little to the speed between them; chosen by us
MIN_MOVING_MPS = 3.0  # a vehicle whose 85th-percentile speed is lower says nothing about free speeds; chosen by us
DEFAULT_SPEED_MPS = 26.8  # 60 mph, where no vehicle moves


@dataclass(frozen=True, kw_only=True, eq=False)
class StationTable:
    """`offsets` (traces, stations) [m]: mean lateral offset of a trace's fixes around each station, NaN where it has none.

    `dropped` lists the traces that cannot be used: vehicle_id, reason.
    """

    stations: FloatArray
    offsets: FloatArray
    vehicle_ids: tuple[str, ...]
    dropped: pd.DataFrame

    def without(self, left_out: BoolArray, *, reason: str) -> "StationTable":
        """The table without some of its traces (traces,), which are named among the dropped ones."""
        ids = np.array(self.vehicle_ids, dtype=object)
        named = pd.DataFrame({"vehicle_id": ids[left_out], "reason": reason})
        dropped = pd.concat([self.dropped, named], ignore_index=True)
        return replace(self, offsets=self.offsets[~left_out], vehicle_ids=tuple(ids[~left_out]), dropped=dropped)


def tabulate(traces: pd.DataFrame, axis: Road, *, stations: FloatArray | None = None) -> StationTable:
    """Offsets of a checked trace table at stations [m] of an axis; equally spaced ones over all fixes where none are given.

    Traces that stand, run against the others, lie far beside them or have too few fixes are left out and named.
    Raises TraceError where none is left.
    """
    s, d = axis.to_sd(np.column_stack([traces["x_m"], traces["y_m"]]))
    if stations is None:
        low, high = np.quantile(s, END_QUANTILES)
        stations = np.arange(low, high + STATION_SPACING_M, STATION_SPACING_M)
    code, ids = pd.factorize(traces["vehicle_id"])
    first = np.flatnonzero(np.diff(code, prepend=-1))  # a checked table is sorted by vehicle and time
    progress = s[np.append(first[1:], len(s)) - 1] - s[first]
    along = (progress > -MIN_PROGRESS_M)[code]  # those that run against the others may be on the other carriageway
    middle = np.median(d[along]) if along.any() else np.median(d)
    cell = np.floor((s - stations[0]) / STATION_SPACING_M + 0.5).astype(int)
    inside = (cell >= 0) & (cell < len(stations)) & (np.abs(d - middle) < MAX_FIX_OFFSET_M)
    flat = code[inside] * len(stations) + cell[inside]
    size = len(ids) * len(stations)
    count = np.bincount(flat, minlength=size)
    with np.errstate(invalid="ignore"):
        offsets = (np.bincount(flat, weights=d[inside], minlength=size) / count).reshape(len(ids), -1)
    reasons = _reasons_to_drop(offsets, progress=progress)
    kept = [i for i in range(len(ids)) if i not in reasons]
    dropped = pd.DataFrame({"vehicle_id": [ids[i] for i in reasons], "reason": list(reasons.values())})
    if not kept:
        raise TraceError(
            f"none of {len(ids)} traces can be used: {dropped['reason'].iloc[0]} ({dropped['vehicle_id'].iloc[0]})"
        )
    return StationTable(stations=stations, offsets=offsets[kept], vehicle_ids=tuple(str(ids[i]) for i in kept), dropped=dropped)


def percentile_85_speed(traces: pd.DataFrame) -> float:
    """85th percentile [m/s], over the vehicles that move, of the 85th-percentile speed of each on its way.

    Source: MUTCD 11th ed., Table 6B-4: S is the posted speed or the off-peak 85th-percentile speed before the work.
    """
    interval = np.floor(traces["time_s"] / SPEED_INTERVAL_S).rename("interval")
    fixes = traces.groupby(["vehicle_id", interval])[["time_s", "x_m", "y_m"]].first()
    step = fixes.groupby(level="vehicle_id").diff()
    of_vehicle = (np.hypot(step["x_m"], step["y_m"]) / step["time_s"]).groupby(level="vehicle_id").quantile(0.85)
    moving = of_vehicle[np.isfinite(of_vehicle) & (of_vehicle > MIN_MOVING_MPS)]
    return float(moving.quantile(0.85)) if len(moving) else DEFAULT_SPEED_MPS


def _reasons_to_drop(offsets: FloatArray, *, progress: FloatArray) -> dict[int, str]:
    """Why a trace, by its row, cannot be used; `progress` (traces,) [m] is how far each advances."""
    level = np.array([np.median(row[known]) if (known := np.isfinite(row)).any() else np.inf for row in offsets])
    comparable = np.isfinite(level) & (progress > -MIN_PROGRESS_M)
    middle = np.median(level[comparable]) if comparable.any() else 0.0
    reasons: dict[int, str] = {}
    for i, row in enumerate(offsets):
        if progress[i] < -MIN_PROGRESS_M:
            reasons[i] = f"runs {-progress[i]:.0f} m against the others"
        elif np.isfinite(row).sum() < MIN_STATIONS:
            reasons[i] = f"has fixes around {int(np.isfinite(row).sum())} stations, fewer than {MIN_STATIONS}"
        elif progress[i] < MIN_PROGRESS_M:
            reasons[i] = f"advances by {progress[i]:.0f} m only"
        elif abs(level[i] - middle) > MAX_OFFSET_M:
            reasons[i] = f"lies {abs(level[i] - middle):.0f} m beside the others"
    return reasons
