"""ResultFolder: the files of one run, as its report reads them."""

import json
import re
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import shapely
from shapely.geometry import shape
from shapely.geometry.base import BaseGeometry

from wzsumo import __version__
from wzsumo.errors import MAX_SHOWN, InputError, check_file, one_line, reading, shown
from wzsumo.files.geojson import collection_in_metres
from wzsumo.files.placing import settle
from wzsumo.files.ros_map import read_map
from wzsumo.frames import BoolArray
from wzsumo.grid import OccupancyGrid, cells_inside
from wzsumo.road import Profile, Road
from wzsumo.spec import parse_spec, read_toml
from wzsumo.vehicle import VehicleGeometry
from wzsumo.work_zone import DEVICE_COLUMNS, SIGN_COLUMNS, OpenLane

LAYOUT = "layout.geojson"
REMEDY = "run the scenario again"
RESULT = "result.json"
NEEDED_FILES = (RESULT, LAYOUT, "traces.parquet")
MIXTURE_FILES = ("mixture_sweep.csv", "mixture.json", "samples.csv")
RESULT_FORMAT = 1  # of result.json; it grows where a key gets another meaning or goes
NEEDED_KEYS = ("scenario", "seed", "version", "methods")
METHOD_NAME = re.compile(r"(?!\.)[\w.-]{1,100}")  # files are called by it
# Of result.json, where they are there.
OBJECTS = ("methods", "fleet", "traffic", "network", "drivers", "slam", "not_run", "timings_s")


