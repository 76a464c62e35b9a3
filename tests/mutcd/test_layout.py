"""A layout's polygons, devices and refusals: what is true of the ground, whatever the rules that made it."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from builders import bent_road, paper_layout, paper_road, paper_work_zone, two_lane_road
from shapely.affinity import affine_transform
from shapely.geometry.base import BaseGeometry

from wzsumo.errors import SpecError
from wzsumo.frames import FloatArray
from wzsumo.mutcd.layout import lay_out
from wzsumo.road import Profile, Road
from wzsumo.units import feet_from_metres
from wzsumo.work_zone import WorkZoneLayout

UNSHIFTED = {"shift_ft": 0, "shifted_lane_width_ft": None}


def discs(layout: WorkZoneLayout) -> npt.NDArray[np.object_]:
    devices = layout.devices
    centres = shapely.points(devices[["x_m", "y_m"]].to_numpy())
    return np.asarray(shapely.buffer(centres, devices["radius_m"].to_numpy(), quad_segs=64))


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
def test_areas_on_a_bend_match_the_integral_over_the_curved_strip(radius_ft: int) -> None:
    road = bent_road(radius_ft)
    layout = lay_out(paper_work_zone(start_ft=1000), road)  # all on the arc
    s = np.linspace(layout.start, layout.end, 200_001)
    curvature = 1 / (radius_ft * 0.3048)

    def strip_area(right: FloatArray, left: FloatArray) -> float:
        # An arc's length at offset d is (1 - (d - middle) / R) of the reference line's.
        return float(np.trapezoid((left - right) * (1 - curvature * ((left + right) / 2 - road.travelled_width / 2)), s))

    expected = strip_area(layout.drivable_right(s), layout.drivable_left(s))
    assert layout.drivable_between(layout.start, layout.end).area == pytest.approx(expected, rel=0.005)
    outer = np.full_like(s, road.left_edge)
    assert layout.closed_area.area == pytest.approx(strip_area(np.minimum(device_line(layout)(s), outer), outer), rel=0.005)


def device_line(layout: WorkZoneLayout) -> Profile:
    (strip,) = layout.closed_strips
    return strip.right


def refusal(road: Road | None = None, /, **changes: object) -> str:
    with pytest.raises(SpecError) as refused:
        lay_out(paper_work_zone(**changes), road or paper_road())
    return str(refused.value)


def test_road_shorter_than_the_zone_is_refused_with_what_is_missing() -> None:
    # 800 + 240 + 720 + 360 + 360 + 570 + 650 + 360 + 100 = 4160 ft.
    message = refusal(paper_road(length_ft=4000))
    for number in ("4160 ft", "merging taper 720", "4000 ft", "by 160 ft"):
        assert number in message


def test_zone_at_42_mph_is_refused_with_the_posted_speeds_that_can_be() -> None:
    assert "posted_speed_mph=42.0: the MUTCD gives no taper formula" in refusal(posted_speed_mph=42)


def interior(road: Road | None = None, /, **changes: object) -> WorkZoneLayout:
    zone = {"closed_lanes": (1,), "closed_shoulder": None, **UNSHIFTED}
    return lay_out(paper_work_zone(**zone | changes), road or paper_road(length_ft=8000))


def by_turns(road: Road | None = None, /, **changes: object) -> WorkZoneLayout:
    zone = {"posted_speed_mph": 45, "road_type": "rural", "closed_lanes": (0,), "closed_shoulder": "right", **UNSHIFTED}
    return lay_out(paper_work_zone(**zone | {"one_lane_two_way": "signal"} | changes), road or two_lane_road())


def widths_ft(layout: WorkZoneLayout, station: float, *names: str) -> list[float]:
    cut = shapely.LineString([(station, -50), (station, 50)])
    return [round(feet_from_metres(getattr(layout, name).intersection(cut).length), 6) for name in names]


def middle(layout: WorkZoneLayout, name: str) -> float:
    area = layout.area(name)
    return (area.start + area.end) / 2


def test_interior_closure_leaves_a_lane_on_each_side_of_the_work() -> None:
    layout = interior()
    s = middle(layout, "activity area")
    assert widths_ft(layout, s, "closed_area", "drivable") == [12, 24]
    lines_ft = sorted(
        (feet_from_metres(float(lane.right(s))), feet_from_metres(float(lane.left(s))))
        for lane in layout.lanes
        if lane.start <= s < lane.end
    )
    assert np.array(lines_ft) == pytest.approx(np.array([[0, 12], [24, 36]]))


def test_interior_closure_beginning_on_the_right_mirrors_the_one_on_the_left() -> None:
    left = interior(closed_shoulder="left")
    road = paper_road(length_ft=8000, left_shoulder_ft=10, right_shoulder_ft=12)
    right = interior(road, closed_shoulder="right")
    flip = [1, 0, 0, -1, 0, left.road.travelled_width]  # y -> travelled width - y
    for name in ("drivable", "closed_area", "pavement"):
        assert affine_transform(getattr(left, name), flip).symmetric_difference(getattr(right, name)).area < 1e-6, name


LAYOUTS: dict[str, Callable[[], WorkZoneLayout]] = {
    "interior": interior,
    "interior of four": lambda: interior(paper_road(lane_count=4, length_ft=9000), closed_lanes=(1, 2)),
    "interior on a bend": lambda: interior(bent_road(-2000, arc_ft=6000)),
    "by turns": by_turns,
    "by turns without shoulder": lambda: by_turns(two_lane_road(right_shoulder_ft=0, left_shoulder_ft=0)),
    "beside opposing lanes": lambda: lay_out(
        paper_work_zone(posted_speed_mph=40, closed_lanes=(1,), closed_shoulder=None, **UNSHIFTED),
        paper_road(lane_count=2, opposing_lane_count=2),
    ),
    "barrier": lambda: paper_layout(work_space_device="barrier"),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_devices_touch_what_they_fence_off_and_stay_out_of_the_drivable_area(name: str) -> None:
    layout = LAYOUTS[name]()
    overlap = shapely.area(shapely.intersection(layout.device_outlines, layout.drivable))
    assert overlap.max() < 1e-3
    assert shapely.distance(layout.device_outlines, layout.closed_area).max() < 0.002


@pytest.mark.parametrize("name", LAYOUTS)
def test_drivable_area_and_closed_area_do_not_overlap(name: str) -> None:
    layout = LAYOUTS[name]()
    assert layout.drivable.intersection(layout.closed_area).area == pytest.approx(0, abs=1e-5)
    assert layout.drivable.difference(layout.pavement).area == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize("name", LAYOUTS)
def test_open_lanes_lie_in_the_drivable_area(name: str) -> None:
    layout = LAYOUTS[name]()
    for lane in layout.lanes:
        if not lane.opposing:
            strip = layout.road.strip(lane.start, lane.end, lane.right, lane.left)
            assert strip.difference(layout.drivable).area < 1e-3, lane.index


def test_opposing_lane_is_no_part_of_the_drivable_area_outside_the_shared_lane() -> None:
    layout = by_turns()
    assert layout.taking_turns is not None
    before = (layout.taking_turns.start - 1) / 2
    assert widths_ft(layout, before, "drivable") == [12]
    assert widths_ft(layout, middle(layout, "activity area"), "drivable", "closed_area") == [12, 18]


def test_barrier_beside_the_work_is_a_wall_whose_face_lies_on_the_line() -> None:
    layout = paper_layout(work_space_device="barrier")
    area = layout.area("activity area")
    pieces = layout.devices["kind"] == "barrier"
    wall = shapely.union_all(shapely.buffer(layout.device_outlines[pieces], 1e-6))
    assert wall.geom_type == "Polygon"  # no gap
    x_0, y_0, x_1, y_1 = wall.bounds
    assert (x_0, x_1) == pytest.approx((area.start, area.end), abs=1e-4)
    assert np.array([y_0, y_1]) / 0.3048 == pytest.approx([12, 14], abs=1e-4)  # 2 ft wide, from the line at 12 ft
    assert (layout.devices[pieces]["length_m"] <= 12.5 * 0.3048 + 1e-9).all()


def test_devices_are_missing_where_the_zone_says_so_and_only_there() -> None:
    whole, gappy = paper_layout(), paper_layout(device_gaps_ft=((300, 700),))
    start = whole.start
    missing = whole.devices["s_m"].between(start + 300 * 0.3048, start + 700 * 0.3048)
    assert missing.sum() == 7  # one every 60 ft of the merging taper
    assert gappy.devices["s_m"].tolist() == whole.devices["s_m"][~missing].tolist()
    assert gappy.closed_area.equals(whole.closed_area)


@pytest.mark.parametrize(
    ("road", "zone", "says"),
    [
        (
            {"lane_count": 2},
            {"typical_application": "TA-37", "closed_lanes": (1,), **UNSHIFTED},
            ["TA-37", "needs 3 lanes", "lane_count=2"],
        ),
        (
            {"lane_count": 2},
            {"typical_application": "TA-38", "closed_lanes": (1,), **UNSHIFTED},
            ["needs 3 lanes", "lane_count=2"],
        ),
        ({"lane_count": 2}, {"typical_application": "TA-37", "closed_lanes": (0, 1), **UNSHIFTED}, ["needs 3 lanes"]),
        ({}, {"typical_application": "TA-38", **UNSHIFTED}, ["open lanes on both sides"]),
        ({}, {"typical_application": "TA-34", **UNSHIFTED}, ['work_space_device = "barrier"']),
        ({}, {"typical_application": "TA-33"}, ["one outer lane closed, no shift"]),
        ({}, {"typical_application": "TA-99"}, ["unknown", "TA-33"]),
        ({}, {"closed_lanes": (1,), "closed_shoulder": None}, ["shift_ft=12", "both sides of closed_lanes=(1,)"]),
        ({}, {"closed_lanes": (0,), "one_lane_two_way": "signal"}, ["lane_count=1 and opposing_lane_count=1", "3 and 0"]),
        (
            {"lane_count": 1, "opposing_lane_count": 1},
            {"closed_lanes": (0,), "closed_shoulder": "right", "one_lane_two_way": "signal"},
            ["closed_lanes = [0]", "no shift"],
        ),
        ({"lane_count": 1}, {"closed_lanes": (0,), "closed_shoulder": None}, ["at least one", "one_lane_two_way"]),
        ({}, {"closed_lanes": (2, 2)}, ["closed_lanes=(2, 2)", "twice", "[2]"]),
        # 240 + 720 + 360 + 360 + 570 + 650 + 360 + 100 ft
        ({}, {"device_gaps_ft": ((300, 3400),)}, ["[300, 3400]", "beyond the zone", "3360 ft long"]),
    ],
)
def test_zone_that_its_road_has_no_lanes_for_is_refused_with_the_numbers(
    road: dict[str, object], zone: dict[str, object], says: list[str]
) -> None:
    message = refusal(paper_road(**road), **zone)
    assert all(part in message for part in says), message


def unrolled(area: BaseGeometry, road: Road) -> BaseGeometry:
    """A polygon of the world in stations and offsets."""
    return shapely.transform(area, lambda points: np.column_stack(road.to_sd(points)))


@pytest.mark.parametrize("closed_lanes", [(2,), (1,), (0, 1)])
@pytest.mark.parametrize("radius_m", [300, -300, 900, -900])
def test_zone_on_a_bend_has_the_areas_of_the_straight_one_along_its_road(closed_lanes: tuple[int, ...], radius_m: int) -> None:
    zone = paper_work_zone(start_ft=1000, closed_lanes=closed_lanes, closed_shoulder=None, **UNSHIFTED)
    straight = lay_out(zone, paper_road(length_ft=5900))
    bent = lay_out(zone, bent_road(radius_m / 0.3048, arc_ft=5000))
    start, end = straight.start, straight.end
    pairs = [(getattr(straight, name), getattr(bent, name)) for name in ("closed_area", "drivable", "pavement")]
    for on_straight, on_bend in [*pairs, (straight.drivable_between(start, end), bent.drivable_between(start, end))]:
        assert unrolled(on_bend, bent.road).symmetric_difference(on_straight).area < 0.005 * on_straight.area
    assert bent.devices[["s_m", "d_m"]].to_numpy() == pytest.approx(straight.devices[["s_m", "d_m"]].to_numpy())


@pytest.mark.parametrize("radius_m", [300, 900])
def test_zone_on_a_left_and_on_a_right_bend_cover_twice_the_ground_of_the_straight_one(radius_m: int) -> None:
    # What a bend takes from one side of its middle the opposite bend adds, to first order in 1 / R exactly.
    straight = lay_out(paper_work_zone(start_ft=1000), paper_road(length_ft=5900))
    bends = [lay_out(paper_work_zone(start_ft=1000), bent_road(sign * radius_m / 0.3048, arc_ft=5000)) for sign in (1, -1)]
    for name in ("closed_area", "drivable", "pavement"):
        mean = sum(getattr(bend, name).area for bend in bends) / 2
        assert mean == pytest.approx(getattr(straight, name).area, rel=0.005), name
    for bend in bends:  # the whole drivable area lies close to the middle of the road
        assert bend.drivable.area == pytest.approx(straight.drivable.area, rel=0.005)


@pytest.mark.parametrize(("end_ft", "fits"), [(3360, True), (3361, False)])
def test_gap_in_the_devices_that_ends_beyond_the_zone_is_refused_with_both_lengths(end_ft: float, fits: bool) -> None:
    # 240 + 720 + 360 + 360 + 570 + 650 + 360 + 100 ft
    if fits:
        paper_layout(device_gaps_ft=((300, end_ft),))
    else:
        with pytest.raises(SpecError, match=r"\[300, 3361\] ends beyond the zone, which is 3360 ft long"):
            paper_layout(device_gaps_ft=((300, end_ft),))


def test_zone_may_end_where_its_road_does() -> None:
    layout = lay_out(paper_work_zone(), paper_road(length_ft=4160.01))
    assert layout.road.length - layout.end == pytest.approx(0.01 * 0.3048)


def test_zone_unlike_the_typical_application_that_it_is_named_after_is_refused() -> None:
    assert "TA-38" in refusal(typical_application="TA-38", **UNSHIFTED)
    assert "needs 3 lanes" in refusal(paper_road(lane_count=2), typical_application="TA-37", closed_lanes=(0, 1), **UNSHIFTED)
