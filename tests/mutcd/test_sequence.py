"""The stretches of a zone with their lengths in feet, by hand from MUTCD 11th ed., Tables 6B-2 to 6B-4."""

import pytest
from builders import paper_road, paper_work_zone, two_lane_road

from wzsumo.errors import SpecError
from wzsumo.mutcd.closure import closure_of
from wzsumo.mutcd.sequence import Stretch, stretches_of
from wzsumo.road import Road

UNSHIFTED = {"shift_ft": 0, "shifted_lane_width_ft": None}
BY_TURNS = {"posted_speed_mph": 45, "closed_lanes": (0,), "closed_shoulder": "right", **UNSHIFTED, "one_lane_two_way": "signal"}


def stretches(road: Road | None = None, /, **changes: object) -> tuple[Stretch, ...]:
    zone = paper_work_zone(**changes)
    return stretches_of(zone, closure_of(zone, road or paper_road()))[1]


def lengths_ft(road: Road | None = None, /, **changes: object) -> dict[str, float]:
    return {stretch.name: round(stretch.length / 0.3048, 6) for stretch in stretches(road, **changes)}


# At 60 mph a merging taper over 12 ft is 60 x 12 = 720 ft long, a shifting taper half, a shoulder taper a third of it; the
# buffer is 570 ft.
@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {},
            {"shoulder taper": 240, "merging taper": 720, "tangent": 360, "shifting taper": 360, "buffer": 570,
             "activity area": 650, "shift back": 360, "downstream taper": 100},
        ),
        (
            {"closed_lanes": (1, 2), **UNSHIFTED},
            {"shoulder taper": 240, "merging taper": 720, "tangent 1": 1440, "merging taper 2": 720, "buffer": 570,
             "activity area": 650, "downstream taper": 200},
        ),
        (
            {"closed_lanes": (1,), **UNSHIFTED},  # interior, from the left: the lanes that move over shift by 12 ft
            {"shoulder taper": 240, "merging taper": 720, "tangent": 360, "shifting taper": 360, "buffer": 570,
             "activity area": 650, "downstream taper": 100},
        ),
        (
            {"closed_lanes": (), **UNSHIFTED},
            {"shoulder taper": 240, "buffer": 570, "activity area": 650, "downstream taper": 100},
        ),
        (
            {"closed_lanes": (), "shift_ft": 10, "shifted_lane_width_ft": None},  # 60 x 10 / 2
            {"shoulder taper": 240, "shifting taper": 300, "buffer": 570, "activity area": 650, "shift back": 300,
             "downstream taper": 100},
        ),
        (
            {"shift_ft": 6},  # devices move by 6 ft, the edge line of two lanes of 11 ft by 4 ft: the greater counts
            {"shoulder taper": 240, "merging taper": 720, "tangent": 360, "shifting taper": 180, "buffer": 570,
             "activity area": 650, "shift back": 180, "downstream taper": 100},
        ),
        (
            {"shift_ft": 2, "shifted_lane_width_ft": 13},  # devices by 2 ft, the edge line by 4 ft
            {"shoulder taper": 240, "merging taper": 720, "tangent": 360, "shifting taper": 120, "buffer": 570,
             "activity area": 650, "shift back": 120, "downstream taper": 100},
        ),
    ],
    ids=["paper", "two lanes", "interior lane", "shoulder", "shift alone", "devices shift more", "edge shifts more"],
)  # fmt: skip
def test_stretches_of_a_zone_have_the_manuals_lengths_in_order(changes: dict[str, object], expected: dict[str, float]) -> None:
    found = lengths_ft(**changes)
    assert found == expected
    assert list(found) == list(expected)


def test_stretches_where_both_directions_take_turns_begin_with_a_short_taper() -> None:
    assert lengths_ft(two_lane_road(), **BY_TURNS) == {  # a 6 ft shoulder: 45 x 6 / 3
        "shoulder taper": 90, "one-lane two-way taper": 100, "buffer": 360, "activity area": 650, "downstream taper": 100,
    }  # fmt: skip
    shorter = lengths_ft(two_lane_road(), **BY_TURNS, one_lane_two_way_taper_ft=60, downstream_taper_ft=70)
    assert (shorter["one-lane two-way taper"], shorter["downstream taper"]) == (60, 70)


