import numpy as np
import pytest
from builders import paper_work_zone, two_lane_road

from wzsumo.behaviour.stop_line import stop_line_ahead
from wzsumo.ego import EgoState
from wzsumo.mutcd.layout import lay_out
from wzsumo.simulation.turns import clearance_s
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()
LAYOUT = lay_out(
    paper_work_zone(
        posted_speed_mph=45, closed_lanes=(0,), closed_shoulder="right", shift_ft=0, shifted_lane_width_ft=None,
        one_lane_two_way="signal",
    ),
    two_lane_road(),
)  # fmt: skip


def ahead(*, bumper_to_line_m, speed_mps, may_enter=False):
    x = LAYOUT.taking_turns.start - bumper_to_line_m - CAR.axle_to_bumper_m
    state = EgoState(x=x, y=1.83, heading=0.0, speed=speed_mps)
    return stop_line_ahead(state, vehicle=CAR, layout=LAYOUT, may_enter=may_enter)


def test_stop_line_holds_back_whoever_can_still_stop() -> None:
    assert ahead(bumper_to_line_m=40, speed_mps=10) == pytest.approx(40)


@pytest.mark.parametrize(
    ("case", "given"),
    [
        ("green", {"bumper_to_line_m": 40, "speed_mps": 10, "may_enter": True}),
        ("passed", {"bumper_to_line_m": -1, "speed_mps": 10}),
        ("too late", {"bumper_to_line_m": 12, "speed_mps": 10}),  # 10^2 / (2 x 3) = 16.7 m to stop
    ],
)
def test_stop_line_lets_go_on_whoever_may_or_must(case: str, given) -> None:
    assert ahead(**given) is None


def test_waiting_at_the_stop_line_goes_on_until_green() -> None:
    assert ahead(bumper_to_line_m=0.2, speed_mps=0.0) == pytest.approx(0.2)


@pytest.mark.parametrize(("length_m", "speed_mps"), [(20.0, 10.0), (430.0, 10.0), (300.0, 20.0)])
def test_red_clears_the_lane_of_who_starts_last(length_m: float, speed_mps: float) -> None:
    # A slow twin: drive it in steps of a millisecond with 1 m/s2 up to the speed.
    t, s, v = 0.0, 0.0, 0.0
    while s < length_m:
        v, t = min(v + 0.001, speed_mps), t + 0.001
        s += v * 0.001
    assert clearance_s(length_m, speed=speed_mps) == pytest.approx(t, abs=0.02)
    assert np.isfinite(t)
