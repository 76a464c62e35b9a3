import numpy as np
import pandas as pd
import pytest

from wzsumo.errors import TraceError
from wzsumo.files.fixes.times import are_clock_times, times_of, with_date

NOON = 1_780_315_200.0  # 2026-06-01T12:00:00Z, by `date -ud 2026-06-01T12:00Z +%s`


@pytest.mark.parametrize(
    "given",
    [
        ["2026-06-01T12:00:00Z", "2026-06-01T12:00:01.5Z"],
        ["2026-06-01 08:00:00-04:00", "2026-06-01 08:00:01.500-04:00"],
        ["2026-06-01T12:00:00", "2026-06-01T12:00:01.5"],
        ["2026/06/01-12:00:00:00", "2026/06/01-12:00:01:50"],
        ["2026-06-01 12:00:00 UTC", "2026-06-01 12:00:01.5 UTC"],
        ["06/01/2026 12:00:00.0", "06/01/2026 12:00:01.5"],
        ["01.06.2026 12:00:00.0", "01.06.2026 12:00:01.5"],
        [NOON, NOON + 1.5],
        [1000 * NOON, 1000 * NOON + 1500],
        [1e6 * NOON, 1e6 * NOON + 1.5e6],
        [int(1e9) * int(NOON), int(1e9) * int(NOON) + 1_500_000_000],
    ],
)
def test_dates_and_epoch_times_of_any_unit_are_seconds_since_1970(given: list[object]) -> None:
    times = times_of(pd.Series(given, name="t"), unit=None, source="f")
    assert times is not None
    assert times.utc
    assert times.seconds == pytest.approx([NOON, NOON + 1.5], abs=1e-5)


def test_local_dates_on_both_sides_of_a_change_of_clocks_stay_in_order() -> None:
    times = times_of(pd.Series(["2026-11-01T01:30:00-04:00", "2026-11-01T01:30:00-05:00"], name="t"), unit=None, source="f")
    assert times is not None
    assert np.diff(times.seconds).tolist() == [3600.0]


@pytest.mark.parametrize(
    ("given", "unit", "seconds"), [([0, 1500], "ms", 1.5), ([0, 1.5], None, 1.5), ([10.0, 11.5], "s", 1.5)]
)
def test_times_of_a_file_of_its_own_clock_are_in_the_unit_of_their_column(
    given: list[float], unit: str | None, seconds: float
) -> None:
    times = times_of(pd.Series(given, name="t"), unit=unit, source="f")
    assert times is not None
    assert (times.utc, float(np.diff(times.seconds)[0])) == (False, seconds)


def test_microseconds_since_another_day_are_told_by_their_size() -> None:
    gentime = pd.Series([257_731_234_500_000, 257_731_236_000_000], name="Gentime")  # since 2004-01-01
    times = times_of(gentime, unit=None, source="f")
    assert times is not None
    assert (times.utc, float(np.diff(times.seconds)[0])) == (False, 1.5)
    assert "since a day that is not said" in times.said[0]


def test_zone_that_is_not_named_is_said() -> None:
    times = times_of(pd.Series(["2026-06-01T12:00:00"], name="t"), unit=None, source="f")
    assert times is not None
    assert any("names no time zone: taken as UTC" in word for word in times.said)


def test_day_before_month_is_told_by_the_days_that_are_no_months() -> None:
    days = [f"{day:02}/06/2026 12:00:00" for day in range(1, 21)]  # 12 of 20 could be months
    times = times_of(pd.Series(days, name="t"), unit=None, source="f")
    assert times is not None
    assert times.seconds == pytest.approx(NOON + 86_400.0 * np.arange(20))
    assert any("of the form %d/%m/%Y" in word for word in times.said)


@pytest.mark.parametrize(
    ("clock", "seconds"),
    [
        (["12:00:00", "12:00:01.5"], [43_200.0, 43_201.5]),
        (["9:05", "9:06"], [32_700.0, 32_760.0]),
        (["01:00:00 PM", "01:00:02 PM"], [46_800.0, 46_802.0]),
        (["12:00:00,0", "12:00:01,5"], [43_200.0, 43_201.5]),
    ],
)
def test_times_of_day_are_seconds_since_midnight_and_dates_beside_them_are_joined(
    clock: list[str], seconds: list[float]
) -> None:
    column = pd.Series(clock, name="clock")
    assert are_clock_times(column)
    times = times_of(column, unit=None, source="f")
    assert times is not None
    assert (times.utc, times.seconds.tolist()) == (False, seconds)
    assert "one day that is not said" in times.said[0]
    assert not are_clock_times(pd.Series([1.0, 2.0]))
    assert not are_clock_times(pd.Series(["2026-06-01T12:00:00"]))


def test_date_and_time_in_two_columns_are_one_time() -> None:
    joined = with_date(pd.Series(["12:00:00", "12:00:01.5"], name="b"), pd.Series(["2026-06-01"] * 2, name="a"))
    times = times_of(joined, unit=None, source="f")
    assert times is not None
    assert times.seconds == pytest.approx([NOON, NOON + 1.5])
    assert times.said[0].startswith("a and b is read as dates")


def test_some_bad_dates_are_no_times_and_mostly_bad_ones_no_column() -> None:
    times = times_of(pd.Series(["2026-06-01T12:00:00Z", "2026-06-01T12:00:01Z", "soon"], name="t"), unit=None, source="f")
    assert times is not None
    assert np.isnan(times.seconds).tolist() == [False, False, True]
    assert times_of(pd.Series(["a", "b"], name="t"), unit=None, source="f") is None
    with pytest.raises(TraceError, match="km is no unit of time"):
        times_of(pd.Series([1.0], name="t"), unit="km", source="f")
