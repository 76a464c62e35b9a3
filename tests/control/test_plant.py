import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from control.drives import CAR
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from wzsumo.control.plant import PlantSpec, PlantState, advance_ego, drag_mps2, slip_gradients
from wzsumo.ego import Command, EgoState
from wzsumo.errors import InputError
from wzsumo.frames import FloatArray

COAST = Command(throttle=0.0, brake=0.0, steering=0.0)


def free_plant(**changes: Any) -> PlantSpec:
    """A car without drag or power-train lag."""
    return PlantSpec.model_validate({"drag_area_m2": 0.0, "rolling_resistance": 0.0, "powertrain_lag_s": 0.0} | changes)


def held(command: Command, spec: PlantSpec, *, seconds: float, dt: float = 0.05, **start: float) -> list[PlantState]:
    """States of a car that is given one command for some seconds."""
    states = [PlantState.of(replace(EgoState(x=0.0, y=0.0, heading=0.0, speed=0.0), **start), spec=spec)]
    for _ in range(round(seconds / dt)):
        states.append(advance_ego(states[-1], command, dt=dt, vehicle=CAR, spec=spec))
    return states


@pytest.mark.parametrize("steering", [0.05, -0.3, 0.6])
def test_kinematic_bicycle_drives_the_circle_of_its_wheelbase_and_steering(steering: float) -> None:
    states = held(
        Command(throttle=0, brake=0, steering=steering), free_plant(), seconds=8, speed=6.0, heading=0.4, steering=steering
    )
    radius = CAR.wheelbase_m / math.tan(steering)
    centre = np.array([-math.sin(0.4), math.cos(0.4)]) * radius
    for state in states:
        assert math.hypot(state.x - centre[0], state.y - centre[1]) == pytest.approx(abs(radius), rel=1e-9)
    assert states[-1].heading == pytest.approx(0.4 + 6.0 * 8 / radius)


@pytest.mark.parametrize("speed", [5.0, 15.0, 24.0])
@pytest.mark.parametrize("front_share", [0.41, 0.5])
def test_single_track_turns_in_the_steady_state_at_the_rate_of_its_understeer_gradient(
    speed: float, front_share: float
) -> None:
    spec = free_plant(body="single_track", single_track={"front_share": front_share, "friction": 50.0})
    steering = 0.004
    end = held(Command(throttle=0, brake=0, steering=steering), spec, seconds=12, speed=speed)[-1]
    # r = v delta / (L + K v^2), K = m / L (l_r / C_f - l_f / C_r): textbook single track.
    front, rear = front_share * CAR.wheelbase_m, (1 - front_share) * CAR.wheelbase_m
    gradient = 1573 / CAR.wheelbase_m * (rear / 160e3 - front / 160e3)
    assert end.yaw_rate == pytest.approx(speed * steering / (CAR.wheelbase_m + gradient * speed**2), rel=2e-4)
    # Rear slip alpha_r = m a_y l_f / (L C_r) points the rear axle's course out of the bend.
    lateral = speed * end.yaw_rate
    assert -end.lateral_speed / speed == pytest.approx(1573 * lateral * front / (CAR.wheelbase_m * 160e3), rel=2e-3)
    assert slip_gradients(spec) == pytest.approx((gradient, 1573 * front_share / 160e3))


def test_single_track_answers_a_step_of_the_steering_as_the_linear_equations_do() -> None:
    speed, steering, front, rear = 20.0, 0.01, 0.41 * 2.85, 0.59 * 2.85

    def derivatives(_: float, state: FloatArray) -> list[float]:
        sideways, yaw_rate, heading, _, _ = state
        force_front = 160e3 * (steering - (sideways + front * yaw_rate) / speed)
        force_rear = 160e3 * -(sideways - rear * yaw_rate) / speed
        rear_sideways = sideways - rear * yaw_rate
        return [
            (force_front + force_rear) / 1573 - speed * yaw_rate,
            (front * force_front - rear * force_rear) / 2873,
            yaw_rate,
            speed * math.cos(heading) - rear_sideways * math.sin(heading),
            speed * math.sin(heading) + rear_sideways * math.cos(heading),
        ]

    oracle = solve_ivp(derivatives, (0, 2), [0, 0, 0, 0, 0], rtol=1e-9, t_eval=np.arange(0, 2.001, 0.1)).y
    spec = free_plant(body="single_track", single_track={"friction": 50.0})
    states = held(Command(throttle=0, brake=0, steering=steering), spec, seconds=2, dt=0.1, speed=speed, steering=steering)[1:]
    # Backward Euler at 0.01 s is up to 4 % late in a mode of 0.1 s.
    np.testing.assert_allclose([state.yaw_rate for state in states], oracle[1, 1:], atol=0.04 * oracle[1].max())
    np.testing.assert_allclose([state.y for state in states], oracle[4, 1:], atol=0.02)
    np.testing.assert_allclose([state.x for state in states], oracle[3, 1:], atol=0.02)


