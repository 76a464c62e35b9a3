"""Columns of the tables that stages exchange, and the check of a trace table.

A trace table has one row per fix. The point (x_m, y_m) is the vehicle's CENTRE, in the world frame.
"""

import numpy as np
import pandas as pd

from wzsumo.errors import TraceError, shown
from wzsumo.frames import BoolArray, FloatArray

MAX_TRACE_M = 1e6  # over which most fixes of one vehicle spread: a day's drive; a zone is a thousandth of it
TRACE_COLUMNS = ("vehicle_id", "time_s", "x_m", "y_m")  # needed for a map
TRACE_OPTIONAL_COLUMNS = ("heading_rad", "speed_mps", "length_m", "width_m", "position_sd_m")
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
    numbers = {name: _finite(traces[name], source=source) for name in kept[1:]}
    ids = traces["vehicle_id"]
    if ids.isna().any():
        raise TraceError(f"{source}: vehicle_id is empty in row {int(np.flatnonzero(ids.isna())[0])}")
    ids = ids.astype(str)
    # Sorted by codes, since a million strings take seconds to sort.
    order = np.lexsort((numbers["time_s"], pd.factorize(ids, sort=True)[0]))
    table = pd.DataFrame({"vehicle_id": ids.array} | numbers, copy=False)
    return table if (np.diff(order) == 1).all() else table.iloc[order].reset_index(drop=True)


def kept_rows(table: pd.DataFrame, kept: BoolArray) -> pd.DataFrame:
    """The rows of a table that a mask (n,) keeps, numbered anew; where it keeps all, the table itself and not a copy."""
    return table if kept.all() else table[kept].reset_index(drop=True)


def refuse_endless_traces(traces: pd.DataFrame, *, source: str) -> None:
    """Raise TraceError where most fixes of a vehicle spread over more than MAX_TRACE_M: a line along them would have no end.

    Single fixes that lie far away do not count.
    """
    points = traces[["x_m", "y_m"]].apply(pd.to_numeric, errors="coerce").replace([np.inf, -np.inf], np.nan)
    if not len(points) or not (points.quantile(0.95) - points.quantile(0.05) > MAX_TRACE_M).any():
        return
    each = points.groupby(traces["vehicle_id"].astype(str))
    spread = (each.quantile(0.95) - each.quantile(0.05)).max(axis=1)
    if (spread > MAX_TRACE_M).any():
        vehicle, most_km = spread.idxmax(), spread.max() / 1000
        raise TraceError(
            f"{source}: the fixes of {shown(vehicle)} spread over {most_km:.0f} km; a map is of one road: see what units the "
            "coordinates have, or cut the traces to the zone"
        )


def _finite(column: pd.Series, *, source: str) -> FloatArray:
    """The numbers (n,) of a column. Raises TraceError where a value is not a finite number."""
    values = (
        column.to_numpy(dtype=float) if column.dtype.kind == "f" else pd.to_numeric(column, errors="coerce").to_numpy(float)
    )
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        first = shown(column.astype(object).iloc[bad[0]])
        raise TraceError(
            f"{source}: {column.name} of row {bad[0]} is {first}; every value must be a finite "
            f"number ({bad.size} of {len(column)} rows are not; drop or repair them)"
        )
    return np.asarray(values)


def some_vehicles(traces: pd.DataFrame, most: int) -> pd.DataFrame:
    """The rows of at most so many vehicles of a trace table, taken evenly in the order of the table."""
    code, ids = pd.factorize(traces["vehicle_id"])
    if len(ids) <= most:
        return traces
    chosen = np.zeros(len(ids), dtype=bool)
    chosen[np.linspace(0, len(ids) - 1, most).astype(int)] = True
    return traces[chosen[code]]
