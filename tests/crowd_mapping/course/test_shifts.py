import numpy as np
import pytest

from wzsumo.crowd_mapping.course.shifts import Shift, find_shifts
from wzsumo.frames import FloatArray

STATIONS = np.arange(0.0, 900.0, 10.0)
SPEED_MPS = 26.8224  # 60 mph: a shifting taper of L/2 is 30 m long for every metre


def ramp(start: float, length: float, size: float, *, stations: FloatArray = STATIONS) -> FloatArray:
    return size * np.clip((stations - start) / length, 0, 1)


def near(shifts: list[Shift], start: float) -> list[Shift]:
    return [shift for shift in shifts if abs(shift.start - start) < 30]


@pytest.mark.parametrize("size", [-3.0, 2.0])
def test_shift_as_long_as_a_shifting_taper_is_found_on_a_bend(size: float) -> None:
    length = 30 * abs(size)
    course = 1e-4 * (STATIONS - 400) ** 2 + ramp(400, length, size)
    found = min(find_shifts(STATIONS, course, speed_mps=SPEED_MPS), key=lambda shift: abs(shift.start - 400))
    assert (found.start, found.end) == pytest.approx((400, 400 + length), abs=15)
    assert found.size == pytest.approx(size, abs=0.3)


@pytest.mark.parametrize("length", [20.0, 240.0])
def test_move_far_from_the_length_of_a_shifting_taper_is_the_roads_own(length: float) -> None:
    # A third of the manual's 60 m for 2 m, and four times as much.
    assert find_shifts(STATIONS, ramp(300, length, 2.0), speed_mps=45.0 if length < 60 else SPEED_MPS) == []


@pytest.mark.parametrize(("length", "is_found"), [(100.0, True), (160.0, False)])
def test_shift_may_be_1_7_times_as_long_as_the_manual_says(length: float, is_found: bool) -> None:
    # 60 m for 2 m at 60 mph: up to 102 m.
    assert bool(near(find_shifts(STATIONS, ramp(400, length, 2.0), speed_mps=SPEED_MPS), 400)) == is_found


@pytest.mark.parametrize(("size", "is_found"), [(0.55, False), (0.65, True)])
def test_shift_of_less_than_0_6_m_is_none(size: float, is_found: bool) -> None:
    # 45 m are as long as the manual says for a metre at 40 m/s: 40 m are within its factor for both sizes.
    assert bool(near(find_shifts(STATIONS, ramp(400, 40.0, size), speed_mps=40.0), 400)) == is_found


@pytest.mark.parametrize(("size", "is_found"), [(4.8, True), (5.2, False)])
def test_shift_of_more_than_5_m_is_none(size: float, is_found: bool) -> None:
    # 30 m for every metre: 140 m and 160 m. Beside a ramp that is too large others of less than 5 m may seem to be.
    sizes = [shift.size for shift in find_shifts(STATIONS, ramp(400, round(1.5 * size) * 20.0, size), speed_mps=SPEED_MPS)]
    assert any(found == pytest.approx(size, abs=0.1) for found in sizes) == is_found
    assert max(sizes) < 5


@pytest.mark.parametrize(("start", "is_found"), [(10.0, False), (20.0, True), (810.0, True), (820.0, False)])
def test_shift_begins_and_ends_20_m_from_the_ends_of_the_course(start: float, is_found: bool) -> None:
    # Stations 0 to 890 m, a ramp of 60 m.
    found = find_shifts(STATIONS, ramp(start, 60.0, 2.0), speed_mps=SPEED_MPS)
    assert any((shift.start, shift.end) == (start, start + 60.0) for shift in found) == is_found


@pytest.mark.parametrize(("waves_m", "is_found"), [(0.15, True), (0.6, False)])
def test_shift_explains_most_of_what_the_road_leaves(waves_m: float, is_found: bool) -> None:
    course = ramp(400, 60.0, 2.0) + waves_m * np.sin(2 * np.pi * STATIONS / 70)
    assert bool(near(find_shifts(STATIONS, course, speed_mps=SPEED_MPS), 400)) == is_found


def steps(n: int, *, spacing: float = 400.0) -> tuple[FloatArray, FloatArray]:
    """(stations, course) with n shifts of 2 m to the left and to the right in turn."""
    stations = np.arange(0.0, spacing * (n + 1), 10.0)
    sizes = [2.0 * (-1) ** i for i in range(n)]
    return stations, sum(
        (ramp(spacing * (i + 0.5), 60.0, size, stations=stations) for i, size in enumerate(sizes)), np.zeros(len(stations))
    )


def test_course_with_more_than_four_ramps_is_a_winding_road() -> None:
    # Ahead of the first ramp of such a course another one seems to be.
    found = find_shifts(*steps(3), speed_mps=SPEED_MPS)
    assert len(found) == 4
    assert [shift.start for shift in found[1:]] == pytest.approx([200, 600, 1000], abs=10)
    assert [shift.size for shift in found[1:]] == pytest.approx([2.0, -2.0, 2.0], abs=0.2)
    assert find_shifts(*steps(4), speed_mps=SPEED_MPS) == []


def test_line_that_winds_all_along_has_no_shifts_of_a_work_zone() -> None:
    # What a line with knots every 300 m leaves of turns of 400 m radius, 450 m apart: 2 m to either side.
    stations = np.arange(0.0, 1500.0, 10.0)
    assert find_shifts(stations, 2.2 * np.sin(2 * np.pi * stations / 360.0), speed_mps=24.0) == []
