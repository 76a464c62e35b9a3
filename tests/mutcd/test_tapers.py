import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.errors import SpecError
from wzsumo.mutcd.spacing import device_gaps, tangent_spacing_ft, taper_spacing_ft
from wzsumo.mutcd.tapers import (
    buffer_length_ft,
    merging_taper_length_ft,
    shifting_taper_length_ft,
    shoulder_taper_length_ft,
)

# Merging, shifting and shoulder taper for an offset of 12 ft: MUTCD, taper length table, in whole feet rounded up.
PRINTED_TAPERS_FT = [
    (20, 80, 40, 27), (25, 125, 63, 42), (30, 180, 90, 60), (35, 245, 123, 82), (40, 320, 160, 107), (45, 540, 270, 180),
    (50, 600, 300, 200), (55, 660, 330, 220), (60, 720, 360, 240), (65, 780, 390, 260), (70, 840, 420, 280),
    (75, 900, 450, 300),
]  # fmt: skip
PRINTED_SIGHT_DISTANCES_FT = [
    (20, 115), (25, 155), (30, 200), (35, 250), (40, 305), (45, 360), (50, 425), (55, 495), (60, 570), (65, 645), (70, 730),
    (75, 820),
]  # fmt: skip


@pytest.mark.parametrize(("speed_mph", "merging", "shifting", "shoulder"), PRINTED_TAPERS_FT)
def test_tapers_for_12_ft_offset_match_printed_table(speed_mph, merging, shifting, shoulder):
    lengths = [
        f(speed_mph, offset_ft=12) for f in (merging_taper_length_ft, shifting_taper_length_ft, shoulder_taper_length_ft)
    ]
    assert [math.ceil(length - 1e-9) for length in lengths] == [merging, shifting, shoulder]


@pytest.mark.parametrize(("speed_mph", "length_ft"), PRINTED_SIGHT_DISTANCES_FT)
def test_buffer_matches_printed_stopping_sight_distance(speed_mph, length_ft):
    assert buffer_length_ft(speed_mph) == length_ft


def test_buffer_between_two_printed_speeds_is_that_of_the_higher():
    assert buffer_length_ft(52) == 495


def test_merging_taper_jumps_between_40_and_45_mph():
    # L = W S^2 / 60 is 405 ft at 45 mph, L = W S is 540 ft: the two formulas do not meet.
    assert merging_taper_length_ft(45, offset_ft=12) - merging_taper_length_ft(40, offset_ft=12) == 220


@pytest.mark.parametrize("speed_mph", [40.5, 42, 44.9])
def test_taper_between_40_and_45_mph_is_refused_with_the_speed(speed_mph):
    with pytest.raises(SpecError, match=rf"{speed_mph}.*between 40 and 45 mph; post 40 or 45"):
        merging_taper_length_ft(speed_mph, offset_ft=12)


@pytest.mark.parametrize("speed_mph", [19, 76, -60, float("nan")])
def test_taper_outside_the_tables_is_refused_with_the_range(speed_mph):
    with pytest.raises(SpecError, match=rf"{speed_mph}.*20 to 75 mph"):
        merging_taper_length_ft(speed_mph, offset_ft=12)


@pytest.mark.parametrize("offset_ft", [-1, float("nan"), float("inf")])
def test_taper_for_an_offset_that_is_no_width_is_refused(offset_ft):
    with pytest.raises(SpecError, match=f"offset_ft={offset_ft}"):
        merging_taper_length_ft(60, offset_ft=offset_ft)


def test_spacing_is_the_speed_in_tapers_and_twice_in_tangents():
    assert (taper_spacing_ft(60), tangent_spacing_ft(60)) == (60, 120)


@given(length_ft=st.floats(1, 5000), spacing_ft=st.floats(5, 200))
def test_device_gaps_are_the_fewest_that_keep_the_spacing(length_ft, spacing_ft):
    gaps = device_gaps(length_ft, spacing_ft=spacing_ft)
    assert length_ft / gaps <= spacing_ft * (1 + 1e-6)
    assert gaps == 1 or length_ft / (gaps - 1) > spacing_ft * (1 - 1e-6)
