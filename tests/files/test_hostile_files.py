"""Files that are damaged or hostile end in a result or in one line: no traceback, no memory without bound."""

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from builders import lane_map_of, paper_layout, straight_traces
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wzsumo.errors import InputError
from wzsumo.feeds.announcement import announced_on
from wzsumo.feeds.road_event import read_feed, road_events
from wzsumo.files.frame import read_frame
from wzsumo.files.lanes import LanesFile, lanes_geojson, read_lanes
from wzsumo.files.traces import read_fixes
from wzsumo.geography import local_frame
from wzsumo.input_files import read_bytes, read_json
from wzsumo.road import Road
from wzsumo.roads.line_file import read_line
from wzsumo.roads.sumo_net import read_net

PLACE = local_frame([[-83.74, 42.28]])
ROAD = Road(reference_line=np.array([[0.0, 0.0], [900.0, 0.0]]), lane_widths=(3.6, 3.6), left_shoulder=1.0, right_shoulder=3.0)
LINE = PLACE.to_lonlat(np.column_stack([np.linspace(200.0, 700.0, 4), np.zeros(4)])).tolist()
HOSTILE: st.SearchStrategy[Any] = st.sampled_from(
    [None, True, "", "x", "\x00\u202e", -1, 0, 1e308, -1e308, 2**63, 10**400, float("nan"), float("inf"), "9" * 400, "1e999",
     [], {}, [[]], [1, 2], {"a": 1}, [[0, 0], [0, 0]], [[1e300, 1e300], [-1e300, 2]], "2026-13-45T99:99:99Z"]
)  # fmt: skip


def feed() -> dict[str, Any]:
    core = {"data_source_id": "1", "event_type": "work-zone", "road_names": ["I-80"], "direction": "eastbound"}
    properties = {"core_details": core, "start_date": "2026-06-01T00:00:00Z", "end_date": "2026-06-30T00:00:00Z",
                  "is_start_position_verified": True, "vehicle_impact": "some-lanes-closed", "reduced_speed_limit_kph": 88.5,
                  "lanes": [{"order": 1, "type": "general", "status": "closed"}]}  # fmt: skip
    event = {"id": "a", "type": "Feature", "properties": properties, "geometry": {"type": "LineString", "coordinates": LINE}}
    return {"type": "FeatureCollection", "feed_info": {"version": "4.2"}, "features": [event]}


def line() -> dict[str, Any]:
    return {"type": "Feature", "properties": {"lanes": 2, "lane_width_ft": 12, "speed_limit_mph": 55},
            "geometry": {"type": "LineString", "coordinates": LINE}}  # fmt: skip


LANES = lanes_geojson(LanesFile(lanes=lane_map_of(paper_layout()), frame=PLACE, utc=True))


def events_of(path: Path) -> None:
    events, faults = road_events(read_feed(path), source="f")
    announced_on(events, ROAD, frame=PLACE, times_s=None, source="f", faults=faults)


