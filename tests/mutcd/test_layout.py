import numpy as np
import pytest
import shapely
from builders import bent_road, paper_layout, paper_road, paper_work_zone
from shapely.affinity import affine_transform

from wzsumo.errors import SpecError
from wzsumo.mutcd.layout import lay_out
from wzsumo.spec import parse_spec
from wzsumo.units import feet_from_metres
from wzsumo.work_zone import DEVICE_COLUMNS, WorkZone


def discs(layout):
    devices = layout.devices
    return shapely.buffer(shapely.points(devices[["x_m", "y_m"]].to_numpy()), devices["radius_m"].to_numpy(), quad_segs=64)


@pytest.mark.parametrize(
    ("name", "length_ft"),
    [
        ("shoulder taper", 240),  # Chen et al. 2022
        ("merging taper", 720),  # ibid.
        ("shifting taper", 360),  # ibid.
        ("activity area", 650),  # ibid.
        ("buffer", 570),  # stopping sight distance at 60 mph
    ],
)
def test_area_of_the_paper_zone_has_its_printed_length(name: str, length_ft: int) -> None:
    assert feet_from_metres(paper_layout().area(name).length) == pytest.approx(length_ft)


def test_areas_of_the_paper_zone_follow_one_another_without_a_gap() -> None:
    areas = paper_layout().areas
    assert [a.end for a in areas[:-1]] == pytest.approx([a.start for a in areas[1:]])
    assert feet_from_metres(areas[0].start) == pytest.approx(800)


def test_activity_area_of_the_paper_zone_is_36_ft_wide_and_leaves_22_ft_open() -> None:
    layout = paper_layout()
    area = layout.area("activity area")
    cut = shapely.LineString([((area.start + area.end) / 2, -50), ((area.start + area.end) / 2, 50)])
    widths_ft = [
        feet_from_metres(getattr(layout, name).intersection(cut).length) for name in ("closed_area", "drivable", "pavement")
    ]
    assert widths_ft == pytest.approx([36, 22, 22])


def test_open_lanes_beside_the_paper_activity_area_are_11_ft_wide_and_side_by_side() -> None:
    layout = paper_layout()
    area = layout.area("activity area")
    beside = [lane for lane in layout.lanes if lane.start <= area.start and lane.end >= area.end]
    lines_ft = [[feet_from_metres(float(line(area.start + 1))) for line in (lane.right, lane.left)] for lane in beside]
    assert np.array(lines_ft) == pytest.approx(np.array([[-10, 1], [1, 12]]))


def test_merging_taper_of_720_ft_at_60_mph_carries_13_devices() -> None:
    layout = paper_layout()
    taper = layout.area("merging taper")
    assert layout.devices["s_m"].between(taper.start - 1e-6, taper.end + 1e-6).sum() == 13


def test_devices_keep_the_spacing_of_their_area() -> None:
    layout = paper_layout()
    assert tuple(layout.devices.columns) == DEVICE_COLUMNS
    s_ft = feet_from_metres(layout.devices["s_m"].to_numpy())
    gaps, middles = np.diff(s_ft), (s_ft[1:] + s_ft[:-1]) / 2
    for area in layout.areas:
        largest = 20 if area.name == "downstream taper" else 60 if "taper" in area.name or area.name == "shift back" else 120
        inside = (middles > feet_from_metres(area.start)) & (middles < feet_from_metres(area.end))
        assert inside.any(), area.name
        assert gaps[inside].max() <= largest + 1e-6, area.name


@pytest.mark.parametrize("device", ["cone_28in", "cone_36in", "drum"])
def test_devices_touch_the_drivable_area_but_do_not_overlap_it(device: str) -> None:
    layout = paper_layout(device=device)
    in_zone = layout.drivable_between(layout.start, layout.end)
    overlap = shapely.area(shapely.intersection(discs(layout), layout.drivable))
    assert overlap.max() < 1e-4
    # On a slope the outline is set back for the steeper of the two lines that meet at it.
    beside_lanes = layout.devices["s_m"].to_numpy() >= layout.area("merging taper").start
    gap = shapely.distance(discs(layout), in_zone)[beside_lanes]
    assert gap.max() < 0.01


def test_closed_area_drivable_and_pavement_cover_the_road_without_overlap() -> None:
    layout = paper_layout()
    whole = layout.road.length * (layout.road.left_edge + layout.road.right_shoulder)
    assert layout.closed_area.area + layout.pavement.area == pytest.approx(whole)
    assert layout.drivable.intersection(layout.closed_area).area == pytest.approx(0, abs=1e-6)
    assert layout.drivable.difference(layout.pavement).area == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("shift_ft", [0, 11])
@pytest.mark.parametrize("closed_count", [1, 2])
def test_right_closure_of_the_mirrored_road_gives_mirrored_polygons(shift_ft: int, closed_count: int) -> None:
    changes = {"shift_ft": shift_ft, "shifted_lane_width_ft": 11 if shift_ft else None}
    road = paper_road(length_ft=8000)
    mirrored_road = paper_road(length_ft=8000, left_shoulder_ft=10, right_shoulder_ft=12)
    left = lay_out(paper_work_zone(closed_lanes=tuple(range(3 - closed_count, 3)), **changes), road)
    right = lay_out(paper_work_zone(closed_lanes=tuple(range(closed_count)), closed_shoulder="right", **changes), mirrored_road)
    flip = [1, 0, 0, -1, 0, road.travelled_width]  # y -> travelled width - y
    for name in ("drivable", "closed_area", "pavement"):
        mirrored = affine_transform(getattr(left, name), flip)
        assert mirrored.symmetric_difference(getattr(right, name)).area < 1e-6, name
    assert right.devices["y_m"].to_numpy() == pytest.approx(road.travelled_width - left.devices["y_m"].to_numpy())


