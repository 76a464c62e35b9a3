"""Exports of the library's zones, read back by other people's readers: lanelet2, netconvert, geopandas."""

import json
import math
import subprocess
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import shapely
from builders import lane_map_of, paper_layout

from wzsumo.errors import MapError
from wzsumo.files.export.geoparquet import geoparquet_bytes
from wzsumo.files.export.lanelet2 import lanelet2_osm
from wzsumo.files.export.open_strips import open_sections
from wzsumo.files.export.opendrive import opendrive_xml
from wzsumo.files.lanes import LanesFile, lanes_geojson, read_lanes, write_lanes
from wzsumo.geography import LocalFrame, local_frame
from wzsumo.scenario.scenario import load_scenario
from wzsumo.simulation.connection import sumo_binary

SCENARIOS = Path(__file__).parents[3] / "scenarios"
ZONES = sorted(path.stem for path in SCENARIOS.glob("*.toml"))
ONE_WAY = [zone for zone in ZONES if not zone.startswith("one_lane") and "two_lane" not in zone]
PLACE = local_frame([[-83.74, 42.28]])


def exact(zone: str, frame: LocalFrame | None = PLACE) -> LanesFile:
    return LanesFile(lanes=lane_map_of(load_scenario(SCENARIOS / f"{zone}.toml").layout()), frame=frame, utc=True)


@pytest.mark.parametrize("frame", [PLACE, None, LocalFrame(crs="EPSG:32756", origin_m=(334_000.0, 6_250_000.0))])
def test_lane_map_comes_back_from_its_file(tmp_path: Path, frame: LocalFrame | None) -> None:
    content = exact("paper_bend_900m", frame)
    write_lanes(content, tmp_path)
    back = read_lanes(tmp_path)
    assert back.frame == frame
    assert back.lanes.axis.reference_line == pytest.approx(content.lanes.axis.reference_line, abs=1e-3)
    for lane, other in zip(content.lanes.lanes, back.lanes.lanes, strict=True):
        for name in ("right", "left", "right_sd", "left_sd", "p_open"):
            assert getattr(other, name) == pytest.approx(getattr(lane, name), abs=1e-4)
    assert (back.lanes.n_traces, back.lanes.first_time_s, back.utc) == (5, 1_780_322_400.0, True)


def test_geojson_is_of_rfc_7946_where_there_is_a_frame_and_says_so_where_there_is_none() -> None:
    placed = lanes_geojson(exact("paper"))
    for found in placed["features"]:
        shape = shapely.geometry.shape(found["geometry"])
        west, south, east, north = shape.bounds
        assert -83.75 < west <= east < -83.70
        assert 42.27 < south <= north < 42.29
        assert all(part.exterior.is_ccw for part in shapely.get_parts(shape) if part.geom_type == "Polygon")
    assert placed["times"]["first"] == "2026-06-01T14:00:00Z"
    bare = lanes_geojson(exact("paper", None))
    assert "not RFC 7946" in bare["coordinates"]
    assert "frame" not in bare


def test_ground_across_the_180th_meridian_is_cut_there() -> None:
    found = lanes_geojson(exact("paper", local_frame([[179.995, -16.8]], step_deg=0.001)))["features"]
    lane = shapely.geometry.shape(next(f["geometry"] for f in found if f["properties"]["name"] == "lane"))
    parts = list(shapely.get_parts(lane))
    assert len(parts) == 2
    assert all(np.ptp(shapely.get_coordinates(part)[:, 0]) < 1 for part in parts)


@pytest.mark.parametrize("centre", [(179.995, -16.8), (180.0, -16.8), (-179.999, 51.9)])
def test_lane_map_across_the_180th_meridian_comes_back_and_is_exported(tmp_path: Path, centre: tuple[float, float]) -> None:
    content = exact("paper_bend_900m", local_frame([centre], step_deg=0.001))
    write_lanes(content, tmp_path)
    back = read_lanes(tmp_path)
    lines = [shapely.LineString(lanes.axis.reference_line) for lanes in (content.lanes, back.lanes)]
    assert shapely.hausdorff_distance(lines[0], lines[1]) < 0.01
    assert lines[1].length == pytest.approx(lines[0].length, abs=0.01)
    assert np.hypot(*(lines[1].coords[0] - np.array(lines[0].coords[0]))) < 0.01  # and runs the same way
    for data in (lanelet2_osm(back, speed_limit_mps=None), opendrive_xml(back, speed_limit_mps=None, name="zone")):
        ET.fromstring(data)


