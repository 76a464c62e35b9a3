import math

import pytest

from wzsumo.errors import SpecError
from wzsumo.tapers import (
    buffer_length_ft,
    downstream_taper_length_ft,
    merging_taper_length_ft,
    merging_taper_m,
    one_lane_two_way_taper_length_ft,
    shifting_taper_length_ft,
    shoulder_taper_length_ft,
)

# Merging, shifting and shoulder taper for an offset of 12 ft: MUTCD, taper length table, in whole feet rounded up.
PRINTED_TAPERS_FT = [
    (20, 80, 40, 27), (25, 125, 63, 42), (30, 180, 90, 60), (35, 245, 123, 82), (40, 320, 160, 107), (45, 540, 270, 180),
    (50, 600, 300, 200), (55, 660, 330, 220), (60, 720, 360, 240), (65, 780, 390, 260), (70, 840, 420, 280),
    (75, 900, 450, 300),
]  # fmt: skip
# Merging tapers for offsets of 5, 6, ... 18 ft, in whole feet: pocket tables of a work-zone guide that prints every width.
PRINTED_WIDTHS_FT = range(5, 19)
PRINTED_MERGING_FT = {
    30: (75, 90, 105, 120, 135, 150, 165, 180, 195, 210, 225, 240, 255, 270),
    35: (102, 123, 143, 163, 184, 204, 225, 245, 265, 286, 306, 327, 347, 368),
    40: (133, 160, 187, 213, 240, 267, 293, 320, 347, 373, 400, 427, 453, 480),
    45: (225, 270, 315, 360, 405, 450, 495, 540, 585, 630, 675, 720, 765, 810),
    50: (250, 300, 350, 400, 450, 500, 550, 600, 650, 700, 750, 800, 850, 900),
    55: (275, 330, 385, 440, 495, 550, 605, 660, 715, 770, 825, 880, 935, 990),
    60: (300, 360, 420, 480, 540, 600, 660, 720, 780, 840, 900, 960, 1020, 1080),
    65: (325, 390, 455, 520, 585, 650, 715, 780, 845, 910, 975, 1040, 1105, 1170),
}
PRINTED_SIGHT_DISTANCES_FT = [
    (20, 115), (25, 155), (30, 200), (35, 250), (40, 305), (45, 360), (50, 425), (55, 495), (60, 570), (65, 645), (70, 730),
    (75, 820),
]  # fmt: skip


@pytest.mark.parametrize(("speed_mph", "merging", "shifting", "shoulder"), PRINTED_TAPERS_FT)
def test_tapers_for_12_ft_offset_match_printed_table(speed_mph: float, merging: int, shifting: int, shoulder: int) -> None:
    lengths = [
        f(speed_mph, offset_ft=12) for f in (merging_taper_length_ft, shifting_taper_length_ft, shoulder_taper_length_ft)
    ]
    assert [math.ceil(length - 1e-9) for length in lengths] == [merging, shifting, shoulder]


@pytest.mark.parametrize("speed_mph", PRINTED_MERGING_FT)
def test_merging_taper_matches_printed_table_at_every_width(speed_mph: int) -> None:
    lengths = [merging_taper_length_ft(speed_mph, offset_ft=width) for width in PRINTED_WIDTHS_FT]
    assert lengths == pytest.approx(PRINTED_MERGING_FT[speed_mph], abs=0.5)  # whole feet


@pytest.mark.parametrize(("speed_mph", "merging", "shifting", "shoulder"), PRINTED_TAPERS_FT)
@pytest.mark.parametrize("offset_ft", [0, 1, 3, 6.5, 10, 11, 24, 36])
def test_tapers_are_in_proportion_to_the_width(
    speed_mph: float, merging: int, shifting: int, shoulder: int, offset_ft: float
) -> None:
    lengths = [
        f(speed_mph, offset_ft=offset_ft) for f in (merging_taper_length_ft, shifting_taper_length_ft, shoulder_taper_length_ft)
    ]
    printed = (merging, shifting, shoulder)  # for 12 ft, rounded up to whole feet
    assert lengths == pytest.approx([length * offset_ft / 12 for length in printed], abs=offset_ft / 12)


