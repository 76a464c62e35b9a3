"""What held the ego back: each cause alone, in a drive that nothing else slows."""

import numpy as np
import pytest
from builders import paper_layout
from metrics.test_conduct import CAR, MIDDLE, braking, other, run_of

from wzsumo.ego import EgoRun
from wzsumo.figures.slowing import Slowing, Why, slowings
from wzsumo.frames import FloatArray

ROAD = paper_layout().road
SLOWED = np.concatenate([np.full(200, 20.0), np.linspace(20, 10, 200), np.full(200, 10.0), np.linspace(10, 20, 200)])  # 20 Hz


def told(run: EgoRun, *, wished: FloatArray | None = None, stop_line_m: float | None = None) -> list[Slowing]:
    free = np.full(len(run.log), 20.0) if wished is None else wished
    return slowings(run, CAR, road=ROAD, wished=free, on_straights_mps=20.0, stop_line_m=stop_line_m)


def test_drive_at_the_wished_speed_was_held_back_by_nothing() -> None:
    assert told(run_of(np.full(400, 19.5))) == []


def test_slow_vehicle_ahead_is_told_from_the_braking_until_the_ego_speeds_up_again() -> None:
    run = run_of(SLOWED, other("slow", np.full(400, 10.0), ahead_m=160.0))
    (slowing,) = told(run)
    assert slowing.why is Why.AHEAD
    # It brakes from 110 s on and is 1 m/s slower at 111 s; it gains speed from 130 s on.
    assert slowing.start_s == pytest.approx(111.0, abs=0.4)
    assert slowing.end_s == pytest.approx(130.0, abs=0.4)
    assert slowing.least_speed_mps == 10.0


def test_bend_is_told_where_the_ego_drives_at_the_speed_that_it_allows() -> None:
    (slowing,) = told(run_of(SLOWED), wished=SLOWED)
    assert slowing.why is Why.BEND
    assert told(run_of(SLOWED), wished=np.full(len(SLOWED), 15.0))[0].start_s == pytest.approx(111.0, abs=0.4)


@pytest.mark.parametrize(("across", "why"), [(3.6, [Why.BESIDE]), (0.0, [Why.AHEAD]), (7.3, [])])
def test_vehicle_in_the_next_lane_is_told_apart_from_one_ahead_and_one_two_lanes_away(across: float, why: list[Why]) -> None:
    beside = other("b", np.interp(np.arange(400), np.arange(800) / 2, SLOWED), ahead_m=12.0, y=MIDDLE + across)
    assert [each.why for each in told(run_of(SLOWED, beside))] == why


def test_vehicle_that_drives_the_other_way_holds_nobody_back() -> None:
    beside = other("f", np.interp(np.arange(400), np.arange(800) / 2, SLOWED), ahead_m=12.0, y=MIDDLE + 3.6)
    facing = beside.assign(heading_rad=np.pi)
    assert told(run_of(SLOWED, facing)) == []


def test_wait_at_the_stop_line_is_for_the_other_direction() -> None:
    speed = braking(20.0, 2.0, steps=200, dt=0.05, after=200)
    run = run_of(speed)
    front = float(run.log["x_m"].iloc[-1]) + CAR.axle_to_bumper_m
    (slowing,) = told(run, stop_line_m=front + 2.0)
    assert slowing.why is Why.TURN
    assert slowing.least_speed_mps == pytest.approx(0.0, abs=1e-9)
    assert told(run, stop_line_m=front + 200.0) == []
    assert told(run, stop_line_m=front - 200.0) == []  # behind it


def test_drive_of_one_moment_is_not_explained() -> None:
    run = run_of(np.full(3, 20.0))
    assert slowings(run, CAR, road=ROAD, wished=np.full(3, 20.0), on_straights_mps=20.0, stop_line_m=None) == []
