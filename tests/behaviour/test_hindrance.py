import pytest
from behaviour.outlooks import LAYOUT as PAPER_LAYOUT
from behaviour.outlooks import MIDDLE, NOBODY, RIGHT, one_vehicle, outlook, together, vehicle_at
from builders import paper_work_zone, two_lane_road

from wzsumo.behaviour.hindrance import Hindrance, hindrance_ahead, stop_line_ahead
from wzsumo.ego import EgoState
from wzsumo.mutcd.layout import lay_out
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
LAYOUT = lay_out(
    paper_work_zone(
        posted_speed_mph=45, closed_lanes=(0,), closed_shoulder="right", shift_ft=0, shifted_lane_width_ft=None,
        one_lane_two_way="signal",
    ),
    two_lane_road(),
)  # fmt: skip
assert LAYOUT.taking_turns is not None
STOP_LINE = LAYOUT.taking_turns.start


def stop_line(*, bumper_to_line_m: float, speed_mps: float, may_enter: bool = False) -> float | None:
    state = EgoState(x=STOP_LINE - bumper_to_line_m - CAR.axle_to_bumper_m, y=1.83, heading=0.0, speed=speed_mps)
    return stop_line_ahead(state, vehicle=CAR, layout=LAYOUT, may_enter=may_enter)


def test_stop_line_holds_an_ego_that_can_still_stop() -> None:
    assert stop_line(bumper_to_line_m=40, speed_mps=10) == pytest.approx(40)


def test_stop_line_lets_the_ego_go_on_in_its_turn() -> None:
    assert stop_line(bumper_to_line_m=40, speed_mps=10, may_enter=True) is None


@pytest.mark.parametrize(("bumper_to_line_m", "held"), [(-0.1, False), (0.1, True)])
def test_stop_line_that_the_bumper_has_passed_holds_nobody(bumper_to_line_m: float, held: bool) -> None:
    assert (stop_line(bumper_to_line_m=bumper_to_line_m, speed_mps=0.5) is not None) == held


@pytest.mark.parametrize(("bumper_to_line_m", "held"), [(15.5, False), (15.8, True)])
def test_stop_line_lets_an_ego_go_on_that_would_have_to_brake_harder_than_3_mps2(bumper_to_line_m: float, held: bool) -> None:
    # 10^2 / (2 x 3) = 16.67 m to stop, of which 1 m may lie beyond the line.
    assert (stop_line(bumper_to_line_m=bumper_to_line_m, speed_mps=10) is not None) == held


def test_ego_that_waits_at_the_stop_line_goes_on_waiting_until_its_turn() -> None:
    assert stop_line(bumper_to_line_m=0.2, speed_mps=0.0) == pytest.approx(0.2)


def test_road_without_a_shared_lane_has_no_stop_line() -> None:
    state = EgoState(x=50.0, y=RIGHT, heading=0.0, speed=10.0)
    assert stop_line_ahead(state, vehicle=CAR, layout=PAPER_LAYOUT, may_enter=False) is None


def test_empty_road_hinders_nobody() -> None:
    assert hindrance_ahead(outlook(), NOBODY, layout=PAPER_LAYOUT, may_enter=True) == Hindrance()


def test_leader_and_yield_point_are_both_part_of_the_hindrance() -> None:
    traffic = together(one_vehicle(40.0, MIDDLE, speed=9.0), one_vehicle(-20, MIDDLE, speed=20))
    found = hindrance_ahead(outlook(slope=0.08), traffic, layout=PAPER_LAYOUT, may_enter=True)
    assert found.leader is not None
    assert found.leader.speed_mps == 9.0
    assert found.stop_in_m is not None


@pytest.mark.parametrize("bumper_to_line_m", [5.0, 20.0])
def test_hindrance_stops_the_ego_at_the_nearer_of_yield_point_and_stop_line(bumper_to_line_m: float) -> None:
    x = STOP_LINE - bumper_to_line_m - CAR.axle_to_bumper_m
    ego = outlook(1.83, slope=0.1, speed=3.0, desired_speed=3.0, x=x)
    oncoming = vehicle_at(x + 60, 1.83 + 3.66, speed=15, heading=3.14159265)
    yielding = hindrance_ahead(ego, oncoming, layout=LAYOUT, may_enter=True).stop_in_m
    assert yielding is not None
    assert 5.0 < yielding < 20.0
    held = hindrance_ahead(ego, oncoming, layout=LAYOUT, may_enter=False)
    assert held.stop_in_m == pytest.approx(min(yielding, bumper_to_line_m), abs=0.1)
