"""`wzsumo map` with places on earth: files of providers, networks, feeds; what goes in comes out where it was."""

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from builders import lane_map_of, paper_layout

from wzsumo.case.map_method import MadeMap, MapTask, TracesMethod
from wzsumo.case.methods import METHODS, register
from wzsumo.cli import main
from wzsumo.files.frame import read_frame
from wzsumo.files.lanes import read_lanes
from wzsumo.files.ros_map import read_map
from wzsumo.geography import LocalFrame, local_frame
from wzsumo.simulation.connection import sumo_binary

PLACE = local_frame([[-83.74, 42.28]])
LENGTH_M = 700.0


def provider_file(path: Path, *, frame: LocalFrame = PLACE, reverse: bool = False) -> Path:
    """Six vehicles in the right of two lanes along y = 0 of a frame, as a data provider ships them."""
    rng = np.random.default_rng(1)
    tables = []
    for number in range(6):
        t = np.arange(0.0, LENGTH_M / 20.0, 0.5)
        x = LENGTH_M - 20.0 * t if reverse else 20.0 * t
        lonlat = frame.to_lonlat(np.column_stack([x, 0.1 * (number - 3) + 0.05 * rng.standard_normal(len(t))]))
        stamps = pd.Timestamp("2026-06-01T14:00:00Z") + pd.to_timedelta(t + 10 * number, unit="s")
        tables.append(pd.DataFrame({"journeyId": f"j{number}", "capturedTimestamp": stamps.strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
                                    "latitude": lonlat[:, 1], "longitude": lonlat[:, 0], "speed": 72.0}))  # fmt: skip
    pd.concat(tables).to_csv(path, index=False)
    return path


def run_map(capsys: pytest.CaptureFixture[str], tmp_path: Path, *words: str | Path) -> tuple[int, Any, str]:
    with pytest.raises(SystemExit) as stopped:
        main(["map", *map(str, words), "--out", str(tmp_path / "out"), "--json", "--resolution-m", "0.25"])
    out = capsys.readouterr()
    return int(stopped.value.code or 0), json.loads(out.out) if out.out else None, out.err


def free_at(out: Path, lonlat: Sequence[tuple[float, float]]) -> list[bool]:
    """Whether places [degrees] are free on a map, found as a stranger would: by frame.json and map.yaml."""
    frame, grid = read_frame(out), read_map(out / "map.yaml")
    assert frame is not None
    return [bool(grid.free[grid.cell_of(frame.from_lonlat([place]))][0]) for place in lonlat]


@pytest.mark.parametrize("centre", [(-84.0, 42.28), (151.2, -33.87), (180.0, -16.8)])
def test_map_of_degrees_lies_where_the_vehicles_drove(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], centre: tuple[float, float]
) -> None:
    frame = local_frame([centre])
    code, figures, _ = run_map(capsys, tmp_path, provider_file(tmp_path / "t.csv", frame=frame))
    assert code == 0
    assert figures["frame"]["crs"].startswith("+proj=tmerc")
    on_lane, beside = (frame.to_lonlat([(x, y) for x in (100.0, 350.0, 600.0)]).tolist() for y in (0.0, 8.0))
    assert free_at(tmp_path / "out", on_lane) == [True] * 3
    assert free_at(tmp_path / "out", beside) == [False] * 3
    assert any("speed is read as km/h" in word for word in figures["read_as"])


