"""Whether the traffic of a run locked: a vehicle that stands and never drives on, whatever the cause.

A queue that discharges moves: in stop-and-go traffic behind a closure a vehicle stands for seconds, not minutes. Where both
directions take turns on one lane a vehicle waits for the other direction's green and until the lane is clear, twice.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from wzsumo.work_zone import WorkZoneLayout

STANDING_MPS = 0.1  # below it a vehicle stands; SUMO's own limit for waiting time
LOCKED_S = 180.0  # a vehicle that stands for longer is locked in; chosen by us
CLEARING_SPEED_MPS = 10.0  # at which a shared lane is cleared, twice in a cycle of its signal (see simulation/turns)


@dataclass(frozen=True, kw_only=True)
class Lock:
    """Where and when the traffic of a run locked."""

    began_s: float  # when the first vehicle that never drove on came to a stand
    station_m: float  # where it stands


def find_lock(traces: pd.DataFrame, stations: np.ndarray, layout: WorkZoneLayout) -> Lock | None:
    """The first lock of a run; None where no vehicle stood for longer than LOCKED_S.

    `traces` are sorted by vehicle and time; `stations` (n,) [m] are those of its rows.
    """
    shared = layout.taking_turns
    patience = LOCKED_S + (2 * (shared.end - shared.start) / CLEARING_SPEED_MPS if shared else 0.0)
    ids, time = traces["vehicle_id"].to_numpy(), traces["time_s"].to_numpy()
    stands = traces["speed_mps"].to_numpy() < STANDING_MPS
    begins = stands & np.concatenate([[True], ~stands[:-1] | (ids[1:] != ids[:-1])])
    ends = stands & np.concatenate([~stands[1:] | (ids[1:] != ids[:-1]), [True]])
    first, last = np.flatnonzero(begins), np.flatnonzero(ends)
    too_long = time[last] - time[first] > patience
    if not too_long.any():
        return None
    row = first[too_long][np.argmin(time[first[too_long]])]
    return Lock(began_s=float(time[row]), station_m=float(stations[row]))
