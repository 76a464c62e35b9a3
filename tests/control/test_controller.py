import math
from typing import Literal

import numpy as np
import pytest
from builders import to_world
from control.drives import CAR, circle_path, curved_road_path, drive, late_plant, straight_path, work_zone_path
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.control.bicycle import SingleTrackSpec
from wzsumo.control.controller import Controller, allow_for_slip
from wzsumo.control.plant import PlantSpec
from wzsumo.control.regulated_pursuit import RegulatedSpec
from wzsumo.ego import EgoState
from wzsumo.errors import InputError, SpecError
from wzsumo.frames import FloatArray, advance
from wzsumo.path import ReferencePath
from wzsumo.scenario.sections import ControlSection

Law = Literal["paper", "regulated"]
SpeedLaw = Literal["paper", "tuned"]
PAPER = ControlSection(lateral="paper", longitudinal="paper")
PATHS = {"work zone": work_zone_path(), "curves of 300 m": curved_road_path()}


def regulated(plant: PlantSpec, *, speed: float) -> ControlSection:
    return allow_for_slip(ControlSection(target_speed_mps=speed), plant=plant)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("dt", [0.02, 0.05, 0.1])
def test_paper_law_in_an_ideal_car_at_10_mps_stays_within_5_cm(path: str, dt: float) -> None:
    run = drive(PATHS[path], PAPER, PlantSpec(), speed=10.0, dt=dt)
    assert np.abs(run["cross_track"]).max() < 0.05
    assert run["station"][-1] >= 899.0


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("body", ["kinematic", "single_track"])
@pytest.mark.parametrize("speed", [10.0, 24.0])
def test_regulated_law_with_steering_lag_and_delay_stays_within_20_cm_and_does_not_oscillate(
    path: str, body: str, speed: float
) -> None:
    plant = late_plant(body=body)
    run = drive(PATHS[path], regulated(plant, speed=speed), plant, speed=speed)
    assert np.abs(run["cross_track"]).max() < 0.2
    # Wheel angles are of the order of a degree: what is left where the path has been of one curvature for 1.5 s.
    steady = (run["station"] > 845) if path == "work zone" else (run["station"] > 250) & (run["station"] < 380)
    assert np.rad2deg(run["steering"][steady].std()) < 0.02


@pytest.mark.parametrize("body", ["kinematic", "single_track"])
@pytest.mark.parametrize("speed", [10.0, 24.0])
def test_regulated_law_comes_back_from_beside_the_path_and_settles(body: str, speed: float) -> None:
    plant = late_plant(body=body)
    run = drive(straight_path(40 * speed), regulated(plant, speed=speed), plant, speed=speed, offset=0.5, time_limit=20)
    assert run["cross_track"].min() > -0.15  # overshoot
    settled = run["time"] > 6
    assert np.abs(run["cross_track"][settled]).max() < 0.02
    assert np.rad2deg(run["steering"][settled].std()) < 0.02


def test_regulated_law_stands_twice_the_delay_of_the_bar() -> None:
    plant = late_plant(body="single_track", command_delay_s=0.2)
    run = drive(PATHS["work zone"], regulated(plant, speed=24.0), plant, speed=24.0)
    assert np.abs(run["cross_track"]).max() < 0.3
    assert np.rad2deg(run["steering"][run["station"] > 845].std()) < 0.1


def test_paper_law_oscillates_where_steering_lags_and_commands_are_late() -> None:
    run = drive(PATHS["work zone"], PAPER, late_plant(), speed=10.0, time_limit=60)
    assert np.abs(run["cross_track"]).max() > 1.0


def test_paper_law_swings_out_from_beside_the_path_where_the_steering_turns_as_slowly_as_a_cars_does() -> None:
    path = ReferencePath(poses=np.column_stack([np.arange(0, 300, 0.5), np.zeros((600, 2))]))
    swings = {
        rate: np.abs(drive(path, PAPER, PlantSpec(max_steering_rate_radps=rate), speed=10.0, offset=0.2)["cross_track"]).max()
        for rate in (None, 0.4)
    }
    assert swings[None] == pytest.approx(0.2)
    assert swings[0.4] > 3.0
    assert np.abs(drive(path, ControlSection(), late_plant(), speed=10.0, offset=0.2)["cross_track"]).max() < 0.21


