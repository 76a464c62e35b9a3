import math

import numpy as np
import pytest
from control.drives import CAR, straight_path

from wzsumo.behaviour.car_following import IdmSpec
from wzsumo.behaviour.ceiling import AccelerationCeiling, FollowingSpec, limit_jerk
from wzsumo.behaviour.hindrance import Hindrance
from wzsumo.control.controller import Controller
from wzsumo.control.plant import PlantSpec, advance_ego
from wzsumo.ego import EgoState, Leader
from wzsumo.frames import FloatArray
from wzsumo.scenario.sections import ControlSection

SPEC = IdmSpec()  # a = 1.4 m/s2, b = 2 m/s2, jerk 4 m/s3
NEAR = Leader(gap_m=16.0, speed_mps=20.0)  # at 20 m/s the IDM asks for -4.2 m/s2


def stop_before(place_m: float, *, speed: float, seen_at_m: float = 0.0) -> FloatArray:
    """Rows of a drive towards a place that comes into view `place_m` ahead of the bumper once the ego has gone `seen_at_m`.

    They are what is left to it, speed and acceleration, over 40 s.
    """
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
    assert 0 < left[-1] < 1.5
    assert accelerations.min() > -1.2 * 2.0
    over_half_a_second = (accelerations[10:] - accelerations[:-10])[speeds[10:] > 1.0] / 0.5  # the last jolt of a stop left out
    assert np.abs(over_half_a_second).max() < 2.5  # m/s3; ISO 15622, of adaptive cruise control above 20 m/s


def test_ego_that_sees_a_place_late_brakes_no_harder_than_it_takes_to_stop_before_it() -> None:
    left, speeds, accelerations = stop_before(12.0, speed=10.0, seen_at_m=50.0)
    assert speeds[-1] < 0.05
    assert left[-1] > 0
    needed = 10.0**2 / (2 * (12.0 - 1.0))
    assert -accelerations.min() < 1.6 * needed  # the power train answers 0.3 s late, which asks for more afterwards


def test_ceiling_that_drops_within_comfort_is_reached_by_a_steady_jerk() -> None:
    ceilings = [1.4]
    for _ in range(20):
        ceilings.append(limit_jerk(-2.0, speed=15.0, last=ceilings[-1], dt=0.05, spec=SPEC))
    assert np.diff(ceilings).min() == pytest.approx(-4.0 * 0.05)
    assert np.isclose(ceilings, -2.0).argmax() == 17  # 3.4 m/s2 at 4 m/s3: 0.85 s


@pytest.mark.parametrize(("wanted", "ceiling"), [(-6.0, -6.0), (-3.6, -3.6), (-3.4, 1.2), (-math.inf, -math.inf)])
def test_braking_beyond_3_5_mps2_is_an_emergency_and_holds_at_once(wanted: float, ceiling: float) -> None:
    assert limit_jerk(wanted, speed=15.0, last=1.4, dt=0.05, spec=SPEC) == pytest.approx(ceiling)


@pytest.mark.parametrize(("speed", "ceiling"), [(1.9, -2.0), (2.1, 1.2)])
def test_braking_below_2_mps_holds_at_once(speed: float, ceiling: float) -> None:
    assert limit_jerk(-2.0, speed=speed, last=1.4, dt=0.05, spec=SPEC) == pytest.approx(ceiling)


@pytest.mark.parametrize(
    ("wanted", "last", "speed", "ceiling"),
    [
        (1.0, -2.0, 15.0, -1.8),  # it rises with the same jerk
        (1.0, -2.0, 1.0, -1.8),  # at creeping speed too
        (1.0, -9.0, 15.0, -3.3),  # after an emergency from -3.5 m/s2 on
        (math.inf, -2.0, 15.0, -1.8),
        (math.inf, 1.3, 15.0, math.inf),  # free again once a is within reach
        (1.3, 1.25, 15.0, 1.3),
        (-1.0, math.inf, 15.0, 1.2),  # a hindrance that comes into view: from a on
        (math.inf, math.inf, 15.0, math.inf),
    ],
)
def test_ceiling_moves_from_the_last_one_with_the_comfortable_jerk(
    wanted: float, last: float, speed: float, ceiling: float
) -> None:
    assert limit_jerk(wanted, speed=speed, last=last, dt=0.05, spec=SPEC) == pytest.approx(ceiling)


@pytest.mark.parametrize(
    ("hindrance", "wanted"),
    [
        (Hindrance(), math.inf),
        (Hindrance(stop_in_m=51.0), 0.55),
        (Hindrance(leader=Leader(gap_m=8.5, speed_mps=10.0)), 1.4 * (1 - 4)),
        (Hindrance(leader=Leader(gap_m=8.5, speed_mps=10.0), stop_in_m=51.0), 1.4 * (1 - 4)),
        (Hindrance(leader=Leader(gap_m=34.0, speed_mps=10.0), stop_in_m=51.0), 0.55),
    ],
)
def test_ceiling_is_the_lower_one_of_leader_and_place_to_stop(hindrance: Hindrance, wanted: float) -> None:
    # At 10 m/s: s* = 17 m; 50 m to stop in take 1 m/s2, of which is left 1.4 - 3.4 / 4 = 0.55 m/s2.
    ceiling = AccelerationCeiling(FollowingSpec(car_following="idm"))
    for _ in range(60):
        found = ceiling.next(hindrance, speed=10.0, dt=0.05)
    assert found == pytest.approx(wanted)


def test_ceiling_of_the_cruise_control_is_calmer_than_that_of_the_idm_it_is_built_on() -> None:
    found = {
        spec.car_following: AccelerationCeiling(spec).next(Hindrance(leader=NEAR), speed=20.0, dt=10.0)
        for spec in (FollowingSpec(car_following="idm"), FollowingSpec())
    }
    assert found["idm"] == pytest.approx(1.4 * (1 - (32 / 16) ** 2))
    assert found["acc"] == pytest.approx(0.01 * -4.2 + 0.99 * 2 * math.tanh(-4.2 / 2))


def test_ego_without_car_following_has_no_ceiling() -> None:
    ceiling = AccelerationCeiling(FollowingSpec(car_following="none"))
    assert ceiling.next(Hindrance(leader=NEAR, stop_in_m=1.0), speed=20.0, dt=0.05) == math.inf