def test_single_track_cannot_turn_harder_than_friction_allows() -> None:
    spec = free_plant(body="single_track", single_track={"friction": 0.9})
    states = held(Command(throttle=0, brake=0, steering=0.3), spec, seconds=2, dt=0.01, speed=25.0)[1:]
    yaw_rate = np.array([state.yaw_rate for state in states])
    sideways = np.array([state.lateral_speed for state in states]) + 0.59 * CAR.wheelbase_m * yaw_rate
    lateral = np.diff(sideways) / 0.01 + 25.0 * yaw_rate[1:]  # acceleration of the centre of gravity
    assert np.abs(lateral).max() < 1.02 * 0.9 * 9.81
    assert np.abs(lateral).max() > 0.8 * 0.9 * 9.81


@pytest.mark.parametrize("speed", [0.9, 1.1, 2.0])  # on both sides of the speed below which the wheels roll
def test_single_track_at_walking_pace_is_the_kinematic_bicycle(speed: float) -> None:
    command = Command(throttle=0, brake=0, steering=0.4)
    slow, rolling = (
        held(command, free_plant(body=body, max_steering_rate_radps=0.4), seconds=4, speed=speed)[-1]
        for body in ("single_track", "kinematic")
    )
    assert (slow.x, slow.y) == pytest.approx((rolling.x, rolling.y), abs=0.05)


@pytest.mark.parametrize("lag", [0.1, 0.5])
def test_steering_lag_closes_all_but_one_part_in_e_of_the_way_in_its_time(lag: float) -> None:
    spec = PlantSpec(steering_lag_s=lag)
    state = held(Command(throttle=0, brake=0, steering=0.2), spec, seconds=lag)[-1]
    assert state.steering == pytest.approx(0.2 * (1 - math.exp(-1)))


def test_steering_turns_no_faster_than_its_rate_and_no_further_than_its_stop() -> None:
    states = held(Command(throttle=0, brake=0, steering=2.0), PlantSpec(max_steering_rate_radps=0.4), seconds=3, dt=0.1)
    angles = np.array([state.steering for state in states])
    np.testing.assert_allclose(angles, np.minimum(0.4 * 0.1 * np.arange(31), math.radians(35)), atol=1e-12)


@pytest.mark.parametrize(("delay", "dt"), [(0.0, 0.05), (0.1, 0.05), (0.13, 0.05), (0.25, 0.1), (0.02, 0.05)])
def test_a_command_acts_after_the_delay_and_not_before(delay: float, dt: float) -> None:
    spec = PlantSpec(command_delay_s=delay)
    state, time, turned = EgoState(x=0, y=0, heading=0, speed=10.0), 0.0, None
    for k in range(20):
        steering = 0.1 if k >= 5 else 0.0  # the wheel is wanted elsewhere from 5 dt on
        state = advance_ego(state, Command(throttle=0, brake=0, steering=steering), dt=dt, vehicle=CAR, spec=spec)
        time += dt
        if turned is None and state.steering == 0.1:
            turned = time
    # The first state that shows it is the first after 5 dt + delay.
    assert turned == pytest.approx((math.floor((5 * dt + delay) / dt + 1e-9) + 1) * dt)


def test_steering_and_drive_stay_as_they_are_until_the_first_command_arrives() -> None:
    spec = PlantSpec(command_delay_s=0.2)
    states = held(Command(throttle=0, brake=1, steering=0.3), spec, seconds=0.2, speed=10.0, steering=0.1, acceleration=0.5)
    assert states[-1].steering == 0.1
    assert states[-1].speed == pytest.approx(10.1, abs=1e-4)


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        (Command(throttle=1, brake=0, steering=0), 3.5),
        (Command(throttle=0.5, brake=0, steering=0), 1.75),
        (Command(throttle=0, brake=0.25, steering=0), -2.0),
    ],
)
def test_pedals_give_their_share_of_full_acceleration_and_braking(command: Command, expected: float) -> None:
    states = held(command, free_plant(), seconds=1, speed=10.0)
    assert states[-1].speed - 10 == pytest.approx(expected)
    assert states[-1].x == pytest.approx(10 + expected / 2)


