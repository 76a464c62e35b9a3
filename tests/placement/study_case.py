"""A small network with a demand, and a scenario that places a zone in it, by which tests run whole cases."""

import functools
from pathlib import Path

from placement.networks import netconvert, new_folder

STREET_NODES = """<nodes>
<node id="a" x="0" y="150"/> <node id="b" x="500" y="150"/> <node id="c" x="1300" y="150"/> <node id="d" x="1600" y="150"/>
<node id="r" x="300" y="0"/>
</nodes>"""
STREET_EDGES = """<edges>
<edge id="e1" from="a" to="b" numLanes="2" speed="15.65"/> <edge id="e2" from="b" to="c" numLanes="2" speed="15.65"/>
<edge id="e3" from="c" to="d" numLanes="2" speed="15.65"/> <edge id="ramp" from="r" to="b" numLanes="1" speed="15.65"/>
</edges>"""
STREET_DEMAND = """<routes>
    <vType id="car" length="4.6" width="1.7"/> <vType id="van" vClass="delivery"/>
    <flow id="through" from="e1" to="e3" begin="28800" end="29100" period="5" departLane="free" departSpeed="max" type="car"/>
    <flow id="vans" from="ramp" to="e3" begin="28800" end="29100" period="20" departSpeed="max" type="van"/>
</routes>"""
CONFIG = """<configuration>
    <input><net-file value="small.net.xml"/> <route-files value="demand.rou.xml"/></input>
    <output><tripinfo-output value="elsewhere/trips.xml"/></output>
    <time><begin value="8:00:00"/> <end value="36000"/> <step-length value="1"/></time>
</configuration>"""
SCENARIO = """name = "street"
seed = 3
[network]
net = "street/small.net.xml"
sumocfg = "street/given.sumocfg"
edge = "e2"
position_m = 250
{times}
[work_zone]
posted_speed_mph = 35
closed_lanes = [1]
work_length_ft = 100
{zone}
[simulation.demand]
duration_s = {duration}
warm_up_s = {warm_up}
{demand}
[crowd]
penetration = 1.0
collected = 3
used = 3
[mixture]
k_max = 2
[map]
resolution_m = 0.3
[route]
start_lane = 1
goal_lane = 1
start_before_zone_m = 60
goal_after_zone_m = 60
"""


@functools.cache
def street() -> Path:
    """The folder of a street of two lanes and 1.6 km, with a ramp, whose day begins at 8 o'clock."""
    folder = new_folder() / "street"
    folder.mkdir()
    for name, text in (("small.nod.xml", STREET_NODES), ("small.edg.xml", STREET_EDGES), ("demand.rou.xml", STREET_DEMAND)):
        (folder / name).write_text(text)
    (folder / "given.sumocfg").write_text(CONFIG)
    netconvert(folder, "-n", str(folder / "small.nod.xml"), "-e", str(folder / "small.edg.xml"), "--no-turnarounds")
    return folder


def scenario_file(
    name: str, *, times: str = "", zone: str = "", demand: str = "", duration: int = 150, warm_up: int = 80
) -> Path:
    """A scenario file beside the street's folder, with further keys in its sections."""
    path = street().parent / f"{name}.toml"
    path.write_text(SCENARIO.format(times=times, zone=zone, demand=demand, duration=duration, warm_up=warm_up))
    return path
