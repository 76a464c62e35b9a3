import math

import numpy as np
import pytest
from control.drives import CAR, drive, straight_path
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.behaviour.car_following import (
    STOP_MARGIN_M,
    IdmSpec,
    acc_acceleration,
    constant_acceleration_heuristic,
    eased,
    idm_acceleration,
    stopping_acceleration,
)
from wzsumo.behaviour.ceiling import AccelerationCeiling, Hindrance
from wzsumo.control.controller import Controller
from wzsumo.control.plant import PlantSpec, advance_ego
from wzsumo.ego import EgoState, Leader
from wzsumo.errors import InputError
from wzsumo.scenario.sections import ControlSection


def driven_leader(gap_m, speed_at, *, dt=0.05):
    """Leader that starts `gap_m` ahead and whose speed is a function of time, seen from the ego."""
    place = {"x": gap_m}

    def seen(time, state):
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
    speed: float, leader_speed: float, gap: float, expected
) -> None:
    leader = Leader(gap_m=gap, speed_mps=leader_speed)
    assert idm_acceleration(speed, leader=leader, spec=IdmSpec()) == pytest.approx(expected)


@given(speed=st.floats(0, 40), leader_speed=st.floats(0, 40), gap=st.floats(0.1, 200), more=st.floats(0, 50))
def test_more_room_and_a_faster_leader_never_ask_for_harder_braking(
    speed: float, leader_speed: float, gap: float, more: float
) -> None:
    near = idm_acceleration(speed, leader=Leader(gap_m=gap, speed_mps=leader_speed), spec=IdmSpec())
    far = idm_acceleration(speed, leader=Leader(gap_m=gap + more, speed_mps=leader_speed), spec=IdmSpec())
    faster = idm_acceleration(speed, leader=Leader(gap_m=gap, speed_mps=leader_speed + more), spec=IdmSpec())
    assert far >= near
    assert faster >= near


@pytest.mark.parametrize("gap", [0.0, -1.5])
@pytest.mark.parametrize("law", [idm_acceleration, acc_acceleration])
def test_a_gap_that_is_used_up_asks_for_all_brakes(law, gap: float) -> None:
    assert law(5.0, leader=Leader(gap_m=gap, speed_mps=5.0), spec=IdmSpec()) == -math.inf


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
    ],
)
def test_constant_acceleration_heuristic_just_avoids_the_crash(
    speed: float, leader_speed: float, leader_acceleration: float, gap: float, expected
) -> None:
    leader = Leader(gap_m=gap, speed_mps=leader_speed, acceleration_mps2=leader_acceleration)
    assert constant_acceleration_heuristic(speed, leader=leader, spec=IdmSpec()) == pytest.approx(expected)


@given(speed=st.floats(0, 40), leader_speed=st.floats(0, 40), leader_acceleration=st.floats(-8, 3), gap=st.floats(0.5, 200))
def test_cruise_control_brakes_as_the_idm_or_more_gently(
    speed: float, leader_speed: float, leader_acceleration: float, gap: float
) -> None:
    leader = Leader(gap_m=gap, speed_mps=leader_speed, acceleration_mps2=leader_acceleration)
    idm = idm_acceleration(speed, leader=leader, spec=IdmSpec())
    acc = acc_acceleration(speed, leader=leader, spec=IdmSpec())
    calm = constant_acceleration_heuristic(speed, leader=leader, spec=IdmSpec())
    assert acc >= idm - 1e-9
    assert acc <= max(idm, calm) + 1e-9
    assert acc_acceleration(speed, leader=leader, spec=IdmSpec(coolness=0.0)) == pytest.approx(idm)


def test_cruise_control_takes_a_close_cut_in_calmly_where_the_idm_brakes_with_all_it_has() -> None:
    hardest = {}
    for car_following in ("idm", "acc"):
        control = ControlSection(car_following=car_following, target_speed_mps=24.0)
        cut_in = driven_leader(10.0, lambda _: 19.0)
        run = drive(straight_path(5000), control, PlantSpec(), speed=24.0, leader=cut_in, time_limit=60)
        assert run["gap"].min() > 5.0
        hardest[car_following] = run["acceleration"].min()
    assert hardest["acc"] > -4.5
    assert hardest["idm"] < -7.0


