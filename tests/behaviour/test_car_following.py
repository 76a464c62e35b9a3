import math
from collections.abc import Callable
from typing import Literal, Protocol

import numpy as np
import pytest
from control.drives import drive, straight_path
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.behaviour.car_following import (
    IdmSpec,
    acc_acceleration,
    constant_acceleration_heuristic,
    idm_acceleration,
    stopping_acceleration,
)
from wzsumo.control.plant import PlantSpec
from wzsumo.ego import EgoState, Leader
from wzsumo.errors import InputError
from wzsumo.scenario.sections import ControlSection

SPEC = IdmSpec()  # T = 1.5 s, s0 = 2 m, a = 1.4 m/s2, b = 2 m/s2, c = 0.99


SpeedAt = Callable[[float], float]


class Law(Protocol):
    def __call__(self, speed: float, *, leader: Leader, spec: IdmSpec) -> float: ...


def driven_leader(gap_m: float, speed_at: SpeedAt, *, dt: float = 0.05) -> Callable[[float, EgoState], Leader]:
    """A leader that starts `gap_m` ahead and whose speed is a function of time, seen from the ego."""
    place = {"x": gap_m}

    def seen(time: float, state: EgoState) -> Leader:
        acceleration = (speed_at(time) - speed_at(time - dt)) / dt
        leader = Leader(gap_m=place["x"] - state.x, speed_mps=speed_at(time), acceleration_mps2=acceleration)
        place["x"] += (speed_at(time) + speed_at(time + dt)) / 2 * dt
        return leader

    return seen


@pytest.mark.parametrize(
    ("speed", "leader_speed", "gap", "expected"),
    [
        (20.0, 20.0, 32.0, 0.0),  # s0 + v T = 2 + 20 * 1.5
        (20.0, 20.0, 16.0, 1.4 * (1 - 4)),
        (0.0, 0.0, 2.0, 0.0),
        # s* = 2 + 15 + 10 * 10 / (2 sqrt(1.4 * 2))
        (10.0, 0.0, 50.0, 1.4 * (1 - ((17 + 50 / math.sqrt(2.8)) / 50) ** 2)),
        (10.0, 40.0, 10.0, 1.4 * (1 - 0.2**2)),  # the dynamic part does not shrink the gap below s0
    ],
)
def test_idm_acceleration_is_that_of_the_idm_without_its_free_road_term(
    speed: float, leader_speed: float, gap: float, expected: float
) -> None:
    assert idm_acceleration(speed, leader=Leader(gap_m=gap, speed_mps=leader_speed), spec=SPEC) == pytest.approx(expected)


@given(speed=st.floats(0, 40), leader_speed=st.floats(0, 40), gap=st.floats(0.1, 200), more=st.floats(0, 50))
def test_more_room_and_a_faster_leader_never_ask_for_harder_braking(
    speed: float, leader_speed: float, gap: float, more: float
) -> None:
    near = idm_acceleration(speed, leader=Leader(gap_m=gap, speed_mps=leader_speed), spec=SPEC)
    far = idm_acceleration(speed, leader=Leader(gap_m=gap + more, speed_mps=leader_speed), spec=SPEC)
    faster = idm_acceleration(speed, leader=Leader(gap_m=gap, speed_mps=leader_speed + more), spec=SPEC)
    assert far >= near
    assert faster >= near


@pytest.mark.parametrize("gap", [0.0, -1.5])
@pytest.mark.parametrize("law", [idm_acceleration, acc_acceleration])
def test_a_gap_that_is_used_up_asks_for_all_brakes(law: Law, gap: float) -> None:
    assert law(5.0, leader=Leader(gap_m=gap, speed_mps=5.0), spec=SPEC) == -math.inf


