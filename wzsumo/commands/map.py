"""The command `map`: a map from anybody's traces, what was learned of them and what was left out."""

import argparse
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pandas as pd

from wzsumo.case.map_method import Source
from wzsumo.case.methods import DEFAULT_METHOD, methods_from
from wzsumo.case.traces_map import crowd_method, map_of_traces
from wzsumo.commands.terminal.arguments import (
    add_out_folder,
    add_reading,
    cell_edge_m,
    column_names,
    compass_bearing,
    number,
    seed,
)
from wzsumo.commands.terminal.progress import progress_of, say
from wzsumo.crowd_mapping.cleaning.usable_traces import usable_traces
from wzsumo.crowd_mapping.reference_line import reference_line_from_traces
from wzsumo.errors import InputError
from wzsumo.feeds.verified import verified_zone
from wzsumo.files.fixes.fixes import Fixes
from wzsumo.files.frame import write_frame
from wzsumo.files.lanes import LanesFile, write_lanes
from wzsumo.files.output import staged_folder
from wzsumo.files.ros_map import write_map
from wzsumo.files.traces import read_fixes
from wzsumo.lane_map import LaneMap
from wzsumo.report.zone_page import write_zone_page
from wzsumo.road import Road
from wzsumo.scenario.known_road import KnownRoad, announcement_along, read_known_road
from wzsumo.scenario.road_before import check_on_road, map_before
from wzsumo.tables import refuse_endless_traces
from wzsumo.units import METRES_PER_FOOT

MORE = """\
Traces are files or folders of .csv, .tsv, .parquet, GeoParquet, SUMO's FCD (.xml), .gpx, also as .csv.gz, one row a fix:
vehicle_id, time_s, x_m, y_m (the vehicle's centre, metres), and may have heading_rad, speed_mps, length_m, width_m. The
names of data providers and tools (journeyId, capturedTimestamp, latitude, ...), ISO 8601 and epoch times are known; --columns
names others. Latitude and longitude are projected to a local frame, which frame.json beside map.yaml states.

Free cells have p_occupied below 0.196; where nobody drove is unknown, not free.

Traces alone leave open which lanes the road has and where they lie exactly; --road says how it was before the zone. It names
a scenario (its road and where its zone begins and ends count), a SUMO network (.net.xml), an OpenStreetMap extract (.osm,
.osm.pbf), OpenDRIVE (.xodr), a GeoJSON line whose properties say `lanes`, or a file such as the one below. The stretch of a
network is found from the traces, or named by --edges. --zone takes the zone from a WZDx 4 feed, with the feed's accuracy.

  [road]                       # lanes from right to left, widths in feet
  lane_count = 2
  left_shoulder_ft = 10
  right_shoulder_ft = 10
  reference_points_m = [[0.0, 3.66], [1500.0, 3.66]]     # the middle of all lanes, in the direction of travel
  [announced]                  # first and last device, along the road
  start_ft = 1000
  end_ft = 3400
"""
MAX_DROPS_PRINTED = 8  # on stderr; --json lists all


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("traces", type=Path, nargs="+", metavar="TRACES", help="files or folders of traces")
    add_out_folder(parser)
    add_reading(parser)
    parser.add_argument(
        "--method", choices=list(methods_from(Source.CROWD)), default=DEFAULT_METHOD,
        help=f"how traces become a map (default: {DEFAULT_METHOD})",
    )  # fmt: skip
    parser.add_argument("--road", type=Path, metavar="FILE", help="the road before the zone, to which the map is joined")
    parser.add_argument(
        "--zone", metavar="FEED.geojson#ID", help="the announced zone: a WZDx feed, one of its events, or a TOML file"
    )
    parser.add_argument(
        "--edges", nargs="+", default=[], metavar="EDGE", help="the stretch of a network, instead of the traces' own"
    )
    parser.add_argument(
        "--shoulders-ft", nargs=2, type=number, metavar=("LEFT", "RIGHT"), help="of a road from a network, which has none"
    )
    parser.add_argument(
        "--direction", type=compass_bearing, metavar="N|NE|...|DEG",
        help="map the vehicles that drive this way: a compass point, or degrees clockwise from north (+y)",
    )  # fmt: skip
    parser.add_argument("--resolution-m", type=cell_edge_m, default=0.127, help="edge of a cell (default 0.127 m, 5 in)")
    parser.add_argument("--seed", type=seed, default=1, help="of the random numbers of a method that draws some (default 1)")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write map.pgm and map.yaml of the traces in files; what they are made of and what was left out.

    Beside them are frame.json where the map has a place on earth, lanes.geojson and zone.html where the method knows lanes.
    Raises InputError where the files make no map of one zone, and where the traces are not on the road.
    """
    method, source = crowd_method(args.method, road=args.road), " ".join(map(str, args.traces))
    with progress_of(args)("reading the traces", 1.0) as tell:
        fixes = read_fixes(args.traces, columns=column_names(args.columns), crs=args.crs, tell=tell)
    refuse_endless_traces(fixes.table, source=source)
    heading = None if args.direction is None else math.pi / 2 - math.radians(args.direction)
    with progress_of(args)("checking the fixes", 1.0) as tell:
        usable = usable_traces(fixes.table, source=source, heading_rad=heading, tell=tell)
    n_fixes, traces = len(fixes.table), usable.traces
    fixes = replace(fixes, table=fixes.table.iloc[:0])  # it may hold millions of fixes
    _say_dropped(args, usable.dropped)
    known = _known_road(args, traces, fixes, source=source)
    before = None if known is None or args.road is None else map_before(known.road, known.announced)
    if before is not None:
        check_on_road(traces, before, source=source, road_source=str(args.road))
    made = map_of_traces(
        traces, method, source=source, seed=args.seed, resolution_m=args.resolution_m, before=before, progress=progress_of(args)
    )
    if known is not None and args.road is None and made.lanes:
        known = _told_along(args.zone, made.lanes.axis, traces, fixes, n_lanes=len(made.lanes.lanes))
    doubts = [*fixes.doubts, *(known.said if known else ())]
    with staged_folder(args.out) as stage:
        write_map(made.grid, stage)
        if fixes.frame:
            write_frame(fixes.frame, stage)
        if made.lanes:
            content = LanesFile(lanes=made.lanes, frame=fixes.frame, utc=fixes.utc)
            write_lanes(content, stage)
            write_zone_page(content, stage, announced=known.announced if known else None, words=doubts)
    return {
        "map": str(args.out / "map.yaml"),
        "frame": fixes.frame.as_json() if fixes.frame else None,
        "read_as": list(fixes.said),
        "method": method.name,
        "n_traces": int(traces["vehicle_id"].nunique()),
        "n_fixes": n_fixes,
        "n_fixes_used": len(traces),
        "dropped": usable.dropped.astype({"n_fixes": int}).to_dict("records"),
        "free_m2": float(made.grid.free.sum() * args.resolution_m**2),
        **made.figures,
        **_road_figures(known),
        **_zone_figures(made.lanes),
        "warnings": [*doubts, *made.figures.get("warnings", ())],
    }


def next_step(figures: dict[str, Any], args: argparse.Namespace) -> str:
    """What to do with what was written."""
    if figures.get("open_lanes") is None:
        return f"wzsumo plan {args.out / 'map.yaml'} --start X Y DEG --goal X Y DEG --out path.csv"
    return f"open {args.out / 'zone.html'} in a browser; wzsumo export {args.out} --to opendrive --out FILE hands the lanes on"


def _known_road(args: argparse.Namespace, traces: pd.DataFrame, fixes: Fixes, *, source: str) -> KnownRoad | None:
    """The road and what is announced on it; a zone without a road is laid along the traces' own line, to be compared."""
    if args.road is not None:
        feet = args.shoulders_ft
        shoulders = None if feet is None else (feet[0] * METRES_PER_FOOT, feet[1] * METRES_PER_FOOT)
        return read_known_road(
            args.road, zone=args.zone, traces=traces, frame=fixes.frame, utc=fixes.utc, edges=args.edges, shoulders=shoulders,
            source=source,
        )  # fmt: skip
    if args.edges or args.shoulders_ft:
        raise InputError("--edges and --shoulders-ft: are of a network; name it with --road NET.net.xml")
    if args.zone is None:
        return None
    return _told_along(args.zone, reference_line_from_traces(traces), traces, fixes, n_lanes=None)


