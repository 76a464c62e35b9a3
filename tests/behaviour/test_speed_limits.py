import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.behaviour.speed_limits import SpeedLimit, limit_ceiling
from wzsumo.behaviour.speed_plan_spec import SpeedPlanSpec

SPEC = SpeedPlanSpec()  # brakes comfortably with 2 m/s2
SLOW = SpeedLimit(start=100.0, end=200.0, speed=10.0)
END = SpeedLimit(start=100.0, end=np.inf, speed=0.0)


def ceiling(*limits: SpeedLimit, station: float, speed: float) -> float:
    return limit_ceiling(limits, station=station, speed=speed, spec=SPEC)


@pytest.mark.parametrize(
    ("station", "speed", "expected"),
    [
        (80.0, 20.0, -2.0),  # too late to brake softly: comfortably is hard enough for a doubt
        (0.0, 20.0, -(400 - 100) / 200),  # v^2 - u^2 = 2 a d
        (0.0, 15.0, np.inf),  # needs 0.6 m/s2, less than 0.7 of 2 m/s2
        (0.0, 9.0, np.inf),
        (150.0, 9.0, 1.0), (150.0, 10.5, -0.5), (150.0, 30.0, -2.0), (200.0, 30.0, np.inf),
    ],
)  # fmt: skip
def test_slow_stretch_is_entered_by_constant_braking_and_passed_no_faster(
    station: float, speed: float, expected: float
) -> None:
    assert ceiling(SLOW, station=station, speed=speed) == pytest.approx(expected)


def test_end_of_the_way_is_braked_for_as_hard_as_it_takes_and_held() -> None:
    assert ceiling(END, station=90.0, speed=20.0) == pytest.approx(-20.0)
    assert ceiling(END, station=0.0, speed=10.0) == np.inf
    assert ceiling(END, station=100.0, speed=0.0) < 0
    assert ceiling(END, station=120.0, speed=5.0) < -9.0


def test_strictest_of_several_limits_holds() -> None:
    assert ceiling(SLOW, END, station=50.0, speed=20.0) == min(
        ceiling(SLOW, station=50.0, speed=20.0), ceiling(END, station=50.0, speed=20.0)
    )
    assert ceiling(station=0.0, speed=30.0) == np.inf


@given(speed=st.floats(5.0, 35.0), ahead=st.floats(5.0, 800.0), slow=st.sampled_from([0.0, 5.0, 10.0]))
def test_vehicle_that_obeys_never_passes_the_start_faster_than_the_limit(speed: float, ahead: float, slow: float) -> None:
    limit, station, dt = SpeedLimit(start=ahead, end=ahead + 50.0, speed=slow), 0.0, 0.05
    hardest = 0.0
    while station < ahead and speed > 0.01:
        acceleration = min(ceiling(limit, station=station, speed=speed), 0.0)
        hardest = min(hardest, acceleration)
        station += speed * dt
        speed = max(speed + acceleration * dt, 0.0)
    assert station <= ahead + 35.0 * dt  # a step beyond
    # Steps of 50 ms bound it, or it was told too late to brake softly.
    assert speed <= slow + 1.0 or hardest < (-4.0 if slow == 0 else -1.99)
    assert slow == 0 or hardest >= -2.0