def test_lane_sections_tell_where_the_closed_lane_is_open() -> None:
    layout = paper_layout()
    content = LanesFile(lanes=lane_map_of(layout), frame=PLACE)
    sections = [f["properties"] for f in lanes_geojson(content)["features"] if f["properties"]["name"] == "lane_section"]
    (closed,) = [found for found in sections if found["state"] == "closed"]
    taper = layout.area("merging taper")
    assert closed["lane"] == 2
    assert taper.start < closed["start_m"] < taper.end  # its middle closes half-way along the taper
    assert closed["end_m"] == pytest.approx(layout.end, abs=40)


def test_geoparquet_is_read_by_geopandas(tmp_path: Path) -> None:
    import geopandas

    (tmp_path / "lanes.parquet").write_bytes(geoparquet_bytes(exact("right_lane")))
    table = geopandas.read_parquet(tmp_path / "lanes.parquet")
    assert table.crs.equals("OGC:CRS84")
    assert set(table["state"]) == {"open", "unknown", "closed"}  # unknown where its middle strips are half closed
    length = (table["end_m"] - table["start_m"]).to_numpy()
    area = table.to_crs("EPSG:32617").area.to_numpy() / 1.0005**2  # UTM's scale there
    assert area == pytest.approx(length * table["width_m"].to_numpy(), rel=0.01)
    (tmp_path / "bare.parquet").write_bytes(geoparquet_bytes(exact("right_lane", None)))
    assert geopandas.read_parquet(tmp_path / "bare.parquet").crs is None


@pytest.mark.parametrize("zone", ONE_WAY)
def test_lanelet2_finds_a_way_from_every_lane_through_the_zone(tmp_path: Path, zone: str) -> None:
    import lanelet2
    from lanelet2.projection import LocalCartesianProjector

    content = exact(zone)
    (tmp_path / "zone.osm").write_bytes(lanelet2_osm(content, speed_limit_mps=20.1168))
    projector = LocalCartesianProjector(lanelet2.io.Origin(42.28, -83.74))
    found, errors = lanelet2.io.loadRobust(str(tmp_path / "zone.osm"), projector)
    assert not errors
    rules = lanelet2.traffic_rules.create(lanelet2.traffic_rules.Locations.Germany, lanelet2.traffic_rules.Participants.Vehicle)
    graph = lanelet2.routing.RoutingGraph(found, rules)
    graph.checkValidity()  # raises where the graph contradicts itself
    lanelets = list(found.laneletLayer)
    lanes = content.lanes
    start, end = float(lanes.stations[0]), float(lanes.stations[-1])

    def at(station: float) -> dict[int, "lanelet2.core.ConstLanelet"]:
        number = np.searchsorted(lanes.stations, station) - 1
        open_ = [i for i, lane in enumerate(lanes.lanes) if lane.p_open_middle[number] > 0.9]
        points = {i: lanes.to_xy(station, lanes.lanes[i].middle[number]) for i in open_}
        return {
            i: lanelet for i, (x, y) in points.items() for lanelet in lanelets
            if lanelet2.geometry.inside(lanelet, lanelet2.core.BasicPoint2d(x, y))
        }  # fmt: skip

    first, last = at(start + 5), at(end - 5)
    assert len(first) == len(last) == lanes.axis.own_lanes
    for lanelet in first.values():
        assert any(graph.getRoute(lanelet, goal) is not None for goal in last.values())
        assert rules.speedLimit(lanelet).speedLimit == pytest.approx(72.42, abs=0.01)  # km/h: 45 mph
        assert lanelet.attributes["one_way"] == "yes"


