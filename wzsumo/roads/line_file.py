"""The road before as a line in a GeoJSON file: the middle of its lanes, in the direction of travel, with attributes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray
from wzsumo.geography import LocalFrame
from wzsumo.input_files import read_json, shown
from wzsumo.roads.found_road import LANE_WIDTH_M, FoundRoad, road_along
from wzsumo.units import METRES_PER_FOOT, mps_from_mph

MAX_COORDINATE_M = 1e8  # of any projection of the earth
KEYS = (
    "lanes", "lane_width_m", "lane_width_ft", "left_shoulder_m", "left_shoulder_ft", "right_shoulder_m", "right_shoulder_ft",
    "speed_limit_mph",
)  # fmt: skip


def read_line(path: Path, *, frame: LocalFrame | None) -> FoundRoad:
    """The road of the first LineString of a GeoJSON file, in metres of the frame.

    Its properties may be KEYS; only `lanes` must be there. Raises SpecError where the file is none, or its line bends too much.
    """
    try:
        content = read_json(path)
        found = content["features"] if content["type"] == "FeatureCollection" else [content]
        line = next(each for each in found if (each.get("geometry") or {}).get("type") == "LineString")
        points = np.array([position[:2] for position in line["geometry"]["coordinates"]], dtype=float).reshape(-1, 2)
        given = dict(line.get("properties") or {})
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file; name a GeoJSON file of a line") from None
    except StopIteration:
        raise SpecError(f"{path}: holds no LineString; the road is the line along the middle of its lanes") from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise SpecError(f"{path}: is no GeoJSON ({type(error).__name__}: {error})") from None
    n_lanes = _number(given, "lanes", path)
    if n_lanes is None or n_lanes != int(n_lanes) or not 1 <= n_lanes <= 8:
        raise SpecError(
            f"{path}: properties.lanes={shown(given.get('lanes'))} must be the number of lanes, 1 to 8, along the line"
        )
    assumed = []
    width = _length(given, "lane_width", path)
    if width is None:
        width = LANE_WIDTH_M
        assumed.append(f"lanes of {width:.2f} m, as of a freeway")
    shoulders = (_length(given, "left_shoulder", path), _length(given, "right_shoulder", path))
    speed_mph = _number(given, "speed_limit_mph", path)
    speed = None if speed_mph is None else mps_from_mph(speed_mph)
    road, said = road_along(
        _in_metres(points, frame, path),
        lane_widths=[width] * int(n_lanes),
        shoulders=None if None in shoulders else (shoulders[0] or 0.0, shoulders[1] or 0.0),
        speed_mps=speed,
        source=str(path),
    )
    return FoundRoad(road=road, speed_mps=speed, assumed=(*assumed, *said))


def _in_metres(points: FloatArray, frame: LocalFrame | None, path: Path) -> FloatArray:
    if len(points) < 2 or not (np.abs(points) < MAX_COORDINATE_M).all():
        raise SpecError(f"{path}: its LineString must have two points or more, each of two numbers")
    degrees = bool((np.abs(points) <= (180, 90)).all())
    if degrees and frame is None:
        raise SpecError(f"{path}: the line is in degrees, the traces are metres of no known place; say theirs with --crs")
    if not degrees and frame is not None:
        x, y = points[0]
        raise SpecError(f"{path}: ({x:g}, {y:g}) is no longitude and latitude; GeoJSON is in WGS 84 (RFC 7946)")
    return points if frame is None else frame.from_lonlat(points)


def _length(given: Mapping[str, Any], name: str, path: Path) -> float | None:
    metres, feet = _number(given, f"{name}_m", path), _number(given, f"{name}_ft", path)
    if metres is not None and feet is not None:
        raise SpecError(f"{path}: give one of {name}_m and {name}_ft")
    return metres if feet is None else feet * METRES_PER_FOOT


def _number(given: Mapping[str, Any], key: str, path: Path) -> float | None:
    value = given.get(key)
    if value is None:
        return None
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not 0 <= number < 1000:
        raise SpecError(f"{path}: properties.{key}={shown(value)} must be a number of 0 or more")
    return number