@pytest.mark.parametrize(("lanes", "per_lane_ft", "length_ft"), [(1, 50, 50), (1, 100, 100), (2, 100, 200), (3, 75, 225)])
def test_downstream_taper_is_50_to_100_ft_a_lane(lanes: int, per_lane_ft: int, length_ft: int) -> None:
    assert downstream_taper_length_ft(lanes, per_lane_ft=per_lane_ft) == length_ft


@pytest.mark.parametrize("length_ft", [49, 101, float("nan")])
def test_short_taper_outside_50_to_100_ft_is_refused_with_its_key(length_ft: float) -> None:
    with pytest.raises(SpecError, match=rf"one_lane_two_way_taper_ft={length_ft} must be 50 to 100 ft"):
        one_lane_two_way_taper_length_ft(length_ft)
    with pytest.raises(SpecError, match=rf"downstream_taper_ft={length_ft} must be 50 to 100 ft"):
        downstream_taper_length_ft(1, per_lane_ft=length_ft)


@pytest.mark.parametrize(("speed_mph", "length_ft"), PRINTED_SIGHT_DISTANCES_FT)
def test_buffer_matches_printed_stopping_sight_distance(speed_mph: float, length_ft: float) -> None:
    assert buffer_length_ft(speed_mph) == length_ft


def test_buffer_between_two_printed_speeds_is_that_of_the_higher() -> None:
    assert buffer_length_ft(52) == 495


def test_merging_taper_jumps_from_320_to_540_ft_between_40_and_45_mph() -> None:
    # L = W S^2 / 60 is 405 ft at 45 mph, L = W S is 540 ft: the two formulas do not meet.
    assert [merging_taper_length_ft(speed, offset_ft=12) for speed in (40, 45)] == [320, 540]


@pytest.mark.parametrize("speed_mph", [40.5, 42, 44.9])
def test_taper_between_40_and_45_mph_is_refused_with_the_speed(speed_mph: float) -> None:
    with pytest.raises(SpecError, match=rf"{speed_mph}.*between 40 and 45 mph; post 40 or 45"):
        merging_taper_length_ft(speed_mph, offset_ft=12)


@pytest.mark.parametrize("speed_mph", [19, 76, -60, float("nan")])
def test_taper_outside_the_tables_is_refused_with_the_range(speed_mph: float) -> None:
    with pytest.raises(SpecError, match=rf"{speed_mph}.*20 to 75 mph"):
        merging_taper_length_ft(speed_mph, offset_ft=12)


@pytest.mark.parametrize("offset_ft", [-1, float("nan"), float("inf")])
def test_taper_for_an_offset_that_is_no_width_is_refused(offset_ft: float) -> None:
    with pytest.raises(SpecError, match=f"offset_ft={offset_ft}"):
        merging_taper_length_ft(60, offset_ft=offset_ft)


@pytest.mark.parametrize("speed_mph", [*range(20, 41), *range(45, 76)])
@pytest.mark.parametrize("offset_ft", [3, 10.5, 12])
def test_taper_for_a_measured_speed_is_the_manuals_wherever_the_manual_has_one(speed_mph: int, offset_ft: float) -> None:
    length_m = merging_taper_m(speed_mph * 0.44704, width_m=offset_ft * 0.3048)
    assert length_m / 0.3048 == pytest.approx(merging_taper_length_ft(speed_mph, offset_ft=offset_ft), rel=1e-12)


@pytest.mark.parametrize(("speed_mph", "length_ft"), [(10, 20), (42.4, 12 * 42.4**2 / 60), (42.6, 12 * 42.6), (90, 1080)])
def test_taper_for_a_measured_speed_changes_its_formula_at_42_5_mph_and_knows_no_limits(
    speed_mph: float, length_ft: float
) -> None:
    assert merging_taper_m(speed_mph * 0.44704, width_m=12 * 0.3048) / 0.3048 == pytest.approx(length_ft)
