"""Times in seconds, from numbers of any common unit and from dates."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray

PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
# Epoch times of the years 2001 to 2286 in each unit; times that count from a file's own start are smaller.
EPOCH_FROM_S, EPOCH_UNTIL_S = 1e9, 1e10
COUNTER_FROM = 1e11  # seconds of 3,000 years
# Forms of dates beside ISO 8601, as the US DOT work zone data collection tool and spreadsheets write them.
OTHER_FORMS = ("%Y/%m/%d-%H:%M:%S:%f", "%m/%d/%Y %I:%M:%S %p", "%m/%d/%Y %H:%M:%S", "%m/%d/%Y %H:%M", "%Y/%m/%d %H:%M:%S")


@dataclass(frozen=True, kw_only=True, eq=False)
class Times:
    """Seconds (n,), not finite where a row has no time; `utc`: they count from 1970-01-01 UTC. `said` tells what was taken."""

    seconds: FloatArray
    utc: bool
    said: tuple[str, ...] = ()


def times_of(column: "pd.Series[Any]", *, unit: str | None, source: str) -> Times | None:
    """Seconds of a column of times; None where it holds neither numbers nor dates. A unit that is given is taken."""
    if unit is not None and unit not in (*PER_SECOND, "utc"):
        raise TraceError(f"{source}: {column.name}: {unit} is no unit of time; known: {', '.join(PER_SECOND)}")
    numbers = _numbers(column)
    if numbers is not None:
        return _times_of_numbers(numbers, name=str(column.name), unit=None if unit == "utc" else unit)
    dates, form = _dates(column)
    if dates is None:
        return None
    naive = dates.dt.tz is None
    stamps = (dates.dt.tz_localize("UTC") if naive else dates.dt.tz_convert("UTC")).dt.tz_localize(None)
    seconds = stamps.to_numpy().astype("datetime64[ns]").astype(np.int64) / 1e9
    seconds[stamps.isna().to_numpy()] = np.nan
    said = [f"{column.name} is read as dates{form}, in seconds since 1970-01-01 UTC"]
    if naive and unit != "utc":
        said.append(f"{column.name} names no time zone: taken as UTC")
    return Times(seconds=seconds, utc=True, said=tuple(said))


def _numbers(column: "pd.Series[Any]") -> FloatArray | None:
    """The column as numbers; None where it holds dates, or more words than numbers."""
    if column.dtype.kind in "iuf":
        return np.asarray(column, dtype=np.float64)
    if column.dtype.kind == "M" or isinstance(column.dtype, pd.DatetimeTZDtype):
        return None
    numbers = pd.to_numeric(column, errors="coerce").to_numpy(dtype=np.float64)
    return np.asarray(numbers) if 2 * np.isfinite(numbers).sum() > len(numbers) else None


def _times_of_numbers(numbers: FloatArray, *, name: str, unit: str | None) -> Times:
    finite = numbers[np.isfinite(numbers)]
    size = float(np.median(np.abs(finite))) if finite.size else 0.0
    fitting = [key for key, per_second in PER_SECOND.items() if EPOCH_FROM_S <= size / per_second < EPOCH_UNTIL_S]
    # A number of the size of a date in another unit is in that unit, whatever its column is called: it is no year 58000.
    # One that is too large for seconds of any epoch counts finer units from some day of its own, as Gentime from 2004-01-01.
    counter = None if size < COUNTER_FROM else "us" if size >= 100 * COUNTER_FROM else "ms"
    taken = fitting[0] if fitting else unit or counter or "s"
    said: tuple[str, ...] = ()
    if fitting and taken != (unit or "s"):
        said = (f"{name} holds epoch times of the size of {taken}, as of {_date(size / PER_SECOND[taken])}: read as {taken}",)
    elif taken != (unit or "s"):
        said = (f"{name} holds numbers of the size of {size:.2g}: read as {taken} since a day that is not said",)
    return Times(seconds=numbers / PER_SECOND[taken], utc=bool(fitting), said=said)


def _date(seconds: float) -> str:
    return str(np.datetime64(int(seconds), "s"))[:10]


def _dates(column: "pd.Series[Any]") -> tuple["pd.Series[pd.Timestamp] | None", str]:
    if column.dtype.kind == "M" or isinstance(column.dtype, pd.DatetimeTZDtype):
        return column, ""
    for form in ("ISO8601", *OTHER_FORMS):
        dates = _parsed(column, form)
        if 2 * int(dates.notna().sum()) > len(dates):
            return dates, "" if form == "ISO8601" else f" of the form {form}"
    return None, ""


def _parsed(column: "pd.Series[Any]", form: str) -> "pd.Series[pd.Timestamp]":
    """Dates of one form, NaT where a row has another one; dates with different offsets come in UTC."""
    text = column.astype("str")
    zoned = bool(text.head(100).str.contains(r"(?:Z|[+-]\d\d:?\d\d)\s*$", regex=True).any()) and form == "ISO8601"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return pd.to_datetime(text, format=form, errors="coerce", utc=zoned)
