"""GeoParquet 1.1 of a lane map: one row a stretch of a lane, with its state, width and standard deviation."""

import json
from typing import Any

import pyarrow as pa
import shapely

from wzsumo.files.lanes import LanesFile, lanes_geojson
from wzsumo.files.output import parquet_bytes

COLUMNS = (
    ("lane", pa.int32()), ("state", pa.string()), ("start_m", pa.float64()), ("end_m", pa.float64()), ("width_m", pa.float64()),
    ("sd_m", pa.float64()), ("p_open", pa.float64()),
)  # fmt: skip


def geoparquet_bytes(content: LanesFile) -> bytes:
    """The content of a GeoParquet file: WKB polygons in WGS 84, or with `crs` null where the map has no place on earth."""
    rows = [found for found in lanes_geojson(content)["features"] if found["properties"]["name"] == "lane_section"]
    shapes = [shapely.geometry.shape(row["geometry"]) for row in rows]
    columns: dict[str, Any] = {name: pa.array([row["properties"][name] for row in rows], type=kind) for name, kind in COLUMNS}
    columns["geometry"] = pa.array(list(shapely.to_wkb(shapes)), type=pa.binary())
    geometry: dict[str, Any] = {"encoding": "WKB", "geometry_types": sorted({shape.geom_type for shape in shapes})}
    if content.frame is None:
        geometry["crs"] = None  # said to be unknown; left out it would be WGS 84
    geo = {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": geometry}}
    return parquet_bytes(pa.table(columns).replace_schema_metadata({"geo": json.dumps(geo)}))
