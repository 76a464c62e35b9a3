import numpy as np
import pytest
import sumolib
from placement.networks import freeway, narrows_and_widens, new_folder, placed_on_freeway, zone

from wzsumo.errors import PlacementError, SpecError
from wzsumo.placement.net import Net
from wzsumo.placement.placement import place_zone


def test_road_of_a_corridor_has_every_lane_within_a_centimetre_of_its_place() -> None:
    corridor = placed_on_freeway("m1", 1000.0, closed_lanes=[2]).corridor
    net, road = sumolib.net.readNet(str(freeway()), withInternal=True), corridor.road
    assert [link.edge.id for link in corridor.links] == ["m1", "m2-AddedOnRampEdge", "m2"]
    for edge, lanes in (("m1", (0, 1, 2)), ("m2-AddedOnRampEdge", (1, 2, 3)), ("m2", (0, 1, 2))):
        for number, lane in enumerate(lanes):
            shape = np.array(net.getEdge(edge).getLane(lane).getShape())
            s, d = road.to_sd(shape)
            assert (np.diff(s) > 0).all()
            assert np.abs(d - (1.6 + 3.2 * number)).max() < 0.05


def test_zone_begins_where_it_was_asked_for() -> None:
    placed = placed_on_freeway("m3", 300.0)
    x, y = placed.layout.road.to_xy(placed.layout.start, 1.6)
    net = sumolib.net.readNet(str(freeway()))
    shape = net.getLane("m3_0").getShape()
    at = sumolib.geomhelper.positionAtShapeOffset(
        shape, 300.0 * sumolib.geomhelper.polyLength(shape) / net.getLane("m3_0").getLength()
    )
    assert np.hypot(x - at[0], y - at[1]) < 0.02


def test_negative_positions_count_from_the_end_of_the_edge() -> None:
    net = Net.read(freeway())
    length = net.edges["m3"].length
    start = [place_zone(net, zone(), edge_id="m3", position=p).layout.start for p in (length - 1200, -1200)]
    assert start[0] == pytest.approx(start[1], abs=1e-9)


def test_auxiliary_lane_is_none_of_the_road() -> None:
    corridor = placed_on_freeway("m2-AddedOnRampEdge", 10.0, closed_lanes=[3]).corridor
    assert corridor.slots == (1, 2, 3)
    assert corridor.road.own_lanes == 3


@pytest.mark.parametrize(("drops", "closed", "slots"), [("left", 0, (0, 1)), ("right", 1, (1, 2))])
def test_both_lanes_that_stay_lead_on_where_one_ends_and_opens_again(drops: str, closed: int, slots: tuple[int, ...]) -> None:
    net = Net.read(narrows_and_widens(drops))
    corridor = place_zone(net, zone(closed_lanes=[closed]), edge_id="ab", position=1300.0).corridor
    assert corridor.slots == slots
    assert [[link.lanes[slot] for slot in slots] for link in corridor.links] == [list(slots), [0, 1], [0, 1]]


@pytest.mark.parametrize(
    ("drops", "closed", "words"),
    [("right", [1, 2], "2 of the 3 lanes of edge 'ab' lead through the .* m of the zone, and it closes all of them"),
     ("right", [0], "lane 0 of edge 'ab', which the zone closes, ends or turns off at the end of edge 'ab'"),
     ("left", [1], "vehicles on lane ':c_0_2' would drive over")],
)  # fmt: skip
def test_zone_over_a_lane_that_ends_or_opens_is_refused(drops: str, closed: list[int], words: str) -> None:
    net = Net.read(narrows_and_widens(drops))
    with pytest.raises(PlacementError, match=words):
        place_zone(net, zone(closed_lanes=closed), edge_id="ab", position=1300.0)


@pytest.mark.parametrize(
    ("edge", "position", "keys", "words"),
    [
        ("nowhere", 0.0, {}, "no such edge"),
        ("m1", 5000.0, {}, "1198.50 m long"),
        ("m4", 1500.0, {}, "the road from its place on ends after"),
        ("m2-AddedOnRampEdge", 10.0, {}, "ends or turns off at the end of edge 'm2-AddedOnRampEdge'"),
        ("m2", 900.0, {"closed_lanes": [3]}, "on edge 'm2': closed_lanes=.3,. must be lanes of the road, 0..2"),
        ("m2", 900.0, {"closed_lanes": [0, 1, 2]}, "must leave open at least one"),
        ("m2", 900.0, {"one_lane_two_way": "signal"}, "needs signals of its own"),
        ("m3", 1000.0, {}, "would drive over"),
    ],
)  # fmt: skip
def test_places_at_which_a_zone_cannot_stand_are_refused_with_their_rule(
    edge: str, position: float, keys: dict[str, object], words: str
) -> None:
    with pytest.raises((PlacementError, SpecError), match=words):
        placed_on_freeway(edge, position, **keys)


def test_posted_speed_is_that_of_the_network_unless_the_zone_gives_one() -> None:
    assert placed_on_freeway("m3", 300.0).layout.work_zone.posted_speed_mph == 65
    assert placed_on_freeway("m3", 300.0, posted_speed_mph=45).layout.work_zone.posted_speed_mph == 45


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("<net version", '<net lefthand="true" version', "its traffic drives on the left"),
        ('<edge id="m4" from=', '<edge id="m4" bidi="m3" from=', "edge 'm4' is one track for both directions"),
        ('<edge id="m3" from=', '<edge id="m3" bidi="m4" from=', "edge 'm3' is one track for both directions"),
        ('6000.00,498.40"/>', '6000.00,498.40"><neigh lane="m3_2"/></lane>', "vehicles on lane 'm4_2' overtake over edge 'm3'"),
        ('4097.39,482.99"/>', '4097.39,482.99"><neigh lane="m4_2"/></lane>', "vehicles on lane 'm3_2' overtake over edge 'm4'"),
        ('"m4', '"m3.wz1', "a piece of it would be called 'm3.wz1'"),
    ],
)
def test_networks_that_a_zone_would_spoil_are_refused(old: str, new: str, words: str) -> None:
    path, text = new_folder() / "some.net.xml", freeway().read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(PlacementError, match=words):
        place_zone(Net.read(path), zone(), edge_id="m3", position=300.0)
