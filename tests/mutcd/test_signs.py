import numpy as np
import pytest
from builders import paper_layout, paper_road, paper_work_zone, two_lane_road

from wzsumo.mutcd.layout import lay_out
from wzsumo.work_zone import SIGN_COLUMNS

# MUTCD, advance warning sign spacing: A, B, C in feet.
PRINTED_SPACING_FT = {
    "urban_low_speed": (100, 100, 100),
    "urban_high_speed": (350, 350, 350),
    "rural": (500, 500, 500),
    "freeway": (1000, 1500, 2640),
}

BY_TURNS = {
    "posted_speed_mph": 45, "road_type": "rural", "closed_lanes": (0,), "closed_shoulder": "right", "shift_ft": 0,
    "shifted_lane_width_ft": None,
}  # fmt: skip


@pytest.mark.parametrize("road_type", PRINTED_SPACING_FT)
def test_signs_stand_at_the_printed_distances_ahead_of_the_first_device(road_type: str) -> None:
    layout = paper_layout(road_type=road_type)
    ahead = layout.signs[layout.signs["s_m"] < layout.start]["s_m"].drop_duplicates().to_numpy()
    distances_ft = np.diff(np.concatenate([ahead, [layout.start]]) / 0.3048)
    assert distances_ft[::-1] == pytest.approx(PRINTED_SPACING_FT[road_type])


def test_signs_on_a_freeway_stand_on_both_sides_clear_of_the_pavement() -> None:
    layout = paper_layout()
    assert tuple(layout.signs.columns) == SIGN_COLUMNS
    assert len(layout.signs) == 8
    d = layout.signs["d_m"].to_numpy()
    assert set(np.round(d / 0.3048)) == {-16, 54}  # 6 ft beyond 10 ft of right shoulder, and beyond 48 ft
    assert layout.road.to_xy(layout.signs["s_m"], d) == pytest.approx(layout.signs[["x_m", "y_m"]].to_numpy())


@pytest.mark.parametrize(
    ("zone", "texts", "codes"),
    [
        ({}, ["ROAD WORK AHEAD", "LEFT LANE CLOSED AHEAD", "LEFT LANE ENDS"], ["W20-1", "W20-5L", "W4-2L"]),
        (
            {"closed_lanes": (0,), "closed_shoulder": "right"},
            ["ROAD WORK AHEAD", "RIGHT LANE CLOSED AHEAD", "RIGHT LANE ENDS"],
            ["W20-1", "W20-5R", "W4-2R"],
        ),
        (
            {"closed_lanes": (0, 1), "closed_shoulder": None, "shift_ft": 0, "shifted_lane_width_ft": None},
            ["ROAD WORK AHEAD", "2 RIGHT LANES CLOSED AHEAD", "RIGHT LANE ENDS"],
            ["W20-1", "W20-5aR", "W4-2R"],  # Figure 6P-37
        ),
        (
            {"closed_lanes": (1,), "shift_ft": 0, "shifted_lane_width_ft": None},
            ["ROAD WORK AHEAD", "LEFT LANE CLOSED AHEAD", "LEFT LANE ENDS"],
            ["W20-1", "W20-5L", "W4-2L"],  # Figure 6P-38: the left lane closes first
        ),
        (
            {"closed_lanes": (), "shift_ft": 10},
            ["ROAD WORK AHEAD", "STAY IN LANE", "REVERSE CURVE"],
            ["W20-1", "R4-9", "W1-4cR"],  # three lanes, three arrows: Figure 6P-36
        ),
        (
            {"closed_lanes": (), "shift_ft": 0, "shifted_lane_width_ft": None},
            ["ROAD WORK AHEAD", "LEFT SHOULDER CLOSED AHEAD", "LEFT SHOULDER CLOSED"],
            ["W20-1", "W21-5bL", "W21-5aL"],
        ),
    ],
)
def test_signs_say_what_is_closed_under_the_manuals_codes(zone: dict[str, object], texts: list[str], codes: list[str]) -> None:
    signs = lay_out(paper_work_zone(road_type="rural", **zone), paper_road(length_ft=8000)).signs
    assert signs["text"].tolist() == [*texts, "END ROAD WORK"]
    assert signs["code"].tolist() == [*codes, "G20-2"]