JSON_READERS: dict[str, tuple[Callable[[], dict[str, Any]], Callable[[Path], object]]] = {
    "feed.geojson": (feed, events_of),
    "road.geojson": (line, lambda path: read_line(path, frame=PLACE)),
    "lanes.geojson": (lambda: LANES, read_lanes),
    "frame.json": (PLACE.as_json, lambda path: read_frame(path.parent)),
}


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths to the values of a JSON document, of long lists to their first three."""
    inner: list[tuple[Any, Any]] = []
    if isinstance(value, dict):
        inner = list(value.items())
    elif isinstance(value, list):
        inner = list(enumerate(value))[:3]
    return [path, *(place for key, each in inner for place in places(each, (*path, key)))]


def ends_well(read: Callable[[Path], object], path: Path) -> None:
    message = ""
    try:
        read(path)
    except InputError as error:
        message = str(error)
    assert "\n" not in message
    assert len(message) < 900


@pytest.mark.parametrize("name", JSON_READERS)
@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_json_with_a_hostile_value_ends_in_a_result_or_a_line(tmp_path: Path, name: str, data: st.DataObject) -> None:
    make, read = JSON_READERS[name]
    content = json.loads(json.dumps(make()))
    where = data.draw(st.sampled_from(places(content)[1:]))
    inner: Any = content
    for key in where[:-1]:
        inner = inner[key]
    if data.draw(st.booleans()):
        inner[where[-1]] = data.draw(HOSTILE)
    else:
        del inner[where[-1]]
    (tmp_path / name).write_text(json.dumps(content))
    ends_well(read, tmp_path / name)


NET = (
    '<net><location netOffset="0,0" projParameter="!"/><edge id="a" from="n" to="m"><lane id="a_0" index="0" speed="13" '
    'shape="0,0 100,0"/></edge><edge id="b" from="m" to="o"><lane id="b_0" index="0" speed="13" shape="100,0 200,0"/></edge>'
    '<connection from="a" to="b" fromLane="0" toLane="0"/></net>'
)
FCD = "<fcd-export>" + "".join(
    f'<timestep time="{t}"><vehicle id="v" x="{20 * t}" y="1" angle="90" speed="20"/></timestep>' for t in range(9)
)
GPX = '<gpx><trk><trkseg><trkpt lat="42.1" lon="-83.1"><time>2026-06-01T12:00:00Z</time></trkpt></trkseg></trk></gpx>'
CSV = straight_traces([0.0]).head(40).to_csv(index=False)
TEXT_READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "a.net.xml": (NET, read_net),
    "a.xml": (f"{FCD}</fcd-export>", lambda path: read_fixes([path])),
    "a.gpx": (GPX, lambda path: read_fixes([path])),
    "a.csv": (CSV, lambda path: read_fixes([path])),
}


@pytest.mark.parametrize("name", TEXT_READERS)
@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_text_ends_in_a_result_or_a_line(tmp_path: Path, name: str, data: st.DataObject) -> None:
    text, read = TEXT_READERS[name]
    content = bytearray(text.encode())
    start = data.draw(st.integers(0, len(content) - 1))
    length = data.draw(st.sampled_from([0, 1, 4, 40, len(content)]))
    put = data.draw(
        st.sampled_from([b"", b"\x00", b"\xff\xfe", b'"', b",,,,", b"<", b"&x;", b"nan", b"1e999", b"9" * 400, b"-"])
    )
    content[start : start + length] = put
    (tmp_path / name).write_bytes(content)
    ends_well(read, tmp_path / name)


@pytest.mark.parametrize("compressed", [False, True])
@settings(max_examples=30, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_bytes_of_packed_tables_end_in_a_result_or_a_line(
    tmp_path: Path, compressed: bool, data: st.DataObject
) -> None:
    path = tmp_path / ("a.csv.gz" if compressed else "a.parquet")
    if compressed:
        path.write_bytes(gzip.compress(CSV.encode()))
    else:
        straight_traces([0.0]).head(40).to_parquet(path)
    content = bytearray(path.read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    content[at:] = (
        content[at + 1 :] if data.draw(st.booleans()) else bytes([data.draw(st.integers(0, 255))]) + content[at + 1 :]
    )
    path.write_bytes(content)
    ends_well(lambda file: read_fixes([file]), path)


BOMB = "<!DOCTYPE a [<!ENTITY a0 'lol'>{}]>".format("".join(f"<!ENTITY a{n} '{f'&a{n - 1};' * 10}'>" for n in range(1, 12)))


@pytest.mark.parametrize("name", ["a.xml", "a.gpx", "a.net.xml"])
@pytest.mark.parametrize("entity", [BOMB, "<!DOCTYPE a [<!ENTITY a11 SYSTEM 'file:///etc/passwd'>]>"])
def test_entities_of_xml_are_not_expanded_without_bound_nor_read_from_files(tmp_path: Path, name: str, entity: str) -> None:
    text, read = TEXT_READERS[name]
    (tmp_path / name).write_text(entity + text.replace('"a"', '"&a11;"').replace('"v"', '"&a11;"').replace("2026", "&a11;"))
    with pytest.raises(InputError, match="entit"):
        read(tmp_path / name)


def test_file_that_unpacks_to_much_more_than_itself_is_refused(tmp_path: Path) -> None:
    with gzip.open(tmp_path / "a.csv.gz", "wb") as file:
        for _ in range(70):
            file.write(bytes(2**20))
    with pytest.raises(InputError, match="unpacks to more than 200 times its size"):
        read_fixes([tmp_path / "a.csv.gz"])
    (tmp_path / "b.gz").write_bytes(gzip.compress(b"abc" * 1000))
    assert read_bytes(tmp_path / "b.gz") == b"abc" * 1000


@pytest.mark.parametrize(("text", "said"), [("[" * 100_000, "nested too deeply"), ("[" + "9" * 21 + "]", "of 21 digits")])
def test_json_that_no_file_of_data_holds_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(ValueError, match=said):
        read_json(tmp_path / "a.json")
    (tmp_path / "b.json").write_text("\ufeff[12345678901234567890]")  # with a byte order mark, as some editors write it
    assert read_json(tmp_path / "b.json") == [12345678901234567890]


def test_table_of_too_many_columns_is_refused(tmp_path: Path) -> None:
    pd.DataFrame([range(2001)], columns=[f"c{n}" for n in range(2001)]).to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(InputError, match="has 2001 columns; a table of traces has at most 2000"):
        read_fixes([tmp_path / "a.csv"])
