from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from builders import bent_road, paper_layout, paper_road, paper_work_zone, two_lane_road

from wzsumo.frames import FloatArray
from wzsumo.mutcd.layout import lay_out
from wzsumo.simulation.edges import edges_of
from wzsumo.simulation.network import write_network
from wzsumo.work_zone import WorkZoneLayout

NetLane = tuple[str, FloatArray, FloatArray, float, str]

UNSHIFTED = {"shift_ft": 0, "shifted_lane_width_ft": None}
NARROWEST_FT = 8  # a closing lane ends where it is narrower


def is_thin(lane: ET.Element) -> bool:
    """Whether a lane of the net file is the remnant of a closing lane or a gore."""
    return float(lane.attrib["width"]) == 0.1


def lanes_of_net(layout: WorkZoneLayout, folder: Path) -> Iterator[NetLane]:
    """(edge id, stations, offsets, width, barred classes) of every through lane in the net file, in order, from the right."""
    net = ET.parse(write_network(layout, folder))  # noqa: S314 a file that netconvert has just written
    for edge in net.getroot().findall("edge"):
        if edge.get("function") == "internal":
            continue
        for lane in edge.findall("lane"):
            if is_thin(lane):
                continue
            points = np.array([p.split(",")[:2] for p in lane.attrib["shape"].split()], dtype=float)
            s, d = layout.road.to_sd(points)
            yield edge.attrib["id"], s, d, float(lane.attrib["width"]), lane.get("disallow", "")


def open_lines(layout: WorkZoneLayout, s: float) -> FloatArray:
    """Right and left lines (n, 2) [m] of the lanes that are open at station s and wide enough, from the right."""
    lines = [(float(q.right(s)), float(q.left(s))) for q in layout.lanes if q.start <= s < q.end]
    return np.array(sorted(line for line in lines if line[1] - line[0] >= NARROWEST_FT * 0.3048 - 1e-6))