@pytest.fixture(scope="session")
def net_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two lanes along y = 0 .. 3.66, eastbound, in the frame PLACE, and the other direction beside them."""
    folder = tmp_path_factory.mktemp("net")
    (folder / "n.nod.xml").write_text('<nodes><node id="a" x="-100" y="-1.83"/><node id="b" x="900" y="-1.83"/></nodes>')
    edge = '<edge id="{}" from="{}" to="{}" numLanes="2" width="3.66" speed="29" spreadType="right" shape="{}"/>'
    edges = edge.format("eb", "a", "b", "-100,5.49 900,5.49") + edge.format("wb", "b", "a", "900,15 -100,15")
    (folder / "e.edg.xml").write_text(f"<edges>{edges}</edges>")
    out = folder / "road.net.xml"
    files = ["-n", str(folder / "n.nod.xml"), "-e", str(folder / "e.edg.xml"), "-o", str(out)]
    command = [str(sumo_binary("netconvert")), *files, "--no-warnings", "--offset.disable-normalization"]
    subprocess.run(command, check=True, capture_output=True)
    text = out.read_text().replace('projParameter="!"', f'projParameter="{PLACE.crs}"')
    out.write_text(text)
    return out


def feed_file(path: Path, **properties: Any) -> Path:
    lonlat = PLACE.to_lonlat([(150.0, 0.0), (300.0, 0.0), (500.0, 0.0)]).tolist()
    core = {"data_source_id": "1", "event_type": "work-zone", "road_names": ["I-94"], "direction": "eastbound"}
    event = {
        "id": "e1", "type": "Feature", "geometry": {"type": "LineString", "coordinates": lonlat},
        "properties": {
            "core_details": core, "start_date": "2026-06-01T00:00:00Z", "end_date": "2026-06-30T00:00:00Z",
            "is_start_position_verified": True, "is_end_position_verified": True, "vehicle_impact": "some-lanes-closed",
            "location_method": "unknown", "lanes": [{"order": 1, "type": "general", "status": "closed"},
                                                    {"order": 2, "type": "general", "status": "open"}],
        } | properties,
    }  # fmt: skip
    info = {"publisher": "DOT", "version": "4.2", "data_sources": [], "update_date": "2026-06-01T00:00:00Z"}
    path.write_text(json.dumps({"type": "FeatureCollection", "feed_info": info, "features": [event]}))
    return path


def test_network_and_feed_give_the_road_and_the_zone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], net_file: Path
) -> None:
    zone = f"{feed_file(tmp_path / 'feed.geojson')}#e1"
    code, figures, _ = run_map(capsys, tmp_path, provider_file(tmp_path / "t.csv"), "--road", net_file, "--zone", zone)
    assert code == 0
    announced = figures["announced"]
    assert (announced["start_m"], announced["end_m"]) == pytest.approx((250.0, 600.0), abs=1.0)  # the road begins at x = -100
    assert announced["closed_lanes"] == [1]
    assert announced["start_sd_m"] < 30
    assert [count["name"] for count in figures["lanes_along_the_road"]] == ["eb"]
    assert any("shoulders" in word for word in figures["warnings"])
    # The left lane was driven by nobody: known to be open well before the zone, and not open within it.
    before, inside = PLACE.to_lonlat([(20.0, 3.66), (320.0, 3.66)]).tolist()
    assert free_at(tmp_path / "out", [before, inside]) == [True, False]


def test_zone_without_a_road_is_told_along_the_traces(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, figures, _ = run_map(
        capsys, tmp_path, provider_file(tmp_path / "t.csv"), "--zone", feed_file(tmp_path / "feed.geojson")
    )
    assert code == 0
    assert figures["announced"]["end_m"] - figures["announced"]["start_m"] == pytest.approx(350.0, abs=2.0)
    # The feed has two lanes, vehicles drove in one: its lanes are not compared, by the number that the map has.
    assert any("says 2 lanes where the road has 1" in word for word in figures["warnings"])
    assert any("told, not used" in word for word in figures["warnings"])


REFUSED = {
    "another place": (["--road", "NET"], {"frame": local_frame([[-80.0, 40.0]])}, "different places or frames"),
    "an edge that is not there": (["--road", "NET", "--edges", "xx"], {}, "has no edge xx for cars"),
    "edges without a network": (["--edges", "eb"], {}, "name it with --road"),
    "a road of another kind": (["--road", "road.shp"], {}, "a road comes from a file that ends in .toml, .net.xml"),
    "an unknown CRS": (["--crs", "EPSG:1"], {}, "PROJ knows no such"),
    "a CRS in metres for degrees": (["--crs", "EPSG:32617"], {}, "is no CRS of degrees"),
    "columns without a name": (["--columns", "vehicle_id"], {}, "must be MEANING=NAME"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_fit_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], net_file: Path, case: str
) -> None:
    words, how, said = REFUSED[case]
    traces = provider_file(tmp_path / "t.csv", frame=how.get("frame", PLACE))
    code, _, err = run_map(capsys, tmp_path, traces, *(str(net_file) if word == "NET" else word for word in words))
    assert code == 2
    assert said in err.splitlines()[-1]
    assert not (tmp_path / "out").exists()


def test_road_in_metres_of_no_place_is_refused_for_traces_that_have_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    road = tmp_path / "road.toml"
    lines = [
        "[road]", "lane_count = 2", "left_shoulder_ft = 4", "right_shoulder_ft = 10",
        "reference_points_m = [[-100.0, 1.83], [900.0, 1.83]]", "CRS", "[announced]", "start_ft = 800", "end_ft = 2000",
    ]  # fmt: skip
    road.write_text("\n".join(lines).replace("CRS", ""))
    traces = provider_file(tmp_path / "t.csv")
    code, _, err = run_map(capsys, tmp_path, traces, "--road", road)
    assert code == 2
    assert "give road.crs" in err
    road.write_text("\n".join(lines).replace("CRS", f'crs = "{PLACE.crs}"'))
    assert run_map(capsys, tmp_path, traces, "--road", road)[0] == 0


def test_lanes_of_a_method_are_written_with_their_place_and_a_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], net_file: Path
) -> None:
    exact = lane_map_of(paper_layout())

    def make(_traces: pd.DataFrame, task: MapTask) -> MadeMap:
        return MadeMap(task.cells, {}, exact)

    register(TracesMethod(name="known_lanes", title="lanes that are known", make=make, cpu_s=1.0))
    try:
        zone = feed_file(tmp_path / "feed.geojson")
        words = ("--road", net_file, "--zone", zone, "--method", "known_lanes")
        code, figures, _ = run_map(capsys, tmp_path, provider_file(tmp_path / "t.csv"), *words)
    finally:
        del METHODS["known_lanes"]
    assert code == 0
    back = read_lanes(tmp_path / "out" / "lanes.geojson")
    assert (back.frame, back.utc) == (PLACE, True)
    assert len(back.lanes.lanes) == 3
    assert figures["verified"]["closed_lanes"] == [2]
    assert figures["verified"]["start_sd_m"] < 5
    assert "Map less announced" in (tmp_path / "out" / "zone.html").read_text()
