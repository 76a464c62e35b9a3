"""GeoJSON of metres: RFC 7946 (WGS 84, longitude first) where the metres have a frame; else metres, and the file says so."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from wzsumo.files.frame import frame_from
from wzsumo.frames import FloatArray
from wzsumo.geography import LocalFrame

DECIMALS_DEG = 9  # 0.1 mm
DECIMALS_M = 4
WITHOUT_A_PLACE = "metres of a local frame without a place on earth: x to the right, y up; not RFC 7946, which is degrees"


def feature(geometry: BaseGeometry, properties: Mapping[str, Any], *, frame: LocalFrame | None) -> dict[str, Any]:
    """A Feature of a geometry in metres of the frame."""
    placed = _rounded(geometry, DECIMALS_M) if frame is None else degrees_of(geometry, frame)
    return {"type": "Feature", "geometry": shapely.geometry.mapping(placed), "properties": dict(properties)}


def feature_collection(features: Sequence[Mapping[str, Any]], *, frame: LocalFrame | None, **members: Any) -> dict[str, Any]:
    """A FeatureCollection that says its frame, or that it has none, in the member `frame` or `coordinates`."""
    about = {"coordinates": WITHOUT_A_PLACE} if frame is None else {"frame": frame.as_json()}
    return {"type": "FeatureCollection", **about, **members, "features": list(features)}


def frame_of_collection(collection: Mapping[str, Any]) -> LocalFrame | None:
    """The frame that a FeatureCollection of ours states; None where its coordinates are metres."""
    return frame_from(collection["frame"]) if "frame" in collection else None


def geometry_in_metres(geometry: dict[str, Any], frame: LocalFrame | None) -> BaseGeometry:
    """A geometry of a file of ours in metres of the frame that the file states."""
    shape = shapely.geometry.shape(geometry)
    return shape if frame is None else shapely.transform(_joined_at_180(shape), frame.from_lonlat)


def placed_collection(collection: Mapping[str, Any], frame: LocalFrame | None) -> dict[str, Any]:
    """A FeatureCollection in metres as it is to be written: in degrees where there is a frame, and with a word where not."""
    members = {key: value for key, value in collection.items() if key not in {"type", "features"}}
    features = [
        feature(shapely.geometry.shape(found["geometry"]), found["properties"], frame=frame) for found in collection["features"]
    ]
    return feature_collection(features, frame=frame, **members)


def collection_in_metres(collection: Mapping[str, Any]) -> dict[str, Any]:
    """A FeatureCollection that was read, with its geometries in metres of the frame that it states."""
    frame = frame_of_collection(collection)
    if frame is None:
        return dict(collection)
    features = [
        {**found, "geometry": shapely.geometry.mapping(geometry_in_metres(found["geometry"], frame))}
        for found in collection["features"]
    ]
    return {**collection, "features": features}


def degrees_of(geometry: BaseGeometry, frame: LocalFrame) -> BaseGeometry:
    """A geometry [m] in degrees: polygons counter-clockwise, cut where they cross the 180th meridian (RFC 7946, 3.1)."""
    placed = shapely.transform(geometry, frame.to_lonlat)
    if _crosses_the_180th(shapely.get_coordinates(placed)):
        placed = _cut_at_180(placed)
    return _rounded(shapely.orient_polygons(placed, exterior_cw=False), DECIMALS_DEG)


def _rounded(geometry: BaseGeometry, decimals: int) -> BaseGeometry:
    return shapely.transform(geometry, lambda points: np.round(points, decimals))


def _crosses_the_180th(lonlat: FloatArray) -> bool:
    return bool(len(lonlat) and np.ptp(lonlat[:, 0]) > 180)


def _cut_at_180(geometry: BaseGeometry) -> BaseGeometry:
    east = _to_360(geometry)
    halves = [shapely.intersection(east, shapely.box(low, -90, low + 180, 90)) for low in (0.0, 180.0)]
    back = shapely.transform(halves[1], lambda p: p - (360.0, 0.0))
    parts = [part for half in (halves[0], back) for part in shapely.get_parts(half)]
    # What begins on the meridian touches the other half in a point or line, which is no part of it.
    return shapely.union_all([part for part in parts if part.geom_type == geometry.geom_type.removeprefix("Multi")])


def _joined_at_180(geometry: BaseGeometry) -> BaseGeometry:
    """A line or polygon that was cut at the 180th meridian in one piece, its longitudes from 0 to 360 degrees."""
    if "Multi" not in geometry.geom_type or not _crosses_the_180th(shapely.get_coordinates(geometry)):
        return geometry
    east = _to_360(geometry)
    return shapely.line_merge(east, directed=True) if "Line" in east.geom_type else shapely.union_all(shapely.get_parts(east))


def _to_360(geometry: BaseGeometry) -> BaseGeometry:
    return shapely.transform(geometry, lambda p: np.column_stack([np.mod(p[:, 0], 360), p[:, 1]]))
