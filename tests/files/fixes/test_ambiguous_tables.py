"""Tables that could be read in two ways, or that are none: nothing is merged, dropped or taken without a word."""

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from wzsumo.errors import TraceError
from wzsumo.files.traces import read_fixes

SECOND = np.arange(20.0)


def drives(*ids: object) -> pd.DataFrame:
    """One vehicle after another at 20 m/s, a fix a second."""
    parts = [pd.DataFrame({"vehicle_id": each, "time_s": SECOND + 60 * n, "x_m": 20 * SECOND, "y_m": n})
             for n, each in enumerate(ids)]  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def written(path: Path, table: pd.DataFrame) -> Path:
    table.to_csv(path, index=False)
    return path


@pytest.mark.parametrize(
    "ids", [("7", "07", "007"), ("1e3", "1000", "1000.0"), ("9007199254740993", "9007199254740992", "0.5")]
)
@pytest.mark.parametrize("name", ["vehicle_id", "trip", "my journey id", "car"])
def test_ids_of_text_stay_as_they_stand(tmp_path: Path, ids: tuple[str, ...], name: str) -> None:
    path = written(tmp_path / "a.csv", drives(*ids).rename(columns={"vehicle_id": name}))
    columns = {"vehicle_id": "car"} if name == "car" else {}
    assert set(read_fixes([path], columns=columns).table["vehicle_id"]) == set(ids)


def test_spaces_around_an_id_are_none_of_it_and_an_id_of_spaces_is_empty(tmp_path: Path) -> None:
    ids = read_fixes([written(tmp_path / "a.csv", drives("a", " a ", "  "))]).table["vehicle_id"]
    assert set(ids.dropna()) == {"a"}
    assert ids.isna().sum() == 20


def test_ids_of_bytes_that_are_no_text_stay_apart(tmp_path: Path) -> None:
    pq.write_table(pa.Table.from_pandas(drives(b"a\xff", b"a\xfe", b"b")), tmp_path / "a.parquet")
    assert read_fixes([tmp_path / "a.parquet"]).table["vehicle_id"].nunique() == 3


@pytest.mark.parametrize("header", ["vehicle_id,time_s,x_m,x_m,y_m", "vehicle_id,time_s,x_m,X_M,y_m", "id,time,x, X ,y"])
def test_second_column_of_a_name_with_other_values_is_refused(tmp_path: Path, header: str) -> None:
    rows = [f"a,{t},{20 * t},{20 * t}" for t in range(20)]
    (tmp_path / "same.csv").write_text("\n".join([header, *(f"{row},0" for row in rows)]))
    assert len(read_fixes([tmp_path / "same.csv"]).table) == 20
    (tmp_path / "other.csv").write_text("\n".join([header, *(f"{row}.5,0" for row in rows)]))
    with pytest.raises(TraceError, match=r"two columns are called x.* and differ"):
        read_fixes([tmp_path / "other.csv"])


@pytest.mark.parametrize(("times_s_per_unit", "speed"), [(1 / 60, "1.2e"), (1 / 86400, "1.73e"), (1 / 4, "80"), (1000, "0.02")])
def test_degrees_with_times_in_another_unit_are_doubted(tmp_path: Path, times_s_per_unit: float, speed: str) -> None:
    table = drives("a", "b")
    place = pd.DataFrame({"id": table["vehicle_id"], "lat": 42.0, "lon": -83.0 + table["x_m"] / 82_850})
    (doubt,) = read_fixes([written(tmp_path / "a.csv", place.assign(t=table["time_s"] * times_s_per_unit))]).doubts
    assert doubt.startswith(f"vehicles would move at {speed}")
    assert not read_fixes([written(tmp_path / "b.csv", place.assign(t=table["time_s"]))]).doubts


def test_metres_with_times_in_days_are_doubted(tmp_path: Path) -> None:
    table = drives("a", "b")
    doubts = read_fixes([written(tmp_path / "a.csv", table.assign(time_s=table["time_s"] / 86400))]).doubts
    assert any("would move at 1.73e+06 m/s" in doubt for doubt in doubts)


def test_index_of_a_pandas_table_in_parquet_is_a_column(tmp_path: Path) -> None:
    drives("a", "b").set_index(["vehicle_id", "time_s"]).to_parquet(tmp_path / "a.parquet")
    fixes = read_fixes([tmp_path / "a.parquet"])
    assert fixes.table["vehicle_id"].unique().tolist() == ["a", "b"]
    assert fixes.table["time_s"].to_list() == drives("a", "b")["time_s"].to_list()


def no_text(path: Path) -> Path:
    path.write_text("vehicle_id,time_s,x_m,y_m\na,0,0,0\n", encoding="utf-16-le")
    return path


def of_another_encoding(path: Path) -> Path:
    path.with_suffix(".gpx").write_text('<?xml version="1.0" encoding="x-none"?><gpx></gpx>')
    return path.with_suffix(".gpx")


def without_columns(path: Path) -> Path:
    pq.write_table(pa.table({}), path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


def beyond_the_pole(path: Path) -> Path:
    return written(path, pd.DataFrame({"id": "a", "t": SECOND, "lat": 91.0, "lon": 100 + SECOND / 1e4}))


@pytest.mark.parametrize(
    ("make", "said"),
    [(no_text, "NUL bytes"), (of_another_encoding, "unknown encoding"), (without_columns, "no column for"),
     (beyond_the_pole, "lat 91 is no latitude")],
)  # fmt: skip
def test_what_is_no_table_is_refused_in_one_line(tmp_path: Path, make: object, said: str) -> None:
    path = make(tmp_path / "a.csv")  # type: ignore[operator]
    with pytest.raises(TraceError, match=said) as refused:
        read_fixes([path])
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)
