import numpy as np
import pytest

from wzsumo.planning.planner_spec import PlannerSpec
from wzsumo.vehicle import VehicleGeometry

CAR = VehicleGeometry()


@pytest.mark.parametrize(
    ("speed_mps", "curvature_1pm"),
    [
        (10.0, 0.02),  # 2 m/s2 / (10 m/s)^2
        (20.0, 0.005),
        (0.0, np.tan(np.deg2rad(35)) / 2.85),  # steering of 35 degrees, wheelbase of 2.85 m
        (2.0, np.tan(np.deg2rad(35)) / 2.85),  # 2 / 2^2 would be 0.5
    ],
)
def test_curvature_is_limited_by_lateral_acceleration_and_at_low_speeds_by_the_steering(
    speed_mps: float, curvature_1pm: float
) -> None:
    assert PlannerSpec().max_curvature(CAR, speed_mps=speed_mps) == pytest.approx(curvature_1pm)


def test_dearest_metre_has_no_clearance_is_as_likely_occupied_as_may_be_and_far_off_the_guide() -> None:
    assert PlannerSpec().max_metre_cost == pytest.approx(1 + 8 + 10 * 0.196 + 12)
