from pathlib import Path

import pytest
from placement.networks import freeway, placed_on_freeway

from wzsumo.placement.demand_files.vehicles import Demand
from wzsumo.placement.movements import Movement, lost_movements, routes_of, vehicles_on
from wzsumo.placement.net import Net
from wzsumo.placement.placement import Placed
from wzsumo.placement.xml_file import XmlFile


def lost(placed: Placed, vehicle_class: str = "passenger") -> set[tuple[str, ...]]:
    return {movement.edges for movement in lost_movements(placed.corridor.net, placed.closed, vehicle_class)}


def demand_of(content: str) -> Demand:
    return Demand.read([XmlFile(path=Path("some.xml"), data=f"<routes>{content}</routes>".encode())])


def test_zone_away_from_ramps_takes_no_movement_away() -> None:
    assert lost(placed_on_freeway("m3", 300.0)) == set()
    assert lost(placed_on_freeway("m1", 1000.0, closed_lanes=[2])) == set()


def test_two_left_lanes_closed_past_a_ramp_leave_a_way_from_it() -> None:
    assert lost(placed_on_freeway("m1", 500.0, closed_lanes=[1, 2])) == set()


def interior_beside_the_ramp() -> Placed:
    """The middle lane closed past the on-ramp: its traffic cannot cross to the left lane."""
    return placed_on_freeway("m1", 500.0, closed_lanes=[1])


def test_way_on_that_leads_beside_a_closed_lane_goes_on_on_its_own_side() -> None:
    assert lost(interior_beside_the_ramp()) == set()


EXIT_ROUTE = "m1 m2-AddedOnRampEdge m2 m3 m3-AddedOffRampEdge off"


def test_ramp_that_joins_behind_closed_ground_loses_its_way() -> None:
    # The right lane closes ahead of the on-ramp, whose own lane ends 100 m on, on the far side of the closed ground.
    assert ("on", "m2-AddedOnRampEdge", "m2") in lost(right_lane_past_the_ramp())
    assert ("m1", "m2-AddedOnRampEdge", "m2") not in lost(right_lane_past_the_ramp())


def right_lane_past_the_ramp() -> Placed:
    return placed_on_freeway("m1", 700.0, closed_lanes=[0])


@pytest.mark.parametrize(
    ("content", "count"),
    [
        (f'<vehicle id="a"><route edges="{EXIT_ROUTE}"/></vehicle>', 1),
        ('<route id="r" edges="m2 m3 m3-AddedOffRampEdge m4"/><vehicle id="a" route="r"/>', 0),
        ('<flow id="a" from="m1" to="off" number="30"/><trip id="b" from="m1" to="m4"/>', 30),
        ('<vType id="t" vClass="bus"/><flow id="a" from="m1" to="off" number="30" type="t"/>', 0),
    ],
)
def test_vehicles_on_a_movement_are_counted_by_route_or_by_the_quickest_way(content: str, count: int) -> None:
    net = Net.read(freeway())
    movement = Movement(came_from="m2", along=("m3", "m3-AddedOffRampEdge"), goes_to="off")
    assert vehicles_on(routes_of(net, demand_of(content), "passenger"), [movement]) == count


def test_class_that_may_use_no_open_lane_loses_its_way() -> None:
    placed = placed_on_freeway("m3", 300.0)
    for lane in placed.corridor.net.edges["m3"].lanes[1:]:
        lane.element.attributes["disallow"] = "truck"
    to_its_end, past_it = ("m3",), ("m3", "m3-AddedOffRampEdge")
    assert lost(placed, "truck") == {to_its_end, past_it, ("m2", *to_its_end), ("m2", *past_it)}
    assert lost(placed, "passenger") == set()
