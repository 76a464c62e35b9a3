import numpy as np
import pytest

from wzsumo.crowd_mapping.kinks import find_shifts

STATIONS = np.arange(0.0, 900.0, 10.0)
SPEED_MPS = 26.8  # 60 mph: a shifting taper of L/2 is 30 m long for every metre


@pytest.mark.parametrize("size", [-3.0, 2.0])
def test_shift_as_long_as_a_shifting_taper_is_found_on_a_bend(size):
    length = 30 * abs(size)
    course = 1e-4 * (STATIONS - 400) ** 2 + size * np.clip((STATIONS - 400) / length, 0, 1)
    found = min(find_shifts(STATIONS, course, speed_mps=SPEED_MPS), key=lambda shift: abs(shift.start - 400))
    assert (found.start, found.end) == pytest.approx((400, 400 + length), abs=15)
    assert found.size == pytest.approx(size, abs=0.3)


def test_move_far_longer_than_a_shifting_taper_is_the_roads_own():
    course = 2.0 * np.clip((STATIONS - 300) / 240, 0, 1)  # four times 60 m
    assert find_shifts(STATIONS, course, speed_mps=SPEED_MPS) == []
