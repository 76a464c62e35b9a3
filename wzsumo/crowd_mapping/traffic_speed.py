"""The speed that the traffic keeps to, as the manual takes it for tapers."""

import numpy as np
import pandas as pd

DEFAULT_SPEED_MPS = 26.8  # 60 mph, where the traces' own speeds say nothing
SPEED_SPELL_S = 3.0


def traffic_speed(traces: pd.DataFrame) -> float:
    """85th percentile [m/s] of the speeds that vehicles reach on their way (85th percentile of each).

    Source: MUTCD 11th ed., Table 6B-4: S is the posted speed or the off-peak 85th-percentile speed before the work.
    """
    # Over some seconds the positions' noise adds little to the speed between them.
    spell = np.floor(traces["time_s"] / SPEED_SPELL_S).rename("spell")
    fixes = traces.groupby(["vehicle_id", spell])[["time_s", "x_m", "y_m"]].first()
    step = fixes.groupby(level="vehicle_id").diff()
    reached = (np.hypot(step["x_m"], step["y_m"]) / step["time_s"]).groupby(level="vehicle_id").quantile(0.85)
    moving = reached[np.isfinite(reached) & (reached > 3)]
    return float(moving.quantile(0.85)) if len(moving) else DEFAULT_SPEED_MPS
