"""The command from start to end, and SUMO's own runs of what it wrote."""

import functools
import io
import json
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
import shapely
from placement.networks import city, freeway, new_folder
from sumo_runs import outlines_in

import wzsumo
from wzsumo.cli import main
from wzsumo.simulation.connection import sumo_binary

LEFT_LANE = "[work_zone]\nclosed_lanes = [2]\nwork_length_ft = 500\n"
DETECTORS = """<additional>
    <inductionLoop id="before" lane="m3_2" pos="200" period="600" file="det.xml"/>
    <inductionLoop id="within" lane="m3_1" pos="600" period="600" file="det.xml"/>
    <inductionLoop id="closed" lane="m3_2" pos="600" period="600" file="det.xml"/>
    <laneAreaDetector id="area" lane="m3_0" pos="250" length="300" period="600" file="det.xml"/>
    <taz id="z" edges="m3 m4"/>
</additional>"""
CONFIG = """<configuration>
    <input> <!-- kept -->
        <net-file value="../small.net.xml"/> <route-files value="../demand.rou.xml"/>
        <additional-files value="detectors.add.xml"/>
    </input>
    <output><tripinfo-output value="trips.xml"/> <summary-output value="results/summary.xml"/></output>
    <time><begin value="0"/><end value="900"/></time>
</configuration>"""

GUI_SECTION = """    <gui_only>
        <gui-settings-file value="wzsumo.zone.view.xml"/>
    </gui_only>
</configuration>"""