LAYOUTS: dict[str, Callable[[], WorkZoneLayout]] = {
    "paper": paper_layout,
    "left bend": lambda: lay_out(paper_work_zone(), bent_road(2500)),
    "right bend": lambda: lay_out(paper_work_zone(), bent_road(-2500)),
    "interior": lambda: lay_out(
        paper_work_zone(closed_lanes=(1,), closed_shoulder=None, **UNSHIFTED), paper_road(length_ft=8000)
    ),
    "no shift": lambda: paper_layout(**UNSHIFTED),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_lane_centre_lines_in_the_net_match_the_layout_within_1_cm(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]()
    by_edge: dict[str, list[tuple[FloatArray, FloatArray, float]]] = {}
    for edge, s, d, width, _ in lanes_of_net(layout, tmp_path):
        by_edge.setdefault(edge, []).append((s, d, width))
    assert len(by_edge) > 10
    for edge, lanes in by_edge.items():
        middle = (lanes[0][0][0] + lanes[0][0][-1]) / 2
        assert len(lanes) == len(open_lines(layout, middle)), edge
        for number, (s, d, width) in enumerate(lanes):
            inner = np.clip(s, s[0] + 0.05, s[-1] - 0.05)  # clear of the stations where the number of lanes changes
            lines = np.array([open_lines(layout, station)[number] for station in inner])
            assert np.abs(d - lines.mean(axis=1)).max() < 0.01, edge
            assert width <= np.diff(lines, axis=1).min() + 0.01, edge


def test_lanes_of_the_paper_zone_are_three_then_two_then_three() -> None:
    layout = paper_layout()
    counts = {edge.id: len(edge.through_lanes) for edge in edges_of(layout)}
    in_order = list(counts.values())
    assert in_order[0] == in_order[-1] == 3
    changes = [b - a for a, b in pairwise(in_order) if a != b]
    assert changes == [-1, 1]
    inner = [
        n for id_, n in counts.items() if id_.endswith(("tangent", "buffer", "activity_area", "shifting_taper", "shift_back"))
    ]
    assert set(inner) == {2}


def test_edges_cover_the_road_without_a_gap() -> None:
    layout = paper_layout()
    edges = edges_of(layout)
    assert [e.end for e in edges[:-1]] == [e.start for e in edges[1:]]
    assert edges[0].start == 0
    assert edges[-1].end == pytest.approx(layout.road.length)


def test_closed_lane_ends_inside_the_merging_taper_where_it_is_8_ft_wide(tmp_path: Path) -> None:
    layout = paper_layout()
    taper = layout.area("merging taper")
    before_zone = [row for row in lanes_of_net(layout, tmp_path) if row[1][0] < layout.area("tangent").start]
    left = {edge: (s, width, disallow) for edge, s, _, width, disallow in before_zone}  # the last of an edge is its leftmost
    three = [edge for edge in left if sum(row[0] == edge for row in before_zone) == 3]
    end = left[three[-1]][0][-1]
    # 12 ft shrink to 8 ft over a third of the 720 ft.
    assert end == pytest.approx(taper.start + 240 * 0.3048, abs=0.01)
    assert left[three[-1]][1] == pytest.approx(NARROWEST_FT * 0.3048 - 0.2, abs=0.03)
    in_taper = [edge for edge in three if left[edge][0][0] > taper.start - 0.1]
    assert all("truck" in left[edge][2] for edge in in_taper)


def test_every_lane_but_the_closing_one_leads_on(tmp_path: Path) -> None:
    layout = paper_layout()
    net = ET.parse(write_network(layout, tmp_path)).getroot()  # noqa: S314 a file that netconvert has just written
    leads_on = {(c.attrib["from"], int(c.attrib["fromLane"])) for c in net.findall("connection")}
    edges = [e for e in net.findall("edge") if e.get("function") != "internal"]
    lanes = {(e.attrib["id"], int(lane.attrib["index"])) for e in edges[:-1] for lane in e.findall("lane") if not is_thin(lane)}
    ends = lanes - leads_on
    assert len(ends) == 1
    ((edge, index),) = ends
    assert index == 2
    assert edge.endswith("merging_taper")


@pytest.mark.parametrize("name", LAYOUTS)
def test_lane_in_the_net_is_as_long_as_its_stretch_of_road(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]()
    net = ET.parse(write_network(layout, tmp_path)).getroot()  # noqa: S314 a file that netconvert has just written
    for edge in edges_of(layout):
        lengths = [float(lane.attrib["length"]) for lane in net.findall(f"edge[@id='{edge.id}']/lane")]
        assert lengths == pytest.approx([edge.end - edge.start] * len(edge.lanes), abs=0.01), edge.id


@pytest.mark.parametrize("radius_ft", [1000, -1000, 3000])
def test_lanes_on_a_bend_are_narrower_by_what_a_truck_cuts_on_either_side(tmp_path: Path, radius_ft: int) -> None:
    layout = lay_out(paper_work_zone(closed_lanes=(), **UNSHIFTED), bent_road(radius_ft))
    widths = {width for _, _, _, width, _ in lanes_of_net(layout, tmp_path)}
    lane_m, sagitta_m = 12 * 0.3048, 12.0**2 / (8 * abs(radius_ft) * 0.3048)
    assert min(widths) == pytest.approx(lane_m - 0.2 - 2 * sagitta_m, abs=0.01)  # a polyline turns more sharply at its corners
    assert max(widths) <= lane_m - 0.2 + 0.0005


def by_turns(control: str) -> WorkZoneLayout:
    zone = paper_work_zone(
        posted_speed_mph=45, closed_lanes=(0,), closed_shoulder="right", **UNSHIFTED, one_lane_two_way=control
    )
    return lay_out(zone, two_lane_road())


def lane_attributes(layout: WorkZoneLayout, folder: Path) -> dict[str, list[dict[str, str]]]:
    """Attributes of the lanes of each edge, from the right, as they are given to netconvert."""
    write_network(layout, folder)
    edges = ET.parse(folder / "zone.edg.xml").getroot()  # noqa: S314 a file that we have just written
    return {edge.attrib["id"].split("_", 1)[1]: [lane.attrib for lane in edge] for edge in edges}


def test_no_vehicle_may_change_lanes_across_a_gore_or_within_100_m_ahead_of_it(tmp_path: Path) -> None:
    # The tangent is 360 ft, 109.7 m long: what lies ahead of it ends more than 100 m ahead of the gore's tip.
    lanes = lane_attributes(LAYOUTS["interior"](), tmp_path)
    for area in ("tangent", "shifting_taper", "activity_area"):
        right, left = lanes[area][0], lanes[area][-1]
        assert (right.get("changeLeft"), left.get("changeRight")) == ("custom1", "custom1"), area
        assert not {"changeRight"} & set(right)
        assert not {"changeLeft"} & set(left)
    for area in ("approach", "departure"):
        assert not [lane for lane in lanes[area] if {"changeLeft", "changeRight"} & set(lane)], area
    assert not {"changeLeft"} & set(lanes["merging_taper"][0])  # its last piece, 110 m ahead of the gore


def test_remnant_admits_cars_alone_may_be_left_and_not_be_entered(tmp_path: Path) -> None:
    layout = paper_layout()
    write_network(layout, tmp_path)
    edges = {edge.id: edge for edge in edges_of(layout)}
    root = ET.parse(tmp_path / "zone.edg.xml").getroot()  # noqa: S314 a file that we have just written
    (lanes,) = [list(e) for e in root if len(edges[e.attrib["id"]].through_lanes) < len(edges[e.attrib["id"]].lanes)]
    right, beside, remnant = (lane.attrib for lane in lanes)
    assert remnant["allow"] == "passenger"
    assert not {"changeRight", "changeLeft"} & set(remnant)
    assert beside["changeLeft"] == "custom1"
    assert not {"changeLeft", "changeRight", "allow", "disallow"} & set(right)
    assert "changeRight" not in beside


def test_lane_that_turns_by_six_in_a_hundred_is_narrower_by_what_a_truck_cuts_beyond_a_tenth_of_a_metre(tmp_path: Path) -> None:
    # 12 ft aside in 200 ft. The middle of 12 m is 0.06 x 6 / 2 = 0.18 m beside the chord of its ends where the lane turns.
    lanes = lane_attributes(by_turns("signal"), tmp_path)
    straight, turning = float(lanes["0"][0]["width"]), float(lanes["one-lane_two-way_taper"][0]["width"])
    assert straight == pytest.approx(12 * 0.3048 - 0.2, abs=1e-3)
    assert turning == pytest.approx(12 * 0.3048 - 0.2 - 2 * (0.18 - 0.1), abs=1e-3)


def test_own_traffic_meets_the_signal_at_its_stop_line_and_the_opposing_traffic_at_the_other(tmp_path: Path) -> None:
    layout = by_turns("signal")
    write_network(layout, tmp_path)
    nodes = ET.parse(tmp_path / "zone.nod.xml").getroot()  # noqa: S314 a file that we have just written
    assert layout.taking_turns is not None
    lights = [float(node.attrib["x"]) for node in nodes if node.attrib["type"] == "traffic_light"]
    assert lights == pytest.approx([layout.taking_turns.start, layout.taking_turns.end], abs=1e-3)
    links = ET.parse(tmp_path / "zone.con.xml").getroot()  # noqa: S314 a file that we have just written
    controlled = [link.attrib["from"] for link in links if link.get("uncontrolled") is None]
    own = next(edge.id for edge in edges_of(layout) if abs(edge.end - layout.taking_turns.start) < 1e-6)
    assert controlled == [own, "opposing_0"]
    program = ET.parse(tmp_path / "zone.tll.xml").getroot()  # noqa: S314 a file that we have just written
    phases = [(phase.attrib["state"], float(phase.attrib["duration"])) for phase in program.iter("phase")]
    # Red until a truck that starts at 1 m/s2 and drives 10 m/s has passed the shared length.
    clear_s = round(10 + (layout.taking_turns.end - layout.taking_turns.start - 50) / 10, 1)
    assert phases == [("Gr", 30), ("yr", 4), ("rr", clear_s), ("rG", 30), ("ry", 4), ("rr", clear_s)]


def test_flaggers_hold_the_lane_open_for_10_to_60_s(tmp_path: Path) -> None:
    write_network(by_turns("flaggers"), tmp_path)
    program = ET.parse(tmp_path / "zone.tll.xml").getroot()  # noqa: S314 a file that we have just written
    greens = [phase.attrib for phase in program.iter("phase") if "G" in phase.attrib["state"]]
    assert [(green["minDur"], green["maxDur"]) for green in greens] == [("10", "60")] * 2
    (logic,) = program.iter("tlLogic")
    assert logic.attrib["type"] == "actuated"
