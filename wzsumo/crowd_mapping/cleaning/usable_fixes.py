"""Which fixes of anybody's file can be used: row by row, and within each vehicle's own trace.

Nothing is repaired silently: what is left out is named with its reason, and a table that makes no trace at all is refused.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pandas as pd

from wzsumo.errors import TraceError
from wzsumo.frames import BoolArray, FloatArray
from wzsumo.tables import TRACE_COLUMNS, check_traces, kept_rows

MAX_SPEED_MPS = 75.0  # 168 mph: no vehicle on a road
POSITION_TOLERANCE_M = 15.0  # by which two fixes may be off besides: five standard deviations of a poor receiver (3 m)
SAME_TIME_TOLERANCE_M = 2.0  # two fixes of one vehicle at one time lie no farther apart; chosen by us
# After a pause without fixes a vehicle may have come round again; it is longer than both. Chosen by us.
MIN_PAUSE_S = 60.0
MIN_PAUSE_INTERVALS = 10.0  # times the file's median interval between fixes
MIN_FIXES_PER_RUN = 5  # in the order of time before the clock jumps back, on average; a file with fewer is shuffled. By us.
MAX_UNREACHABLE_SHARE = 0.2  # of a trace's fixes; where more cannot be reached it is not one vehicle's. Chosen by us.
MIN_EXTENT_M = 1.0  # of all fixes together
Dropped = list[pd.DataFrame]  # tables with vehicle_id, n_fixes, reason


@dataclass(frozen=True, kw_only=True, eq=False)
class UsableTraces:
    """A checked trace table and what was left out of it: `dropped` has vehicle_id, n_fixes, reason."""

    traces: pd.DataFrame
    dropped: pd.DataFrame


def usable_fixes(table: pd.DataFrame, *, source: str) -> UsableTraces:
    """The traces in a table of fixes, sorted by vehicle and time; headings and speeds are not looked at.

    A vehicle that drives by again, or another one under its id, becomes a trace of its own, named id#2. Raises TraceError,
    in one line with the remedy, where columns are missing, where half of the rows or more are no fixes, and where the
    coordinates are all in one place, or of vehicles with one fix each.
    """
    numbers, dropped = _finite_rows(table, source=source)
    extent = float(np.ptp(numbers[["x_m", "y_m"]].to_numpy(), axis=0).max())
    if extent < MIN_EXTENT_M:
        raise TraceError(f"{source}: all fixes lie within {extent:.2f} m; a map needs vehicles that move, in metres")
    repeats = _repeats(numbers)
    dropped += _dropped(numbers["vehicle_id"][repeats], "repeats a fix of the same vehicle, time and place")
    traces = _split_at_pauses(_split_at_clock(kept_rows(numbers, ~repeats)))
    if traces["vehicle_id"].nunique() == len(traces):
        raise TraceError(
            f"{source}: each of {len(traces)} vehicle_ids has one fix; a trace is two fixes or more under one vehicle_id: "
            "give the fixes of one drive the same id"
        )
    lost, reasons = _unreachable(traces)
    for reason in np.unique(reasons[lost]):
        dropped += _dropped(traces["vehicle_id"][lost & (reasons == reason)], str(reason))
    if lost.all():
        raise TraceError(f"{source}: no fix is left of {len(table)}: the first trace {reasons[0]}; check vehicle_id and time_s")
    return UsableTraces(traces=check_traces(kept_rows(traces, ~lost), source=source), dropped=merge_dropped(dropped))


def merge_dropped(parts: Dropped) -> pd.DataFrame:
    """One table (vehicle_id, n_fixes, reason) of what was left out."""
    columns = ["vehicle_id", "n_fixes", "reason"]
    return pd.concat([pd.DataFrame(columns=columns), *parts], ignore_index=True) if parts else pd.DataFrame(columns=columns)


def _finite_rows(table: pd.DataFrame, *, source: str) -> tuple[pd.DataFrame, Dropped]:
    """(rows with an id and finite time and place, as numbers; the others)."""
    if any(name not in table.columns for name in TRACE_COLUMNS) or table.empty:
        check_traces(table, source=source)
    named = table["vehicle_id"].notna().to_numpy()
    ids = table["vehicle_id"].astype(str)
    columns = {name: pd.to_numeric(table[name], errors="coerce").astype(float) for name in TRACE_COLUMNS[1:]}
    finite = np.logical_and.reduce([np.isfinite(values.to_numpy()) for values in columns.values()])
    # Columns that are numbers already are shared with the table, which may hold millions of fixes.
    numbers = pd.DataFrame({"vehicle_id": ids if named.all() else ids.where(named, "(none)")} | columns, copy=False)
    if 2 * (named & finite).sum() <= len(table):
        check_traces(table[[*TRACE_COLUMNS]], source=source)  # raises, and names the first value that is none
    for name in (name for name in ("width_m", "position_sd_m") if name in table):
        values = pd.to_numeric(table[name], errors="coerce").astype(float)
        values = values.where(np.isfinite(values) & (values >= 0))
        if values.notna().any():
            numbers[name] = values.fillna(values.median())
    dropped = _dropped(numbers["vehicle_id"][named & ~finite], "time_s, x_m or y_m is no finite number")
    dropped += _dropped(numbers["vehicle_id"][~named], "vehicle_id is empty")
    return kept_rows(numbers, named & finite), dropped


def _repeats(numbers: pd.DataFrame) -> BoolArray:
    """Which rows (n,) repeat an earlier one: few share vehicle and time with another, and only these are compared."""
    code, time = pd.factorize(numbers["vehicle_id"])[0], numbers["time_s"].to_numpy()
    order = np.lexsort((time, code))
    alike = (np.diff(code[order]) == 0) & (np.diff(time[order]) == 0)
    shared = np.sort(order[np.r_[alike, False] | np.r_[False, alike]])
    repeats = np.zeros(len(numbers), dtype=bool)
    repeats[shared] = numbers.iloc[shared].duplicated([*TRACE_COLUMNS]).to_numpy()
    return repeats


def _dropped(vehicle_ids: "pd.Series[str]", reason: str) -> Dropped:
    """A row for each vehicle among the ids of fixes that are left out for one reason."""
    counts = vehicle_ids.value_counts(sort=False)
    return [pd.DataFrame({"vehicle_id": counts.index, "n_fixes": counts.to_numpy(), "reason": reason})] if len(counts) else []


def _split_at_clock(numbers: pd.DataFrame) -> pd.DataFrame:
    """Fixes by vehicle and time; runs of one id in the file that overlap in time become traces of their own."""
    code, ids = pd.factorize(numbers["vehicle_id"], sort=True)
    time = numbers["time_s"].to_numpy()
    in_file = np.argsort(code, kind="stable")
    back = np.flatnonzero((np.diff(code[in_file]) == 0) & (np.diff(time[in_file]) < 0)) + 1
    part = np.zeros(len(numbers), dtype=int)
    starts = np.searchsorted(code[in_file], np.arange(len(ids) + 1))
    for vehicle in np.unique(code[in_file][back]):
        own = slice(starts[vehicle], starts[vehicle + 1])
        cuts = back[(back > own.start) & (back < own.stop)] - own.start
        runs = np.split(in_file[own], cuts)
        spans = sorted((time[run[0]], time[run[-1]]) for run in runs)
        overlap = any(later[0] < earlier[1] for earlier, later in pairwise(spans))
        if overlap and own.stop - own.start >= MIN_FIXES_PER_RUN * len(runs):
            for number, run in enumerate(runs):
                part[run] = number
    return _named_parts(numbers, code, part, ids)


def _split_at_pauses(numbers: pd.DataFrame) -> pd.DataFrame:
    """Fixes by vehicle and time; after a long pause a trace begins again, under a name of its own."""
    code, ids = pd.factorize(numbers["vehicle_id"])
    gap, same = np.diff(numbers["time_s"].to_numpy()), np.diff(code) == 0
    usual = float(np.median(gap[same])) if same.any() else 0.0
    pauses = np.r_[False, same & (gap > max(MIN_PAUSE_S, MIN_PAUSE_INTERVALS * usual))]
    total = np.cumsum(pauses)
    first = np.r_[True, ~same]
    return _named_parts(numbers, code, total - total[first][np.cumsum(first) - 1], ids)


def _named_parts(numbers: pd.DataFrame, code: npt.NDArray[np.intp], part: npt.NDArray[np.intp], ids: pd.Index) -> pd.DataFrame:
    """Fixes sorted by vehicle, part and time; parts after a vehicle's first are named id#2, id#3 ..."""
    order = np.lexsort((numbers["time_s"].to_numpy(), part, code))
    if not part.any():
        return numbers if (np.diff(order) == 1).all() else numbers.iloc[order].reset_index(drop=True)
    names = np.array([str(id_) for id_ in ids], dtype=object)[code]
    later = part > 0
    names[later] = [f"{name}#{number + 1}" for name, number in zip(names[later], part[later], strict=True)]
    return numbers.assign(vehicle_id=names).iloc[order].reset_index(drop=True)