@pytest.mark.parametrize(
    ("speed", "leader_speed", "leader_acceleration", "gap", "expected"),
    [
        (20.0, 10.0, 0.0, 25.0, -(10.0**2) / 50),  # shed the difference of speed within the gap
        (20.0, 0.0, 0.0, 50.0, -(20.0**2) / 100),  # stop behind what stands
        (20.0, 20.0, 0.0, 5.0, 0.0),
        # Both brake to standstill: v^2 / (2 a) = v_l^2 / (2 * 4) + gap.
        (20.0, 20.0, -4.0, 30.0, -(20.0**2) / (2 * (20.0**2 / 8 + 30.0))),
        (20.0, 15.0, -1.0, 10.0, -1.0 - 5.0**2 / 20),  # speeds meet before the leader stands
        (20.0, 20.0, 9.0, 30.0, 1.4),  # no more than one's own a
        (20.0, 30.0, -1.0, 20.0, -(20.0**2) / (2 * (30.0**2 / 2 + 20.0))),  # the leader stands first, however fast it is
        (10.0, 20.0, 0.5, 20.0, 10.0**2 * 0.5 / (20.0**2 - 2 * 20.0 * 0.5)),  # the same equation for a leader that speeds up
    ],
)
def test_constant_acceleration_heuristic_just_avoids_the_crash(
    speed: float, leader_speed: float, leader_acceleration: float, gap: float, expected: float
) -> None:
    leader = Leader(gap_m=gap, speed_mps=leader_speed, acceleration_mps2=leader_acceleration)
    assert constant_acceleration_heuristic(speed, leader=leader, spec=SPEC) == pytest.approx(expected)


@given(speed=st.floats(0, 40), leader_speed=st.floats(0, 40), leader_acceleration=st.floats(-8, 3), gap=st.floats(0.5, 200))
def test_cruise_control_brakes_as_the_idm_or_more_gently(
    speed: float, leader_speed: float, leader_acceleration: float, gap: float
) -> None:
    leader = Leader(gap_m=gap, speed_mps=leader_speed, acceleration_mps2=leader_acceleration)
    idm = idm_acceleration(speed, leader=leader, spec=SPEC)
    acc = acc_acceleration(speed, leader=leader, spec=SPEC)
    calm = constant_acceleration_heuristic(speed, leader=leader, spec=SPEC)
    assert acc >= idm - 1e-9
    assert acc <= max(idm, calm) + 1e-9
    assert acc_acceleration(speed, leader=leader, spec=IdmSpec(coolness=0.0)) == pytest.approx(idm)


def test_cruise_control_after_a_close_cut_in_brakes_by_a_hundredth_of_the_idm_and_the_rest_of_its_heuristic() -> None:
    # 20 m/s behind 20 m/s with 10 m: s* = 32 m, IDM 1.4 (1 - 3.2^2) = -12.936; the heuristic finds 0.
    acc = acc_acceleration(20.0, leader=Leader(gap_m=10.0, speed_mps=20.0), spec=SPEC)
    assert acc == pytest.approx(0.01 * -12.936 + 0.99 * 2.0 * math.tanh(-12.936 / 2.0))


def test_cruise_control_takes_a_close_cut_in_calmly_where_the_idm_brakes_with_all_it_has() -> None:
    hardest = {}
    laws: tuple[Literal["idm", "acc"], ...] = ("idm", "acc")
    for car_following in laws:
        control = ControlSection(car_following=car_following, target_speed_mps=24.0)
        cut_in = driven_leader(10.0, lambda _: 19.0)
        run = drive(straight_path(5000), control, PlantSpec(), speed=24.0, leader=cut_in, time_limit=60)
        assert run["gap"].min() > 5.0
        hardest[car_following] = run["acceleration"].min()
    assert hardest["acc"] > -4.5
    assert hardest["idm"] < -7.0


@pytest.mark.parametrize(("gap", "speed"), [(math.nan, 3.0), (math.inf, 3.0), (10.0, math.nan)])
def test_a_leader_that_is_not_finite_is_refused(gap: float, speed: float) -> None:
    with pytest.raises(InputError, match="give None where there is no leader"):
        Leader(gap_m=gap, speed_mps=speed)


