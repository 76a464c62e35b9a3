import math

import pytest

from wzsumo.control.pure_pursuit import pursuit_steering
from wzsumo.ego import EgoState


@pytest.mark.parametrize(("radius", "length_m"), [(20.0, 2.85), (-50.0, 2.85), (300.0, 4.6391)])
@pytest.mark.parametrize("angle_deg", [2.0, 10.0, 40.0])
def test_steering_to_a_point_on_a_circle_through_the_rear_axle_is_that_circles_ackermann_angle(
    radius: float, length_m: float, angle_deg: float
) -> None:
    angle = math.radians(angle_deg)
    state = EgoState(x=5.0, y=-3.0, heading=0.7, speed=10.0)
    ahead, left = abs(radius) * math.sin(angle), radius * (1 - math.cos(angle))
    target = (
        state.x + ahead * math.cos(state.heading) - left * math.sin(state.heading),
        state.y + ahead * math.sin(state.heading) + left * math.cos(state.heading),
    )
    assert pursuit_steering(state, target, length_m=length_m) == pytest.approx(math.atan(length_m / radius), rel=1e-9)