@pytest.mark.parametrize("radius_ft", [3000, -3000, 800, -800])
def test_areas_on_a_bend_match_the_integral_over_the_curved_strip(radius_ft: int):
    road = bent_road(radius_ft)
    layout = lay_out(paper_work_zone(start_ft=1000), road)  # all on the arc
    s = np.linspace(layout.start, layout.end, 200_001)
    curvature = 1 / (radius_ft * 0.3048)

    def strip_area(right, left):  # an arc's length at offset d is (1 - (d - middle) / R) of the reference line's
        return np.trapezoid((left - right) * (1 - curvature * ((left + right) / 2 - road.travelled_width / 2)), s)

    expected = strip_area(layout.drivable_right(s), layout.drivable_left(s))
    assert layout.drivable_between(layout.start, layout.end).area == pytest.approx(expected, rel=0.005)
    outer = np.full_like(s, road.left_edge)
    assert layout.closed_area.area == pytest.approx(strip_area(np.minimum(device_line(layout)(s), outer), outer), rel=0.005)


def device_line(layout):
    (strip,) = layout.closed_strips
    return strip.right


def refusal(road=None, **changes):
    with pytest.raises(SpecError) as refused:
        lay_out(paper_work_zone(**changes), road or paper_road())
    return str(refused.value)


def parse_refusal(**changes):
    content = paper_work_zone().model_dump(mode="json", exclude_none=True) | changes
    with pytest.raises(SpecError) as refused:
        parse_spec(WorkZone, content, source="zone.toml")
    return str(refused.value)


def test_closing_all_lanes_is_refused_with_the_lanes() -> None:
    message = refusal(closed_lanes=(0, 1, 2), closed_shoulder=None)
    assert "closed_lanes=(0, 1, 2)" in message
    assert "at least one of lanes 0..2" in message


def test_interior_closure_is_refused_with_a_remedy() -> None:
    message = refusal(closed_lanes=(1,), closed_shoulder=None)
    assert "closed_lanes=(1,)" in message
    assert "close the lanes beside it" in message


def test_closed_lanes_with_a_gap_are_refused() -> None:
    assert "(0, 2)" in refusal(closed_lanes=(0, 2), closed_shoulder=None)


@pytest.mark.parametrize("lane", [-1, 3])
def test_closing_a_lane_that_the_road_lacks_is_refused(lane: int) -> None:
    assert "lanes of the road, 0..2" in refusal(closed_lanes=(lane,), closed_shoulder=None)


def test_closing_nothing_is_refused() -> None:
    assert "nothing is closed" in refusal(closed_lanes=(), closed_shoulder=None, shift_ft=0, shifted_lane_width_ft=None)


def test_shoulder_on_the_other_side_than_the_closed_lanes_is_refused() -> None:
    assert 'closed_shoulder="right"' in refusal(closed_shoulder="right")


def test_shift_beyond_the_shoulder_is_refused_with_the_largest_that_fits() -> None:
    # 24 ft of device line - 16 ft shift - 22 ft of lanes = 14 ft past the edge line, 10 ft of shoulder: 4 ft too much.
    message = refusal(shift_ft=16)
    for number in ("shift_ft=16", "22.0 ft", "14.0 ft", "10.0 ft", "at most 12.0 ft"):
        assert number in message


def test_road_shorter_than_the_zone_is_refused_with_what_is_missing() -> None:
    # 800 + 240 + 720 + 360 + 360 + 570 + 650 + 360 + 100 = 4160 ft.
    message = refusal(road=paper_road(length_ft=4000))
    for number in ("4160 ft", "merging taper 720", "4000 ft", "by 160 ft"):
        assert number in message


def test_zone_at_42_mph_is_refused_with_the_posted_speeds_that_can_be() -> None:
    assert "posted_speed_mph=42.0: the MUTCD gives no taper formula" in refusal(posted_speed_mph=42)


@pytest.mark.parametrize("key", ["work_length_ft", "start_ft", "buffer_ft", "shift_ft"])
def test_negative_length_is_refused_with_file_key_and_value(key: str) -> None:
    assert parse_refusal(**{key: -5.0}).startswith(f"zone.toml: {key}=-5.0: ")


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_length_that_is_not_finite_is_refused(value) -> None:
    assert "work_length_ft" in parse_refusal(work_length_ft=value)


def test_unknown_key_is_refused_with_the_known_ones() -> None:
    message = parse_refusal(post_speed_mph=60)
    assert "post_speed_mph: unknown key (given 60)" in message
    assert "posted_speed_mph" in message.split("known here:")[1]


def test_missing_key_is_refused_by_name() -> None:
    with pytest.raises(SpecError, match=r"zone\.toml: work_length_ft: missing"):
        parse_spec(WorkZone, {"posted_speed_mph": 60, "start_ft": 0}, source="zone.toml")