@dataclass(frozen=True, kw_only=True)
class ResultFolder:
    """The files of one run. World frame, metres; stations are those of `road`."""

    folder: Path
    result: Mapping[str, Any]
    layout: Mapping[str, Any]

    @property
    def methods(self) -> dict[str, Mapping[str, Any]]:
        """The figures of every map method, by its name, in the order of the run."""
        return dict(self.result.get("methods") or {})

    @property
    def areas(self) -> list[tuple[str, float, float]]:
        """Name, start and end (stations [m]) of every area of the zone."""
        with self._reading(LAYOUT):
            return [(str(a["name"]), float(a["start_m"]), float(a["end_m"])) for a in self.layout["areas"]]

    @property
    def span(self) -> tuple[float, float]:
        """Stations [m] where the zone starts and ends."""
        return min(start for _, start, _ in self.areas), max(end for _, _, end in self.areas)

    @cached_property
    def polygons(self) -> dict[str, BaseGeometry]:
        """The drivable area, the closed area and the pavement."""
        with self._reading(LAYOUT):
            found = {f["properties"]["name"]: f["geometry"] for f in self.layout["features"]}
            return {name: shape(found[name]) for name in ("drivable", "closed_area", "pavement")}

    @cached_property
    def road(self) -> Road:
        """The road that the zone is on."""
        with self._reading(LAYOUT):
            (line,) = [f for f in self.layout["features"] if f["properties"]["name"] == "reference_line"]
            section = line["properties"]
            return Road(
                reference_line=np.array(line["geometry"]["coordinates"], dtype=float),
                lane_widths=tuple(section["lane_widths_m"]),
                left_shoulder=section["left_shoulder_m"],
                right_shoulder=section["right_shoulder_m"],
                opposing_lanes=section["opposing_lanes"],
            )

    @cached_property
    def devices(self) -> pd.DataFrame:
        """Every channelizing device, in DEVICE_COLUMNS."""
        return self._points("device", DEVICE_COLUMNS)

    @cached_property
    def signs(self) -> pd.DataFrame:
        """Every sign, in SIGN_COLUMNS."""
        return self._points("sign", SIGN_COLUMNS)

    @cached_property
    def lanes(self) -> tuple[OpenLane, ...]:
        """Every lane that is open, along its whole length."""
        with self._reading(LAYOUT):
            return tuple(self._lane(f) for f in self.layout["features"] if f["properties"]["name"] == "lane")

    @cached_property
    def stop_lines(self) -> list[dict[str, Any]]:
        """Station s_m, ends right_m and left_m [m] and direction (`opposing`) of each line where those wait who take turns."""
        return [dict(f["properties"]) for f in self.layout["features"] if f["properties"]["name"] == "stop_line"]

    def _lane(self, feature: Mapping[str, Any]) -> OpenLane:
        place = feature["properties"]
        outline = shapely.get_coordinates(shape(feature["geometry"]))[:-1]  # right line along the road, left line back
        s, d = self.road.to_sd(outline)
        n = len(s) // 2
        right, left = Profile(stations=s[:n], offsets=d[:n]), Profile(stations=s[n:][::-1], offsets=d[n:][::-1])
        return OpenLane(
            index=int(place["index"]), opposing=bool(place["opposing"]),
            start=float(place["start_m"]), end=float(place["end_m"]), right=right, left=left,
        )  # fmt: skip

    def lanes_at(self, station: float) -> list[tuple[float, float]]:
        """Offsets (right, left) [m] of every lane that is open at a station."""
        return sorted(
            (float(lane.right(station)), float(lane.left(station))) for lane in self.lanes if lane.start <= station < lane.end
        )

    @cached_property
    def used_traces(self) -> pd.DataFrame:
        """The fixes of which the maps were made."""
        with self._reading("traces.parquet"):
            traces = pd.read_parquet(self.folder / "traces.parquet")
            return traces[traces["used"].astype(bool)]

    @property
    def vehicle(self) -> VehicleGeometry:
        """The ego's outline in the run's scenario.toml."""
        path = self.folder / "scenario.toml"
        table = read_toml(path).get("vehicle", {}) if path.exists() else {}
        return parse_spec(VehicleGeometry, table, source=f"{path}, vehicle")

    @property
    def has_mixture(self) -> bool:
        """Whether a mixture was fitted to the traces, and all its files are here."""
        return all((self.folder / name).is_file() for name in MIXTURE_FILES)

    @property
    def mixtures_tried(self) -> pd.DataFrame:
        """n_components, log_likelihood, aic and bic of every mixture that was fitted."""
        return self._whole_table("mixture_sweep.csv")

    @property
    def mixture(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Weights (k,), means (k, 2) [m] and covariances (k, 2, 2) [m^2] of the chosen mixture, in stations and offsets."""
        with self._reading("mixture.json"):
            mixture = json.loads((self.folder / "mixture.json").read_text(encoding="utf-8"))
            weights, means, covariances = (np.array(mixture[name], dtype=float) for name in ("weights", "means", "covariances"))
            k = len(weights)
            return weights.reshape(k), means.reshape(k, 2), covariances.reshape(k, 2, 2)

    @property
    def samples(self) -> pd.DataFrame:
        """x_m and y_m of the points drawn from the mixture."""
        return self._whole_table("samples.csv")

    @cached_property
    def traffic_cells(self) -> pd.DataFrame | None:
        """time_s, station_m, flow_vph, density_vpkm and speed_mps of every space-time cell; None where not measured."""
        return self._table("traffic/cells.parquet")

    @cached_property
    def network_edges(self) -> pd.DataFrame | None:
        """edge_id, delays [s] and shape of every edge of the network between junctions; None where there is no network."""
        path = self.folder / "traffic" / "edges.csv"
        if not path.exists():
            return None
        edges = pd.read_csv(path)
        return edges[edges["shape"].notna()].reset_index(drop=True)

    def map_of(self, method: str) -> OccupancyGrid | None:
        """The map of a method, None where it made none."""
        path = self.folder / "maps" / f"{method}.yaml"
        return read_map(path) if path.exists() else None

    def path_of(self, method: str) -> pd.DataFrame | None:
        """The planned path of a method (rear axle), None where none was found."""
        return self._table(f"paths/{method}.csv")

    def drive_of(self, method: str) -> pd.DataFrame | None:
        """The ego's log of the drive on a method's path, None where it did not drive."""
        return self._table(f"drives/{method}.csv")

    def drive_traffic_of(self, method: str) -> pd.DataFrame | None:
        """The trace table of the vehicles near the ego on that drive, None where it did not drive."""
        return self._table(f"drives/{method}_traffic.parquet")

    def truth_on(self, grid: OccupancyGrid) -> tuple[BoolArray, BoolArray]:
        """Cells (rows, cols) of `grid` within the zone, and those of them that are drivable by the layout."""
        road, margin = self.road, 5.0  # a map reaches at most so far beyond the pavement
        zone = cells_inside(grid, road.strip(*self.span, -road.right_shoulder - margin, road.left_edge + margin))
        return zone, cells_inside(grid, self.polygons["drivable"]) & zone

    def _reading(self, name: str) -> AbstractContextManager[None]:
        """InputError, which names the file, in the place of what its reader raises."""
        return reading(self.folder / name, error=InputError, remedy=REMEDY, also=(pa.ArrowException,))

    def _table(self, name: str) -> pd.DataFrame | None:
        """The table of a CSV or Parquet file of the folder; None where there is no such file."""
        return self._whole_table(name) if (self.folder / name).exists() else None

    def _whole_table(self, name: str) -> pd.DataFrame:
        """The table of a file. Raises InputError where it is cut: the last line of a CSV must have an end."""
        path = self.folder / name
        check_file(path, error=InputError, remedy=REMEDY)  # of a folder pandas reads what is in it
        with self._reading(name):
            if path.suffix == ".csv" and not path.read_bytes().endswith(b"\n"):
                raise InputError(f"{path}: is cut off in its last line; {REMEDY}")
            return pd.read_csv(path) if path.suffix == ".csv" else pd.read_parquet(path)

    def _points(self, name: str, columns: tuple[str, ...]) -> pd.DataFrame:
        with self._reading(LAYOUT):
            rows = [
                f["properties"] | dict(zip(("x_m", "y_m"), f["geometry"]["coordinates"], strict=True))
                for f in self.layout["features"]
                if f["properties"]["name"] == name
            ]
            table = pd.DataFrame(rows, columns=list(columns))
            return table.astype({column: float for column in columns if column.endswith(("_m", "_rad"))})


def read_result_folder(folder: Path) -> ResultFolder:
    """The run of a result folder. Raises InputError where a file is missing or is not what it should be."""
    settle(folder)
    _refuse_lacking(folder, NEEDED_FILES)
    result, layout = (_json_object(folder / name) for name in (RESULT, LAYOUT))
    _check_result(result, folder / RESULT)
    _refuse_lacking(folder, _files_told_of(result))
    with reading(folder / LAYOUT, error=InputError, remedy=REMEDY):
        features = {feature["properties"]["name"] for feature in layout.get("features") or []}
        placed = collection_in_metres(layout)
    if not layout.get("areas") or not features >= {"drivable", "closed_area", "pavement", "reference_line"}:
        raise InputError(f"{folder / LAYOUT}: areas or features missing; run the scenario again")
    return ResultFolder(folder=folder, result=result, layout=placed)


def _refuse_lacking(folder: Path, names: Iterable[str]) -> None:
    """Raise InputError where the folder lacks one of these files."""
    missing = [name for name in names if not (folder / name).exists()]
    if missing:
        raise InputError(f"{folder}: {', '.join(missing)} missing; a report needs the folder that `wzsumo run` wrote")
    for name in names:
        check_file(folder / name, error=InputError, remedy=REMEDY)


def _check_result(result: Mapping[str, Any], path: Path) -> None:
    """Raise InputError where an object is not the content of a run's result.json."""
    if missing := [key for key in NEEDED_KEYS if key not in result]:
        raise InputError(f"{path}: {', '.join(missing)} missing; it is no result of wzsumo {__version__}: {REMEDY}")
    if result.get("format") != RESULT_FORMAT:
        given = f"wzsumo {shown(result['version'])}, format {shown(result.get('format'))}"
        raise InputError(f"{path}: written by another version ({given}; this one reads format {RESULT_FORMAT}); {REMEDY}")
    parts = {key: result[key] for key in OBJECTS if result.get(key) is not None}
    if isinstance(result["methods"], dict):
        if wrong := [name for name in result["methods"] if not METHOD_NAME.fullmatch(name)]:
            raise InputError(f"{path}: methods: {shown(wrong[0])} is no name of a map method, and of its files; {REMEDY}")
        parts |= {f"methods.{name}": figures for name, figures in result["methods"].items()}
    for key, value in ({"methods": None} | parts).items():
        if not isinstance(value, dict):
            raise InputError(f"{path}: {key} must be a JSON object, given: {type(value).__name__}; {REMEDY}")


def _files_told_of(result: Mapping[str, Any]) -> list[str]:
    """The files that a run writes which has this result: each method has a map, its path and its drive where it has one."""
    methods = result["methods"]
    names = [f"maps/{name}.yaml" for name in methods]
    for folder, key in (("paths", "planned"), ("drives", "driven")):
        names += [f"{folder}/{name}.csv" for name, figures in methods.items() if figures.get(key)]
    return names + (list(MIXTURE_FILES) if result.get("n_components") else [])


def _json_object(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else one_line(str(error), limit=MAX_SHOWN)
        raise InputError(f"{path}: not JSON ({reason}); {REMEDY}") from None
    if not isinstance(content, dict):
        raise InputError(f"{path}: a JSON object is needed, given: {type(content).__name__}; {REMEDY}")
    return content
