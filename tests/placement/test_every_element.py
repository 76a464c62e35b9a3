"""A set of files with every element that can lie on a cut edge: SUMO finds each where it was, and traffic drives as it did."""

import functools
import subprocess
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from placement.networks import freeway, new_folder

import wzsumo
from wzsumo.simulation.connection import connected_library, sumo_binary

# Edge m3 is cut at 300, 350 and 904 m; what lies on it stands before, between, behind and over the cuts.
ADDITIONALS = """<additional>
    <inductionLoop id="before" lane="m3_0" pos="299.99" period="300" file="out.xml"/>
    <inductionLoop id="at" lane="m3_1" pos="310.5" period="300" file="out.xml"/>
    <inductionLoop id="within" lane="m3_1" pos="600" period="300" file="results/loops/out.xml"/>
    <instantInductionLoop id="from_the_end" lane="m3_0" pos="-100" file="out.xml"/>
    <laneAreaDetector id="over_all" lane="m3_0" pos="250" length="700" period="300" file="out.xml"/>
    <laneAreaDetector id="over_edges" lanes="m2_0 m3_0" pos="1000" endPos="400" period="300" file="out.xml"/>
    <laneAreaDetector id="inside" lane="m3_1" pos="400" endPos="-700" period="300" file="out.xml"/>
    <entryExitDetector id="gate" period="300" file="out.xml">
        <detEntry lane="m3_0" pos="100"/><detEntry lane="m3_1" pos="100"/><detEntry lane="m3_2" pos="100"/>
        <detExit lane="m3_0" pos="1400"/><detExit lane="m3_1" pos="1400"/><detExit lane="m3_2" pos="1400"/>
    </entryExitDetector>
    <busStop id="stop" lane="m3_0" startPos="950" endPos="980"><access lane="m3_0" pos="960"/></busStop>
    <chargingStation id="charger" lane="m3_0" startPos="1000" endPos="1020"/>
    <parkingArea id="park" lane="m3_0" startPos="100" endPos="140" roadsideCapacity="3"/>
    <poi id="mark" lane="m3_1" pos="700" posLat="2"/>
    <variableSpeedSign id="sign" lanes="m3_0 m3_1 m3_2">
        <step time="0" speed="27"/><step time="400" speed="29.06"/></variableSpeedSign>
    <rerouter id="around" edges="m2"><interval begin="100" end="101"><closingReroute id="off"/></interval></rerouter>
    <rerouter id="bar" edges="m2" probability="0">
        <interval begin="200" end="230"><closingLaneReroute id="m3_0" disallow="truck"/></interval></rerouter>
    <routeProbe id="probe" edge="m3" period="300" file="out.xml"/>
    <edgeData id="edges" edges="m3 m4" file="edges.xml"/> <laneData id="lanes" file="lanes.xml" period="300"/>
    <taz id="west" edges="m1"/> <taz id="east" edges="m3 m4"/>
</additional>"""
DEMAND = """<routes>
    <vType id="car"/> <vType id="truck" vClass="truck"/> <vType id="bus" vClass="bus"/>
    <vTypeDistribution id="mix">
        <vType id="slow" maxSpeed="25" probability="0.3"/><vType id="fast" probability="0.7"/></vTypeDistribution>
    <route id="through" edges="m1 m2-AddedOnRampEdge m2 m3 m3-AddedOffRampEdge m4"/>
    <routeDistribution id="some"><route id="exit" edges="m1 m2-AddedOnRampEdge m2 m3 m3-AddedOffRampEdge off" probability="1"/>
        <route refId="through" probability="3"/></routeDistribution>
    <flow id="a" route="through" begin="0" end="600" period="8" type="car" departLane="free" departSpeed="max"/>
    <flow id="b" route="some" begin="0" end="600" period="15" type="mix" departLane="free" departSpeed="max"/>
    <flow id="c" from="on" to="m4" begin="0" end="600" period="30" type="truck" departSpeed="max"/>
    <flow id="d" from="m1" to="m3" begin="0" end="600" period="40" type="car" arrivalPos="700" departSpeed="max"/>
    <flow id="e" fromTaz="west" toTaz="east" begin="0" end="600" period="60" type="car" departSpeed="max"/>
    <vehicle id="bus" type="bus" depart="5"><route edges="m1 m2-AddedOnRampEdge m2 m3 m3-AddedOffRampEdge m4"/>
        <stop busStop="stop" duration="20"/></vehicle>
    <vehicle id="van" type="car" route="through" depart="20"><stop lane="m3_0" endPos="1200" duration="10"/></vehicle>
    <trip id="parks" from="m1" to="m4" depart="30" type="car"><stop parkingArea="park" duration="30"/></trip>
    <person id="p" depart="0"><walk edges="m3" departPos="920" busStop="stop"/><ride busStop="stop" lines="bus"/></person>
</routes>"""
ZONE = "[work_zone]\nclosed_lanes = [2]\nwork_length_ft = 500\n"


