import pytest

from wzsumo.simulation.turns import clearance_s


@pytest.mark.parametrize(("length_m", "speed_mps"), [(20.0, 10.0), (430.0, 10.0), (300.0, 20.0)])
def test_red_clears_the_lane_of_the_vehicle_that_starts_last(length_m: float, speed_mps: float) -> None:
    # A slow twin: drive it in steps of a millisecond with 1 m/s2 up to the speed.
    t, s, v = 0.0, 0.0, 0.0
    while s < length_m:
        v, t = min(v + 0.001, speed_mps), t + 0.001
        s += v * 0.001
    assert clearance_s(length_m, speed=speed_mps) == pytest.approx(t, abs=0.02)
