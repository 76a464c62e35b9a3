from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from builders import bent_road, paper_layout, paper_road, paper_work_zone, two_lane_road

from wzsumo.frames import FloatArray
from wzsumo.mutcd.layout import lay_out
from wzsumo.simulation.edges import edge_at, edges_of
from wzsumo.simulation.network import write_network
from wzsumo.work_zone import WorkZoneLayout

NetLane = tuple[str, FloatArray, FloatArray, float]

UNSHIFTED = {"shift_ft": 0, "shifted_lane_width_ft": None}
NARROWEST_FT = 8  # a closing lane ends where it is narrower


def is_thin(lane: ET.Element) -> bool:
    """Whether a lane of the net file is the remnant of a closing lane or a gore."""
    return float(lane.attrib["width"]) == 0.1


def lanes_of_net(layout: WorkZoneLayout, folder: Path) -> Iterator[NetLane]:
    """(edge id, stations, offsets, width) of the middle of every through lane in the net file, in order, from the right."""
    net = ET.parse(write_network(layout, folder))
    for edge in net.getroot().findall("edge"):
        for lane in edge.findall("lane"):
            if not is_thin(lane):
                points = np.array([p.split(",")[:2] for p in lane.attrib["shape"].split()], dtype=float)
                s, d = layout.road.to_sd(points)
                yield edge.attrib["id"], s, d, float(lane.attrib["width"])


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
def test_lanes_in_the_net_lie_between_the_lines_of_the_layouts_lanes(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]()
    by_edge: dict[str, list[tuple[FloatArray, FloatArray, float]]] = {}
    for edge, s, d, width in lanes_of_net(layout, tmp_path):
        by_edge.setdefault(edge, []).append((s, d, width))
    for edge, lanes in by_edge.items():
        # Middles are rounded over 15 m to either side of a place where a line turns or a lane begins.
        inner = np.linspace(lanes[0][0][0] + 15.5, lanes[0][0][-1] - 15.5, 50)
        for number, (s, d, width) in enumerate(lanes):
            middle = np.interp(inner, s, d)
            lines = np.array([open_lines(layout, station) for station in inner])
            assert lines.shape[1] == len(lanes), edge
            right, left = lines[:, number].T
            # A turn of 12 ft in 360 ft is rounded by 0.034 x 15 / 6 m.
            assert (middle - width / 2 > right - 0.09).all(), edge
            assert (middle + width / 2 < left + 0.09).all(), edge


@pytest.mark.parametrize("name", LAYOUTS)
def test_vehicle_that_crosses_the_line_between_two_lanes_does_so_on_the_road(tmp_path: Path, name: str) -> None:
    # In SUMO it leaves one lane at its line and is in the next one at its line, wherever these lie on the road.
    layout = LAYOUTS[name]()
    lanes = list(lanes_of_net(layout, tmp_path))
    gore = layout.area("tangent").end if name == "interior" else np.inf
    for (edge, s, d, width), (edge_of_left, s_left, d_left, width_left) in pairwise(lanes):
        if edge == edge_of_left and not gore - 1 < s[0] < layout.end - 1:
            inner = np.linspace(s[0] + 17.5, s[-1] - 17.5, 50)  # middles are rounded over 15 m
            apart = np.interp(inner, s_left, d_left) - np.interp(inner, s, d) - (width + width_left) / 2
            assert np.abs(apart).max() < 0.01, edge


@pytest.mark.parametrize("name", LAYOUTS)
def test_lane_goes_on_from_edge_to_edge_without_a_step_and_turns_by_no_more_than_a_hundredth_at_a_time(
    tmp_path: Path, name: str
) -> None:
    layout = LAYOUTS[name]()
    root = ET.parse(write_network(layout, tmp_path)).getroot()
    shapes = {
        lane.attrib["id"]: np.array([p.split(",")[:2] for p in lane.attrib["shape"].split()], dtype=float)
        for lane in root.iter("lane")
    }
    links = root.findall("connection")
    assert len(links) >= 9
    for link in links:
        before, after = shapes[f"{link.get('from')}_{link.get('fromLane')}"], shapes[f"{link.get('to')}_{link.get('toLane')}"]
        (s_end, s_begin), (d_end, d_begin) = layout.road.to_sd(np.vstack([before[-1], after[0]]))
        assert abs(s_begin - s_end) < 0.2  # netconvert cuts lanes back at a node
        assert abs(d_begin - d_end) < 0.01
        s, d = layout.road.to_sd(np.vstack([before[:-1], after[1:]]))
        assert np.abs(np.diff(np.diff(d) / np.diff(s))).max() < 0.012


