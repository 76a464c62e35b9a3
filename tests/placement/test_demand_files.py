"""Each kind of element on an edge m3 of 1,600 m that is cut at 300 and at 900 m into m3.wz0, m3.wz1 and m3.wz2."""

from contextlib import nullcontext
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.errors import PlacementError
from wzsumo.placement.cuts import CutEdge
from wzsumo.placement.demand_files.rewriting import Rewriting
from wzsumo.placement.demand_files.vehicles import Demand
from wzsumo.placement.net import NetEdge, NetLane
from wzsumo.placement.placement import RULES
from wzsumo.placement.xml_file import Element, XmlFile

LANE = {"id": "m3_0", "length": "1600.00", "shape": "0,0 1600,0"}
CUT = CutEdge(edge=NetEdge(Element("edge", {"id": "m3"}, 0), [NetLane(Element("lane", LANE, 0), 0)]), positions=(300.0, 900.0))
LANE_COUNTS = {"m2": 3, "m3": 3, "m4": 3, "m5": 3}
ALL = "m3.wz0 m3.wz1 m3.wz2"


def rewriting_of(content: str) -> tuple[Rewriting, str]:
    file = XmlFile(path=Path("some.xml"), data=f"<additional>{content}</additional>".encode())
    rewriting = Rewriting(cuts={"m3": CUT}, routes=Demand.read([file]).routes, rules=RULES, lane_counts=LANE_COUNTS)
    return rewriting, rewriting.rewrite(file).decode().removeprefix("<additional>").removesuffix("</additional>")


