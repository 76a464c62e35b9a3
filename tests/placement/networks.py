"""Small networks and demand, made by SUMO's own tools, in which tests place zones."""

import functools
import subprocess
import tempfile
from pathlib import Path

from wzsumo.placement.net import Net
from wzsumo.placement.placement import Placed, place_zone
from wzsumo.placement.zone_file import ZoneToPlace
from wzsumo.simulation.connection import sumo_binary

FREEWAY_NODES = """<nodes>
<node id="a" x="0" y="0"/> <node id="b" x="1200" y="0"/> <node id="c" x="2600" y="60"/> <node id="d" x="4200" y="300"/>
<node id="e" x="6000" y="300"/> <node id="r1" x="800" y="-200"/> <node id="r2" x="4700" y="60"/>
</nodes>"""
FREEWAY_EDGES = """<edges>
<edge id="m1" from="a" to="b" numLanes="3" speed="29.06"/> <edge id="m2" from="b" to="c" numLanes="3" speed="29.06"/>
<edge id="m3" from="c" to="d" numLanes="3" speed="29.06"/> <edge id="m4" from="d" to="e" numLanes="3" speed="29.06"/>
<edge id="on" from="r1" to="b" numLanes="1" speed="20"/> <edge id="off" from="d" to="r2" numLanes="1" speed="20"/>
</edges>"""
FREEWAY_DEMAND = """<routes>
    <vType id="car" lcStrategic="2"/>   <!-- stays -->
    <vType id="truck" vClass="truck" maxSpeed="24"/>
    <route id="through" edges="m1 m2-AddedOnRampEdge m2 m3 m3-AddedOffRampEdge m4"/>
    <flow id="main" route="through" begin="0" end="300" vehsPerHour="2700" departLane="best" departSpeed="max" type="car"/>
    <flow id="lorries" from="m1" to="m4" begin="0" end="300" vehsPerHour="200" departLane="free" type="truck"/>
    <flow id="on" from="on" to="m4" begin="0" end="300" vehsPerHour="300" departSpeed="max"/>
    <flow id="off" from="m1" to="off" begin="0" end="300" vehsPerHour="300" departLane="best" type="car"/>
</routes>"""


_folders: list[tempfile.TemporaryDirectory[str]] = []  # deleted when Python ends


def new_folder() -> Path:
    """A folder for one network, which lasts as long as the tests."""
    _folders.append(tempfile.TemporaryDirectory(prefix="wzsumo-net-"))
    return Path(_folders[-1].name)


def netconvert(folder: Path, *options: str) -> Path:
    """The network that netconvert makes with these options."""
    net = folder / "small.net.xml"
    command = [str(sumo_binary("netconvert")), *options, "-o", str(net), "--xml-validation", "never", "--no-warnings"]
    subprocess.run(command, check=True, capture_output=True)
    return net


@functools.cache
def freeway() -> Path:
    """A freeway of three lanes with a ramp on at 1.2 km and a ramp off at 4.2 km, and auxiliary lanes beside both."""
    folder = new_folder()
    (folder / "small.nod.xml").write_text(FREEWAY_NODES)
    (folder / "small.edg.xml").write_text(FREEWAY_EDGES)
    (folder / "demand.rou.xml").write_text(FREEWAY_DEMAND)
    plain = ("-n", str(folder / "small.nod.xml"), "-e", str(folder / "small.edg.xml"))
    return netconvert(folder, *plain, "--ramps.guess", "--no-turnarounds")


@functools.cache
def freeway_on_earth() -> Path:
    """A freeway of three lanes in Tennessee, 1.8 km along 36 degrees north, in the UTM frame that netconvert chose."""
    folder = new_folder()
    nodes = '<node id="a" x="-86.60" y="36.00"/> <node id="b" x="-86.58" y="36.00"/>'
    (folder / "small.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
    (folder / "small.edg.xml").write_text('<edges><edge id="ab" from="a" to="b" numLanes="3" speed="29.06"/> '
                                          '<edge id="ba" from="b" to="a" numLanes="3" speed="29.06"/></edges>')  # fmt: skip
    plain = ("-n", str(folder / "small.nod.xml"), "-e", str(folder / "small.edg.xml"))
    return netconvert(folder, *plain, "--proj.utm", "--no-turnarounds", "false")


@functools.cache
def narrows_and_widens(drops: str) -> Path:
    """A road of three lanes whose "left" or "right" one ends; for 300 m it has two, then a third opens on the left."""
    folder = new_folder()
    nodes = "".join(f'<node id="{name}" x="{x}" y="0"/>' for name, x in (("a", 0), ("b", 1500), ("c", 1800), ("d", 4000)))
    edges = "".join(
        f'<edge id="{from_}{to}" from="{from_}" to="{to}" numLanes="{lanes}" speed="29.06"/>'
        for from_, to, lanes in (("a", "b", 3), ("b", "c", 2), ("c", "d", 3))
    )
    ways = [("ab", "bc", lane + (drops == "right"), lane) for lane in (0, 1)]
    ways += [("bc", "cd", 0, 0), ("bc", "cd", 1, 1), ("bc", "cd", 1, 2)]
    links = "".join(
        f'<connection from="{from_}" to="{to}" fromLane="{lane}" toLane="{onto}"/>' for from_, to, lane, onto in ways
    )
    parts = {"nod": f"<nodes>{nodes}</nodes>", "edg": f"<edges>{edges}</edges>", "con": f"<connections>{links}</connections>"}
    for part, text in parts.items():
        (folder / f"small.{part}.xml").write_text(text)
    return netconvert(folder, "-n", str(folder / "small.nod.xml"), "-e", str(folder / "small.edg.xml"),
                      "-x", str(folder / "small.con.xml"))  # fmt: skip


@functools.cache
def city() -> Path:
    """A grid of signals, with sidewalks and crossings, lanes of 3.2 m, two in each direction and a lane for turns."""
    folder = new_folder()
    net = folder / "small.net.xml"
    command = [
        str(sumo_binary("netgenerate")), "--grid", "--grid.number", "3", "--grid.length", "300", "-L", "2", "--sidewalks.guess",
        "--crossings.guess", "--tls.guess", "--turn-lanes", "1", "-o", str(net), "--no-warnings", "--xml-validation", "never",
    ]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True)
    return net


def zone(**keys: object) -> ZoneToPlace:
    """A zone of 500 ft of work that closes the rightmost lane."""
    return ZoneToPlace.model_validate({"work_zone": {"closed_lanes": [0], "work_length_ft": 500} | keys})


def placed_on_freeway(edge: str, position: float, **keys: object) -> Placed:
    """A zone at a place of the freeway."""
    return place_zone(Net.read(freeway()), zone(**keys), edge_id=edge, position=position)
