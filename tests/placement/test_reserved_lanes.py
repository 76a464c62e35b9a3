"""Zones beside and on a lane that is reserved for buses and cars with several people in them (HOV)."""

import functools
import subprocess
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from placement.networks import netconvert, new_folder, zone

from wzsumo.errors import PlacementError
from wzsumo.placement.configuration import Configuration
from wzsumo.placement.net import Net
from wzsumo.placement.placement import place_zone, write_placement
from wzsumo.simulation.connection import sumo_binary

NODES = '<nodes><node id="a" x="0" y="0"/> <node id="b" x="1000" y="0"/> <node id="c" x="3000" y="0"/></nodes>'
LANES = '<lane index="2" allow="hov bus"/>'
EDGES = f"""<edges>
<edge id="e1" from="a" to="b" numLanes="3" speed="29">{LANES}</edge>
<edge id="e2" from="b" to="c" numLanes="3" speed="29">{LANES}</edge>
</edges>"""
DEMAND = """<routes><vType id="car"/> <vType id="pool" vClass="hov"/> <vType id="bus" vClass="bus"/>
<flow id="car" from="e1" to="e2" begin="0" end="120" number="50" departLane="best" departSpeed="max" type="car"/>
<flow id="pool" from="e1" to="e2" begin="0" end="120" number="12" departLane="best" departSpeed="max" type="pool"/>
<flow id="bus" from="e1" to="e2" begin="0" end="120" number="3" departLane="best" departSpeed="max" type="bus"/></routes>"""


@functools.cache
def freeway() -> Path:
    folder = new_folder()
    for name, text in (("small.nod.xml", NODES), ("small.edg.xml", EDGES), ("demand.rou.xml", DEMAND)):
        (folder / name).write_text(text)
    return netconvert(folder, "-n", str(folder / "small.nod.xml"), "-e", str(folder / "small.edg.xml"), "--no-turnarounds")


def place(closed: list[int], folder: Path) -> None:
    net = freeway()
    placed = place_zone(Net.read(net), zone(closed_lanes=closed, work_length_ft=300), edge_id="e2", position=300.0)
    write_placement(placed, Configuration.of_files(net, [net.parent / "demand.rou.xml"], []), folder)


@pytest.mark.parametrize("closed", [[0], [2], [1, 2]])
def test_all_vehicles_come_through_where_each_class_has_a_lane_left(closed: list[int], tmp_path: Path) -> None:
    place(closed, tmp_path / "out")
    trips = tmp_path / "trips.xml"
    options = ("--tripinfo-output", str(trips), "--end", "400", "--no-step-log", "--xml-validation", "never")
    config = tmp_path / "out" / "closed" / "run.sumocfg"
    subprocess.run([str(sumo_binary("sumo")), "-c", str(config), *options], check=True, capture_output=True)
    assert len(ET.parse(trips).getroot()) == 50 + 12 + 3


def test_cars_that_have_the_reserved_lane_alone_left_are_refused_with_their_number(tmp_path: Path) -> None:
    with pytest.raises(PlacementError, match="50 vehicles of class passenger would lose their way"):
        place([0, 1], tmp_path / "out")
