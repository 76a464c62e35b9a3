"""Trace tables in files: parquet or csv."""

from pathlib import Path

import pandas as pd
from pyarrow import ArrowException

from wzsumo.errors import TraceError
from wzsumo.tables import check_traces


def read_traces(path: Path | str) -> pd.DataFrame:
    """The checked trace table of a .parquet or .csv file. Raises TraceError."""
    return check_traces(read_fixes(Path(path)), source=str(path))


def read_fixes(path: Path) -> pd.DataFrame:
    """The table of a .parquet or .csv file as it stands, not checked. Raises TraceError where it is none."""
    if path.suffix not in {".parquet", ".csv"}:
        raise TraceError(f"{path}: a trace file ends in .parquet or .csv")
    if not path.is_file():
        raise TraceError(f"{path}: no such file; name a .parquet or .csv file of traces")
    try:
        return pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path, low_memory=False)
    except (OSError, ValueError, ArrowException, pd.errors.EmptyDataError) as error:
        raise TraceError(f"{path}: cannot be read as a trace table ({str(error).splitlines()[0]})") from None
