import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.frames import (
    advance,
    arc_length,
    heading_from_sumo_angle,
    sumo_angle_from_heading,
    wrap_angle,
)
from wzsumo.vehicle import VehicleGeometry

ANGLES = st.floats(-50, 50)
PLACES = st.floats(-1e4, 1e4)


@pytest.mark.parametrize(("angle_deg", "heading"), [(0, np.pi / 2), (90, 0), (180, -np.pi / 2), (270, np.pi), (45, np.pi / 4)])
def test_sumo_angle_of_a_compass_point_is_its_heading(angle_deg: int, heading: float) -> None:
    assert heading_from_sumo_angle(angle_deg) == pytest.approx(heading)
    assert sumo_angle_from_heading(heading) == pytest.approx(angle_deg)


@given(angle_deg=st.floats(0, 359.999))
def test_sumo_angle_comes_back_from_its_heading(angle_deg: float) -> None:
    back = sumo_angle_from_heading(heading_from_sumo_angle(angle_deg))
    assert 0 <= back < 360
    assert (back - angle_deg + 180) % 360 - 180 == pytest.approx(0, abs=1e-9)


@given(angle=ANGLES)
def test_wrapped_angle_is_in_the_half_open_turn_and_points_the_same_way(angle: float) -> None:
    wrapped = float(wrap_angle(angle))
    assert -np.pi < wrapped <= np.pi
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=1e-9)


@given(x=PLACES, y=PLACES, heading=ANGLES, length=st.floats(2, 20), overhang=st.floats(0, 1))
def test_bumper_centre_and_rear_axle_lead_back_to_one_another(
    x: float, y: float, heading: float, length: float, overhang: float
) -> None:
    axle = np.array([x, y, heading])
    bumper = advance(axle, length - overhang)
    centre = advance(bumper, -length / 2)
    assert advance(centre, -(length / 2 - overhang)) == pytest.approx(axle, abs=1e-6)
    assert np.hypot(*(bumper - centre)[:2]) == pytest.approx(length / 2, abs=1e-6)


def test_advance_north_moves_y_alone() -> None:
    assert advance([1.0, 2.0, np.pi / 2], 3.0) == pytest.approx([1, 5, np.pi / 2])


def test_advance_leaves_its_argument_unchanged() -> None:
    poses = np.array([[1.0, 2.0, 0.5]])
    advance(poses, 3.0)
    assert poses.tolist() == [[1.0, 2.0, 0.5]]


def test_outline_of_a_vehicle_facing_north_has_its_bumper_ahead_of_the_axle() -> None:
    car = VehicleGeometry(length_m=4.64, width_m=1.86, wheelbase_m=2.85, rear_overhang_m=0.92)
    corners = car.outline([10.0, 20.0, np.pi / 2])
    expected = [(10.93, 19.08), (10.93, 23.72), (9.07, 23.72), (9.07, 19.08)]
    assert corners == pytest.approx(np.array(expected))


def test_arc_length_of_a_staircase_counts_its_steps() -> None:
    assert arc_length([[0, 0], [3, 0], [3, 4], [6, 4]]).tolist() == [0, 3, 7, 10]