def test_lanelet2_bounds_lie_where_the_lines_are(tmp_path: Path) -> None:
    import lanelet2
    from lanelet2.projection import LocalCartesianProjector

    content = exact("paper_bend_900m")
    (tmp_path / "zone.osm").write_bytes(lanelet2_osm(content, speed_limit_mps=None))
    found = lanelet2.io.load(str(tmp_path / "zone.osm"), LocalCartesianProjector(lanelet2.io.Origin(42.28, -83.74)))
    lines = shapely.MultiLineString(
        [content.lanes.to_xy(content.lanes.stations, side) for lane in content.lanes.lanes for side in (lane.right, lane.left)]
    )
    points = [(p.x, p.y) for lanelet in found.laneletLayer for p in lanelet.leftBound]
    off = shapely.distance(shapely.points(points), lines)
    on_line = off[off < 0.29]  # a strip of 0.3 m: what is farther is the device line along a taper
    assert len(on_line) > 0.8 * len(off)
    # The ENU plane of that projector leaves the transverse Mercator by d^3 / (6 R^2): 1 mm at 2 km.
    assert np.quantile(on_line, 0.9) < 0.01


def read_by_netconvert(path: Path) -> ET.Element:
    out = path.with_suffix(".net.xml")
    command = [str(sumo_binary("netconvert")), "--opendrive-files", str(path), "-o", str(out), "--no-internal-links",
               "--offset.disable-normalization", "--opendrive.curve-resolution", "0.5"]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "rror" not in done.stderr, done.stderr
    return ET.parse(out).getroot()


@pytest.mark.parametrize("zone", ONE_WAY)
def test_netconvert_reads_the_open_lanes_of_an_opendrive_file(tmp_path: Path, zone: str) -> None:
    content = exact(zone)
    (tmp_path / "zone.xodr").write_bytes(opendrive_xml(content, speed_limit_mps=20.0, name=zone))
    net = read_by_netconvert(tmp_path / "zone.xodr")
    counts = [
        len([lane for lane in edge.findall("lane") if "passenger" in lane.get("allow", "passenger")])
        for edge in net.findall("edge") if edge.get("function") != "internal"
    ]  # fmt: skip
    layout = load_scenario(SCENARIOS / f"{zone}.toml").layout()
    n_closed = len(layout.work_zone.closed_lanes)
    assert max(counts) == layout.road.own_lanes
    assert min(counts) == layout.road.own_lanes - n_closed


def test_netconvert_puts_lanes_of_one_width_where_they_are(tmp_path: Path) -> None:
    content = exact("paper_bend_300m")
    (tmp_path / "zone.xodr").write_bytes(opendrive_xml(content, speed_limit_mps=20.0, name="bend"))
    net = read_by_netconvert(tmp_path / "zone.xodr")
    location = net.find("location")
    assert location is not None
    assert location.get("projParameter", "").startswith("+proj=tmerc +lat_0=42.28 +lon_0=-83.74")
    lanes = content.lanes
    middles = shapely.MultiLineString([lanes.to_xy(lanes.stations, lane.middle) for lane in lanes.lanes])
    points = np.concatenate(
        [
            np.array([point.split(",") for point in lane.get("shape", "").split()], dtype=float)
            for edge in net.findall("edge") for lane in edge.findall("lane")
        ]
    )  # fmt: skip
    stations, _ = lanes.axis.to_sd(points)
    # Beyond the zone, on the bend; inside it SUMO draws lanes with the width of their start.
    beyond = (stations > load_scenario(SCENARIOS / "paper_bend_300m.toml").layout().end + 5) & (
        stations < lanes.stations[-1] - 5
    )
    assert beyond.sum() > 100
    assert shapely.distance(shapely.points(points[beyond]), middles).max() < 0.02  # shapes have two decimals