def test_lanes_of_the_paper_zone_are_three_then_two_then_three() -> None:
    layout = paper_layout()
    counts = {edge.id: len(edge.through_lanes) for edge in edges_of(layout)}
    in_order = list(counts.values())
    assert in_order[0] == in_order[-1] == 3
    changes = [b - a for a, b in pairwise(in_order) if a != b]
    assert changes == [-1, 1]
    beside_work = layout.area("activity area")
    middle = (beside_work.start + beside_work.end) / 2
    assert len(edge_at(edges_of(layout), middle).through_lanes) == 2


def test_edges_cover_the_road_without_a_gap() -> None:
    layout = paper_layout()
    edges = edges_of(layout)
    assert [e.end for e in edges[:-1]] == [e.start for e in edges[1:]]
    assert edges[0].start == 0
    assert edges[-1].end == pytest.approx(layout.road.length)


def test_closed_lane_ends_inside_the_merging_taper_where_it_is_8_ft_wide(tmp_path: Path) -> None:
    layout = paper_layout()
    taper = layout.area("merging taper")
    rows = list(lanes_of_net(layout, tmp_path))
    closing = [(s, d, width) for edge, s, d, width in rows if edge.endswith("_merging_taper")][2]
    s, d, width = closing
    # 12 ft shrink to 8 ft over a third of the 720 ft. Up to there the lane is as wide as at its end, beside the open lanes.
    assert (s[0], s[-1]) == pytest.approx((taper.start, taper.start + 240 * 0.3048), abs=0.2)
    assert width == pytest.approx(NARROWEST_FT * 0.3048 - 0.1, abs=0.01)
    assert d[-1] == pytest.approx(24 * 0.3048 + width / 2, abs=0.01)


def test_every_lane_but_the_closing_one_leads_on(tmp_path: Path) -> None:
    layout = paper_layout()
    net = ET.parse(write_network(layout, tmp_path)).getroot()
    leads_on = {(c.attrib["from"], int(c.attrib["fromLane"])) for c in net.findall("connection")}
    edges = [e for e in net.findall("edge") if e.get("function") != "internal"]
    lanes = {(e.attrib["id"], int(lane.attrib["index"])) for e in edges[:-1] for lane in e.findall("lane") if not is_thin(lane)}
    ends = lanes - leads_on
    assert len(ends) == 1
    ((edge, index),) = ends
    assert index == 2
    assert edge == "01_merging_taper"


@pytest.mark.parametrize("name", LAYOUTS)
def test_lane_in_the_net_is_as_long_as_its_stretch_of_road(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]()
    net = ET.parse(write_network(layout, tmp_path)).getroot()
    for edge in edges_of(layout):
        lengths = [float(lane.attrib["length"]) for lane in net.findall(f"edge[@id='{edge.id}']/lane")]
        assert lengths == pytest.approx([edge.end - edge.start] * len(edge.lanes), abs=0.01), edge.id


@pytest.mark.parametrize("radius_ft", [1000, -1000, 3000])
def test_outer_lanes_on_a_bend_are_narrower_on_their_outer_side_by_what_a_truck_cuts(tmp_path: Path, radius_ft: int) -> None:
    layout = lay_out(paper_work_zone(closed_lanes=(), **UNSHIFTED), bent_road(radius_ft))
    right, middle, left = (width for _, _, _, width in lanes_of_net(layout, tmp_path))
    lane_m, sagitta_m = 12 * 0.3048, 12.0**2 / (8 * abs(radius_ft) * 0.3048)
    assert (right, left) == pytest.approx((lane_m - 0.1 - sagitta_m,) * 2, abs=0.01)  # a polyline turns more at its corners
    assert middle == pytest.approx(lane_m, abs=1e-3)


def by_turns(control: str) -> WorkZoneLayout:
    zone = paper_work_zone(
        posted_speed_mph=45, closed_lanes=(0,), closed_shoulder="right", **UNSHIFTED, one_lane_two_way=control
    )
    return lay_out(zone, two_lane_road())


def lane_attributes(layout: WorkZoneLayout, folder: Path) -> dict[str, list[dict[str, str]]]:
    """Attributes of the lanes of each edge, from the right, as they are given to netconvert."""
    write_network(layout, folder)
    edges = ET.parse(folder / "zone.edg.xml").getroot()
    return {edge.attrib["id"]: [lane.attrib for lane in edge] for edge in edges}