def rewritten(content: str) -> str:
    return rewriting_of(content)[1]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('<route id="r" edges="m2  m3 m4"/>', f'<route id="r" edges="m2 {ALL} m4"/>'),
        ('<vType id="t"/>', '<vType id="t" lcStrategicLookahead="20000"/>'),
        ('<vType id="t" lcStrategicLookahead="30000"/>', '<vType id="t" lcStrategicLookahead="30000"/>'),
        ('<trip id="a" from="m2" to="m3"/>', '<trip id="a" from="m2" to="m3.wz2"/>'),
        ('<trip id="a" from="m3" via="m3" to="m4"/>', '<trip id="a" from="m3.wz0" via="m3.wz0" to="m4"/>'),
        (
            '<flow id="a" from="m3" to="m3" departPos="310" arrivalPos="-1000"/>',
            '<flow id="a" from="m3.wz1" to="m3.wz1" departPos="10.00" arrivalPos="300.00"/>',
        ),
        ('<trip id="a" from="m3" to="m4" departPos="random"/>', '<trip id="a" from="m3.wz0" to="m4" departPos="random"/>'),
        (
            '<vehicle id="a" departPos="950" arrivalPos="20"><route edges="m3 m4"/></vehicle>',
            f'<vehicle id="a" departPos="50.00" arrivalPos="20" departEdge="2"><route edges="{ALL} m4"/></vehicle>',
        ),
        (
            '<vehicle id="a" departEdge="1" arrivalEdge="2"><route edges="m2 m3 m4 m5"/></vehicle>',
            f'<vehicle id="a" departEdge="1" arrivalEdge="4"><route edges="m2 {ALL} m4 m5"/></vehicle>',
        ),
        (
            '<vehicle id="a" arrivalPos="400"><route edges="m2 m3"/></vehicle>',
            f'<vehicle id="a" arrivalPos="100.00" arrivalEdge="2"><route edges="m2 {ALL}"/></vehicle>',
        ),
        ('<stop lane="m3_0" endPos="350" duration="9"/>', '<stop lane="m3.wz1_0" endPos="50.00" duration="9"/>'),
        ('<stop edge="m3" startPos="310" endPos="320"/>', '<stop edge="m3.wz1" startPos="10.00" endPos="20.00"/>'),
        ('<stop busStop="b"/>', '<stop busStop="b"/>'),
        (
            '<busStop id="b" lane="m3_1" startPos="905" endPos="-600"><access lane="m3_0" pos="299"/></busStop>',
            '<busStop id="b" lane="m3.wz2_1" startPos="5.00" endPos="100.00"><access lane="m3.wz0_0" pos="299.00"/></busStop>',
        ),
        ('<inductionLoop id="d" lane="m3_2" pos="300"/>', '<inductionLoop id="d" lane="m3.wz1_2" pos="0.00"/>'),
        ('<e1Detector id="d" lane="m3_2" pos="-10" file="o"/>', '<e1Detector id="d" lane="m3.wz2_2" pos="690.00" file="o"/>'),
        ('<detEntry lane="m3_0" pos="899.5"/>', '<detEntry lane="m3.wz1_0" pos="599.50"/>'),
        (
            '<laneAreaDetector id="d" lane="m3_0" pos="310" length="40"/>',
            '<laneAreaDetector id="d" lane="m3.wz1_0" pos="10.00" length="40"/>',
        ),
        (
            '<laneAreaDetector id="d" lane="m3_0" pos="290" length="700"/>',
            '<laneAreaDetector id="d" lanes="m3.wz0_0 m3.wz1_0 m3.wz2_0" pos="290.00" endPos="90.00"/>',
        ),
        (
            '<e2Detector id="d" lanes="m3_0 m4_0" pos="310" endPos="50"/>',
            '<e2Detector id="d" lanes="m3.wz1_0 m3.wz2_0 m4_0" pos="10.00" endPos="50"/>',
        ),
        ('<poi id="p" lane="m3_1" pos="1"/>', '<poi id="p" lane="m3.wz0_1" pos="1.00"/>'),
        ('<poi id="p" x="1" y="2"/>', '<poi id="p" x="1" y="2"/>'),
        ('<variableSpeedSign lanes="m2_0 m3_1"/>', '<variableSpeedSign lanes="m2_0 m3.wz0_1 m3.wz1_1 m3.wz2_1"/>'),
        ('<edgeData id="e" file="o" edges="m3"/>', f'<edgeData id="e" file="o" edges="{ALL}"/>'),
        (
            '<taz id="z" edges="m2 m3"/>',
            '<taz id="z" edges="m2"><tazSource id="m3.wz0" weight="1"/><tazSink id="m3.wz2" weight="1"/></taz>',
        ),
        (
            '<taz id="z"><tazSource id="m3" weight="2"/><tazSink id="m3" weight="1"/></taz>',
            '<taz id="z"><tazSource id="m3.wz0" weight="2"/><tazSink id="m3.wz2" weight="1"/></taz>',
        ),
        (
            '<rerouter id="r" edges="m2 m3"><interval><closingReroute id="m3"/></interval></rerouter>',
            '<rerouter id="r" edges="m2 m3.wz0"><interval><closingReroute id="m3.wz0"/><closingReroute id="m3.wz1"/>'
            '<closingReroute id="m3.wz2"/></interval></rerouter>',
        ),
        ('<destProbReroute id="m3"/>', '<destProbReroute id="m3.wz2"/>'),
        ('<routeProbe id="p" edge="m3"/>', '<routeProbe id="p" edge="m3.wz0"/>'),
        ('<person id="p"><walk edges="m3 m4"/></person>', f'<person id="p"><walk edges="{ALL} m4"/></person>'),
        (
            '<person id="p" departPos="320"><ride from="m3" to="m3" arrivalPos="910"/></person>',
            '<person id="p" departPos="20.00"><ride from="m3.wz1" to="m3.wz2" arrivalPos="10.00"/></person>',
        ),
        ('<calibrator id="c" edge="m2"/>', '<calibrator id="c" edge="m2"/>'),
        (
            '<interval begin="0" end="9"><edge id="m3" traveltime="64"/></interval>',
            '<interval begin="0" end="9"><edge id="m3.wz0" traveltime="12.000"/><edge id="m3.wz1" traveltime="24.000"/>'
            '<edge id="m3.wz2" traveltime="28.000"/></interval>',
        ),
    ],
)  # fmt: skip
def test_elements_mean_the_pieces_on_which_they_lie(before: str, after: str) -> None:
    assert ET.canonicalize(rewritten(before), strip_text=True) == ET.canonicalize(after, strip_text=True)


def test_what_names_no_cut_edge_stays_byte_for_byte() -> None:
    content = "<!-- m3 -->\n <route  id='r' edges='m2   m4' />\n<tlLogic id=\"m3\"/><param key='edges' value='m3'/>"
    assert rewritten(content) == content


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('<busStop id="b" lane="m3_0" startPos="290" endPos="310"/>', r"busStop 'b' lies on edge 'm3' from 290.0 to 310.0 m"),
        ('<parkingArea id="p" lane="m3_0"/>', r"from 0.0 to 1600.0 m, where the zone cuts it at 900.0 m"),
        ('<calibrator id="c" lane="m3_0" pos="3"/>', "calibrator 'c' acts on edge 'm3' as a whole"),
    ],
)
def test_what_a_cut_would_part_is_refused(content: str, words: str) -> None:
    with pytest.raises(PlacementError, match=words):
        rewritten(content)


