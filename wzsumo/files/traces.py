"""Trace tables as they are shipped: files and folders of any dialect, and tables from Python."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wzsumo.errors import TraceError
from wzsumo.files.fixes.fixes import Fixes, fixes_of
from wzsumo.files.fixes.point_columns import table_of_arrow
from wzsumo.files.fixes.tables import read_table, table_files
from wzsumo.geography import LocalFrame
from wzsumo.tables import check_traces

NO_COLUMNS: Mapping[str, str] = {}


def read_traces(path: Path | str) -> pd.DataFrame:
    """The checked trace table of a file or folder. Raises TraceError."""
    return check_traces(read_fixes([Path(path)]).table, source=str(path))


def read_fixes(
    paths: Sequence[Path | str],
    *,
    columns: Mapping[str, str] = NO_COLUMNS,
    crs: str | None = None,
    frame: LocalFrame | None = None,
    tell: Callable[[float], None] = lambda _share: None,
) -> Fixes:
    """The fixes of files and folders together, rows not checked; what several files lack is told by `check_traces`.

    `columns` names the columns of some meanings (see `fixes.dialects`), `crs` says what plane coordinates are in, `frame` is
    one that degrees are to be projected to. `tell` is called with the share that is read. Raises TraceError where a file is
    none, and where files do not belong together.
    """
    files = [file for path in paths for file in table_files(Path(path))]
    sizes = np.array([file.stat().st_size for file in files], dtype=float)
    read_before = np.concatenate([[0.0], np.cumsum(sizes)]) / max(sizes.sum(), 1.0)
    parts: list[Fixes] = []
    of_first: str | None = None
    for file, before, after in zip(files, read_before, read_before[1:], strict=False):
        raw, own_crs = read_table(file, id_column=columns.get("vehicle_id"))
        tell(float(before + after) / 2)
        of_first = own_crs if not parts else of_first
        if own_crs != of_first:
            given = f"{own_crs or 'not said'}, that of {files[0]} {of_first or 'not said'}"
            raise TraceError(f"{file}: its CRS is {given}; files of one map share one: map them apart or convert one")
        known = frame or (parts[0].frame if parts else None)
        drive = file.name.split(".")[0]
        part = fixes_of(raw, columns=columns, crs=crs or own_crs, frame=known, source=str(file), drive=drive)
        if parts and (part.frame is None) != (parts[0].frame is None):
            raise TraceError(f"{file}: has {_kind(part)}, {files[0]} has {_kind(parts[0])}; give files of one kind")
        parts.append(part)
        tell(float(after))
    return _joined(parts)


def fixes_from(
    table: Any,
    *,
    columns: Mapping[str, str] = NO_COLUMNS,
    crs: str | None = None,
    frame: LocalFrame | None = None,
    source: str = "traces",
) -> Fixes:
    """The fixes of a table from Python: pandas, geopandas, anything with Arrow's C stream or with `__geo_interface__`."""
    raw, own_crs = _table_from(table, source=source)
    return fixes_of(raw, columns=columns, crs=crs or own_crs, frame=frame, source=source, drive=None)


def _kind(fixes: Fixes) -> str:
    return "metres of no known place" if fixes.frame is None else "a place on earth"


def _joined(parts: Sequence[Fixes]) -> Fixes:
    if len(parts) == 1:
        return parts[0]
    return Fixes(
        table=pd.concat([part.table for part in parts], ignore_index=True),
        frame=parts[0].frame,
        utc=all(part.utc for part in parts),
        said=tuple(dict.fromkeys(word for part in parts for word in part.said)),
        doubts=tuple(dict.fromkeys(word for part in parts for word in part.doubts)),
    )


def _table_from(table: Any, *, source: str) -> tuple[pd.DataFrame, str | None]:
    """(a pandas table, the CRS where the object says one)."""
    if hasattr(table, "geometry") and hasattr(table, "crs") and isinstance(table, pd.DataFrame):
        points = table.geometry
        plain = pd.DataFrame(table.drop(columns=points.name)).assign(x=points.x.to_numpy(), y=points.y.to_numpy())
        return plain, None if table.crs is None else table.crs.to_string()
    if isinstance(table, pd.DataFrame):
        return table.copy(deep=False), None
    if hasattr(table, "__arrow_c_stream__"):
        import pyarrow as pa

        return table_of_arrow(pa.table(table))
    if hasattr(table, "__geo_interface__") or isinstance(table, Mapping):
        return _table_of_features(getattr(table, "__geo_interface__", table), source=source), "OGC:CRS84"
    raise TraceError(f"{source}: {type(table).__name__} is no table; give pandas, Arrow, or an object with __geo_interface__")


def _table_of_features(collection: Mapping[str, Any], *, source: str) -> pd.DataFrame:
    """One row a Point of a FeatureCollection, with its properties; longitude first (RFC 7946)."""
    features = collection.get("features", [])
    points = [feature for feature in features if (feature.get("geometry") or {}).get("type") == "Point"]
    if not points:
        raise TraceError(
            f"{source}: a {collection.get('type')} without Point features; give a FeatureCollection with a Point a fix"
        )
    table = pd.DataFrame([dict(feature.get("properties") or {}) for feature in points])
    place = np.array([feature["geometry"]["coordinates"][:2] for feature in points], dtype=float)
    return table.assign(x=place[:, 0], y=place[:, 1])