def test_power_train_lag_is_first_order() -> None:
    spec = free_plant(powertrain_lag_s=0.5)
    states = held(Command(throttle=1, brake=0, steering=0), spec, seconds=0.5, speed=10.0)
    assert states[-1].acceleration == pytest.approx(3.5 * (1 - math.exp(-1)))


def test_a_coasting_car_slows_down_by_rolling_and_air() -> None:
    weight, air = 0.01 * 9.80665, 0.5 * 1.225 * 0.66 / 1573
    oracle = solve_ivp(lambda _, v: -weight - air * v**2, (0, 30), [25.0], rtol=1e-9).y[0, -1]
    assert held(COAST, PlantSpec(), seconds=30, speed=25.0)[-1].speed == pytest.approx(oracle, abs=0.1)
    assert drag_mps2(25.0, spec=PlantSpec()) == pytest.approx(weight + air * 625)


def test_a_braking_car_stops_and_does_not_roll_back() -> None:
    states = held(Command(throttle=0, brake=1, steering=0), PlantSpec(), seconds=5, speed=10.0)
    assert states[-1].speed == 0.0
    assert states[-1].acceleration == 0.0
    assert states[-1].x == states[-20].x
    assert min(np.diff([state.x for state in states])) >= 0.0


def test_a_stopped_car_starts_on_a_light_throttle() -> None:
    states = held(Command(throttle=0.05, brake=0, steering=0), PlantSpec(), seconds=5)
    assert states[-1].speed == pytest.approx((0.05 * 3.5 - 0.01 * 9.80665) * (5 - 0.3), abs=0.06)


@given(
    body=st.sampled_from(["kinematic", "single_track"]), speed=st.floats(0, 30), angle=st.floats(-3, 3),
    command=st.builds(Command, throttle=st.floats(0, 1), brake=st.floats(0, 1), steering=st.floats(-0.5, 0.5)),
)  # fmt: skip
def test_the_car_does_not_know_where_north_is_nor_left_from_right(
    body: Literal["kinematic", "single_track"], speed: float, angle: float, command: Command
) -> None:
    spec = PlantSpec(body=body, steering_lag_s=0.2)
    plain = held(command, spec, seconds=1, speed=speed)[-1]
    turned = held(command, spec, seconds=1, speed=speed, x=7.0, y=-9.0, heading=angle)[-1]
    mirrored = held(replace(command, steering=-command.steering), spec, seconds=1, speed=speed)[-1]
    cos, sin = math.cos(angle), math.sin(angle)
    assert (turned.x - 7.0, turned.y + 9.0) == pytest.approx(
        (cos * plain.x - sin * plain.y, sin * plain.x + cos * plain.y), abs=1e-9
    )
    assert turned.heading - angle == pytest.approx(plain.heading, abs=1e-9)
    assert (mirrored.x, mirrored.y, mirrored.heading) == pytest.approx((plain.x, -plain.y, -plain.heading), abs=1e-12)


@given(speed=st.floats(1, 30), steering=st.floats(-0.3, 0.3), delay=st.sampled_from([0.0, 0.1]))
def test_two_short_steps_of_a_command_are_one_long_one(speed: float, steering: float, delay: float) -> None:
    spec = PlantSpec(body="single_track", steering_lag_s=0.2, command_delay_s=delay)
    command = Command(throttle=0.3, brake=0.0, steering=steering)
    once = held(command, spec, seconds=0.4, dt=0.1, speed=speed)[-1]
    twice = held(command, spec, seconds=0.4, dt=0.05, speed=speed)[-1]
    assert (once.x, once.y, once.heading, once.speed) == pytest.approx((twice.x, twice.y, twice.heading, twice.speed), abs=1e-9)


def test_commands_on_their_way_are_few() -> None:
    state = held(COAST, PlantSpec(command_delay_s=0.1), seconds=5, speed=10.0)[-1]
    assert len(state.pending) <= 4


@pytest.mark.parametrize("dt", [0.0, -0.05, math.nan, math.inf])
def test_a_time_step_that_is_none_is_refused(dt: float) -> None:
    with pytest.raises(InputError, match="control step, above 0"):
        advance_ego(EgoState(x=0, y=0, heading=0, speed=1), COAST, dt=dt, vehicle=CAR, spec=PlantSpec())