def _unreachable(traces: pd.DataFrame) -> tuple[BoolArray, npt.NDArray[np.object_]]:
    """(fixes that their vehicle cannot have reached, why)."""
    code, _ = pd.factorize(traces["vehicle_id"])
    time, xy = traces["time_s"].to_numpy(), traces[["x_m", "y_m"]].to_numpy()
    jumps = (np.diff(code) == 0) & _too_far(np.hypot(*np.diff(xy, axis=0).T), np.diff(time))
    lost, reasons = np.zeros(len(traces), dtype=bool), np.full(len(traces), "", dtype=object)
    starts = np.searchsorted(code, np.arange(code[-1] + 2))
    for vehicle in np.unique(code[:-1][jumps]):
        own = np.arange(starts[vehicle], starts[vehicle + 1])
        pieces = np.split(own, np.flatnonzero(jumps[own[:-1]]) + 1)
        kept = _reachable_pieces(pieces, time, xy)
        gone = np.concatenate([own[:0], *(piece for piece, keep in zip(pieces, kept, strict=True) if not keep)])
        if len(gone) > MAX_UNREACHABLE_SHARE * len(own):
            lost[own] = True
            reasons[own] = "jumps to and fro between fixes: several vehicles under one vehicle_id"
        else:
            lost[gone] = True
            reasons[gone] = f"cannot be reached from the fixes before and after at {MAX_SPEED_MPS:g} m/s"
    return lost, reasons


def _too_far(distance: FloatArray, elapsed: FloatArray) -> BoolArray:
    """Whether two fixes of one vehicle, `distance` [m] and `elapsed` [s] apart, contradict each other."""
    return np.asarray(distance > np.where(elapsed > 0, MAX_SPEED_MPS * elapsed + POSITION_TOLERANCE_M, SAME_TIME_TOLERANCE_M))


def _reachable_pieces(pieces: list[npt.NDArray[np.intp]], time: FloatArray, xy: FloatArray) -> list[bool]:
    """Which pieces of a trace belong to its longest: going outwards, each must be reachable from the last one kept."""
    main = int(np.argmax([len(piece) for piece in pieces]))
    kept = [index == main for index in range(len(pieces))]
    for outwards in (range(main + 1, len(pieces)), range(main - 1, -1, -1)):
        last = main
        for index in outwards:
            (before, after) = (pieces[last][-1], pieces[index][0]) if index > last else (pieces[index][-1], pieces[last][0])
            if not _too_far(np.hypot(*(xy[after] - xy[before])), time[after] - time[before]):
                kept[index] = True
                last = index
    return kept
