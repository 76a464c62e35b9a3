import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.crowd_mapping.cleaning.usable_fixes import UsableTraces, _repeats, usable_fixes
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray


def drive(vehicle_id: str = "a", n: int = 20, *, interval_s: float = 1.0, start_s: float = 0.0) -> pd.DataFrame:
    """n fixes of one vehicle along the x axis at 20 m/s."""
    time = start_s + interval_s * np.arange(n)
    return pd.DataFrame({"vehicle_id": vehicle_id, "time_s": time, "x_m": 20.0 * time, "y_m": 0.0})


def usable(*tables: pd.DataFrame) -> UsableTraces:
    return usable_fixes(pd.concat(tables, ignore_index=True), source="file")


def fixes_by_trace(made: UsableTraces) -> dict[str, int]:
    return {str(name): len(trace) for name, trace in made.traces.groupby("vehicle_id")}


def dropped(made: UsableTraces) -> list[tuple[str, int, str]]:
    return [(str(row["vehicle_id"]), int(row["n_fixes"]), str(row["reason"])) for _, row in made.dropped.iterrows()]


@pytest.mark.parametrize(
    ("interval_s", "distance_m", "reachable"), [(1, 89, True), (1, 91, False), (10, 764, True), (10, 766, False)]
)
def test_fix_farther_than_75_m_a_second_and_15_m_is_left_out(interval_s: float, distance_m: float, reachable: bool) -> None:
    table = drive(interval_s=interval_s)
    step = 20.0 * interval_s
    table.loc[12, "y_m"] = np.sqrt(distance_m**2 - step**2)
    made = usable(table)
    reason = "cannot be reached from the fixes before and after at 75 m/s"
    assert dropped(made) == ([] if reachable else [("a", 1, reason)])


@pytest.mark.parametrize(("apart_m", "kept"), [(1.9, 21), (2.1, 20)])
def test_fix_2_m_from_another_of_the_same_time_is_left_out(apart_m: float, kept: int) -> None:
    table = drive()
    again = table.iloc[[19]].assign(y_m=apart_m)
    assert len(usable(table, again).traces) == kept


@pytest.mark.parametrize(("n_wild", "left"), [(4, {"a": 16, "b": 20}), (5, {"b": 20})])
def test_trace_of_which_more_than_a_fifth_cannot_be_reached_is_left_out_whole(n_wild: int, left: dict[str, int]) -> None:
    table = drive()
    table.loc[2 : 2 * n_wild : 2, "y_m"] = 500.0 * np.arange(1, n_wild + 1)
    made = usable(table, drive("b"))
    assert fixes_by_trace(made) == left
    assert ("to and fro" in made.dropped["reason"].iloc[0]) == (n_wild == 5)


def test_pieces_after_a_wild_one_are_reached_from_the_longest() -> None:
    table = drive()
    table.loc[8:9, "y_m"] = 900.0
    table.loc[15:16, "y_m"] = -900.0
    assert fixes_by_trace(usable(table)) == {"a": 16}


@pytest.mark.parametrize(
    ("interval_s", "pause_s", "names"),
    [(1, 59, ["a"]), (1, 61, ["a", "a#2"]), (10, 99, ["a"]), (10, 101, ["a", "a#2"])],
)
def test_pause_of_a_minute_and_ten_intervals_begins_another_trace(interval_s: float, pause_s: float, names: list[str]) -> None:
    first = drive(interval_s=interval_s)
    second = drive(interval_s=interval_s, start_s=float(first["time_s"].iloc[-1]) + pause_s)
    assert sorted(fixes_by_trace(usable(first, second))) == names


@pytest.mark.parametrize(("n", "names"), [(5, ["a", "a#2"]), (4, ["a"])])
def test_runs_of_five_fixes_that_overlap_in_time_are_two_vehicles(n: int, names: list[str]) -> None:
    assert sorted(fixes_by_trace(usable(drive(n=n), drive(n=n, start_s=0.5)))) == names


def test_runs_of_one_vehicle_in_the_wrong_order_are_one_trace() -> None:
    table = drive()
    assert fixes_by_trace(usable(table.iloc[10:], table.iloc[:10])) == {"a": 20}


@pytest.mark.parametrize(("n_bad", "refused"), [(9, False), (10, True)])
def test_table_of_which_half_are_no_fixes_is_refused(n_bad: int, refused: bool) -> None:
    table = drive()
    table.loc[: n_bad - 1, "y_m"] = np.nan
    if refused:
        with pytest.raises(TraceError, match="y_m of row 0"):
            usable(table)
    else:
        assert dropped(usable(table)) == [("a", 9, "time_s, x_m or y_m is no finite number")]


@pytest.mark.parametrize("extent_m", [0.98, 1.02])
def test_fixes_that_extend_over_less_than_a_metre_are_refused(extent_m: float) -> None:
    table = drive(n=5).assign(x_m=np.linspace(0, extent_m, 5))
    if extent_m < 1:
        with pytest.raises(TraceError, match=r"all fixes lie within 0\.98 m"):
            usable(table)
    else:
        assert fixes_by_trace(usable(table)) == {"a": 5}


def test_widths_that_are_missing_are_the_median_of_the_others() -> None:
    table = drive().assign(width_m=[2.0] * 10 + [np.nan] * 10)
    assert usable(table).traces["width_m"].tolist() == [2.0] * 20
    assert "width_m" not in usable(drive().assign(width_m=np.nan)).traces


def test_empty_ids_and_repeated_fixes_are_named() -> None:
    table = drive()
    nameless = table.head(3).assign(vehicle_id=None)
    assert dropped(usable(table, table.head(2), nameless)) == [
        ("(none)", 3, "vehicle_id is empty"),
        ("a", 2, "repeats a fix of the same vehicle, time and place"),
    ]


def test_fixes_of_a_trace_come_sorted_by_time() -> None:
    shuffled = drive().sample(frac=1, random_state=0)
    time: FloatArray = usable(shuffled).traces["time_s"].to_numpy()
    assert (np.diff(time) > 0).all()


@given(rows=st.lists(st.tuples(st.sampled_from("ab"), *(st.sampled_from([0.0, 1.0]),) * 3), min_size=1, max_size=12))
def test_repeats_are_those_that_pandas_finds_over_all_columns(rows: list[tuple[str, float, float, float]]) -> None:
    table = pd.DataFrame(rows, columns=["vehicle_id", "time_s", "x_m", "y_m"])
    assert _repeats(table).tolist() == table.duplicated().tolist()