def test_no_vehicle_may_change_lanes_across_a_gore_or_within_100_m_ahead_of_it(tmp_path: Path) -> None:
    layout = LAYOUTS["interior"]()
    nose = layout.area("shifting taper").start
    lanes = lane_attributes(layout, tmp_path)
    barred = [edge for edge in edges_of(layout) if nose - 101 < edge.start < layout.end - 1]
    assert [(edge.start, edge.end) for edge in barred] == [
        pytest.approx((nose - 100, nose)), pytest.approx((nose, layout.area("downstream taper").end)),
    ]  # fmt: skip
    for edge in edges_of(layout):
        right, left = lanes[edge.id][0], lanes[edge.id][-1]
        found = [lane.get(key) for lane, key in ((right, "changeLeft"), (left, "changeRight"))]
        if nose - 101 < edge.start < layout.end - 1:
            assert found == ["custom1", "custom1"], edge.id
        elif len(edge.lanes) == 3:
            assert found == [None, None], edge.id
        assert (right.get("changeRight"), left.get("changeLeft")) == (None, None)


def test_remnant_admits_cars_alone_may_be_left_and_not_be_entered(tmp_path: Path) -> None:
    lanes = lane_attributes(paper_layout(), tmp_path)
    ((right, beside, remnant),) = [of_edge for of_edge in lanes.values() if any(lane["width"] == "0.100" for lane in of_edge)]
    assert remnant["allow"] == "passenger"
    assert not {"changeRight", "changeLeft"} & set(remnant)
    assert beside["changeLeft"] == "custom1"
    assert not {"changeLeft", "changeRight", "allow", "disallow"} & set(right)
    assert "changeRight" not in beside


def test_lane_that_turns_by_six_in_a_hundred_is_narrower_by_what_a_truck_cuts(tmp_path: Path) -> None:
    # 12 ft aside in 200 ft. Rounded over 15 m, the middle 6 m on either side of the turn lies so far from there aside: on the
    # straight and on the slope, and both rounded.
    lane = lane_attributes(by_turns("signal"), tmp_path)["01_approach_to_departure"][0]
    ends_aside = (0.06 * 6 + 2 * 0.06 * (15 - 6) ** 3 / (6 * 15**2)) / 2
    assert float(lane["width"]) == pytest.approx(12 * 0.3048 - 2 * (0.1 + ends_aside), abs=5e-3)


def test_own_traffic_meets_the_signal_at_its_stop_line_and_the_opposing_traffic_at_the_other(tmp_path: Path) -> None:
    layout = by_turns("signal")
    write_network(layout, tmp_path)
    nodes = ET.parse(tmp_path / "zone.nod.xml").getroot()
    assert layout.taking_turns is not None
    lights = [float(node.attrib["x"]) for node in nodes if node.attrib["type"] == "traffic_light"]
    assert lights == pytest.approx([layout.taking_turns.start, layout.taking_turns.end], abs=1e-3)
    links = ET.parse(tmp_path / "zone.con.xml").getroot()
    controlled = [link.attrib["from"] for link in links if link.get("uncontrolled") is None]
    own = next(edge.id for edge in edges_of(layout) if abs(edge.end - layout.taking_turns.start) < 1e-6)
    assert controlled == [own, "opposing_0"]
    program = ET.parse(tmp_path / "zone.tll.xml").getroot()
    phases = [(phase.attrib["state"], float(phase.attrib["duration"])) for phase in program.iter("phase")]
    # Red until a truck that starts at 1 m/s2 and drives 10 m/s has passed the shared length.
    clear_s = round(10 + (layout.taking_turns.end - layout.taking_turns.start - 50) / 10, 1)
    assert phases == [("Gr", 30), ("yr", 4), ("rr", clear_s), ("rG", 30), ("ry", 4), ("rr", clear_s)]


def test_flaggers_hold_the_lane_open_for_10_to_60_s(tmp_path: Path) -> None:
    write_network(by_turns("flaggers"), tmp_path)
    program = ET.parse(tmp_path / "zone.tll.xml").getroot()
    greens = [phase.attrib for phase in program.iter("phase") if "G" in phase.attrib["state"]]
    assert [(green["minDur"], green["maxDur"]) for green in greens] == [("10", "60")] * 2
    (logic,) = program.iter("tlLogic")
    assert logic.attrib["type"] == "actuated"