def test_stop_on_a_lane_that_the_zone_closes_is_refused() -> None:
    file = XmlFile(path=Path("some.xml"), data=b'<r><busStop id="b" lane="m3_0" startPos="400" endPos="410"/></r>')
    for closed, refused in (("m3.wz1_0", True), ("m3.wz0_0", False), ("m3.wz1_1", False)):
        rewriting = Rewriting(
            cuts={"m3": CUT}, routes={}, rules=RULES, lane_counts=LANE_COUNTS, closed_lanes=frozenset({closed})
        )
        with pytest.raises(PlacementError, match="lies on lane 'm3_0' where the zone closes it") if refused else nullcontext():
            rewriting.rewrite(file)


@given(st.floats(0, 1600))
def test_position_of_a_detector_stays_the_same_point_to_a_centimetre(position: float) -> None:
    element = ET.fromstring(rewritten(f'<e1Detector id="d" lane="m3_0" pos="{position:.3f}"/>'))
    piece, _ = element.get("lane", "").split("_")
    assert {"m3.wz0": 0, "m3.wz1": 300, "m3.wz2": 900}[piece] + float(element.get("pos", "")) == pytest.approx(
        position, abs=0.001
    )


def test_vehicles_that_depart_on_a_cut_edge_are_counted_flows_by_their_number() -> None:
    rewriting, _ = rewriting_of(
        '<route id="r" edges="m3 m4"/><vehicle id="a" route="r"/><trip id="b" from="m2" to="m3"/>'
        '<flow id="c" from="m3" to="m4" begin="0" end="1800" vehsPerHour="100"/><flow id="d" route="r" number="7"/>'
    )
    assert dict(rewriting.departures) == {"m3": 1 + 50 + 7}


def test_rerouter_that_some_vehicles_no_longer_meet_is_doubted() -> None:
    rewriting, _ = rewriting_of('<rerouter id="r" edges="m2 m3"/><rerouter id="s" edges="m2"/>')
    assert rewriting.doubts == ["rerouter 'r' acts on the first piece of m3: vehicles that depart on the others do not meet it"]


def test_every_change_is_on_record_with_file_element_and_rule() -> None:
    rewriting, _ = rewriting_of('<route id="r" edges="m3"/><inductionLoop id="d" lane="m3_0" pos="5"/>')
    rows = [change.as_row() for change in rewriting.changes]
    assert rows == [
        {"file": "some.xml", "element": "route", "id": "r", "what": "lists the pieces", "to": f"edges={ALL}"},
        {
            "file": "some.xml",
            "element": "inductionLoop",
            "id": "d",
            "what": "moved to its piece",
            "to": "lane=m3.wz0_0 pos=5.00",
        },
    ]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('<inductionLoop id="d" lane="m3_7" pos="1"/>', "the network has no lane 'm3_7'"),
        ('<inductionLoop id="d" lane="m3" pos="1"/>', "the network has no lane 'm3'"),
        ('<laneAreaDetector id="d" lanes="m2_0 n_0" pos="1" endPos="3"/>', "the network has no lane 'n_0'"),
        ('<taz id="z" edges="m3 elsewhere"/>', "the network has no edge 'elsewhere'"),
        ('<include href="more.xml"/>', "<include> reads href='more.xml'"),
        ('<rerouter id="r" edges="m3" file="more.xml"/>', "<rerouter> reads file='more.xml'"),
        ('<edgeData id="e" edgesFile="edges.txt" file="out.xml"/>', "<edgeData> reads edgesFile='edges.txt'"),
    ],
)
def test_places_of_another_network_and_files_that_no_option_names_are_refused(content: str, words: str) -> None:
    with pytest.raises(PlacementError, match=words):
        rewritten(content)


@pytest.mark.parametrize("count", ['number="1e400"', 'period="exp(x)"', 'period="0"', 'perHour="nan" end="nan"', 'end="soon"'])
def test_flows_whose_number_is_none_are_left_to_sumo(count: str) -> None:
    flow = f'<flow id="a" from="m2" to="m4" begin="0" {count}/>'
    assert rewritten(flow) == flow