def run_place(*words: object) -> tuple[int, str, str]:
    """(exit code, stdout, stderr) of `wzsumo place`."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as stopped:
        main(["place", *map(str, words)])
    return int(stopped.value.code or 0), out.getvalue(), err.getvalue()


def simulate(folder: Path, *options: str) -> str:
    command = [
        str(sumo_binary("sumo")),
        "-c",
        str(folder / "run.sumocfg"),
        "--no-step-log",
        "--xml-validation",
        "never",
        *options,
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stderr


@functools.cache
def placed_freeway() -> tuple[Path, dict[str, object]]:
    """The left lane closed 300 m before the middle of edge m3, with detectors, from a whole configuration; and what it says."""
    folder = freeway().parent / "configuration"
    folder.mkdir()
    (folder / "zone.toml").write_text(LEFT_LANE)
    (folder / "detectors.add.xml").write_text(DETECTORS)
    (folder / "given.sumocfg").write_text(CONFIG)
    out = new_folder() / "out"
    code, told, err = run_place(
        freeway(),
        "--zone",
        folder / "zone.toml",
        "--at",
        "m3",
        300,
        "--sumocfg",
        folder / "given.sumocfg",
        "--out",
        out,
        "--json",
    )
    assert code == 0, err
    return out, json.loads(told)


@functools.cache
def trips(name: str) -> pd.DataFrame:
    out, _ = placed_freeway()
    warnings = simulate(out / name, "--seed", "7")
    assert "teleport" not in warnings.lower()
    rows = [trip.attrib for trip in ET.parse(out / name / "trips.xml").iter("tripinfo")]
    return pd.DataFrame(rows).set_index("id")


def test_three_configurations_keep_the_given_one_but_for_the_names_of_files() -> None:
    out, figures = placed_freeway()
    assert figures["cuts"] == {"m3": {"pieces": ["m3.wz0", "m3.wz1", "m3.wz2", "m3.wz3"], "at_m": [300.0, 349.5, 903.98]}}
    for name, additionals in (
        ("original", "detectors.add.xml"),
        ("open", "wzsumo.vtype.add.xml,detectors.add.xml"),
        ("closed", "wzsumo.vtype.add.xml,detectors.add.xml,wzsumo.zone.add.xml"),
    ):
        text = (out / name / "run.sumocfg").read_text()
        assert text == CONFIG.replace('"../small.net.xml"', '"small.net.xml"').replace("../demand", "demand").replace(
            '"detectors.add.xml"', f'"{additionals}"'
        ).replace("</configuration>", GUI_SECTION)
    for file in ("small.net.xml", "demand.rou.xml"):
        assert (out / "original" / file).read_bytes() == (freeway().parent / file).read_bytes()
        assert (out / "original" / "results").is_dir()  # SUMO makes no folder for what it writes
        assert (out / "open" / file).read_bytes() != (freeway().parent / file).read_bytes()
    assert "<!-- stays -->" in (out / "closed" / "demand.rou.xml").read_text()


def test_every_vehicle_drives_as_far_in_all_three_and_nobody_is_lost() -> None:
    original, opened, closed = (trips(name)["routeLength"].astype(float) for name in ("original", "open", "closed"))
    assert len(original) > 250
    for other in (opened, closed):
        assert set(other.index) == set(original.index)
        assert np.abs(other - original[other.index]).max() < 0.0101


def test_detectors_count_the_same_vehicles_where_nothing_is_closed_and_none_in_the_closed_lane() -> None:
    counts = {}
    for name in ("original", "open", "closed"):
        trips(name)
        rows = ET.parse(placed_freeway()[0] / name / "det.xml").iter("interval")
        seen = [(row.get("id"), float(row.get("nVehContrib") or row.get("nVehSeen") or 0)) for row in rows]
        counts[name] = pd.DataFrame(seen, columns=["id", "n"]).groupby("id")["n"].sum().to_dict()
    assert counts["open"]["within"] == pytest.approx(counts["original"]["within"], rel=0.15)
    assert counts["open"]["area"] == pytest.approx(counts["original"]["area"], rel=0.15)
    assert counts["original"]["closed"] > 20
    assert counts["closed"]["closed"] == 0


def vehicles_over_closed_ground(out: Path) -> dict[str, int]:
    """How many vehicles reach into the closed ground by 0.1 m or more in `open` and in `closed`."""
    features = json.loads((out / "layout.geojson").read_text())["features"]
    ground = next(shapely.geometry.shape(f["geometry"]) for f in features if f["properties"]["name"] == "closed_area")
    core = ground.buffer(-0.1)
    over = {}
    for name in ("open", "closed"):
        fcd = new_folder() / "fcd.csv"
        simulate(out / name, "--fcd-output", str(fcd), "--fcd-output.filter-edges.input-file", str(_pieces(out)))
        rows = pd.read_csv(fcd, sep=";").rename(columns=lambda column: column.split("_", 1)[1])
        rows = rows[rows["id"].notna()]
        over[name] = rows["id"][core.intersects(outlines_in(rows, length=5.0, width=1.8))].nunique()
    return over


def _pieces(out: Path) -> Path:
    path = out / "pieces.txt"
    path.write_text("".join(f"edge:m3.wz{number}\n" for number in range(6)))
    return path


def test_nobody_drives_over_the_closed_ground_and_without_the_zone_many_do() -> None:
    over = vehicles_over_closed_ground(placed_freeway()[0])
    assert over["open"] > 50
    assert over["closed"] == 0


@pytest.mark.parametrize(
    "zone",
    [
        "closed_lanes = [1]\nwork_length_ft = 300\nposted_speed_mph = 55",
        "closed_lanes = [1, 2]\nwork_length_ft = 300\nposted_speed_mph = 45",
        "closed_lanes = [2]\nwork_length_ft = 300\nshift_ft = 6\n[road]\nright_shoulder_ft = 10\nleft_shoulder_ft = 8",
    ],
    ids=["interior", "two lanes", "shift"],
)
def test_zones_of_other_kinds_keep_everybody_off_the_closed_ground(zone: str, tmp_path: Path) -> None:
    (tmp_path / "zone.toml").write_text(f"[work_zone]\n{zone}\n")
    demand = freeway().parent / "demand.rou.xml"
    wzsumo.place(freeway(), zone=tmp_path / "zone.toml", at=("m3", 100.0), routes=[demand], out=tmp_path / "out")
    assert vehicles_over_closed_ground(tmp_path / "out")["closed"] == 0
    assert "eleport" not in simulate(tmp_path / "out" / "closed")


def test_zone_is_drawn_in_the_network_that_is_closed() -> None:
    out, figures = placed_freeway()
    root = ET.parse(out / "closed" / "wzsumo.zone.add.xml").getroot()
    devices = [poly for poly in root.iter("poly") if poly.get("id", "").startswith("wzsumo.zone.device_")]
    assert len(devices) == figures["n_devices"] == 26
    assert {poi.get("type") for poi in root.iter("poi")} >= {"W4-2L", "W20-5L", "W20-1", "G20-2"}


def test_second_zone_in_a_network_that_has_one_loads_and_both_are_drawn(tmp_path: Path) -> None:
    (tmp_path / "zone.toml").write_text(LEFT_LANE.replace("500", "100"))
    first = placed_freeway()[0] / "closed"
    words = ("--at", "m2", 100, "--sumocfg", first / "run.sumocfg", "--out", tmp_path / "out")
    code, _, err = run_place(first / "small.net.xml", "--zone", tmp_path / "zone.toml", *words)
    assert code == 0, err
    second = tmp_path / "out" / "closed"
    assert "Warning" not in simulate(second, "--end", "5")
    drawn = {poly.get("id", "") for path in second.glob("*zone.add.xml") for poly in ET.parse(path).getroot().iter("poly")}
    assert {"wzsumo.zone.device_000", "wzsumo.zone1.device_000"} <= drawn


def test_window_opens_at_the_zone_unless_the_configuration_has_settings_of_its_own(tmp_path: Path) -> None:
    for name in ("original", "open", "closed"):
        viewport = ET.parse(placed_freeway()[0] / name / "wzsumo.zone.view.xml").getroot().find("viewport")
        assert viewport is not None
        assert float(viewport.get("x", 0)) == pytest.approx(2890, abs=100)  # edge m3 begins at 2,600 m
        assert 5999 * 100 / float(viewport.get("zoom", 0)) == pytest.approx(320, abs=1)  # m of the 6 km
    (tmp_path / "own.view.xml").write_text("<viewsettings/>")
    own = '<gui_only><start value="true"/> <gui-settings-file value="own.view.xml"/></gui_only></configuration>'
    (tmp_path / "given.sumocfg").write_text(
        CONFIG.replace("</configuration>", own)
        .replace("../small", str(freeway().parent / "small"))
        .replace('<route-files value="../demand.rou.xml"/>', "")
        .replace('<additional-files value="detectors.add.xml"/>', "")
    )
    (tmp_path / "zone.toml").write_text(LEFT_LANE)
    words = ("--at", "m3", 300, "--sumocfg", tmp_path / "given.sumocfg", "--out", tmp_path / "out")
    code, _, err = run_place(freeway(), "--zone", tmp_path / "zone.toml", *words)
    assert code == 0, err
    config = ET.parse(tmp_path / "out" / "closed" / "run.sumocfg").getroot()
    assert [item.get("value") for item in config.iter("gui-settings-file")] == ["own.view.xml"]


def test_zone_in_a_city_of_signals_loads_and_runs() -> None:
    folder = new_folder()
    (folder / "zone.toml").write_text("[work_zone]\nclosed_lanes = [0]\nwork_length_ft = 50\nposted_speed_mph = 25\n")
    (folder / "trips.xml").write_text(
        '<routes><flow id="a" from="A0B0" to="B2C2" begin="0" end="200" number="20"/>'
        '<flow id="b" from="A1B1" to="B1C1" begin="0" end="200" number="40"/></routes>'
    )
    out = folder / "out"
    code, told, err = run_place(
        city(), "--zone", folder / "zone.toml", "--at", "A1B1", 20, "--routes", folder / "trips.xml", "--out", out, "--json"
    )
    assert code == 0, err
    assert json.loads(told)["warnings"] == [
        "road_type is left out: signs and arrow boards are those of a freeway, at 25 mph; give "
        'road_type = "urban_low_speed", "urban_high_speed" or "rural" on another road',
        "40 vehicles depart on edge 'A1B1', which is cut: they enter on its first piece, which is not quite the same",
    ]
    for name in ("original", "open", "closed"):
        assert "Warning" not in simulate(out / name, "--end", "600")


def test_vehicles_that_heed_no_closure_are_refused_with_their_number(tmp_path: Path) -> None:
    (tmp_path / "zone.toml").write_text(LEFT_LANE)
    demand = '<vType id="t" vClass="ignoring"/><flow id="a" from="m1" to="m4" number="12" begin="0" end="60" type="t"/>'
    (tmp_path / "trips.xml").write_text(f"<routes>{demand}</routes>")
    words = ("--at", "m3", 300, "--routes", tmp_path / "trips.xml", "--out", tmp_path / "out")
    code, _, err = run_place(freeway(), "--zone", tmp_path / "zone.toml", *words)
    assert (code, err.count("\n")) == (2, 1)
    assert '12 vehicles of class "ignoring" drive along the closed lanes\' edges (m3)' in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--at", "m3", "300", "--routes", "no.xml"], "the demand no.xml: cannot be read"),
        (["--at", "m3", "far"], "the position is not a number"),
        (["--at", "m9", "3"], "the network has no such edge"),
        (["--at-latlon", "36", "-86"], "has no geographic frame"),
        (["--at", "m3", "300", "--sumocfg", "no.sumocfg"], "the configuration no.sumocfg: cannot be read"),
    ],
)
def test_bad_input_is_told_in_one_line_and_nothing_is_written(words: list[str], message: str, tmp_path: Path) -> None:
    (tmp_path / "zone.toml").write_text(LEFT_LANE)
    code, out, err = run_place(freeway(), "--zone", tmp_path / "zone.toml", *words, "--out", tmp_path / "out")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert not (tmp_path / "out").exists()


def test_routes_of_another_network_are_refused(tmp_path: Path) -> None:
    (tmp_path / "zone.toml").write_text(LEFT_LANE)
    (tmp_path / "trips.xml").write_text('<routes><trip id="a" from="m1" to="elsewhere" depart="0"/></routes>')
    words = ("--at", "m3", 300, "--routes", tmp_path / "trips.xml", "--out", tmp_path / "out")
    code, _, err = run_place(freeway(), "--zone", tmp_path / "zone.toml", *words)
    assert (code, err.count("\n")) == (2, 1)
    assert "trips.xml: 1 of 2 edges that vehicles drive on are not in" in err
    assert "'elsewhere'" in err
    assert not (tmp_path / "out").exists()


def test_zone_with_a_time_is_open_with_rerouters_that_bar_its_lanes(tmp_path: Path) -> None:
    (tmp_path / "zone.toml").write_text(LEFT_LANE)
    words = ("--at", "m3", 300, "--routes", freeway().parent / "demand.rou.xml", "--out", tmp_path / "out")
    code, _, _ = run_place(freeway(), "--zone", tmp_path / "zone.toml", *words, "--closed-from", 60, "--closed-for", 900)
    assert code == 0
    nets = [(tmp_path / "out" / name / "small.net.xml").read_bytes() for name in ("open", "closed")]
    assert nets[0] == nets[1]
    closure = ET.parse(tmp_path / "out" / "closed" / "wzsumo.closure.add.xml").getroot()
    intervals = {(item.get("begin"), item.get("end")) for item in closure.iter("interval")}
    assert min(float(begin or 0) for begin, _ in intervals) == 60
    assert {end for _, end in intervals} == {"960.0"}
    assert {lane.get("id") for lane in closure.iter("closingLaneReroute")} == {"m3.wz1_2", "m3.wz2_2"}


def test_zone_that_is_gone_before_it_stands_is_refused(tmp_path: Path) -> None:
    (tmp_path / "zone.toml").write_text(LEFT_LANE)
    words = ("--at", "m3", 300, "--routes", freeway().parent / "demand.rou.xml", "--out", tmp_path / "out")
    code, _, err = run_place(freeway(), "--zone", tmp_path / "zone.toml", *words, "--closed-for", 60)
    assert (code, err.count("\n")) == (2, 1)
    assert "begin earlier or end later" in err
