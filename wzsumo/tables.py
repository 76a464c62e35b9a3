"""Columns of the tables that travel between stages, and the check of a trace table.

A trace table has one row a fix. The point (x_m, y_m) is the vehicle's CENTRE, in the world frame.
"""

import numpy as np
import pandas as pd

from wzsumo.errors import TraceError

TRACE_COLUMNS = ("vehicle_id", "time_s", "x_m", "y_m")  # enough for a map
TRACE_OPTIONAL_COLUMNS = ("heading_rad", "speed_mps", "length_m", "width_m")
EGO_LOG_COLUMNS = (
    "time_s", "x_m", "y_m", "heading_rad", "speed_mps",  # rear axle
    "steering_rad", "throttle", "brake", "cross_track_m", "s_m",
)  # fmt: skip


def check_traces(traces: pd.DataFrame, *, source: str) -> pd.DataFrame:
    """The same traces in the toolkit's column order, sorted by vehicle and time. Raises TraceError at the first fault."""
    missing = [name for name in TRACE_COLUMNS if name not in traces.columns]
    if missing:
        raise TraceError(
            f"{source}: column(s) {', '.join(missing)} missing; a trace table has {', '.join(TRACE_COLUMNS)} "
            f"(and may have {', '.join(TRACE_OPTIONAL_COLUMNS)}), given: {', '.join(map(str, traces.columns)) or 'none'}"
        )
    if traces.empty:
        raise TraceError(f"{source}: no fixes in it; a map needs at least one trace")
    kept = [name for name in (*TRACE_COLUMNS, *TRACE_OPTIONAL_COLUMNS) if name in traces.columns]
    table = traces[kept].copy()
    for name in kept[1:]:
        values = pd.to_numeric(table[name], errors="coerce").to_numpy(dtype=float)
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            value = traces[name].astype(object).iloc[bad[0]]
            raise TraceError(
                f"{source}: {name} of row {bad[0]} is {value!r}; every value must be a finite number "
                f"({bad.size} of {len(table)} rows are not; drop or repair them)"
            )
        table[name] = values
    if table["vehicle_id"].isna().any():
        raise TraceError(f"{source}: vehicle_id is empty in row {int(np.flatnonzero(table['vehicle_id'].isna())[0])}")
    table["vehicle_id"] = table["vehicle_id"].astype(str)
    # By codes: strings of a million rows take seconds to sort.
    order = np.lexsort((table["time_s"].to_numpy(), pd.factorize(table["vehicle_id"], sort=True)[0]))
    return table.iloc[order].reset_index(drop=True)
