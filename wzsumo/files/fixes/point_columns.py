"""Points that a table holds in one column: GeoParquet's geometry, text (WKT) and hexadecimal bytes (WKB) of databases."""

import json
import re
from typing import Any

import pandas as pd
import pyarrow as pa

DEFAULT_CRS = "OGC:CRS84"  # of GeoParquet that names none (GeoParquet 1.1, "crs")
TEXT_NAMES = ("geometry", "geom", "thegeom", "wkt", "wktgeom", "wktgeometry", "point", "location", "shape", "coordinates")
_WKT = re.compile(r"\s*(?:SRID=\d+;)?\s*POINT\b", re.IGNORECASE)
_WKB = re.compile(r"\s*0[01][0-9A-Fa-f]{40,}\s*")  # byte order, kind, two numbers of 8 bytes


def table_of_arrow(table: pa.Table) -> tuple[pd.DataFrame, str | None]:
    """(the table, the CRS of its geometry where it has one); GeoParquet's points become columns x and y.

    A column that was the index of a pandas table is a column like the others.
    """
    geometry, encoding, crs = _geometry_column(table)
    if geometry is None:
        return table.to_pandas(ignore_metadata=True), None
    x, y = _coordinates(table[geometry].combine_chunks(), encoding)
    return table.drop_columns([geometry]).to_pandas(ignore_metadata=True).assign(x=x, y=y), crs


def with_points_of_text(table: pd.DataFrame) -> pd.DataFrame:
    """The same table with the points of a column of WKT or hexadecimal WKB in columns x and y; as it is where it has none."""
    for name in table.columns:
        values = table[name].dropna()
        if re.sub(r"[^a-z]", "", str(name).lower()) not in TEXT_NAMES or values.empty or values.dtype.kind in "iufMb":
            continue
        first = str(values.iloc[0])
        if not (_WKT.match(first) or _WKB.fullmatch(first)):
            continue
        import shapely

        text = table[name].astype("object").where(table[name].notna(), None)
        plain = [None if value is None else str(value).rpartition(";")[2].strip() for value in text]
        points = (
            shapely.from_wkt(plain, on_invalid="ignore") if _WKT.match(first) else shapely.from_wkb(plain, on_invalid="ignore")
        )
        points[shapely.is_empty(points)] = None
        return table.drop(columns=name).assign(x=shapely.get_x(points), y=shapely.get_y(points))
    return table


def _geometry_column(table: pa.Table) -> tuple[str | None, str, str | None]:
    """(name of the geometry column, its encoding, its CRS) by GeoParquet's metadata; the name is None where there is none."""
    metadata = (table.schema.metadata or {}).get(b"geo")
    if metadata is None:
        return None, "", None
    about: dict[str, Any] = json.loads(metadata)
    name = about.get("primary_column", "geometry")
    column = about.get("columns", {}).get(name, {})
    encoding = column.get("encoding", "WKB")
    if name not in table.column_names or encoding not in {"WKB", "point"}:
        return None, "", None
    return name, encoding, _crs_text(column.get("crs", DEFAULT_CRS))


def _crs_text(crs: Any) -> str | None:
    """The authority and code of a CRS in PROJJSON, as EPSG:32617, where it has them; else its text."""
    if isinstance(crs, str) or crs is None:
        return crs
    identifier = crs.get("id") or {}
    if {"authority", "code"} <= set(identifier):
        return f"{identifier['authority']}:{identifier['code']}"
    return json.dumps(crs)


def _coordinates(geometry: pa.Array, encoding: str) -> tuple[Any, Any]:
    if encoding == "point":  # of GeoArrow: two columns of numbers
        return tuple(geometry.field(axis).to_numpy(zero_copy_only=False) for axis in ("x", "y"))
    import shapely

    points = shapely.from_wkb(geometry.to_numpy(zero_copy_only=False))
    points[shapely.is_empty(points)] = None
    return shapely.get_x(points), shapely.get_y(points)
