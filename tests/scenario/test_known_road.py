"""The road before from OpenStreetMap and OpenDRIVE, which netconvert reads, and announcements of spec files."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import shapely
from builders import lane_map_of, paper_layout

from wzsumo.errors import InputError
from wzsumo.files.export.opendrive import opendrive_xml
from wzsumo.files.lanes import LanesFile
from wzsumo.geography import local_frame
from wzsumo.scenario.known_road import KnownRoad, read_known_road

PLACE = local_frame([[-83.74, 42.28]])
LINE = np.array([(0.0, 0.0), (400.0, 0.0), (800.0, 40.0), (1200.0, 120.0)])


def traces_along(line: np.ndarray) -> pd.DataFrame:
    path = shapely.LineString(line)
    tables = []
    for number in range(3):
        at = np.arange(0.0, path.length, 25.0)
        points = np.add(shapely.get_coordinates(shapely.line_interpolate_point(path, at)), (0.0, -1.0 * number))
        tables.append(pd.DataFrame({"vehicle_id": f"v{number}", "time_s": at / 25, "x_m": points[:, 0], "y_m": points[:, 1]}))
    return pd.concat(tables, ignore_index=True)


def osm_file(path: Path) -> Path:
    """A motorway of three lanes along LINE, and the other carriageway 30 m beside it."""
    nodes, refs = [], []
    for way, shift in enumerate((0.0, 30.0)):
        lonlat = PLACE.to_lonlat(np.add(LINE, (0.0, shift)))
        ids = [1 + 10 * way + k for k in range(len(LINE))]
        nodes += [
            f'<node id="{n}" lat="{lat:.8f}" lon="{lon:.8f}" version="1"/>' for n, (lon, lat) in zip(ids, lonlat, strict=True)
        ]
        order = ids if way == 0 else ids[::-1]
        refs.append("".join(f'<nd ref="{n}"/>' for n in order))
    tags = "".join(
        f'<tag k="{k}" v="{v}"/>'
        for k, v in {"highway": "motorway", "lanes": "3", "oneway": "yes", "maxspeed": "65 mph", "ref": "I 94"}.items()
    )
    ways = "".join(f'<way id="{900 + n}" version="1">{ref}{tags}</way>' for n, ref in enumerate(refs))
    path.write_text(f'<osm version="0.6">{"".join(nodes)}{ways}</osm>')
    return path


def known(path: Path, traces: pd.DataFrame, **given: Any) -> KnownRoad:
    return read_known_road(path, traces=traces, frame=PLACE, utc=False, source="t.csv", **given)


@pytest.mark.parametrize("suffix", [".osm", ".osm.pbf"])
def test_osm_extract_gives_the_carriageway_that_was_driven(tmp_path: Path, suffix: str) -> None:
    path = osm_file(tmp_path / "a.osm")
    if suffix == ".osm.pbf":
        import osmium

        path = tmp_path / "a.osm.pbf"
        writer = osmium.SimpleWriter(str(path))
        for entity in osmium.FileProcessor(str(tmp_path / "a.osm")):
            writer.add(entity)
        writer.close()
    found = known(path, traces_along(LINE))
    assert found.road.own_lanes == 3
    assert shapely.distance(shapely.points(found.road.reference_line), shapely.LineString(LINE)).max() < 0.5
    assert found.road.heading_at(10.0) == pytest.approx(0.0, abs=0.05)
    assert found.details["speed_limit_mps"] == pytest.approx(29.06, abs=0.1)
    assert any("wide, SUMO's default" in word or "shoulders" in word for word in found.said)
    back = known(path, traces_along(np.add(LINE, (0.0, 30.0))[::-1]))
    assert abs(float(back.road.heading_at(back.road.length - 10.0))) == pytest.approx(np.pi, abs=0.05)


def test_opendrive_that_was_exported_is_the_road_again(tmp_path: Path) -> None:
    content = LanesFile(lanes=lane_map_of(paper_layout(closed_lanes=(), shift_ft=0, shifted_lane_width_ft=None)), frame=PLACE)
    (tmp_path / "a.xodr").write_bytes(opendrive_xml(content, speed_limit_mps=26.8, name="zone"))
    axis = content.lanes.axis
    found = known(tmp_path / "a.xodr", traces_along(axis.to_xy(np.linspace(10.0, 1500.0, 20), 5.0)))
    assert found.road.lane_widths == pytest.approx(axis.lane_widths, abs=0.05)
    assert shapely.distance(shapely.points(found.road.reference_line), shapely.LineString(axis.reference_line)).max() < 0.15


@pytest.mark.parametrize(("name", "content"), [("a.osm", "<osm"), ("a.xodr", "<OpenDRIVE/>"), ("a.osm.pbf", "none")])
def test_file_of_which_no_network_is_made_is_refused(tmp_path: Path, name: str, content: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=f"--road .*{name}"):
        known(tmp_path / name, traces_along(LINE))


def test_feed_needs_traces_with_a_place(tmp_path: Path) -> None:
    road = tmp_path / "road.toml"
    road.write_text("[road]\nlane_count = 2\nleft_shoulder_ft = 4\nright_shoulder_ft = 10\nlength_ft = 5000\n")
    info = {"publisher": "DOT", "version": "4.2", "data_sources": [], "update_date": "2026-06-01T00:00:00Z"}
    feed = {
        "type": "FeatureCollection",
        "feed_info": info,
        "features": [{"properties": {"core_details": {"event_type": "work-zone"}}}],
    }
    (tmp_path / "f.geojson").write_text(json.dumps(feed))
    with pytest.raises(InputError, match="a feed is in degrees"):
        read_known_road(
            road, zone=str(tmp_path / "f.geojson"), traces=traces_along(LINE), frame=None, utc=False, source="t.csv"
        )


def test_announcement_of_a_spec_file_is_known_as_well_as_it_says(tmp_path: Path) -> None:
    road, zone = tmp_path / "road.toml", tmp_path / "zone.toml"
    road.write_text("[road]\nlane_count = 2\nleft_shoulder_ft = 4\nright_shoulder_ft = 10\nlength_ft = 5000\n")
    zone.write_text("[announced]\nstart_ft = 1000\nend_ft = 3000\nstart_sd_ft = 30\n")
    found = read_known_road(road, zone=str(zone), traces=traces_along(LINE), frame=None, utc=False, source="t.csv").announced
    assert found is not None
    assert (found.start_m, found.end_m, found.start_sd_m) == pytest.approx((304.8, 914.4, 9.144))
    assert found.end_sd_m == pytest.approx(60.96)  # 200 ft where the file does not say
    assert read_known_road(road, traces=traces_along(LINE), frame=None, utc=False, source="t.csv").announced is None
