"""Times in seconds, from numbers of any common unit and from dates."""

import re
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
MAX_NUMBER = 1e20  # nanoseconds since 1970 are 1.8e18; the square of a larger number tells nothing
COUNTER_FROM = 1e11  # seconds of 3,000 years
# Forms of dates beside ISO 8601, as the US DOT work zone data collection tool, spreadsheets and databases write them. Of two
# that read as many dates the first is taken: the month before the day, where no number is above 12.
OTHER_FORMS = (
    "%Y/%m/%d-%H:%M:%S:%f", "%m/%d/%Y %I:%M:%S %p", "%m/%d/%Y %I:%M %p", "%m/%d/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S.%f",
    "%m/%d/%Y %H:%M", "%Y/%m/%d %H:%M:%S", "%Y/%m/%d %H:%M:%S.%f", "%d/%m/%Y %H:%M:%S", "%d/%m/%Y %H:%M", "%d.%m.%Y %H:%M:%S",
    "%d.%m.%Y %H:%M:%S.%f", "%d-%b-%Y %H:%M:%S", "%d %b %Y %H:%M:%S",
)  # fmt: skip
CLOCK = re.compile(r"\s*\d{1,2}:\d\d(:\d\d([.,]\d+)?)?(\s*[AaPp][Mm])?\s*")  # a time of day without a date
LOOKED_AT = 1000  # dates of a column by which its form is told


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
    if are_clock_times(column):
        seconds = _since_midnight(column).dt.total_seconds()
        return Times(
            seconds=np.asarray(seconds, dtype=np.float64),
            utc=False,
            said=(f"{column.name} is read as the time of one day that is not said",),
        )
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


def numbers_of(column: "pd.Series[Any]") -> FloatArray:
    """The column as numbers (n,), not a number where it holds something else, or what measures nothing on a road."""
    if column.dtype.kind == "f":
        values = column.to_numpy(dtype=np.float64)
    else:
        values = pd.to_numeric(column, errors="coerce").to_numpy(dtype=np.float64)
    return np.where(np.abs(values) < MAX_NUMBER, values, np.nan)


def _numbers(column: "pd.Series[Any]") -> FloatArray | None:
    """The column as numbers; None where it holds dates, or more words than numbers."""
    if column.dtype.kind == "M" or isinstance(column.dtype, pd.DatetimeTZDtype):
        return None
    numbers = numbers_of(column)
    return numbers if column.dtype.kind in "iuf" or 2 * np.isfinite(numbers).sum() > len(numbers) else None


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


def are_clock_times(column: "pd.Series[Any]") -> bool:
    """Whether a column holds times of day without a date."""
    if column.dtype.kind in "iufM" or isinstance(column.dtype, pd.DatetimeTZDtype):
        return False
    words = _sample(column.dropna()).astype("str")
    return bool(len(words)) and 2 * int(words.str.fullmatch(CLOCK).sum()) > len(words)


def with_date(clock: "pd.Series[Any]", date: "pd.Series[Any]") -> "pd.Series[Any]":
    """A column of dates with times, of a column of times of day and one of dates, under both their names."""
    joined: pd.Series[Any] = date.astype("str").str.strip() + " " + clock.astype("str").str.strip()
    return joined.rename(f"{date.name} and {clock.name}")


def _since_midnight(column: "pd.Series[Any]") -> "pd.Series[Any]":
    """Durations since midnight."""
    text = "2000-01-01 " + column.astype("str").str.strip().str.replace(",", ".", regex=False)
    half_days = bool(_sample(text).str.contains(r"[AaPp][Mm]$", regex=True).any())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        stamps = pd.to_datetime(text, format="mixed" if half_days else "ISO8601", errors="coerce")
    return stamps - pd.Timestamp("2000-01-01")


def _dates(column: "pd.Series[Any]") -> tuple["pd.Series[pd.Timestamp] | None", str]:
    if column.dtype.kind == "M" or isinstance(column.dtype, pd.DatetimeTZDtype):
        return column, ""
    some = _sample(column)
    read = {form: int(_parsed(some, form).notna().sum()) for form in ("ISO8601", *OTHER_FORMS)}
    form = max(read, key=read.__getitem__)
    dates = _parsed(column, form) if read[form] else None
    if dates is None or 2 * int(dates.notna().sum()) <= len(dates):
        return None, ""
    return dates, "" if form == "ISO8601" else f" of the form {form}"


def _sample(column: "pd.Series[Any]") -> "pd.Series[Any]":
    return column.iloc[:: max(1, len(column) // LOOKED_AT)]


def _parsed(column: "pd.Series[Any]", form: str) -> "pd.Series[pd.Timestamp]":
    """Dates of one form, NaT where a row has another one; dates with different offsets come in UTC."""
    text = column.astype("str")
    if text.head(100).str.contains(r"\s(?:UTC|GMT)\s*$", regex=True).any():
        text = text.str.replace(r"\s(?:UTC|GMT)\s*$", "Z" if form == "ISO8601" else "", regex=True)
    zoned = bool(text.head(100).str.contains(r"(?:Z|[+-]\d\d:?\d\d)\s*$", regex=True).any()) and form == "ISO8601"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return pd.to_datetime(text, format=form, errors="coerce", utc=zoned)