@pytest.mark.parametrize("radius", [60.0, -150.0])
def test_steering_on_a_long_circle_settles_at_the_ackermann_angle(radius: float) -> None:
    run = drive(circle_path(radius, turns=1.5), ControlSection(), late_plant(), speed=10.0)
    round_twice = run["station"] > 2 * np.pi * abs(radius)
    ahead_of_the_end = run["station"] < run["station"][-1] - 20
    steady = run["steering"][round_twice & ahead_of_the_end]
    np.testing.assert_allclose(steady, math.atan(CAR.wheelbase_m / radius), rtol=2e-3)


def test_paper_length_in_place_of_the_wheelbase_runs_on_the_inside_of_a_circle() -> None:
    # Steady: atan(L_paper 2 sin(alpha) / l_d) = atan(L / R), so the pursued arc is wider than the road's by 1.63.
    run = drive(circle_path(60.0, turns=1.5), PAPER, PlantSpec(), speed=10.0)
    lookahead, curvature = 3.25, 1 / 60.0  # the first pose at 3 m or more is 3.0 to 3.5 m away
    expected = curvature * lookahead**2 / 2 * (1 - CAR.wheelbase_m / 4.6391)
    assert np.median(run["cross_track"]) == pytest.approx(expected, rel=0.2)


def test_speed_in_a_tight_bend_keeps_lateral_acceleration_at_its_limit() -> None:
    step = 0.5
    s = np.arange(0, 400 + step, step)
    curvature = np.interp(s, [150, 190, 260, 300], [0, 1 / 50, 1 / 50, 0])
    heading = np.concatenate([[0], np.cumsum((curvature[1:] + curvature[:-1]) / 2 * step)])
    mean = (heading[1:] + heading[:-1]) / 2
    xy = np.vstack([[0, 0], step * np.cumsum(np.column_stack([np.cos(mean), np.sin(mean)]), axis=0)])
    path = ReferencePath(poses=np.column_stack([xy, heading]))
    run = drive(path, ControlSection(target_speed_mps=20.0), late_plant(), speed=20.0)
    lateral = run["speed"] ** 2 * np.tan(np.abs(run["steering"])) / CAR.wheelbase_m
    assert lateral.max() < 2.0 * 1.02
    assert run["speed"].min() == pytest.approx(10.0, abs=0.6)  # the preview brings it there early
    assert run["speed"][-1] > 15.0
    assert np.abs(run["cross_track"]).max() < 0.2


@pytest.mark.parametrize("speed", [10.0, 24.0])
def test_stop_at_goal_ends_at_the_last_pose_in_standstill(speed: float) -> None:
    control = ControlSection(target_speed_mps=speed, regulated=RegulatedSpec(stop_at_goal=True))
    run = drive(straight_path(500.0), control, late_plant(), speed=speed, time_limit=90)
    assert run["speed"][-1] < 0.5
    assert run["station"][-1] == pytest.approx(500.0, abs=0.3)
    assert run["acceleration"].min() > -2.5


@given(
    lateral=st.sampled_from(["paper", "regulated"]), longitudinal=st.sampled_from(["paper", "tuned"]),
    state=st.builds(
        EgoState, x=st.floats(-20, 950), y=st.floats(-30, 30), heading=st.floats(-3.1, 3.1),
        speed=st.floats(0, 40), steering=st.floats(-0.6, 0.6),
    ),
    ceiling=st.just(math.inf) | st.just(-math.inf) | st.floats(-20, 20),
)  # fmt: skip
def test_a_command_is_within_the_cars_limits_wherever_the_car_is(
    lateral: Law, longitudinal: SpeedLaw, state: EgoState, ceiling: float
) -> None:
    controller = Controller(PATHS["work zone"], CAR, ControlSection(lateral=lateral, longitudinal=longitudinal))
    command = controller.command(state, dt=0.05, ceiling=ceiling)
    assert 0 <= command.throttle <= 1
    assert 0 <= command.brake <= 1
    assert command.throttle == 0 or command.brake == 0
    assert abs(command.steering) <= math.radians(CAR.max_steering_deg) + 1e-12