def _told_along(zone: str, line: Road, traces: pd.DataFrame, fixes: Fixes, *, n_lanes: int | None) -> KnownRoad:
    """What is announced along a line of traces or the axis of a map, whose lanes it is compared with."""
    found, said, details = announcement_along(zone, line, traces=traces, frame=fixes.frame, utc=fixes.utc, n_lanes=n_lanes)
    word = "the announced zone is told, not used: a map is joined to it on a road (--road)"
    return KnownRoad(road=line, announced=found, said=(*said, word), details=details)


def _road_figures(known: KnownRoad | None) -> dict[str, Any]:
    """What --json prints of the road and of the announcement."""
    if known is None:
        return {}
    zone = known.announced
    return known.details | {"announced": None if zone is None else asdict(zone), "road_length_m": known.road.length}


def _zone_figures(lanes: LaneMap | None) -> dict[str, Any]:
    """Where the map shows the zone, what it closes, and how well that is known."""
    verified = None if lanes is None else verified_zone(lanes)
    if verified is None:
        return {}
    numbers = {key: None if value == math.inf else value for key, value in asdict(verified).items()}  # JSON has no infinity
    return {"verified": numbers}


def _say_dropped(args: argparse.Namespace, dropped: pd.DataFrame) -> None:
    for vehicle_id, n_fixes, reason in dropped.head(MAX_DROPS_PRINTED).itertuples(index=False):
        say(args, f"left out: {vehicle_id}, {n_fixes} fix(es): {reason}")
    if len(dropped) > MAX_DROPS_PRINTED:
        say(args, f"left out: {len(dropped) - MAX_DROPS_PRINTED} more; --json lists them all")
