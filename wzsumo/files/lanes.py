"""lanes.geojson: a LaneMap as a file, for QGIS and web maps and for `wzsumo export`."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.errors import GEOSException

from wzsumo.errors import MapError
from wzsumo.files.geojson import feature, feature_collection, frame_of_collection, geometry_in_metres
from wzsumo.files.placing import settle
from wzsumo.frames import FloatArray
from wzsumo.geography import LocalFrame
from wzsumo.input_files import read_json
from wzsumo.lane_map import LaneMap, MappedBranch, MappedLane
from wzsumo.road import Road

LANES_FILE = "lanes.geojson"
MAX_OFFSET_M = 1e4  # of a lane from the axis of its map
MAX_WHY = 160  # letters of a fault that a message repeats


@dataclass(frozen=True, kw_only=True, eq=False)
class LanesFile:
    """A lane map with the frame of its metres (None: no place on earth); `utc`: its times count from 1970-01-01 UTC."""

    lanes: LaneMap
    frame: LocalFrame | None
    utc: bool = False


def write_lanes(content: LanesFile, folder: Path) -> None:
    """Write lanes.geojson."""
    (folder / LANES_FILE).write_text(json.dumps(lanes_geojson(content)) + "\n", encoding="utf-8")


def lanes_geojson(content: LanesFile) -> dict[str, Any]:
    """FeatureCollection of the axis, each lane with its lines, its sections by state, and branches.

    Features have a `name`. `lane` is the strip between a lane's lines and holds its numbers at `stations_m`; `lane_line` is one
    of the lines with its standard deviation; `lane_section` is a stretch that is open, closed or unknown; `branch` is other
    driven ground. Offsets [m] count from the axis's right edge line to the left.
    """
    lanes, frame = content.lanes, content.frame
    road = lanes.axis
    section = {
        "lane_widths_m": list(road.lane_widths), "left_shoulder_m": road.left_shoulder,
        "right_shoulder_m": road.right_shoulder, "opposing_lanes": road.opposing_lanes,
    }  # fmt: skip
    features = [feature(shapely.LineString(road.reference_line), {"name": "axis"} | section, frame=frame)]
    for index, lane in enumerate(lanes.lanes):
        features += _lane_features(lanes, index, lane, frame)
    for branch in lanes.branches:
        strip = shapely.LineString(branch.line).buffer(float(np.median(branch.width)) / 2, cap_style="flat")
        about = {"name": "branch", "p_open": branch.p_open, "n_traces": branch.n_traces}
        numbers = {"line_m": _rounded(branch.line), "width_m": _rounded(branch.width)}
        features.append(feature(strip, about | numbers, frame=frame))
    return feature_collection(
        features, frame=frame, n_traces=lanes.n_traces, times=_times(lanes, utc=content.utc), warnings=list(lanes.warnings)
    )


def read_lanes(path: Path | str) -> LanesFile:
    """The lane map of a lanes.geojson, or of the folder that holds it. Raises MapError where the file is none."""
    path = Path(path)
    if path.is_dir():
        path = path / LANES_FILE
    settle(path.parent)
    try:
        collection = read_json(path)
        frame = frame_of_collection(collection)
        by_name: dict[str, list[dict[str, Any]]] = {}
        for found in collection["features"]:
            by_name.setdefault(found["properties"]["name"], []).append(found)
        (axis,) = by_name["axis"]
        stations = np.array(by_name["lane"][0]["properties"]["stations_m"], dtype=float)
        return LanesFile(
            lanes=LaneMap(
                axis=_road(axis, frame),
                stations=stations,
                lanes=tuple(_lane(found["properties"]) for found in by_name["lane"]),
                branches=tuple(_branch(found["properties"]) for found in by_name.get("branch", [])),
                n_traces=int(collection["n_traces"]),
                first_time_s=float(collection["times"]["first_s"]),
                last_time_s=float(collection["times"]["last_s"]),
                warnings=tuple(collection["warnings"]),
            ),
            frame=frame,
            utc=bool(collection["times"]["utc"]),
        )
    except FileNotFoundError:
        raise MapError(f"{path}: no such file; name a lanes.geojson that `wzsumo map` wrote, or its folder") from None
    except (OSError, ValueError, KeyError, TypeError, IndexError, AttributeError, OverflowError, GEOSException) as error:
        why = str(error).splitlines()[0][:MAX_WHY] if str(error) else type(error).__name__
        raise MapError(f"{path}: is no lanes.geojson of `wzsumo map` ({type(error).__name__}: {why})") from None


def time_text(seconds: float) -> str:
    """A time in seconds since 1970-01-01 UTC as RFC 3339 has it.

    >>> time_text(1780322400.0)
    '2026-06-01T14:00:00Z'
    """
    return datetime.fromtimestamp(round(seconds), UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def strip_polygon(lanes: LaneMap, right: FloatArray, left: FloatArray, *, first: int, last: int) -> shapely.Polygon:
    """The ground [m] between two lines (n,) from station number `first` to `last`."""
    part = slice(first, last + 1)
    sides = [lanes.to_xy(lanes.stations[part], side[part]) for side in (right, left)]
    return shapely.Polygon(np.vstack([sides[0], sides[1][::-1]]))


def _lane_features(lanes: LaneMap, index: int, lane: MappedLane, frame: LocalFrame | None) -> list[dict[str, Any]]:
    n = len(lanes.stations)
    numbers = {
        "name": "lane", "lane": index, "n_traces": lane.n_traces,
        "open_m": lanes.open_intervals(index), "closed_m": lanes.closed_intervals(index),
        "stations_m": _rounded(lanes.stations), "right_m": _rounded(lane.right), "left_m": _rounded(lane.left),
        "right_sd_m": _rounded(lane.right_sd), "left_sd_m": _rounded(lane.left_sd), "p_open": _rounded(lane.p_open),
    }  # fmt: skip
    found = [feature(strip_polygon(lanes, lane.right, lane.left, first=0, last=n - 1), numbers, frame=frame)]
    for side, offsets, sd in (("right", lane.right, lane.right_sd), ("left", lane.left, lane.left_sd)):
        about = {"name": "lane_line", "lane": index, "side": side, "median_sd_m": round(float(np.median(sd)), 3)}
        line = shapely.LineString(lanes.to_xy(lanes.stations, offsets))
        found.append(feature(line, about | {"sd_m": _rounded(sd)}, frame=frame))
    for state, start, end in _states(lanes, index):
        s = np.unique(np.concatenate([[start, end], lanes.stations[(lanes.stations > start) & (lanes.stations < end)]]))
        right, left = (np.interp(s, lanes.stations, side) for side in (lane.right, lane.left))
        strip = shapely.Polygon(np.vstack([lanes.to_xy(s, right), lanes.to_xy(s, left)[::-1]]))
        inside = (lanes.stations >= start) & (lanes.stations <= end)
        about = {
            "name": "lane_section", "lane": index, "state": state, "start_m": round(start, 2), "end_m": round(end, 2),
            "width_m": round(float(np.mean(left - right)), 3),
            "sd_m": round(float(np.median(np.maximum(lane.right_sd, lane.left_sd)[inside])), 3),
            "p_open": round(float(np.mean(lane.p_open_middle[inside])), 3),
        }  # fmt: skip
        found.append(feature(strip, about, frame=frame))
    return found


def _states(lanes: LaneMap, index: int) -> list[tuple[str, float, float]]:
    """(open, closed or unknown, from, to) of a lane along the whole map."""
    known = [("open", *span) for span in lanes.open_intervals(index)]
    known += [("closed", *span) for span in lanes.closed_intervals(index)]
    states, at = [], float(lanes.stations[0])
    for state, start, end in sorted(known, key=lambda span: span[1]):
        if start > at:
            states.append(("unknown", at, start))
        states.append((state, start, end))
        at = end
    end = float(lanes.stations[-1])
    return [*states, ("unknown", at, end)] if at < end else states


def _times(lanes: LaneMap, *, utc: bool) -> dict[str, Any]:
    times: dict[str, Any] = {"first_s": lanes.first_time_s, "last_s": lanes.last_time_s, "utc": utc}
    return times | {"first": time_text(lanes.first_time_s), "last": time_text(lanes.last_time_s)} if utc else times


def _rounded(values: FloatArray) -> Any:
    return np.round(values, 4).tolist()


def _road(axis: Mapping[str, Any], frame: LocalFrame | None) -> Road:
    section = axis["properties"]
    return Road(
        reference_line=shapely.get_coordinates(geometry_in_metres(axis["geometry"], frame)),
        lane_widths=tuple(section["lane_widths_m"]),
        left_shoulder=section["left_shoulder_m"],
        right_shoulder=section["right_shoulder_m"],
        opposing_lanes=section["opposing_lanes"],
    )


def _lane(numbers: Mapping[str, Any]) -> MappedLane:
    names = ("right", "left", "right_sd", "left_sd")
    lines = {name: np.array(numbers[f"{name}_m"], dtype=float) for name in names}
    if not all((np.abs(line) < MAX_OFFSET_M).all() for line in (lines["right"], lines["left"])):
        raise ValueError("the lines of a lane must be numbers, in metres beside the axis")
    return MappedLane(**lines, p_open=np.array(numbers["p_open"], dtype=float), n_traces=int(numbers["n_traces"]))


def _branch(numbers: Mapping[str, Any]) -> MappedBranch:
    return MappedBranch(
        line=np.array(numbers["line_m"], dtype=float),
        width=np.array(numbers["width_m"], dtype=float),
        p_open=float(numbers["p_open"]),
        n_traces=int(numbers["n_traces"]),
    )
