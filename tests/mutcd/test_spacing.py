import pytest
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.mutcd.spacing import DEVICE_SIZE_M, device_gaps, tangent_spacing_ft, taper_spacing_ft
from wzsumo.work_zone import DeviceKind


@pytest.mark.parametrize(("length_ft", "gaps"), [(720, 12), (721, 13), (719, 12), (60, 1), (61, 2), (10, 1)])
def test_stretch_has_the_fewest_equal_gaps_of_at_most_60_ft(length_ft: float, gaps: int) -> None:
    assert device_gaps(length_ft, spacing_ft=60) == gaps


def test_rounding_of_a_length_adds_no_gap() -> None:
    assert device_gaps(720 * (1 + 1e-12), spacing_ft=60) == 12
    assert device_gaps(720 * (1 + 1e-6), spacing_ft=60) == 13


def test_devices_stand_the_speed_in_feet_apart_in_tapers_and_twice_that_in_tangents() -> None:
    assert (taper_spacing_ft(60), tangent_spacing_ft(60)) == (60, 120)
    assert (taper_spacing_ft(45), tangent_spacing_ft(45)) == (45, 90)


@given(length_ft=st.floats(1, 5000), spacing_ft=st.floats(5, 200))
def test_device_gaps_are_the_fewest_that_keep_any_spacing(length_ft: float, spacing_ft: float) -> None:
    gaps = device_gaps(length_ft, spacing_ft=spacing_ft)
    assert length_ft / gaps <= spacing_ft * (1 + 1e-6)
    assert gaps == 1 or length_ft / (gaps - 1) > spacing_ft * (1 - 1e-6)


@pytest.mark.parametrize(
    ("kind", "height_m", "width_m"),
    [
        # MUTCD 11th ed., 6K.03: cones of 28 and 36 in, on bases of 14 in; 6K.07: drums 36 in high and 18 in wide; an F-shape
        # barrier is 32 in high and 24 in wide (AASHTO Roadside Design Guide, ch. 9).
        (DeviceKind.CONE_28_IN, 0.711, 0.356), (DeviceKind.CONE_36_IN, 0.914, 0.356), (DeviceKind.DRUM, 0.914, 0.457),
        (DeviceKind.BARRIER, 0.813, 0.610),
    ],
)  # fmt: skip
def test_devices_have_the_sizes_of_the_manual(kind: DeviceKind, height_m: float, width_m: float) -> None:
    height, radius = DEVICE_SIZE_M[kind]
    assert (height, 2 * radius) == pytest.approx((height_m, width_m), abs=5e-4)