def test_lengths_that_the_zone_gives_replace_the_manuals() -> None:
    given = lengths_ft(taper_tangent_ft=500, buffer_ft=90, downstream_taper_ft=50)
    assert (given["tangent"], given["buffer"], given["downstream taper"]) == (500, 90, 50)
    assert lengths_ft(closed_lanes=(1, 2), **UNSHIFTED, taper_tangent_ft=500)["tangent 1"] == 500
    assert lengths_ft(closed_lanes=(1, 2), **UNSHIFTED, downstream_taper_ft=60)["downstream taper"] == 120


def test_stretch_of_no_length_is_left_out() -> None:
    assert {"tangent", "buffer"} & set(lengths_ft(taper_tangent_ft=0, buffer_ft=0)) == set()
    assert "shoulder taper" not in lengths_ft(paper_road(left_shoulder_ft=0))


def test_devices_stand_at_most_the_speed_in_feet_apart_in_tapers_and_twice_that_elsewhere() -> None:
    spacings_ft = {stretch.name: round(stretch.spacing / 0.3048, 6) for stretch in stretches()}
    assert spacings_ft == {
        "shoulder taper": 60, "merging taper": 60, "tangent": 120, "shifting taper": 60, "buffer": 120, "activity area": 120,
        "shift back": 60, "downstream taper": 20,
    }  # fmt: skip
    by_turns = {stretch.name: stretch.spacing / 0.3048 for stretch in stretches(two_lane_road(), **BY_TURNS)}
    assert by_turns["one-lane two-way taper"] == by_turns["downstream taper"] == pytest.approx(20)
    interior = {stretch.name: stretch.spacing / 0.3048 for stretch in stretches(closed_lanes=(1,), **UNSHIFTED)}
    assert interior["downstream taper"] == pytest.approx(20)


def outer_and_open_edge_ft(**changes: object) -> list[tuple[float | None, float]]:
    """Offsets [ft] of the line of devices and of the open edge line from the open side, at the end of each stretch."""
    ends = [stretch.end for stretch in stretches(**changes)]
    return [(end.outer and round(end.outer / 0.3048, 6), round(end.open_edge / 0.3048, 6)) for end in ends]


def test_line_of_devices_follows_the_closing_lanes_and_the_shift_and_comes_back() -> None:
    assert outer_and_open_edge_ft() == [(36, 0), (24, 0), (24, 0), (12, -10), (12, -10), (12, -10), (24, 0), (36, 0)]
    two_lanes = outer_and_open_edge_ft(closed_lanes=(1, 2), **UNSHIFTED)
    assert two_lanes == [(36, 0), (24, 0), (24, 0), (12, 0), (12, 0), (12, 0), (36, 0)]
    narrowed = outer_and_open_edge_ft(shift_ft=0)  # two lanes of 11 ft, from the devices on
    assert narrowed == [(36, 0), (24, 0), (24, 0), (24, 2), (24, 2), (24, 2), (24, 0), (36, 0)]
    shoulder = outer_and_open_edge_ft(closed_lanes=(), **UNSHIFTED)
    assert shoulder == [(36, 0), (36, 0), (36, 0), (48, 0)]


def test_gore_around_an_interior_lane_opens_in_the_shifting_taper_and_closes_in_the_downstream_taper() -> None:
    ends = [stretch.end for stretch in stretches(closed_lanes=(1,), **UNSHIFTED)]
    gores_ft = [end.gore and tuple(round(e / 0.3048, 6) for e in end.gore) for end in ends]
    assert gores_ft == [None, None, None, (12, 24), (12, 24), (12, 24), (12, 12)]
    assert [end.outer and round(end.outer / 0.3048, 6) for end in ends] == [36, 24, 24, 36, None, None, None]


def test_shift_that_ends_at_the_edge_of_the_shoulder_fits_and_one_beyond_does_not() -> None:
    stretches(shift_ft=12)  # 12 + 22 - 24 = 10 ft, the right shoulder
    with pytest.raises(
        SpecError, match=r"22\.0 ft wide together, would end 10\.1 ft .* on a shoulder of 10\.0 ft; .* 12\.0 ft"
    ):
        stretches(shift_ft=12.1)
    with pytest.raises(SpecError, match="shift_ft=12"):
        stretches(shift_ft=12, shifted_lane_width_ft=None)
