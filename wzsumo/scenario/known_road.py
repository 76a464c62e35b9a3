"""KnownRoad: the road before a zone and what is announced on it, from any of the files that people have.

A road comes from a scenario, a TOML file, a SUMO network, OpenStreetMap, OpenDRIVE or a GeoJSON line, by the name of its file;
an announcement from the same scenario or TOML file, or from a WZDx feed.
"""

import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from wzsumo.announced_zone import AnnouncedZone
from wzsumo.errors import InputError, SpecError
from wzsumo.feeds.announcement import announced_on
from wzsumo.feeds.road_event import read_feed, road_event, road_events, split_event
from wzsumo.files.work_folder import work_folder
from wzsumo.geography import LocalFrame
from wzsumo.road import Road
from wzsumo.roads.found_road import FoundRoad
from wzsumo.roads.line_file import read_line
from wzsumo.roads.network_road import read_network_road
from wzsumo.scenario.road_before import read_announced, read_road_spec
from wzsumo.simulation.connection import sumo_binary

NETWORKS = (".net.xml", ".net.xml.gz")
LINES = (".geojson", ".json")
# Sources that netconvert makes a network of, with its options. OSM: types of roads and their lanes as SUMO ships them.
OSM_OPTIONS = ("--geometry.remove", "--ramps.guess", "--junctions.join", "--output.original-names", "--proj.utm")
IMPORTED = {
    ".osm": ("--osm-files", OSM_OPTIONS),
    ".osm.xml": ("--osm-files", OSM_OPTIONS),
    ".osm.pbf": ("--osm-files", OSM_OPTIONS),
    ".xodr": ("--opendrive-files", ()),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownRoad:
    """The road before (metres of the traces), what is announced on it (None: nothing), and what was taken for what."""

    road: Road
    announced: AnnouncedZone | None = None
    said: tuple[str, ...] = ()
    details: dict[str, Any] = field(default_factory=dict)  # lane counts, ramps and events, as --json prints them


def read_known_road(
    path: Path,
    *,
    traces: pd.DataFrame,
    frame: LocalFrame | None,
    utc: bool,
    source: str,
    zone: str | None = None,
    edges: Sequence[str] = (),
    shoulders: tuple[float, float] | None = None,
) -> KnownRoad:
    """The road of a file, and the announcement of `zone` (FEED.geojson#ID or a TOML file) or of the road's own file.

    `traces` are usable ones, in metres of `frame`; `edges` name the stretch of a network. Raises InputError: file, key, rule.
    """
    name = path.name.lower()
    if name.endswith(NETWORKS):
        found = read_network_road(path, traces=traces, frame=frame, edges=edges, shoulders=shoulders, source=source)
    elif suffix := next((suffix for suffix in IMPORTED if name.endswith(suffix)), None):
        with work_folder(Path(tempfile.gettempdir())) as folder:
            net = _imported(path, suffix, folder)
            found = read_network_road(net, traces=traces, frame=frame, edges=edges, shoulders=shoulders, source=source)
    elif name.endswith(LINES):
        found = read_line(path, frame=frame)
    elif name.endswith(".toml"):
        return _of_toml(path, zone=zone, traces=traces, frame=frame, utc=utc)
    else:
        known = ", ".join([".toml", *NETWORKS, *IMPORTED, *LINES])
        raise SpecError(f"--road {path}: a road comes from a file that ends in {known}")
    announced, said, events = _announced(zone, found.road, traces=traces, frame=frame, utc=utc)
    return KnownRoad(road=found.road, announced=announced, said=(*found.assumed, *said), details=_details(found) | events)


def announcement_along(
    zone: str, line: Road, *, traces: pd.DataFrame, frame: LocalFrame | None, utc: bool, n_lanes: int | None = None
) -> tuple[AnnouncedZone, tuple[str, ...], dict[str, Any]]:
    """(what a feed announces along a line, what was said about it, the ids of its events); `n_lanes` are along it."""
    announced, said, events = _announced(zone, line, traces=traces, frame=frame, utc=utc, n_lanes=n_lanes)
    if announced is None:
        raise InputError(f"--zone {zone}: announces nothing")
    return announced, said, events


def _of_toml(path: Path, *, zone: str | None, traces: pd.DataFrame, frame: LocalFrame | None, utc: bool) -> KnownRoad:
    road, own_frame, own = read_road_spec(path)
    if frame is not None and own_frame is None:
        raise SpecError(f"{path}: its road is in metres of no known place, the traces have one ({frame.crs}); give road.crs")
    if frame is None and own_frame is not None:
        raise SpecError(f"{path}: its road has a place on earth (road.crs), the traces have none; say theirs with --crs")
    if frame is not None and own_frame is not None and frame != own_frame:
        line = frame.from_lonlat(own_frame.to_lonlat(road.reference_line))
        road = Road(
            reference_line=line, lane_widths=road.lane_widths, left_shoulder=road.left_shoulder,
            right_shoulder=road.right_shoulder, opposing_lanes=road.opposing_lanes,
        )  # fmt: skip
    if zone is None:
        return KnownRoad(road=road, announced=own)
    announced, said, events = _announced(zone, road, traces=traces, frame=frame, utc=utc)
    return KnownRoad(road=road, announced=announced, said=said, details=events)


def _announced(
    zone: str | None, road: Road, *, traces: pd.DataFrame, frame: LocalFrame | None, utc: bool, n_lanes: int | None = None
) -> tuple[AnnouncedZone | None, tuple[str, ...], dict[str, Any]]:
    if zone is None:
        return None, (), {}
    path, event_id = split_event(zone)
    if path.suffix == ".toml":
        return read_announced(path, road), (), {}
    feed = read_feed(path)
    if frame is None:
        raise SpecError(f"--zone {zone}: a feed is in degrees, the traces are metres of no known place; say theirs with --crs")
    if event_id is None:
        events, faults = road_events(feed, source=str(path))
    else:
        events, faults = [road_event(feed, event_id, source=str(path))], []
    times = (float(traces["time_s"].min()), float(traces["time_s"].max())) if utc else None
    found = announced_on(events, road, frame=frame, times_s=times, source=str(path), n_lanes=n_lanes, faults=faults)
    return found.zone, found.said, {"events": list(found.events)}


def _details(found: FoundRoad) -> dict[str, Any]:
    return {
        "lanes_along_the_road": [vars(count) for count in found.counts],
        "ramps": [vars(ramp) for ramp in found.ramps],
        "speed_limit_mps": found.speed_mps,
    }


def _imported(path: Path, suffix: str, folder: Path) -> Path:
    """The network that netconvert makes of a file. Raises InputError where it makes none."""
    if not path.is_file():
        raise SpecError(f"--road {path}: no such file")
    option, others = IMPORTED[suffix]
    source = _as_osm_xml(path, folder) if suffix == ".osm.pbf" else path
    if option == "--osm-files":
        types = sumo_binary("netconvert").parents[1] / "data" / "typemap" / "osmNetconvert.typ.xml"
        others = ("--type-files", str(types), *others)
    net = folder / "road.net.xml"
    command = [str(sumo_binary("netconvert")), option, str(source), "--output-file", str(net), *others, "--no-warnings"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0 or not net.is_file():
        why = " ".join(done.stderr.split())[:200]
        raise InputError(f"--road {path}: netconvert makes no network of it ({why})")
    return net


def _as_osm_xml(path: Path, folder: Path) -> Path:
    """The same extract as OSM XML, ways and nodes alone."""
    try:
        import osmium
    except ImportError:
        raise InputError(f"--road {path}: reading .osm.pbf takes the extra: pip install 'wzsumo[osm]', or give .osm") from None
    out = folder / "extract.osm"
    writer = osmium.SimpleWriter(str(out))
    try:
        for entity in osmium.FileProcessor(str(path)):
            writer.add(entity)
    except RuntimeError as error:
        raise InputError(f"--road {path}: is no OSM extract ({error})") from None
    finally:
        writer.close()
    return out
