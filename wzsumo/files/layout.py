"""Writes a layout as GeoJSON, and its devices as a table."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import shapely

from wzsumo.files.frame import write_frame
from wzsumo.files.geojson import placed_collection
from wzsumo.geography import LocalFrame
from wzsumo.work_zone import WorkZoneLayout


def write_layout(layout: WorkZoneLayout, folder: Path, *, frame: LocalFrame | None) -> None:
    """Write layout.geojson, in WGS 84 where the road's metres have a frame, with frame.json beside it; and devices.csv."""
    placed = placed_collection(layout_geojson(layout), frame)
    (folder / "layout.geojson").write_text(json.dumps(placed), encoding="utf-8")
    if frame is not None:
        write_frame(frame, folder)
    layout.devices.to_csv(folder / "devices.csv", index=False, float_format="%.4f")


def layout_geojson(layout: WorkZoneLayout) -> dict[str, Any]:
    """FeatureCollection of drivable, closed_area, pavement, reference_line, lanes, stop lines, devices and signs.

    Coordinates are metres in the world frame, not degrees. `areas` lists the areas of the zone with their stations [m].
    """
    road = layout.road
    section = {
        "lane_widths_m": list(road.lane_widths),
        "left_shoulder_m": road.left_shoulder,
        "right_shoulder_m": road.right_shoulder,
        "opposing_lanes": road.opposing_lanes,
    }
    line = {"type": "LineString", "coordinates": road.reference_line.tolist()}
    features = [
        _feature(shapely.geometry.mapping(getattr(layout, name)), {"name": name})
        for name in ("drivable", "closed_area", "pavement")
    ]
    features.append(_feature(line, {"name": "reference_line"} | section))
    for lane in layout.lanes:
        strip = shapely.geometry.mapping(road.strip(lane.start, lane.end, lane.right, lane.left))
        place = {"index": lane.index, "opposing": lane.opposing, "start_m": lane.start, "end_m": lane.end}
        features.append(_feature(strip, {"name": "lane"} | place))
    features += [_feature(shapely.geometry.mapping(line), about) for line, about in _stop_lines(layout)]
    for name, table in (("device", layout.devices), ("sign", layout.signs)):
        for row in table.to_dict("records"):
            point = {"type": "Point", "coordinates": [row.pop("x_m"), row.pop("y_m")]}
            features.append(_feature(point, {"name": name} | {str(key): value for key, value in row.items()}))
    areas = [{"name": area.name, "start_m": area.start, "end_m": area.end} for area in layout.areas]
    return {"type": "FeatureCollection", "areas": areas, "features": features}


def _stop_lines(layout: WorkZoneLayout) -> Iterator[tuple[shapely.LineString, dict[str, Any]]]:
    """The lines at which those wait who take turns: across the lanes of their direction."""
    turns = layout.taking_turns
    for station, opposing in ((turns.start, False), (turns.end, True)) if turns else ():
        lanes = [lane for lane in layout.lanes if lane.opposing == opposing and lane.start <= station <= lane.end]
        if lanes:
            ends = [min(float(lane.right(station)) for lane in lanes), max(float(lane.left(station)) for lane in lanes)]
            line = shapely.LineString(layout.road.to_xy([station, station], ends))
            yield line, {"name": "stop_line", "s_m": station, "right_m": ends[0], "left_m": ends[1], "opposing": opposing}


def _feature(geometry: Any, properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}
