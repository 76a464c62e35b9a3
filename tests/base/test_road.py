import numpy as np
import pytest
from builders import bent_road, paper_road
from hypothesis import given
from hypothesis import strategies as st

from wzsumo.errors import SpecError
from wzsumo.road import Bend, RoadSpec
from wzsumo.spec import parse_spec

BENT_ROADS = {radius_ft: bent_road(radius_ft, arc_ft=1500) for radius_ft in (400, -400, 3000, -3000)}


@given(radius_ft=st.sampled_from(sorted(BENT_ROADS)), share=st.floats(0.001, 0.999), across=st.floats(0, 1))
def test_station_and_offset_on_the_pavement_of_a_bend_come_back_from_the_world_point(
    radius_ft: int, share: float, across: float
) -> None:
    road = BENT_ROADS[radius_ft]
    s, d = share * road.length, -road.right_shoulder + across * (road.left_edge + road.right_shoulder)
    back_s, back_d = road.to_sd(road.to_xy(s, d))
    assert (back_s[0], back_d[0]) == pytest.approx((s, d), abs=1e-6)


@given(s=st.floats(-100, 1700), d=st.floats(-20, 20))
def test_straight_road_from_the_origin_is_the_world_frame(s: float, d: float) -> None:
    road = paper_road()
    assert road.to_xy(s, d) == pytest.approx([s, d])
    back_s, back_d = road.to_sd([[s, d]])
    assert (back_s[0], back_d[0]) == pytest.approx((s, d), abs=1e-9)


@pytest.mark.parametrize("radius_ft", [600, -600])
def test_points_beside_an_arc_lie_on_the_circle_of_their_offset(radius_ft: int) -> None:
    road = paper_road(length_ft=None, alignment=(Bend(length_ft=900, radius_ft=radius_ft),))
    radius, s, middle = radius_ft * 0.3048, np.linspace(0, road.length, 500), 18 * 0.3048
    assert road.length == pytest.approx(900 * 0.3048, rel=1e-4)
    for d in (-3.0, 0.0, 14.0):
        distance = np.hypot(*(road.to_xy(s, d) - [0.0, middle + radius]).T)
        assert np.abs(distance - abs(radius - (d - middle))).max() < 0.006  # chord error of 5 mm, and rounding


@pytest.mark.parametrize("radius_ft", [600, -600])
def test_heading_on_an_arc_grows_with_the_curvature(radius_ft: int) -> None:
    road = paper_road(length_ft=None, alignment=(Bend(length_ft=900, radius_ft=radius_ft),))
    s = np.linspace(10, road.length - 10, 50)
    assert road.heading_at(s) == pytest.approx(s / (radius_ft * 0.3048), abs=1e-3)


def test_lanes_are_counted_from_the_right() -> None:
    road = paper_road()
    assert [road.lane_span(lane)[0] / 0.3048 for lane in range(3)] == pytest.approx([0, 12, 24])
    assert road.lane_centre(2) / 0.3048 == pytest.approx(30)
    assert road.left_edge / 0.3048 == pytest.approx(48)


def test_bend_tighter_than_the_pavement_is_refused_with_both_numbers() -> None:
    with pytest.raises(SpecError, match=r"7\.6 m \(25 ft\).*reaches 9\.1 m.*more than 9\.14 m \(30\.0 ft\)"):
        paper_road(length_ft=None, alignment=(Bend(length_ft=60, radius_ft=25),))


def test_road_that_crosses_itself_is_refused_with_its_length() -> None:
    with pytest.raises(SpecError, match=r"runs across itself within its 2\d\d\d m; shorten it"):
        paper_road(length_ft=None, alignment=(Bend(length_ft=7000, radius_ft=984),))


def test_road_with_a_repeated_point_is_refused() -> None:
    with pytest.raises(SpecError, match="same point twice"):
        paper_road(length_ft=None, reference_points_m=((0, 0), (0, 0), (100, 0)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"length_ft": -100}, r"road\.toml: length_ft=-100: "),
        ({"lane_count": 0}, r"road\.toml: lane_count=0: "),
        (
            {"lane_widht_ft": 12},
            r"lane_widht_ft: unknown key \(given 12\) \(did you mean lane_width_ft\?\); known here: alignment",
        ),
        ({"alignment": [{"length_ft": 100}]}, r"exactly one of length_ft, alignment, reference_points_m"),
        ({"length_ft": None}, r"exactly one of .*given: none"),
        ({"length_ft": None, "alignment": [{"length_ft": 100, "radius_ft": 0}]}, r"radius_ft=0 is no bend"),
    ],
)
def test_road_spec_that_is_impossible_is_refused_with_key_and_rule(changes: dict[str, object], message: str) -> None:
    content = {"lane_count": 3, "left_shoulder_ft": 12, "right_shoulder_ft": 10, "length_ft": 5000} | changes
    with pytest.raises(SpecError, match=message):
        parse_spec(RoadSpec, content, source="road.toml")
