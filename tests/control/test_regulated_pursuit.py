import math

import pytest
from control.drives import CAR, circle_path
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.control.path_frame import PathFrame
from wzsumo.control.regulated_pursuit import RegulatedSpec, lookahead_m, predicted_state, regulated_steering
from wzsumo.ego import EgoState


def steering_on_circle(radius: float, *, speed: float, slip_heading: float = 0.0, **spec: float) -> tuple[float, float]:
    """Steering that is found for a car on the circle, at an angle of 1 rad, and the steering that keeps it there."""
    rules = RegulatedSpec.model_validate(spec)
    held = math.atan(CAR.wheelbase_m / radius) + rules.understeer_rad_per_mps2 * speed**2 / radius
    angle = math.copysign(1.0, radius)
    state = EgoState(
        x=radius * math.sin(angle), y=radius * (1 - math.cos(angle)), heading=angle + slip_heading, speed=speed, steering=held
    )
    frame = PathFrame.of(circle_path(radius, step=0.1))
    position = frame.locate(state.x, state.y, near=None)
    found = regulated_steering(frame, position, state=state, wheelbase_m=CAR.wheelbase_m, spec=rules)
    return found, held


@pytest.mark.parametrize("radius", [30.0, -100.0, 300.0])
def test_a_car_on_a_circle_keeps_the_ackermann_angle_of_its_wheelbase(radius: float) -> None:
    found, _ = steering_on_circle(radius, speed=8.0)
    assert found == pytest.approx(math.atan(CAR.wheelbase_m / radius), rel=2e-3)


def test_a_car_that_slips_on_a_circle_keeps_the_steering_and_the_heading_of_its_slip() -> None:
    speed, radius, rear_slip = 24.0, 300.0, 0.004
    lateral = speed**2 / radius
    found, held = steering_on_circle(
        radius, speed=speed, slip_heading=rear_slip * lateral,
        understeer_rad_per_mps2=0.002, rear_slip_rad_per_mps2=rear_slip,
    )  # fmt: skip
    assert held == pytest.approx(math.atan(2.85 / 300) + 0.002 * 1.92)
    assert found == pytest.approx(held, rel=0.02)


@given(speed=st.floats(0, 60))
def test_lookahead_grows_with_speed_between_its_limits(speed: float) -> None:
    assert lookahead_m(speed, spec=RegulatedSpec(lookahead_time_s=0.8)) == pytest.approx(min(max(0.8 * speed, 3.0), 30.0))


@given(steering=st.floats(-0.5, 0.5), speed=st.floats(0.1, 30), prediction=st.floats(0, 0.5))
def test_predicted_state_lies_on_the_circle_that_the_car_drives(steering: float, speed: float, prediction: float) -> None:
    state = EgoState(x=2.0, y=1.0, heading=0.3, speed=speed, steering=steering)
    ahead = predicted_state(state, wheelbase_m=2.85, spec=RegulatedSpec(prediction_s=prediction))
    turn = speed * prediction * math.tan(steering) / 2.85
    assert ahead.heading == pytest.approx(0.3 + turn)
    # Chord along the mean heading; its length is the arc's, which is longer by turn^2 / 24.
    assert math.hypot(ahead.x - 2, ahead.y - 1) == pytest.approx(speed * prediction)
    if speed * prediction > 1e-6:
        assert math.atan2(ahead.y - 1, ahead.x - 2) == pytest.approx(math.remainder(0.3 + turn / 2, 2 * math.pi))
