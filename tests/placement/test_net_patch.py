"""The patched networks as ElementTree and sumolib read them: what changed, and that nothing else did."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import sumolib
from placement.networks import city, freeway, placed_on_freeway, zone

from wzsumo.placement.net import Net
from wzsumo.placement.net_patch import NetPatch
from wzsumo.placement.placement import Placed, place_zone

Row = tuple[str, tuple[tuple[str, str], ...], int]


def patched(placed: Placed, *, closed: bool) -> bytes:
    cuts = {cut.edge.id: cut for cut in placed.plan.cuts}
    return NetPatch(net=placed.corridor.net, cuts=cuts, closed=placed.closed if closed else None).apply()


def rows(text: bytes) -> Counter[Row]:
    """Every element below the root with its attributes and number of children."""
    root = ET.fromstring(text)
    return Counter((e.tag, tuple(sorted(e.attrib.items())), len(e)) for e in root.iter() if e is not root)


def sumolib_net(text: bytes, folder: Path) -> Any:
    path = folder / "patched.net.xml"
    path.write_bytes(text)
    return sumolib.net.readNet(str(path), withInternal=True)


@pytest.fixture(scope="module")
def placed() -> Placed:
    """The left lane of three closed from 300 m of edge m3 on, before the off-ramp."""
    return placed_on_freeway("m3", 300.0, closed_lanes=[2])


@pytest.fixture(scope="module")
def over_ramp() -> Placed:
    """The left lane closed from 1,000 m of edge m1 on, past the on-ramp at its end."""
    return placed_on_freeway("m1", 1000.0, closed_lanes=[2])


def test_cut_network_differs_from_the_old_one_by_the_cut_edge_and_what_names_it(placed: Placed) -> None:
    old, new = rows(freeway().read_bytes()), rows(patched(placed, closed=False))
    gone, come = old - new, new - old
    # m3 and its 3 lanes; 3 connections into it, 3 over internal lanes, 4 out of it; the junction at its end.
    assert Counter(tag for tag, _, _ in gone.elements()) == {"edge": 1, "lane": 3, "connection": 10, "junction": 1}
    assert Counter(tag for tag, _, _ in come.elements()) == {
        "edge": 4, "lane": 12, "param": 4, "connection": 10 + 9, "junction": 1 + 3, "request": 0 + _new_requests(come),
    }  # fmt: skip
    for _, attributes, _ in gone.elements():
        assert "m3" in " ".join(value for _, value in attributes).replace("_", " ").split()


def _new_requests(come: Counter[Row]) -> int:
    """Rows of zeros for 3 links at each of 3 nodes; those that the network had already do not count as new."""
    return sum(n for (tag, _, _), n in come.items() if tag == "request")


def test_pieces_add_up_to_the_old_edge_in_length_and_shape(over_ramp: Placed, tmp_path: Path) -> None:
    old, new = sumolib.net.readNet(str(freeway())), sumolib_net(patched(over_ramp, closed=False), tmp_path)
    for cut in over_ramp.plan.cuts:
        for lane in old.getEdge(cut.edge.id).getLanes():
            parts = [new.getEdge(piece).getLane(lane.getIndex()) for piece in cut.ids]
            assert sum(part.getLength() for part in parts) == pytest.approx(lane.getLength(), abs=1e-9)
            joined = [point for part in parts for point in part.getShape()]
            assert sumolib.geomhelper.polyLength(joined) == pytest.approx(
                sumolib.geomhelper.polyLength(lane.getShape()), abs=0.02
            )


@pytest.mark.parametrize("position", [3.0, 299.99, 300.01, 500.0, 1400.0])
def test_a_position_lies_at_the_same_point_of_its_piece(placed: Placed, position: float, tmp_path: Path) -> None:
    old, new = sumolib.net.readNet(str(freeway())), sumolib_net(patched(placed, closed=False), tmp_path)
    (cut,) = placed.plan.cuts
    number, on_piece = cut.on_piece(position)

    def point(lane: Any, at: float) -> tuple[float, float]:
        shape = lane.getShape()
        return sumolib.geomhelper.positionAtShapeOffset(shape, at * sumolib.geomhelper.polyLength(shape) / lane.getLength())

    before = point(old.getLane("m3_1"), position)
    after = point(new.getLane(f"{cut.ids[number]}_1"), on_piece)
    assert np.hypot(*np.subtract(before, after)) < 0.01


def test_closed_lane_ends_in_the_taper_and_opens_again_behind_the_downstream_taper(placed: Placed) -> None:
    root = ET.fromstring(patched(placed, closed=True))
    (cut,) = placed.plan.cuts
    lanes = {lane.get("id"): lane for lane in root.iter("lane")}
    bars = [lanes[f"{piece}_2"].get("allow") for piece in cut.ids]
    assert bars == [None, None, "custom1", None]
    assert lanes[f"{cut.ids[1]}_2"].get("width") == "2.44"  # 8 ft
    links = {(c.get("from"), c.get("fromLane"), c.get("to"), c.get("toLane")) for c in root.iter("connection")}
    for number, n_lanes in enumerate([3, 2, 2]):
        first, second = cut.ids[number : number + 2]
        assert {link for link in links if link[0] == first} == {(first, str(k), second, str(k)) for k in range(n_lanes)}
    # 208 m of taper for 10.5 ft at 65 mph; the last 2.44 m of 3.2 m are reached after 0.76 / 3.2 of it.
    assert cut.positions[0] == 300.0
    assert cut.positions[1] == pytest.approx(300 + 208.0 * 0.7616 / 3.2, abs=0.05)
    end = 300 + 208.0 + 645 * 0.3048 + 500 * 0.3048 + 100 * 0.3048 + 16.5  # a truck with trailer past the last device
    assert cut.positions[2] == pytest.approx(end, abs=0.05)


def test_closing_lane_bends_along_the_taper_and_meets_the_lane_that_it_left(placed: Placed, tmp_path: Path) -> None:
    net = sumolib_net(patched(placed, closed=True), tmp_path)
    (cut,) = placed.plan.cuts
    before, bent = (net.getLane(f"{piece}_2").getShape() for piece in cut.ids[:2])
    assert np.hypot(*np.subtract(before[-1], bent[0])) < 0.05
    beside = net.getLane(f"{cut.ids[1]}_1").getShape()
    assert np.hypot(*np.subtract(bent[-1], beside[-1])) == pytest.approx(1.6 + 1.22, abs=0.05)


def test_zone_past_a_ramp_bars_the_lane_on_every_edge_and_within_its_junctions(over_ramp: Placed) -> None:
    root = ET.fromstring(patched(over_ramp, closed=True))
    barred = {lane.get("id") for lane in root.iter("lane") if lane.get("allow") == "custom1"}
    assert barred == {"m1.wz2_2", ":b_1_2", "m2-AddedOnRampEdge_3", ":m2-AddedOnRampNode_0_2", "m2.wz0_2"}


def elements_that_name(text: bytes, id_: str) -> Iterator[ET.Element]:
    for element in ET.fromstring(text).iter():
        words = " ".join(element.attrib.values()).replace("_", " ").split()
        if id_ in words and not (element.tag == "param" and element.get("key") == "origId"):
            yield element


@pytest.mark.parametrize("closed", [False, True])
def test_no_element_of_a_city_names_a_cut_edge_by_its_old_id(closed: bool) -> None:
    net = Net.read(city())
    edge = next(e for e in net.edges.values() if not e.is_internal and len(e.lanes) > 2 and e.length > 200)
    placed = place_zone(net, zone(work_length_ft=50, posted_speed_mph=25), edge_id=edge.id, position=20.0)
    assert edge.id in placed.corridor.links[0].edge.id
    text = patched(placed, closed=closed)
    assert list(elements_that_name(text, edge.id)) == []
    assert len(list(elements_that_name(city().read_bytes(), edge.id))) > 10
