import numpy as np
import pandas as pd
import pytest
from builders import straight_traces

from wzsumo.errors import TraceError
from wzsumo.tables import check_traces, kept_rows, refuse_endless_traces, some_vehicles

TRACES = straight_traces([0.0, 3.5], length_m=10)


def refusal(traces: pd.DataFrame) -> str:
    with pytest.raises(TraceError) as refused:
        check_traces(traces, source="traces.csv")
    return str(refused.value)


def test_shuffled_traces_come_back_by_vehicle_and_time() -> None:
    shuffled = TRACES.sample(frac=1, random_state=3)
    pd.testing.assert_frame_equal(check_traces(shuffled, source="traces.csv"), TRACES)


def test_checking_leaves_the_given_table_unchanged() -> None:
    given = TRACES.assign(vehicle_id=np.arange(len(TRACES)), lane=1)
    before = given.copy()
    checked = check_traces(given, source="traces.csv")
    pd.testing.assert_frame_equal(given, before)
    assert "lane" not in checked.columns
    assert all(isinstance(id_, str) for id_ in checked["vehicle_id"])


@pytest.mark.parametrize("column", ["vehicle_id", "time_s", "x_m", "y_m"])
def test_missing_column_is_refused_by_name_with_those_given(column: str) -> None:
    message = refusal(TRACES.drop(columns=column))
    assert f"traces.csv: column(s) {column} missing" in message
    assert "given: " in message


@pytest.mark.parametrize("value", [np.nan, np.inf, "north"])
@pytest.mark.parametrize("column", ["time_s", "x_m", "y_m", "speed_mps"])
def test_value_that_is_no_finite_number_is_refused_with_row_and_column(column: str, value: float | str) -> None:
    bad = TRACES.astype({column: object})
    bad.loc[4, column] = value
    message = refusal(bad)
    assert f"traces.csv: {column} of row 4 is {value!r}" in message
    assert f"1 of {len(TRACES)} rows" in message


def test_empty_vehicle_id_is_refused_with_the_row() -> None:
    bad = TRACES.astype({"vehicle_id": object})
    bad.loc[2, "vehicle_id"] = None
    assert "vehicle_id is empty in row 2" in refusal(bad)


def test_table_without_fixes_is_refused() -> None:
    assert "no fixes" in refusal(TRACES.iloc[:0])


def test_traces_without_end_are_refused_and_single_fixes_far_away_are_not() -> None:
    times = np.arange(20.0)
    usual = pd.DataFrame({"vehicle_id": "a", "time_s": times, "x_m": 20 * times, "y_m": 0.0})
    refuse_endless_traces(pd.concat([usual, usual.tail(1).assign(x_m=1e15)]), source="here")
    elsewhere = usual.assign(vehicle_id="b", x_m=usual["x_m"] + 4e6)
    refuse_endless_traces(pd.concat([usual, elsewhere]), source="here")
    with pytest.raises(TraceError, match="here: the fixes of 'a' spread over 342000 km"):
        refuse_endless_traces(usual.assign(x_m=2e7 * times), source="here")


@pytest.mark.parametrize(("most", "kept"), [(1, ["v0"]), (3, ["v0", "v3", "v6"]), (7, [f"v{i}" for i in range(7)]), (9, None)])
def test_some_vehicles_are_taken_evenly_with_all_their_fixes(most: int, kept: list[str] | None) -> None:
    ids = np.repeat([f"v{i}" for i in range(7)], 3)
    table = pd.DataFrame({"vehicle_id": ids, "time_s": np.arange(21.0), "x_m": 0.0, "y_m": 0.0})
    some = some_vehicles(table, most)
    expected = sorted(set(ids)) if kept is None else kept
    assert some["vehicle_id"].tolist() == [name for name in expected for _ in range(3)]


def test_kept_rows_are_numbered_anew_and_all_of_them_are_the_table_itself() -> None:
    table = pd.DataFrame({"a": [1, 2, 3]}, index=[0, 1, 2])
    assert kept_rows(table, np.ones(3, dtype=bool)) is table
    assert kept_rows(table, np.array([True, False, True])).equals(pd.DataFrame({"a": [1, 3]}))