@pytest.mark.parametrize(("longitudinal", "car_following"), [("paper", "idm"), ("tuned", "idm"), ("tuned", "acc")])
@pytest.mark.parametrize(
    ("gap", "speed_at"),
    [
        (38.0, lambda time: max(0.0, 24.0 - 6.0 * max(0.0, time - 5.0))),  # emergency stop of the leader
        (150.0, lambda _: 0.0),  # the end of a queue
        (25.0, lambda time: 8.0 + 8.0 * math.cos(time / 8)),  # stop and go
    ],
)
def test_the_ego_never_touches_its_leader(
    longitudinal: Literal["paper", "tuned"],
    car_following: Literal["idm", "acc"],
    gap: float,
    speed_at: SpeedAt,
) -> None:
    control = ControlSection(longitudinal=longitudinal, car_following=car_following, target_speed_mps=24.0)
    speed = min(24.0, max(speed_at(0.0), 20.0))
    plant = PlantSpec(command_delay_s=0.1)
    run = drive(straight_path(5000), control, plant, speed=speed, leader=driven_leader(gap, speed_at), time_limit=100)
    assert run["gap"].min() > 1.5
    assert run["acceleration"].min() > -8.5


def test_without_car_following_the_pid_alone_runs_into_the_queue() -> None:
    control = ControlSection(car_following="none", target_speed_mps=10.0)
    queue = driven_leader(150.0, lambda _: 0.0)
    run = drive(straight_path(500), control, PlantSpec(), speed=10.0, leader=queue, time_limit=30)
    assert run["gap"].min() < 0
    assert run["speed"].min() > 9.5


def test_the_gap_in_steady_following_is_standstill_gap_and_time_gap() -> None:
    control = ControlSection(target_speed_mps=24.0)
    still_air = PlantSpec(drag_area_m2=0.0, rolling_resistance=0.0)
    leader = driven_leader(60.0, lambda _: 15.0)
    run = drive(straight_path(5000), control, still_air, speed=15.0, leader=leader, time_limit=150)
    assert run["gap"][-1] == pytest.approx(2.0 + 15.0 * 1.5, abs=0.1)
    assert np.abs(run["acceleration"][-200:]).max() < 0.01


@pytest.mark.parametrize(
    ("speed", "distance", "expected"),
    [
        (10.0, 1e6, 1.4),  # far off: all of a
        (10.0, 51.0, 1.4 - 3.4 * 0.5**2),  # 100 / (2 x 50) = 1 m/s2 would do, half of b
        (10.0, 26.0, -2.0),  # a metre before the place with b
        (10.0, 11.0, -5.0),  # later than that: what it takes
        (10.0, 1.2, -100.0),  # in the last half metre as if half a metre were left
        (0.5, 0.9, -2.0),  # within the metre: b at least
        (4.0, 0.0, -16.0),
    ],
)
def test_stopping_acceleration_leaves_a_metre_to_the_place(speed: float, distance: float, expected: float) -> None:
    assert stopping_acceleration(speed, distance_m=distance, spec=SPEC) == pytest.approx(expected)


@given(speed=st.floats(0, 40), distance=st.floats(-5, 300), more=st.floats(0, 100))
def test_place_farther_off_never_asks_for_harder_braking(speed: float, distance: float, more: float) -> None:
    near = stopping_acceleration(speed, distance_m=distance, spec=SPEC)
    assert stopping_acceleration(speed, distance_m=distance + more, spec=SPEC) >= near - 1e-12


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("time_gap_s", 1.5),
        ("standstill_gap_m", 2.0),
        ("acceleration_mps2", 1.4),
        ("comfortable_deceleration_mps2", 2.0),
        ("coolness", 0.99),
        ("comfortable_jerk_mps3", 4.0),
    ],
)
def test_default_driver_is_that_of_kesting_and_others_with_the_jerk_of_iso_15622(name: str, expected: float) -> None:
    assert getattr(IdmSpec(), name) == expected
