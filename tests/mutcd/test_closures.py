import numpy as np
import pytest
import shapely
from builders import bent_road, paper_layout, paper_road, paper_work_zone, two_lane_road
from shapely.affinity import affine_transform

from wzsumo.errors import SpecError
from wzsumo.mutcd.layout import lay_out
from wzsumo.spec import parse_spec
from wzsumo.units import feet_from_metres
from wzsumo.work_zone import WorkZone

UNSHIFTED = {"shift_ft": 0, "shifted_lane_width_ft": None}


def interior(road=None, **changes):
    zone = {"closed_lanes": (1,), "closed_shoulder": None, **UNSHIFTED}
    return lay_out(paper_work_zone(**zone | changes), road or paper_road(length_ft=8000))


def by_turns(road=None, **changes):
    zone = {"posted_speed_mph": 45, "road_type": "rural", "closed_lanes": (0,), "closed_shoulder": "right", **UNSHIFTED}
    return lay_out(paper_work_zone(**zone | {"one_lane_two_way": "signal"} | changes), road or two_lane_road())


def widths_ft(layout, station, *names):
    cut = shapely.LineString([(station, -50), (station, 50)])
    return [round(feet_from_metres(getattr(layout, name).intersection(cut).length), 6) for name in names]


def middle(layout, name):
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


def test_interior_closure_merges_then_shifts_by_half_a_merging_taper() -> None:
    # 60 mph, 12 ft: L = 720; tangent and shift L/2; stopping sight distance 570; 100 ft downstream a lane.
    areas = {area.name: round(feet_from_metres(area.length), 6) for area in interior().areas}
    assert areas == {
        "shoulder taper": 240, "merging taper": 720, "tangent": 360, "shifting taper": 360, "buffer": 570,
        "activity area": 650, "downstream taper": 100,
    }  # fmt: skip


def test_interior_closure_beginning_on_the_right_mirrors_the_one_on_the_left() -> None:
    left = interior(closed_shoulder="left")
    road = paper_road(length_ft=8000, left_shoulder_ft=10, right_shoulder_ft=12)
    right = interior(road, closed_shoulder="right")
    flip = [1, 0, 0, -1, 0, left.road.travelled_width]  # y -> travelled width - y
    for name in ("drivable", "closed_area", "pavement"):
        assert affine_transform(getattr(left, name), flip).symmetric_difference(getattr(right, name)).area < 1e-6, name


LAYOUTS = {
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
def test_devices_touch_what_they_fence_off_and_stay_out_of_the_drivable_area(name) -> None:
    layout = LAYOUTS[name]()
    overlap = shapely.area(shapely.intersection(layout.device_outlines, layout.drivable))
    assert overlap.max() < 1e-3
    assert shapely.distance(layout.device_outlines, layout.closed_area).max() < 0.002


@pytest.mark.parametrize("name", LAYOUTS)
def test_drivable_area_and_closed_area_do_not_overlap(name) -> None:
    layout = LAYOUTS[name]()
    assert layout.drivable.intersection(layout.closed_area).area == pytest.approx(0, abs=1e-5)
    assert layout.drivable.difference(layout.pavement).area == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize("name", LAYOUTS)
def test_open_lanes_lie_in_the_drivable_area(name) -> None:
    layout = LAYOUTS[name]()
    for lane in layout.lanes:
        if not lane.opposing:
            strip = layout.road.strip(lane.start, lane.end, lane.right, lane.left)
            assert strip.difference(layout.drivable).area < 1e-3, lane.index


def test_devices_line_an_interior_closure_on_both_sides() -> None:
    layout = interior()
    area = layout.area("activity area")
    beside = layout.devices[layout.devices["s_m"].between(area.start, area.end)]
    radius_ft = 7 / 12  # of a cone
    inner = beside.iloc[2:-2]  # the outermost are set back for the tapers that meet the line there
    assert set(np.round(feet_from_metres(inner["d_m"].to_numpy()), 3)) == {round(12 + radius_ft, 3), round(24 - radius_ft, 3)}


def test_lane_by_turns_goes_over_to_the_opposing_lane_and_back() -> None:
    layout = by_turns()
    own = next(lane for lane in layout.lanes if not lane.opposing)
    s = np.array([0.0, middle(layout, "activity area"), layout.road.length])
    assert feet_from_metres(own.right(s)) == pytest.approx([0, 12, 0])
    assert feet_from_metres(own.left(s)) == pytest.approx([12, 24, 12])
    assert feet_from_metres(layout.area("one-lane two-way taper").length) == pytest.approx(100)
    assert layout.taking_turns.start < layout.area("one-lane two-way taper").start < layout.end < layout.taking_turns.end


def test_opposing_lane_is_no_part_of_the_drivable_area_outside_the_shared_lane() -> None:
    layout = by_turns()
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
    assert feet_from_metres(np.array([y_0, y_1])) == pytest.approx([12, 14], abs=1e-4)  # 2 ft wide, from the line at 12 ft
    assert (layout.devices[pieces]["length_m"] <= 12.5 * 0.3048 + 1e-9).all()


def test_devices_are_missing_where_the_zone_says_so_and_only_there() -> None:
    whole, gappy = paper_layout(), paper_layout(device_gaps_ft=((300, 700),))
    start = whole.start
    missing = whole.devices["s_m"].between(start + 300 * 0.3048, start + 700 * 0.3048)
    assert missing.sum() == 7  # one every 60 ft of the merging taper
    assert gappy.devices["s_m"].tolist() == whole.devices["s_m"][~missing].tolist()
    assert gappy.closed_area.equals(whole.closed_area)


def refusal(road=None, **changes):
    with pytest.raises(SpecError) as refused:
        lay_out(paper_work_zone(**changes), road or paper_road())
    return str(refused.value)


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
def test_zone_that_its_road_has_no_lanes_for_is_refused_with_the_numbers(road, zone, says) -> None:
    message = refusal(paper_road(**road), **zone)
    assert all(part in message for part in says), message


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"taper_tangent_ft": -100.0}, ["taper_tangent_ft=-100.0", "overlap by 100 ft", "0 or more"]),
        ({"device": "barrier"}, ["device='barrier'", "must not form the tapers", "work_space_device"]),
        ({"device_gaps_ft": [[700, 300]]}, ["device_gaps_ft", "[700, 300]", "from < to"]),
        ({"shifted_lane_width_ft": 9.5}, ["shifted_lane_width_ft=9.5", "10"]),
        ({"downstream_taper_ft": 20.0}, ["downstream_taper_ft=20.0", "50"]),
    ],
)
def test_zone_spec_that_cannot_be_is_refused_with_key_and_rule(changes, says) -> None:
    content = paper_work_zone().model_dump(mode="json", exclude_none=True) | changes
    with pytest.raises(SpecError) as refused:
        parse_spec(WorkZone, content, source="zone.toml")
    assert all(part in str(refused.value) for part in ["zone.toml", *says]), str(refused.value)


def unrolled(area, road):
    """A polygon of the world in stations and offsets."""
    return shapely.transform(area, lambda points: np.column_stack(road.to_sd(points)))


@pytest.mark.parametrize("closed_lanes", [(2,), (1,), (0, 1)])
@pytest.mark.parametrize("radius_m", [300, -300, 900, -900])
def test_zone_on_a_bend_has_the_areas_of_the_straight_one_along_its_road(closed_lanes, radius_m: int) -> None:
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