@pytest.mark.parametrize(("control", "nearest"), [("signal", "SIGNAL AHEAD"), ("flaggers", "FLAGGER")])
def test_both_directions_are_warned_where_they_take_turns(control: str, nearest: str) -> None:
    layout = lay_out(paper_work_zone(**BY_TURNS, one_lane_two_way=control), two_lane_road())
    texts = ["ROAD WORK AHEAD", "ONE LANE ROAD AHEAD", nearest, "END ROAD WORK"]
    assert layout.signs["text"].tolist() == texts * 2
    own, other = layout.signs.iloc[:4], layout.signs.iloc[4:]
    assert (own["d_m"] < 0).all()
    assert (other["d_m"] > layout.road.left_edge).all()
    assert own["s_m"].is_monotonic_increasing
    assert other["s_m"].is_monotonic_decreasing
    assert np.cos(other["heading_rad"].to_numpy()) == pytest.approx(-1)


def test_road_work_ends_500_ft_behind_the_zone() -> None:
    layout = paper_layout()
    behind = layout.signs[layout.signs["s_m"] > layout.end]
    assert behind["code"].tolist() == ["G20-2", "G20-2"]  # on both sides of a freeway
    assert (behind["s_m"].to_numpy() - layout.end) / 0.3048 == pytest.approx(500)


def test_signs_of_both_directions_count_from_the_stop_lines_and_stand_6_ft_beyond_their_pavement() -> None:
    layout = lay_out(paper_work_zone(**BY_TURNS, one_lane_two_way="signal"), two_lane_road())
    first = layout.start + (90 - 100) * 0.3048  # shoulder taper 90 ft, then the taper, whose stop line is 100 ft ahead of it
    last = layout.end + 100 * 0.3048
    own, other = layout.signs.iloc[:4], layout.signs.iloc[4:]
    assert (own["s_m"].to_numpy() - first)[:3] / 0.3048 == pytest.approx([-1500, -1000, -500])
    assert (own["s_m"].to_numpy() - last)[3] / 0.3048 == pytest.approx(500)
    assert (other["s_m"].to_numpy() - last)[:3] / 0.3048 == pytest.approx([1500, 1000, 500])
    assert (other["s_m"].to_numpy() - first)[3] / 0.3048 == pytest.approx(-500)
    assert own["d_m"].to_numpy() / 0.3048 == pytest.approx(-12)  # a shoulder of 6 ft
    assert other["d_m"].to_numpy() / 0.3048 == pytest.approx(36)  # two lanes and a shoulder of 6 ft
    assert own["heading_rad"].to_numpy() == pytest.approx(0)


@pytest.mark.parametrize(
    ("changes", "lane_count", "codes"),
    [
        ({}, 1, ["W1-4R", "W20-1"]),
        ({}, 2, ["W1-4bR", "W20-1"]),
        ({}, 4, ["W1-4cR", "W20-1"]),
        ({"closed_shoulder": "right"}, 2, ["W1-4bL", "W20-1"]),
    ],
)
def test_reverse_curve_shows_an_arrow_a_lane_away_from_the_closed_side(
    changes: dict[str, object], lane_count: int, codes: list[str]
) -> None:
    zone = paper_work_zone(road_type="rural", closed_lanes=(), shift_ft=4, shifted_lane_width_ft=None, **changes)
    signs = lay_out(zone, paper_road(lane_count=lane_count)).signs["code"].tolist()
    assert [signs[2], signs[0]] == codes


def test_shoulder_closed_on_the_right_is_announced_for_the_right() -> None:
    layout = paper_layout(road_type="rural", closed_lanes=(), closed_shoulder="right", shift_ft=0, shifted_lane_width_ft=None)
    assert layout.signs["code"].tolist() == ["W20-1", "W21-5bR", "W21-5aR", "G20-2"]
    assert layout.signs["text"].tolist()[1:3] == ["RIGHT SHOULDER CLOSED AHEAD", "RIGHT SHOULDER CLOSED"]