@given(
    lateral=st.sampled_from(["paper", "regulated"]), angle=st.floats(-3, 3),
    beside=st.floats(-2, 2), turned=st.floats(-0.3, 0.3),
)  # fmt: skip
def test_a_command_does_not_depend_on_where_north_is(lateral: Law, angle: float, beside: float, turned: float) -> None:
    there = (300.0, -80.0, angle)

    def moved(poses: FloatArray) -> FloatArray:
        xy = to_world(there, np.atleast_2d(poses)[:, :2])
        return np.column_stack([xy, np.atleast_2d(poses)[:, 2] + angle])

    here = np.array([100.0, beside, turned])
    path = curved_road_path()
    commands = []
    for poses, pose in ((path.poses, here), (moved(path.poses), moved(here)[0])):
        controller = Controller(ReferencePath(poses=poses), CAR, ControlSection(lateral=lateral))
        state = EgoState(x=pose[0], y=pose[1], heading=pose[2], speed=12.0)
        commands.append(controller.command(state, dt=0.05))
    assert commands[0].steering == pytest.approx(commands[1].steering, abs=1e-6)
    assert commands[0].throttle == pytest.approx(commands[1].throttle, abs=1e-9)


def test_a_new_path_is_followed_from_where_the_car_is_with_the_memory_of_the_pid() -> None:
    controller = Controller(straight_path(500.0), CAR, ControlSection())
    state = EgoState(x=100.0, y=0.0, heading=0.0, speed=9.0)
    for _ in range(50):
        before = controller.command(state, dt=0.05)
    left = advance(straight_path(500.0).poses + np.array([0.0, 1.0, 0.0]), 50.0)
    controller.follow(ReferencePath(poses=left))
    assert not controller.reached_end
    after = controller.command(state, dt=0.05)
    assert after.throttle == pytest.approx(before.throttle, abs=0.01)
    assert after.steering > 0
    assert (controller.station_m, controller.cross_track_m) == pytest.approx((50.0, -1.0))


def test_the_end_is_reached_at_the_last_pose_and_past_it() -> None:
    controller = Controller(straight_path(50.0), CAR, ControlSection())
    reached = []
    for x in (0.0, 49.0, 49.95, 60.0):
        controller.command(EgoState(x=x, y=0.3, heading=0.0, speed=5.0), dt=0.05)
        reached.append(controller.reached_end)
    assert reached == [False, False, True, True]


@pytest.mark.parametrize("dt", [0.0, -1.0, math.nan])
def test_a_control_step_of_no_time_is_refused(dt: float) -> None:
    controller = Controller(straight_path(50.0), CAR, ControlSection())
    with pytest.raises(InputError, match="from one command to the next, above 0"):
        controller.command(EgoState(x=0, y=0, heading=0, speed=5.0), dt=dt)


def test_allowing_for_slip_takes_it_from_the_plant_and_keeps_the_rest() -> None:
    spec = ControlSection(target_speed_mps=20.0, regulated=RegulatedSpec(lookahead_time_s=0.9))
    aware = allow_for_slip(spec, plant=PlantSpec(body="single_track"))
    # Rajamani's sedan: rear slip m l_f / (L C_r), understeer m (l_r - l_f) / (L C).
    assert aware.regulated.rear_slip_rad_per_mps2 == pytest.approx(1573 * 0.41 / 160e3)
    assert aware.regulated.understeer_rad_per_mps2 == pytest.approx(1573 * 0.18 / 160e3)
    assert allow_for_slip(aware, plant=PlantSpec()) == spec


def test_a_plant_that_oversteers_is_refused() -> None:
    with pytest.raises(SpecError, match="slip of the plant: understeer_rad_per_mps2"):
        allow_for_slip(ControlSection(), plant=PlantSpec(body="single_track", single_track=SingleTrackSpec(front_share=0.6)))
