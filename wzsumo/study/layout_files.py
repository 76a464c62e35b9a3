"""The layout as files: GeoJSON in world metres, the devices as a table, a drawing."""

import json
from pathlib import Path
from typing import Any

import shapely

from wzsumo.work_zone import WorkZoneLayout


def write_layout(layout: WorkZoneLayout, folder: Path) -> None:
    """Write layout.geojson and devices.csv."""
    (folder / "layout.geojson").write_text(json.dumps(layout_geojson(layout)), encoding="utf-8")
    layout.devices.to_csv(folder / "devices.csv", index=False, float_format="%.4f")


def layout_geojson(layout: WorkZoneLayout) -> dict[str, Any]:
    """FeatureCollection of drivable, closed_area, pavement and the devices; coordinates are world metres, not degrees.

    `areas` lists the named stretches with their stations [m].
    """
    features = [
        _feature(shapely.geometry.mapping(getattr(layout, name)), {"name": name})
        for name in ("drivable", "closed_area", "pavement")
    ]
    columns = ["kind", "s_m", "d_m", "height_m", "radius_m"]
    for device in layout.devices.to_dict("records"):
        point = {"type": "Point", "coordinates": [device["x_m"], device["y_m"]]}
        features.append(_feature(point, {"name": "device"} | {key: device[key] for key in columns}))
    areas = [{"name": area.name, "start_m": area.start, "end_m": area.end} for area in layout.areas]
    return {"type": "FeatureCollection", "areas": areas, "features": features}


def _feature(geometry: Any, properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}