@pytest.mark.parametrize("zone", ["paper_bend_300m", "lane_shift", "interior_lane"])
def test_opendrive_says_the_edges_of_open_lanes_within_a_centimetre(zone: str) -> None:
    content = exact(zone)
    road = ET.fromstring(opendrive_xml(content, speed_limit_mps=None, name=zone)).find("road")
    assert road is not None
    lanes = content.lanes
    known = shapely.MultiLineString(
        [lanes.to_xy(section.stations, side) for section in open_sections(lanes) for strip in section.strips
         for side in (strip.right, strip.left)]
    )  # fmt: skip
    edges = np.concatenate([edges_at(road, s) for s in np.arange(1.0, float(road.get("length", "0")), 7.3)])
    assert len(edges) > 300
    assert shapely.distance(shapely.points(edges), known).max() < 0.01


def edges_at(road: ET.Element, s: float) -> np.ndarray:
    """Both edges (k, 2) of every driving lane at a station, by the equations of the specification."""

    def last(elements: list[ET.Element], key: str, at: float) -> ET.Element:
        return [element for element in elements if float(element.get(key, "0")) <= at + 1e-9][-1]

    def value(element: ET.Element, ds: float) -> float:
        return sum(float(element.get(name, "0")) * ds**power for power, name in enumerate("abcd"))

    geometry = last(road.findall("planView/geometry"), "s", s)
    x, y, heading, length, start = (float(geometry.get(name, "0")) for name in ("x", "y", "hdg", "length", "s"))
    straight = ET.Element("paramPoly3", bU=str(length))  # a <line> as a cubic
    found_cubic = geometry.find("paramPoly3")
    cubic = straight if found_cubic is None else found_cubic
    p = (s - start) / length
    u, v = (sum(float(cubic.get(f"{name}{axis}", "0")) * p**k for k, name in enumerate("abcd")) for axis in "UV")
    du, dv = (
        sum(k * float(cubic.get(f"{name}{axis}", "0")) * p ** (k - 1) for k, name in enumerate("abcd") if k) for axis in "UV"
    )
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    point, along = turn @ (u, v) + (x, y), turn @ (du, dv)
    normal = np.array([-along[1], along[0]]) / np.hypot(*along)
    lanes = road.find("lanes")
    assert lanes is not None
    offset = last(lanes.findall("laneOffset"), "s", s)
    t = value(offset, s - float(offset.get("s", "0")))
    section = last(lanes.findall("laneSection"), "s", s)
    found = []
    for lane in section.findall("right/lane"):
        ds = s - float(section.get("s", "0"))
        width = last(lane.findall("width"), "sOffset", ds)
        other = t - value(width, ds - float(width.get("sOffset", "0")))
        if lane.get("type") == "driving":
            found += [point + t * normal, point + other * normal]
        t = other
    return np.array(found)


def closed_in_the_middle() -> LanesFile:
    """The right lane of a zone that closes it, alone."""
    lanes = exact("right_lane").lanes
    return LanesFile(lanes=replace(lanes, lanes=lanes.lanes[:1]), frame=PLACE)


def test_maps_without_a_place_or_an_open_lane_are_refused() -> None:
    with pytest.raises(MapError, match="--origin"):
        lanelet2_osm(exact("paper", None), speed_limit_mps=None)
    with pytest.raises(MapError, match="a road of OpenDRIVE has no gap"):
        opendrive_xml(closed_in_the_middle(), speed_limit_mps=None, name="closed")


def test_file_that_is_no_lane_map_is_refused_with_its_path(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    for content in ("{", json.dumps({"type": "FeatureCollection", "features": []}), json.dumps([1])):
        path.write_text(content)
        with pytest.raises(MapError, match=r"a.geojson: is no lanes.geojson"):
            read_lanes(path)
    with pytest.raises(MapError, match="no such file"):
        read_lanes(tmp_path / "none.geojson")


def test_speed_limits_are_in_mph_for_lanelet2() -> None:
    root = ET.fromstring(lanelet2_osm(exact("paper"), speed_limit_mps=26.8224))
    limits = {tag.get("v") for tag in root.iter("tag") if tag.get("k") == "speed_limit"}
    assert limits == {"60 mph"}
    assert math.isclose(float(root.find("node").get("lat", "0")), 42.28, abs_tol=0.01)  # type: ignore[union-attr]  # there is one
