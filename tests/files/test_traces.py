from pathlib import Path

import pandas as pd
import pytest
from builders import straight_traces

from wzsumo.errors import TraceError
from wzsumo.files.traces import read_fixes, read_traces

TRACES = straight_traces([0.0, 3.5])


def test_traces_come_back_from_both_formats(tmp_path: Path) -> None:
    TRACES.to_parquet(tmp_path / "a.parquet")
    TRACES.to_csv(tmp_path / "a.csv", index=False)
    pd.testing.assert_frame_equal(read_traces(tmp_path / "a.parquet"), read_traces(tmp_path / "a.csv"))
    assert len(read_traces(tmp_path / "a.csv")) == len(TRACES)


def test_fixes_are_read_as_they_are_and_only_traces_are_checked(tmp_path: Path) -> None:
    TRACES.assign(y_m=[float("nan"), *TRACES["y_m"].iloc[1:]]).to_csv(tmp_path / "a.csv", index=False)
    assert read_fixes([tmp_path / "a.csv"]).table["y_m"].isna().sum() == 1
    with pytest.raises(TraceError, match="y_m of row 0 is nan"):
        read_traces(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("lost", "said"),
    [
        (["y_m"], "no column for y_m; say which holds what with --columns y_m=NAME; the file has vehicle_id"),
        (["x_m", "y_m", "time_s"], r"no column for time, lat, lon \(or x_m, y_m\); .* --columns time=NAME lat=NAME lon=NAME"),
        (["vehicle_id"], "no column for vehicle_id; "),
    ],
)
def test_column_that_is_not_there_is_named_with_the_option_that_names_it(tmp_path: Path, lost: list[str], said: str) -> None:
    TRACES.drop(columns=lost).sample(frac=1, random_state=1).to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(TraceError, match=said):
        read_fixes([tmp_path / "a.csv"])


@pytest.mark.parametrize(
    ("name", "content", "part"),
    [
        ("a.doc", b"", "ends in .csv, .tsv"),
        ("a.csv", b"", "cannot be read as a trace table"),
        ("a.parquet", b"not parquet", "cannot be read as a trace table"),
        ("a.csv", None, "no such file"),
    ],
)
def test_file_that_holds_no_table_is_refused_with_its_path(tmp_path: Path, name: str, content: bytes | None, part: str) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(TraceError, match=part) as error:
        read_fixes([tmp_path / name])
    assert str(tmp_path / name) in str(error.value)