@functools.cache
def placed() -> Path:
    folder = new_folder()
    for name, text in (("all.add.xml", ADDITIONALS), ("all.rou.xml", DEMAND), ("zone.toml", ZONE)):
        (folder / name).write_text(text)
    files = {"routes": [folder / "all.rou.xml"], "additionals": [folder / "all.add.xml"]}
    wzsumo.place(freeway(), zone=folder / "zone.toml", at=("m3", 300.0), out=folder / "out", **files)
    return folder / "out"


def places(name: str) -> dict[str, np.ndarray]:
    """x, y [m] at which SUMO itself has each thing: both ends of what is long."""
    found = {}
    with connected_library(["-c", str(placed() / name / "run.sumocfg")]) as sumo:

        def point(lane: str, position: float) -> tuple[float, float]:
            edge, _, index = lane.rpartition("_")
            return sumo.simulation.convert2D(edge, position, int(index))

        loops = sumo.inductionloop
        for id_ in ("before", "at", "within"):
            found[id_] = np.array([point(loops.getLaneID(id_), loops.getPosition(id_))])
        for id_, kind in (("stop", sumo.busstop), ("charger", sumo.chargingstation), ("park", sumo.parkingarea)):
            found[id_] = np.array([point(kind.getLaneID(id_), at) for at in (kind.getStartPos(id_), kind.getEndPos(id_))])
        for area in ET.parse(placed() / name / "all.add.xml").getroot().iter("laneAreaDetector"):
            lanes, given = str(area.get("lanes") or area.get("lane")).split(), float(area.get("endPos", "nan"))
            first = float(area.get("pos", 0))
            last = first + float(area.get("length", 0)) if np.isnan(given) else given
            last += sumo.lane.getLength(lanes[-1]) if last < 0 else 0.0
            id_ = area.get("id", "")
            found[id_] = np.array([point(lanes[0], first), point(lanes[-1], last)])
            found[f"length of {id_}"] = np.array([sumo.lanearea.getLength(id_)])
        found["mark"] = np.array([sumo.poi.getPosition("mark")])
    return found


def test_everything_stands_where_it_stood_to_a_centimetre() -> None:
    before, after = places("original"), places("open")
    assert len(before) == 13
    for name, points in before.items():
        assert np.abs(after[name] - points).max() <= 0.0101, name


def mean_duration(name: str, seed: int) -> tuple[float, int]:
    trips = placed() / name / f"trips_{seed}.xml"
    options = ("--seed", str(seed), "--tripinfo-output", str(trips), "--no-step-log", "--xml-validation", "never")
    config = placed() / name / "run.sumocfg"
    done = subprocess.run([str(sumo_binary("sumo")), "-c", str(config), *options], capture_output=True, text=True, check=False)
    assert (done.returncode, "eleport" in done.stderr) == (0, False), done.stderr
    durations = [float(trip.get("duration", 0)) for trip in ET.parse(trips).iter("tripinfo")]
    return float(np.mean(durations)), len(durations)


def test_traffic_drives_as_before_where_nothing_is_closed() -> None:
    runs = {name: [mean_duration(name, seed) for seed in (1, 2, 3)] for name in ("original", "open")}
    assert [n for _, n in runs["open"]] == [n for _, n in runs["original"]]
    difference = np.mean([after - before for (before, _), (after, _) in zip(runs["original"], runs["open"], strict=True)])
    assert difference == pytest.approx(0.0, abs=0.2)


def test_all_come_through_where_the_lane_is_closed() -> None:
    assert mean_duration("closed", 1)[1] == mean_duration("original", 1)[1]