@pytest.mark.parametrize(("gap", "speed"), [(math.nan, 3.0), (math.inf, 3.0), (10.0, math.nan)])
def test_a_leader_that_is_not_finite_is_refused(gap, speed) -> None:
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
def test_the_ego_never_touches_its_leader(longitudinal: str, car_following: str, gap: float, speed_at) -> None:
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


def stop_before(place_m, *, speed, seen_at_m=0.0):
    """A drive towards a place that shows itself `place_m` ahead of the bumper once the ego has gone `seen_at_m`; for 40 s."""
    control = ControlSection(target_speed_mps=speed)
    controller, ceiling = Controller(straight_path(1000), CAR, control), AccelerationCeiling(control)
    state, rows = EgoState(x=0.0, y=0.0, heading=0.0, speed=speed), []
    for _ in range(800):
        left = place_m + seen_at_m - state.x
        hindrance = Hindrance(stop_in_m=left if state.x >= seen_at_m else None)
        command = controller.command(state, dt=0.05, ceiling=ceiling.next(hindrance, speed=state.speed, dt=0.05))
        state = advance_ego(state, command, dt=0.05, vehicle=CAR, spec=PlantSpec())
        rows.append((left, state.speed, state.acceleration))
    return np.array(rows).T


@pytest.mark.parametrize("speed", [10.0, 20.0, 27.0])
def test_ego_that_sees_a_place_in_time_stops_before_it_with_comfortable_braking(speed: float) -> None:
    left, speeds, accelerations = stop_before(speed**2 / 4 + 60.0, speed=speed)
    assert speeds[-1] < 0.05
    assert 0 < left[-1] < 1.5 * STOP_MARGIN_M
    assert accelerations.min() > -1.2 * IdmSpec().comfortable_deceleration_mps2
    over_half_a_second = (accelerations[10:] - accelerations[:-10])[speeds[10:] > 1.0] / 0.5  # the last jolt of a stop left out
    assert np.abs(over_half_a_second).max() < 2.5  # m/s3; ISO 15622, of adaptive cruise control above 20 m/s


def test_ego_that_sees_a_place_late_brakes_no_harder_than_it_takes_to_stop_before_it() -> None:
    left, speeds, accelerations = stop_before(12.0, speed=10.0, seen_at_m=50.0)
    assert speeds[-1] < 0.05
    assert left[-1] > 0
    needed = 10.0**2 / (2 * (12.0 - STOP_MARGIN_M))
    assert -accelerations.min() < 1.6 * needed  # the power train answers 0.3 s late, which asks for more afterwards


def test_place_that_is_far_off_takes_nothing_of_the_acceleration() -> None:
    assert stopping_acceleration(10.0, distance_m=1e6, spec=IdmSpec()) == pytest.approx(IdmSpec().acceleration_mps2)


@given(speed=st.floats(0, 40), distance=st.floats(-5, 300), more=st.floats(0, 100))
def test_place_farther_off_never_asks_for_harder_braking(speed: float, distance: float, more: float) -> None:
    near = stopping_acceleration(speed, distance_m=distance, spec=IdmSpec())
    assert stopping_acceleration(speed, distance_m=distance + more, spec=IdmSpec()) >= near - 1e-12


def test_ceiling_that_drops_within_comfort_is_reached_by_a_steady_jerk_and_an_emergency_at_once() -> None:
    spec, ceilings = IdmSpec(), [1.4]
    for _ in range(20):
        ceilings.append(eased(-2.0, speed=15.0, last=ceilings[-1], dt=0.05, spec=spec))
    assert np.diff(ceilings).min() == pytest.approx(-4.0 * 0.05)
    assert np.isclose(ceilings, -2.0).argmax() == 17  # 3.4 m/s2 at 4 m/s3: 0.85 s
    assert eased(-6.0, speed=15.0, last=1.4, dt=0.05, spec=spec) == -6.0
    assert eased(-2.0, speed=1.0, last=1.4, dt=0.05, spec=spec) == -2.0  # a metre before a place there is no time left
    assert eased(1.0, speed=15.0, last=-2.0, dt=0.05, spec=spec) == pytest.approx(-1.8)
