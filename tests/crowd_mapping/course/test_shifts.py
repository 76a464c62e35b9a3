import numpy as np
import pytest

from wzsumo.crowd_mapping.course.shifts import find_shifts

STATIONS = np.arange(0.0, 900.0, 10.0)
SPEED_MPS = 26.8  # 60 mph: a shifting taper of L/2 is 30 m long for every metre


@pytest.mark.parametrize("size", [-3.0, 2.0])
def test_shift_as_long_as_a_shifting_taper_is_found_on_a_bend(size: float) -> None:
    length = 30 * abs(size)
    course = 1e-4 * (STATIONS - 400) ** 2 + size * np.clip((STATIONS - 400) / length, 0, 1)
    found = min(find_shifts(STATIONS, course, speed_mps=SPEED_MPS), key=lambda shift: abs(shift.start - 400))
    assert (found.start, found.end) == pytest.approx((400, 400 + length), abs=15)
    assert found.size == pytest.approx(size, abs=0.3)


def test_move_far_longer_than_a_shifting_taper_is_the_roads_own() -> None:
    course = 2.0 * np.clip((STATIONS - 300) / 240, 0, 1)  # four times 60 m
    assert find_shifts(STATIONS, course, speed_mps=SPEED_MPS) == []


def test_line_that_winds_all_along_has_no_shifts_of_a_work_zone() -> None:
    # What a line with knots every 300 m leaves of turns of 400 m radius, 450 m apart: 2 m to either side.
    stations = np.arange(0.0, 1500.0, 10.0)
    assert find_shifts(stations, 2.2 * np.sin(2 * np.pi * stations / 360.0), speed_mps=24.0) == []
